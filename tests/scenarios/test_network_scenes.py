"""The scenes of several sensors with views of their own: the published truths, and who sees what."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.evaluation import custom_metrics, measure_run, run_scenario, targets_in_view
from vedette.kernels.base.types import Floats
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_targets
from vedette.scenarios.loading import Scenario
from vedette.simulation import Truth

# Scene -> targets in all, targets at the first and the last scan, mean number.
NUMBERS = {
    "eight-mobile": (20, 20, 20, 20.0),
    "shore-radar": (8, 6, 8, 7.65),
    "six-cameras": (11, 11, 9, 10.26),
    "sixteen-views": (18, 6, 4, 10.2875),
    "three-radars": (8, 8, 8, 8.0),
    "two-views-1": (3, 2, 2, 2.6375),
    "two-views-2": (22, 4, 11, 14.725),
}
# Scene, step, number of the target -> where it is.
PLACES = {
    ("eight-mobile", 100, 0): (100.0, 396.0),
    ("eight-mobile", 100, 10): (-300.0, 458.0),
    ("six-cameras", 50, 0): (0.0, 100.0),
    ("six-cameras", 50, 3): (-450.0, -650.0),
    ("six-cameras", 50, 10): (450.0, -150.0),
    ("two-views-1", 1, 0): (-183.0, 600.0),
    ("two-views-1", 10, 2): (20.0, 210.0),
    ("two-views-1", 60, 2): (1020.0, 710.0),
    ("two-views-2", 80, 0): (40.0, 600.0),
}
NUM_SCANS = 6  # of the scenes as they are run here


def truth_of(scenario: Scenario) -> Truth:
    return build_targets(scenario).truth(scenario.model.time.build(), rng=np.random.default_rng(0))


def seen_by(scenario: Scenario, truth: Truth) -> Floats:
    """(total, num_sensors) whether each sensor, lying still, sees each target."""
    experiment = build_experiment(scenario)
    sensors, columns = experiment.tracker.sensors, []
    for s, sensor in enumerate(sensors):
        poses = np.tile(experiment.poses[s], (truth.num_scans, 1, 1))
        columns.append(targets_in_view(truth, poses, [sensor], min_detection_probability=0.4))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", NUMBERS)
def test_their_truth_is_the_published_one(name: str) -> None:
    truth = truth_of(load_scenario(name))
    alive = np.diff(truth.offsets)
    found: tuple[Any, ...] = (len(np.unique(truth.ids)), alive[0], alive[-1], alive.mean())
    assert found == pytest.approx(NUMBERS[name])


@pytest.mark.parametrize("name", NUMBERS)
def test_targets_stay_in_the_region(name: str) -> None:
    scenario = load_scenario(name)
    region, states = scenario.model.region, truth_of(scenario).states
    assert (states[:, :2] >= [region.x_min, region.y_min]).all()
    assert (states[:, :2] <= [region.x_max, region.y_max]).all()


@pytest.mark.parametrize(("scene", "place"), PLACES.items())
def test_targets_follow_their_script(scene: tuple[str, int, int], place: tuple[float, float]) -> None:
    name, step, target = scene
    ids, states = truth_of(load_scenario(name)).at(step - 1)
    np.testing.assert_allclose(states[ids == target][0, :2], place)


def test_most_ships_of_the_bay_are_seen_by_one_alone() -> None:
    scenario = load_scenario("shore-radar")
    truth = truth_of(scenario)
    seen = seen_by(scenario, truth)
    assert seen.any(axis=1).all()
    alone = [{tuple(row) for row in seen[truth.ids == ship].tolist()} for ship in range(8)]
    assert alone.count({(True, False, False)}) == 3
    assert alone.count({(False, True, False)}) == 1
    assert alone.count({(False, False, True)}) == 2


@pytest.mark.parametrize("name", ["two-views-1", "two-views-2"])
def test_both_views_together_miss_nothing_and_neither_sees_all(name: str) -> None:
    scenario = load_scenario(name)
    seen = seen_by(scenario, truth_of(scenario))
    assert seen.any(axis=1).all()
    assert not seen.all(axis=0).any()


def test_two_or_three_of_sixteen_see_each_target() -> None:
    scenario = load_scenario("sixteen-views")
    seen = seen_by(scenario, truth_of(scenario)).sum(axis=1)
    assert (seen.min(), seen.max()) == (1, 4)
    assert seen.mean() == pytest.approx(2.82, abs=0.005)


@pytest.mark.parametrize(("name", "share"), [("eight-mobile", 0.702), ("six-cameras", 0.598)])
def test_sensors_that_stay_miss_most(name: str, share: float) -> None:
    scenario = load_scenario(name)
    seen = seen_by(scenario, truth_of(scenario))
    assert (~seen.any(axis=1)).mean() == pytest.approx(share, abs=0.02)


def beginning(name: str) -> Scenario:
    """The first scans of a scene, with its targets of then."""
    scenario = load_scenario(name)
    targets = scenario.model.targets.model_dump(mode="json")
    targets["tracks"] = [
        {**track, "end_step": None} for track in targets["tracks"] if (track["start_step"] or 1) <= NUM_SCANS
    ]
    fields: dict[str, Any] = {"time.num_steps": NUM_SCANS, "targets": targets}
    if scenario.model.decision_steps:
        fields["control.decision_steps"] = [2, 4]
    return replace_fields(scenario, fields)


@pytest.mark.parametrize("name", NUMBERS)
def test_their_beginning_runs_and_what_is_seen_is_tracked(name: str) -> None:
    scenario = beginning(name)
    record = run_scenario(scenario, "stationary", seed=1, num_threads=1)
    share = measure_run(record, scenario, custom_metrics(scenario)).columns()["tracked_fraction"]
    assert (record.ospa[:, 0] <= scenario.model.ospa.cutoff).all()
    assert share[-1] >= 0.8
    scans = build_experiment(scenario).scans_at
    sent = record.health.bytes_sent > 0
    np.testing.assert_array_equal(sent, np.ones_like(sent) if scans is None else scans.T)


@pytest.mark.parametrize("name", ["eight-mobile", "six-cameras"])
def test_mobile_sensors_move(name: str) -> None:
    scenario = beginning(name)
    poses = run_scenario(scenario, "random", seed=1, num_threads=1).poses
    moved = np.abs(np.diff(poses, axis=0)).max(axis=2) > 0.0
    assert np.flatnonzero(moved.any(axis=1)).tolist() == [1, 3]  # in the second after each decision
