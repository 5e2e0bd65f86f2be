"""Runs of scenarios, and what is made of several."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation import track_table
from vedette.evaluation.comparison import compare_scored_scans, typical_run
from vedette.evaluation.ensembles import build_ensemble
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, list_builtin, load_scenario
from vedette.scenarios.build import build_planner
from vedette.scenarios.loading import parse_scenario


@pytest.fixture(scope="module")
def scenario():
    """paper-e, twelve scans, one decision of few samples."""
    text = list_builtin()["paper-e"].read_text(encoding="utf-8")
    for old, new in (
        ("num_steps: 40", "num_steps: 12"),
        ("decision_steps: [10, 20, 30]", "decision_steps: [8]"),
        ("num_samples: 40", "num_samples: 2"),
        ("horizon_steps: 5", "horizon_steps: 2"),
        ("first_scan: 11, last_scan: 40", "first_scan: 9, last_scan: 12"),
    ):
        assert old in text
        text = text.replace(old, new)
    return Scenario(parse_scenario(text))


@pytest.fixture(scope="module")
def runs(scenario):
    return {
        name: [run_scenario(scenario, name, seed=5, run=run, num_threads=1) for run in range(2)]
        for name in ("jdm", "idm", "stationary")
    }


def same(a, b):
    return (
        a.ospa.tobytes() == b.ospa.tobytes()
        and a.poses.tobytes() == b.poses.tobytes()
        and [d.plan.chosen for d in a.decisions] == [d.plan.chosen for d in b.decisions]
        and all(
            s.mean.tobytes() == t.mean.tobytes()
            for d, e in zip(a.decisions, b.decisions, strict=True)
            for s, t in zip(d.plan.tables, e.plan.tables, strict=True)
        )
    )


def test_threads_change_no_byte(scenario, runs):
    assert same(run_scenario(scenario, "jdm", seed=5, run=1, num_threads=3), runs["jdm"][1])


def ensembles_of(runs):
    return {name: build_ensemble((record.summary(), None) for record in of) for name, of in runs.items()}


def test_the_scans_that_count_are_the_scenarios(scenario, runs):
    comparison = compare_scored_scans(scenario, ensembles_of(runs))
    assert comparison.counted.nonzero()[0].tolist() == [8, 9, 10, 11]
    np.testing.assert_allclose(comparison.run_means("jdm"), [r.ospa[8:12, 0].mean() for r in runs["jdm"]])


def test_the_typical_run_is_in_the_middle(scenario, runs):
    comparison = compare_scored_scans(scenario, ensembles_of(runs))
    means = comparison.run_means("stationary")
    assert typical_run(comparison, "stationary") == int(np.argmin(means))


def test_unknown_strategy(scenario):
    with pytest.raises(InputError, match="planner"):
        build_planner(scenario, "clever")


def test_a_scenario_may_be_named() -> None:
    named = run_scenario("paper-a", "stationary", seed=3)
    assert named.ospa.tobytes() == run_scenario(load_scenario("paper-a"), "stationary", seed=3).ospa.tobytes()
    with pytest.raises(InputError, match="paper-z"):
        run_scenario("paper-z", "stationary", seed=3)


def test_a_text_that_a_spreadsheet_would_take_for_a_formula_is_written_with_an_apostrophe() -> None:
    cells = ["=1+cmd", "+A1", "-2+3", "@x", "-12.5", "MMSI 1", None, 2.0]
    written = track_table._csv({"target": cells}).decode().splitlines()[1:]
    assert written == ["'=1+cmd", "'+A1", "'-2+3", "'@x", "-12.5", "MMSI 1", '""', "2.0"]
