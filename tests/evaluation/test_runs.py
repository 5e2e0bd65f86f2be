"""Runs of scenarios: paired, and the same whoever does the work."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation.comparison import scored
from vedette.evaluation.reproduction import MARK, check_target, typical_run, write_reproduction
from vedette.evaluation.runs import run_paired, run_scenario, strategy
from vedette.scenarios import Scenario, list_builtin
from vedette.scenarios.loading import parse_scenario
from vedette.simulation.storage import load_run


@pytest.fixture(scope="module")
def scenario():
    """paper-e, twelve scans, one decision of few samples."""
    text = list_builtin()["paper-e"].read_text(encoding="utf-8")
    for old, new in (
        ("num_steps: 40", "num_steps: 12"),
        ("decision_steps: [10, 20, 30]", "decision_steps: [8]"),
        ("num_samples: 40", "num_samples: 2"),
        ("horizon_steps: 5", "horizon_steps: 2"),
        ("from_step: 11, to_step: 40", "from_step: 9, to_step: 12"),
    ):
        assert old in text
        text = text.replace(old, new)
    return Scenario(parse_scenario(text))


@pytest.fixture(scope="module")
def runs(scenario):
    return run_paired(scenario, ("jdm", "idm", "still"), 2, seed=5, num_workers=1)


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


def test_workers_and_threads_change_no_byte(scenario, runs):
    shared = run_paired(scenario, ("jdm", "idm", "still"), 2, seed=5, num_workers=2)
    for name, records in runs.items():
        for mine, other in zip(records, shared[name], strict=True):
            assert same(mine, other)
    assert same(run_scenario(scenario, "jdm", seed=5, run=1, num_threads=3), runs["jdm"][1])


def test_every_finished_run_is_told(scenario):
    told = []
    run_paired(scenario, ("still",), 3, seed=1, num_workers=1, progress=lambda record: told.append(record.run))
    assert told == [0, 1, 2]


def test_the_scans_that_count_are_the_scenarios(scenario, runs):
    comparison = scored(scenario, runs)
    assert comparison.counted.nonzero()[0].tolist() == [8, 9, 10, 11]
    np.testing.assert_allclose(comparison.run_means("jdm"), [r.ospa[8:12, 0].mean() for r in runs["jdm"]])


def test_the_typical_run_is_in_the_middle(scenario, runs):
    comparison = scored(scenario, runs)
    means = comparison.run_means("still")
    assert typical_run(comparison, runs["still"]) is runs["still"][int(np.argmin(means))]


def test_a_reproduction_is_written_whole_and_may_be_replaced_only_by_another(scenario, runs, tmp_path):
    folder = tmp_path / "deep" / "out"
    for _ in range(2):
        write_reproduction(scenario, runs, 5, folder)
    assert [p.name for p in folder.parent.iterdir()] == ["out"]
    assert json.loads((folder / MARK).read_text())["strategies"] == ["jdm", "idm", "still"]
    assert same(load_run(folder / "runs" / "jdm-0001"), runs["jdm"][1])
    for name in ("overview.png", "ospa.pdf", "tracks-idm.svg", "rewards-jdm-8s.png", "strategies.csv", "strategies.md"):
        assert (folder / name).stat().st_size > 100
    other = tmp_path / "mine"
    other.mkdir()
    (other / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="holds something else"):
        check_target(other)
    with pytest.raises(InputError, match="holds something else"):
        write_reproduction(scenario, runs, 5, other)
    assert (other / "thesis.tex").read_text() == "precious"


def test_unknown_strategy(scenario):
    with pytest.raises(InputError, match="planner"):
        strategy(scenario, "clever")
