"""The comparison in a terminal: labels give way, numbers never do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.cli import comparisons
from vedette.cli.comparisons import print_comparison
from vedette.evaluation import Comparison, compare, strategy_rows

LONG = "a variant with a very long name that says everything about it, and about the weather too"
ODD = "\N{CJK UNIFIED IDEOGRAPH-6F22}\N{CJK UNIFIED IDEOGRAPH-5B57} [bold]:smile:"


def comparison_of(num_runs: int) -> Comparison:
    found = compare({name: [make_record(name, run) for run in range(num_runs)] for name in ("jdm", "idm", "random")})
    first, second, third = found.ensembles
    tied = (first, second, replace(third, ospa=first.ospa))
    return replace(found, strategies=("jdm", LONG, ODD), ensembles=tied)


@pytest.mark.parametrize("width", [60, 80, 100, 160])
def test_every_number_is_shown_at_any_width(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    comparison = comparison_of(4)
    print_comparison(comparison)
    printed = capsys.readouterr().out
    table = printed[: printed.index("± is one")]
    for row in strategy_rows(comparison):
        assert all(number in table for number in row[1:])
    assert "0%, 100% tied" in table
    assert LONG not in table
    assert max(map(len, table.splitlines())) <= width


def test_one_run_has_no_significance(capsys: pytest.CaptureFixture[str]) -> None:
    print_comparison(comparison_of(1))
    printed = " ".join(capsys.readouterr().out.split())
    assert "synthetic: 1 run, mean OSPA over" in printed
    assert "standard error" not in printed
    assert "Won: " not in printed
    assert "unknown unknown" in printed


def test_decisions_are_printed_if_asked_for_and_many_are_counted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = comparison_of(2)
    often = [
        replace(each, decision_times=np.arange(9.0), choices=tuple(run[:1] * 9 for run in each.choices))
        for each in found.ensembles
    ]
    print_comparison(replace(found, ensembles=tuple(often)))
    assert "jdm at " not in capsys.readouterr().out
    monkeypatch.setattr(comparisons, "is_verbose", lambda: True)
    print_comparison(replace(found, ensembles=tuple(often)))
    printed = capsys.readouterr().out
    assert printed.count("jdm at ") == 6
    assert "jdm: and at 3 other times\n" in printed
    assert "[bold]:smile:" in printed
