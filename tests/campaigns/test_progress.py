"""What is shown of a campaign while it runs."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from campaigns.stubs import stub_campaign, stub_perform
from vedette.campaigns import Progress, engine, progress, run_campaign


def lines_of(place: Path, monkeypatch: pytest.MonkeyPatch, **options: Any) -> list[str]:
    """What a campaign writes to a console of its own."""
    monkeypatch.setattr(engine, "perform", stub_perform)
    out = io.StringIO()
    campaign = stub_campaign(4)
    with Progress(campaign, Console(file=out, width=200, **options)) as progress:
        run_campaign(campaign, place / "results", progress=progress)
    return out.getvalue().splitlines()


def test_a_log_has_a_line_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines_of(tmp_path, monkeypatch, force_terminal=False) == ["trial: 8 runs"]


def test_a_line_now_and_then_says_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_LOG_SECONDS", -1.0)
    first, *lines = lines_of(tmp_path, monkeypatch, force_terminal=False)
    assert first == "trial: 8 runs"
    assert [line.split()[0] for line in lines] == [f"{number}/8" for number in range(1, 9)]
    assert "jdm 1.0 m" in lines[-1]
    assert "random 1.0 m" in lines[-1]


def test_a_notebook_has_lines_oftener(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are no widgets, in which a line could move."""
    monkeypatch.setattr(progress, "_NOTEBOOK_SECONDS", -1.0)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    shown: list[str] = []
    monkeypatch.setattr("rich.jupyter.display", lambda segments, text: shown.append(re.sub("\x1b.*?m", "", text)))
    assert lines_of(tmp_path, monkeypatch, force_jupyter=True) == []  # what is written goes to the cell
    assert [text.split()[0] for text in shown] == ["trial:", *(f"{number}/8" for number in range(1, 9))]
