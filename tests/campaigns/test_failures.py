"""Runs of a campaign that fail: where they stopped is kept until they are done, and they are tried again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from campaigns.examples import small_campaign
from vedette.campaigns import open_results, run_campaign, tasks
from vedette.campaigns.database import Failure
from vedette.cli import app
from vedette.errors import NumericalError
from vedette.evaluation.runs import run_scenario
from vedette.filters import DeltaGlmbFilter
from vedette.reports import write_report


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """The run of number 1 of `still` stops at its seventh step."""
    step = DeltaGlmbFilter.step

    def failing(self: Any, belief: Any, scan: Any, pose: Any, dt: float, number: int, *, rng: Any) -> Any:
        if number == 7:
            raise NumericalError("no hypothesis has positive weight")
        return step(self, belief, scan, pose, dt, number, rng=rng)

    def sometimes(scenario: Any, planner: str, *, run: int, **options: Any) -> Any:
        with monkeypatch.context() as patch:
            if (planner, run) == ("stationary", 1):
                patch.setattr(DeltaGlmbFilter, "step", failing)
            return run_scenario(scenario, planner, run=run, **options)

    monkeypatch.setattr(tasks, "run_scenario", sometimes)
    return monkeypatch


def test_a_failed_run_says_where_it_stopped_until_it_is_done(broken: pytest.MonkeyPatch, tmp_path: Path) -> None:
    campaign, folder = small_campaign(runs=2), tmp_path / "results"
    (failed,) = run_campaign(campaign, folder).failed
    message = (
        "paper-a, stationary, seed 0, run 1: stopped at step 7 of 12 (7 s), in the filter of sensor 1: no "
        "hypothesis has positive weight"
    )
    assert (failed.cell, failed.run, failed.message) == ("stationary", 1, message)
    results = open_results(folder)
    assert results.failures() == (Failure("stationary", 1, 1, message),)
    assert results.missing("stationary") == (1,)
    told = CliRunner().invoke(app, ["results", str(folder)])
    assert f"failed: 1 run; the same command tries again:\n  cell stationary, run 1: {message}" in told.stdout
    write_report(results, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "1 run failed." in page
    assert "stopped at step 7 of 12 (7 s), in the filter of sensor 1" in page
    (again,) = run_campaign(campaign, folder).failed
    assert open_results(folder).failures() == (Failure("stationary", 1, 2, again.message),)
    broken.undo()
    assert run_campaign(campaign, folder).num_completed == 1
    results = open_results(folder)
    assert (results.failures(), results.missing("stationary")) == ((), ())
    write_report(results, tmp_path / "report.html")
    assert "failed" not in (tmp_path / "report.html").read_text("utf-8")
