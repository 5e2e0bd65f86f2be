"""Sensors of their own periods, and scans that do not take place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.errors import ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_scan_times
from vedette.scenarios.overrides import replace_fields
from vedette.simulation.loop import scan_flags_of_run
from vedette.simulation.replay import scans_of


def of(**fields: Any) -> Any:
    """A short scenario; sections of scan times are whole, as a field by its path must be."""
    whole: dict[str, Any] = {"every": 1, "first": 1, "period": None, "offset": None, "scan_loss_probability": None}
    given = {path: {**whole, **value} for path, value in fields.items()}
    short = {"time.num_steps": 12, "control.decision_steps": [4], "ospa.first_scan": None, "ospa.last_scan": None}
    return replace_fields(load_scenario("paper-e"), {**short, **given})


def test_periods_in_seconds_are_those_in_steps() -> None:
    seconds = of(**{"sensors.1.scans": {"period": 3.0, "offset": 2.0}})
    steps = of(**{"sensors.1.scans": {"every": 3, "first": 3}})
    np.testing.assert_array_equal(build_scan_times(seconds), build_scan_times(steps))
    assert np.flatnonzero(build_scan_times(seconds)[1]).tolist() == [2, 5, 8, 11]
    one, other = (run_scenario(each, "stationary", seed=1) for each in (seconds, steps))
    assert all(a.means.tobytes() == b.means.tobytes() for a, b in zip(one.estimates, other.estimates, strict=True))


def test_scans_drop_out_at_the_given_probability_and_equally_for_every_strategy() -> None:
    shares = (0.0, 0.3)
    tables = [scan_flags_of_run(None, shares, 100, 5, run) for run in range(40)]
    there = np.array(tables)
    assert there[:, 0].all()
    assert there[:, 1].mean() == pytest.approx(0.7, abs=4.0 * np.sqrt(0.21 / 4000.0))
    assert (there[0] != there[1]).any()
    scenario = of(**{"sensors.*.scans": {"scan_loss_probability": 0.4}})
    experiment = build_experiment(scenario)
    moved, still = (run_scenario(scenario, planner, seed=2, num_threads=1) for planner in ("constant", "stationary"))
    dropped = []
    for record in (moved, still):
        scans = scans_of(record, experiment)
        dropped.append([[scan is None for scan in each] for each in scans])
    assert dropped[0] == dropped[1]
    assert 0 < np.sum(dropped[0]) < np.size(dropped[0])


def test_a_run_equals_the_tracker_on_the_scans_that_took_place() -> None:
    scenario = of(**{"sensors.*.scans": {"scan_loss_probability": 0.4}})
    experiment, record = build_experiment(scenario), run_scenario(scenario, "stationary", seed=2)
    state = experiment.tracker.initial()
    rngs = [np.random.default_rng(0)] * experiment.num_sensors
    for k, scans in enumerate(scans_of(record, experiment)):
        measured = [None if scan is None else scan.measurements for scan in scans]
        state, _ = experiment.tracker.step(state, measured, record.poses[k], float(record.times[k]), rngs=rngs)
        estimate = experiment.estimate(state.fused, k + 1)
        assert estimate.means.tobytes() == record.estimates[k].means.tobytes()


@pytest.mark.parametrize(
    ("scans", "message"),
    [
        ({"period": 2.5}, r"sensors\[0\].scans.period: expected a multiple of time.step_period, 1 s, got 2.5"),
        ({"period": 3.0, "offset": 0.5}, r"scans.offset: expected a multiple of time.step_period, 1 s, got 0.5"),
        ({"period": 3.0, "offset": 3.0}, r"scans.offset: expected a time below that of period, with it, got 3"),
        ({"offset": 1.0}, r"scans.offset: expected a period with it, got 1"),
        ({"period": 3.0, "every": 3}, r"scans.period: expected either every and first, or period and offset, got both"),
        ({"period": 0.4}, r"scans.period: expected a multiple of time.step_period"),
        ({"period": 40.0, "offset": 20.0}, r"scans.offset: expected a step up to the last, 12"),
        ({"scan_loss_probability": 1.0}, r"scans.scan_loss_probability: expected a number below 1"),
    ],
)
def test_impossible_times_are_reported(scans: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        of(**{"sensors.0.scans": scans})


def test_filters_that_go_on_from_each_scan_have_no_drop_outs() -> None:
    scenario = load_scenario("linear-10")
    with pytest.raises(ScenarioError, match="scans: expected every step, as phd filters go on from each scan"):
        replace_fields(
            scenario,
            {"filter": {"kind": "phd"}, "fusion": {"kind": "none"}, "sensors.*.scans.scan_loss_probability": 0.1},
        )
