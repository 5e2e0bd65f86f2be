"""The page on extending: its files, saved side by side in an empty folder, are a campaign that runs."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vedette.campaigns import open_results
from waiting import PATIENCE

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = "\n".join((DOCS / name).read_text("utf-8") for name in ("extending.md", "custom-filters.md"))
FILES = dict(re.findall(r'^```\w+ title="([^"]+)"\n(.*?)^```$', PAGE, re.DOTALL | re.MULTILINE))
COMMANDS = re.findall(r"^vedette .*$", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all files of the page are and its commands were run, in its order."""
    place = tmp_path_factory.mktemp("own")
    for name, text in FILES.items():
        (place / name).write_text(text, "utf-8")
    for command in COMMANDS:
        program = [str(Path(sys.executable).with_name("vedette")), *command.split()[1:]]
        result = subprocess.run(program, cwd=place, capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert result.returncode == 0, command + "\n" + result.stdout + result.stderr
    return place


def test_the_page_has_all_that_it_needs() -> None:
    assert any(command.startswith("vedette campaign") for command in COMMANDS)
    named = set(re.findall(r"function(?:: | = \")(\w+\.py):", "".join(FILES.values())))
    assert {name for name in FILES if name.endswith(".py")} == named


def test_every_part_is_used_and_kept(folder: Path) -> None:
    results = open_results(folder / "results")
    runs = list(results.runs())
    assert {run.record.planner for run in runs} == {"jdm", "tree"}
    assert {run.cell.split("-")[-1] for run in runs} == {"average", "fading", "alone", "corrector"}
    assert all(np.isfinite(run.metrics.custom["nearest_sensor_m"]).all() for run in runs)
    for run in runs:
        for decision in run.record.decisions:
            assert {own.columns for own in decision.plan.actions} == {("pointing_deg",)}
            assert all(len(table.mean) > 0 and np.nanmax(table.mean) > 0.0 for table in decision.plan.tables)
        # Whom both sensors see is found; the arithmetic average keeps whom one sees.
        assert max(estimate.num_targets for estimate in run.record.estimates) == 2


def test_the_rewards_are_those_of_the_formula(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(folder)
    reward = importlib.import_module("hellinger").SquaredHellinger()
    z = np.log([[0.5, 1.0, 1.0], [1.0, 1.0, 1.0]])
    np.testing.assert_allclose(reward.combine(z), [0.5, 0.0], atol=1e-15)
