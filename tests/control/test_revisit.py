"""Places that are visited again and again: the seconds since the last visit, and that all strategies keep to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.control.constraints.protocol import ConstraintContext
from vedette.control.constraints.revisit import Revisit
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.kernels.base.types import VISITS
from vedette.platforms import HeadingPlatform, Patrolling, Stationary
from vedette.platforms.base import options_at
from vedette.scenarios import Scenario, load_scenario, replace_fields

PLACES, RADIUS, EVERY = ((0.0, 250.0), (-250.0, -100.0)), 80.0, 45.0
TIMES = np.arange(1.0, 13.0)


def pose(x: float, y: float, *since: float) -> Any:
    return np.array([x, y, *(0.0,) * (VISITS - 2), *since])


def test_the_seconds_since_a_visit_are_those_of_a_dense_walk() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        places = rng.uniform(-60.0, 60.0, (3, 2))
        platform = Patrolling(HeadingPlatform(10.0, (0.0, 60.0, 135.0)), [(x, y) for x, y in places.tolist()], 15.0)
        start = pose(*rng.uniform(-60.0, 60.0, 2), 20.0, 0.0, 7.5)
        found = options_at("platform", platform, start, TIMES).courses
        for course, heading in zip(found, np.radians([0.0, 60.0, 135.0]), strict=True):
            dense = np.linspace(0.0, 12.0, 24_001)
            way = start[:2] + 10.0 * dense[:, np.newaxis] * np.array([np.cos(heading), np.sin(heading)])
            for k, place in enumerate(places):
                inside = np.hypot(*(way - place).T) <= 15.0
                for time, clock in zip(TIMES, course[:, VISITS + k], strict=True):
                    visited = dense[(dense <= time) & inside]
                    wanted = time - visited[-1] if len(visited) else start[VISITS + k] + time
                    assert clock == pytest.approx(wanted, abs=2e-3)


def test_a_platform_that_stays_at_a_place_is_there_all_the_time() -> None:
    found = options_at("platform", Patrolling(Stationary(), PLACES, RADIUS), pose(0.0, 240.0, 9.0, 9.0), TIMES).courses
    assert found[0, :, VISITS].tolist() == [0.0] * 12
    assert found[0, :, VISITS + 1].tolist() == (9.0 + TIMES).tolist()


def situation(*since: float) -> ConstraintContext:
    """Two sensors 100 and 200 m from a place, which go towards it, away from it, or stay beside."""
    poses = np.array([pose(100.0, 0.0, *since), pose(-200.0, 0.0, 50.0)])
    ways = np.array([[-10.0, 0.0], [10.0, 0.0], [0.0, 5.0]])
    times = np.arange(1.0, 6.0)
    moves = np.zeros((3, 5, len(poses[0])))
    moves[..., :2] = ways[:, np.newaxis] * times[:, np.newaxis]
    courses = [own + moves for own in poses]
    return ConstraintContext(tuple(courses), times, poses=poses)


def test_the_nearest_sensor_goes_when_it_is_time() -> None:
    """At 10 m/s the way of 90 m takes 9 s, and two horizons are 10 s."""
    constraint = Revisit([(0.0, 0.0)], 10.0, 60.0)
    assert [own.tolist() for own in constraint.courses(situation(40.9))] == [[True] * 3] * 2
    assert [own.tolist() for own in constraint.courses(situation(41.1))] == [[True, False, False], [True] * 3]
    assert [own.tolist() for own in constraint.courses(situation(90.0))] == [[True, False, False], [True] * 3]


def test_courses_that_come_to_the_place_are_equally_good_however_far_they_go_in() -> None:
    """From 50 m on, three courses come within 30, 10 and 0 m of a place with a radius of 30 m."""
    poses, times = np.array([pose(50.0, 0.0, 90.0)]), np.arange(1.0, 6.0)
    moves = np.zeros((4, 5, len(poses[0])))
    moves[..., 0] = np.array([-4.0, -8.0, -10.0, -3.0])[:, np.newaxis] * times
    found = Revisit([(0.0, 0.0)], 30.0, 60.0).violations(ConstraintContext((poses + moves,), times, poses=poses))
    assert found[0].tolist() == [0.0, 0.0, 0.0, 5.0]


def visited(fields: dict[str, Any] | None = None) -> Scenario:
    constraint = {"kind": "revisit", "places": [list(place) for place in PLACES], "radius": RADIUS, "every": EVERY}
    scene = load_scenario("paper-a")
    steps = scene.model.time.num_steps
    lmb = {"filter": {"kind": "lmb"}, "fusion": {"kind": "sequential"}, "time.num_steps": 110}
    decisions = {"control.decision_steps": list(range(5, 110, 5)), "control.constraints": [constraint]}
    assert steps < 110
    return replace_fields(scene, {**lmb, **decisions, **(fields or {})})


@pytest.mark.parametrize("planner", ["jdm", "idm", "lookahead", "nearest", "random"])
def test_every_strategy_visits_in_time(planner: str) -> None:
    scenario = visited()
    record = run_scenario(scenario, planner, seed=0)
    ways = record.poses[:, :, :2]
    late = []
    for place in PLACES:
        near = (np.hypot(*(ways - np.array(place)).transpose(2, 0, 1)) <= RADIUS + 1e-6).any(axis=1)
        times = np.concatenate([[record.times[4]], record.times[near], [record.times[-1]]])
        late.append(float(np.diff(times).max()))
    assert max(late) <= EVERY + 1.0, late  # a visit may fall between two scans
    assert record.poses[5:, :, VISITS:].min(axis=1).max() <= EVERY


def test_without_the_constraint_they_are_not_visited() -> None:
    record = run_scenario(visited({"control.constraints": []}), "jdm", seed=0)
    gaps = [np.hypot(*(record.poses[:, :, :2] - np.array(place)).transpose(2, 0, 1)).min() for place in PLACES]
    assert max(gaps) > RADIUS


def test_mistakes_are_named() -> None:
    with pytest.raises(InputError, match="places: expected an array of shape"):
        Patrolling(Stationary(), [], 3.0)
    with pytest.raises(InputError, match="every"):
        Revisit(PLACES, 3.0, 0.0)
    with pytest.raises(InputError, match=r"expected poses of 13 components.*see Patrolling.*got 3"):
        Revisit(PLACES, 3.0, 9.0).courses(ConstraintContext((np.zeros((2, 5, 3)),), TIMES[:5], poses=np.zeros((1, 3))))
    with pytest.raises(InputError, match="pose: expected 13 components"):
        options_at("platform", Patrolling(Stationary(), PLACES, 3.0), np.zeros(VISITS), TIMES)
    twice = [{"kind": "revisit", "places": [[0.0, 0.0]], "radius": 3.0, "every": 9.0}] * 2
    with pytest.raises(ScenarioError, match="one constraint revisit with all places"):
        visited({"control.constraints": twice})
    still = [{"name": "radar", "position": [0.0, 0.0]}]
    with pytest.raises(ScenarioError, match="a sensor that moves, for revisit"):
        visited({"sensors": still})
