"""Plans and rules of thumb where zones are forbidden: sensors go around them, decision by decision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import pytest

from control.examples import KNOWN, Situation, decided, mobile_sensor, target_model
from reference.shortest_paths import forbidden
from vedette import models
from vedette.control import (
    ExpectedLossReward,
    HorizonPlanner,
    IndependentPlanner,
    JointPlanner,
    KeepOut,
    Plan,
    RulePlanner,
    StayInside,
    ZoneConstraint,
)
from vedette.control.constraints.paths import visibility_graph
from vedette.control.cost_to_go import CostToGo, attracting_targets
from vedette.control.inputs import options_of
from vedette.densities import LMB
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.kernels.base.types import Bools, Floats
from vedette.models import Region
from vedette.platforms import GridPlatform, HeadingPlatform, Stationary
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_planner
from vedette.tracking import State

SIGHT, STEP, REWARD = 60.0, 20.0, ExpectedLossReward(60.0)
CALM = replace(target_model(4), motion=models.constant_velocity(0.01))
ONCE = replace(KNOWN, horizon_steps=1, horizon_period=1.0)


def searchers(num: int = 1, platform: Any = None) -> tuple[Any, ...]:
    """They see 60 m, and take steps of 20 m."""
    standard = mobile_sensor("lmb", platform or GridPlatform(STEP, STEP), detection=models.limited_range(0.9, SIGHT))
    return (replace(standard, filter=LmbFilter(CALM, standard.filter.sensor)),) * num


def targets(*places: Any) -> LMB:
    states = np.concatenate([np.array(places, np.float64), np.zeros((len(places), 2))], axis=1)
    covs = np.tile(np.diag(np.square([5.0, 5.0, 0.1, 0.1])), (len(places), 1, 1))
    return LMB.from_bernoullis([(0, i) for i in range(len(places))], [0.95] * len(places), states, covs)


def planned(kind: Any, belief: LMB, poses: Any, constraints: Any, sensors: Any = None, **parts: Any) -> Plan:
    at = np.array(poses, np.float64)
    given = searchers(len(at)) if sensors is None else sensors
    if kind is RulePlanner:
        rule = RulePlanner(given, parts.pop("rule", "nearest"), ONCE, constraints, **parts)
        return rule.plan(State((belief,) * len(at), belief, 1, 1.0), at, rng=np.random.default_rng(0))
    of = Situation(given, ParallelUpdate(), ONCE, (belief,) * len(at), belief, at)
    return decided(of, kind, REWARD, constraints=constraints, **parts)


def walked(kind: Any, belief: LMB, start: Any, constraints: Any, most: int) -> Any:
    """(num, 2) m, where decisions take one sensor until it sees the first target, in `most` steps at most."""
    pose, [sensor], track = np.array([*start, 0.0]), searchers(), [np.array(start, np.float64)]
    goal = belief.tracks.means[0, :2]
    while np.hypot(*(goal - pose[:2])) > SIGHT and len(track) <= most:
        plan = planned(kind, belief, pose[np.newaxis], constraints)
        assert plan.notes == () or kind is HorizonPlanner or len(track) == 1
        pose = sensor.platform.course(pose, plan.chosen_actions[0], np.array([1.0]))[0]
        track.append(pose[:2].copy())
    return np.array(track)


def box(x_min: float, x_max: float, y_min: float, y_max: float) -> KeepOut:
    return KeepOut(Region(x_min, x_max, y_min, y_max))


WALL = box(0.0, 20.0, -80.0, 80.0)
OUTSIDE = [[-30.0, 110], [-110, 110], [-110, -110], [110, -110], [110, 110], [30, 110]]
INSIDE = [[30.0, 90], [90, 90], [90, -90], [-90, -90], [-90, 90], [-30, 90]]
RING = KeepOut(np.array([*OUTSIDE, *INSIDE]))
BAY = KeepOut(np.array([[0.0, 0], [100, 0], [100, 100], [0, 100], [0, 80], [80, 80], [80, 20], [0, 20]]))
SCENES: dict[str, tuple[Any, Any, Any, int]] = {
    "wall": ((-4.0, 5.0), (85.0, 10.0), (WALL,), 12),
    "fence closes one end": ((-4.0, 5.0), (85.0, 10.0), (WALL, StayInside(Region(-200.0, 200.0, -300.0, 85.0))), 13),
    "overlap": ((-20.0, 30.0), (90.0, 30.0), (box(0, 20, -80, 80), box(-60, 10, 60, 80)), 15),
    "two walls": ((-4.0, 5.0), (165.0, 0.0), (WALL, box(80.0, 100.0, -200.0, 40.0)), 20),
    "ring": ((-20.0, -130.0), (0.0, 0.0), (RING,), 30),
    "bay": ((70.0, 50.0), (190.0, 50.0), (BAY,), 22),
    "strait": ((-60.0, 10.0), (120.0, 0.0), (box(0, 20, 6, 500), box(0, 20, -500, -6)), 14),
    "start inside": ((5.0, 30.0), (85.0, 20.0), (WALL,), 12),
}


@pytest.mark.parametrize("kind", [JointPlanner, RulePlanner])
@pytest.mark.parametrize("scene", list(SCENES))
def test_sensors_come_to_see_what_is_behind_zones(scene: str, kind: Any) -> None:
    """In about as many steps as the shortest path has, and by no line through a zone."""
    start, goal, constraints, most = SCENES[scene]
    track = walked(kind, targets(goal), start, constraints, most)
    assert np.hypot(*(track[-1] - goal)) <= SIGHT
    zones = [own.zone for own in constraints]
    shares = np.linspace(0.0, 1.0, 50)[:, np.newaxis]
    begins_inside = bool(forbidden(track[:1], zones)[0])
    for a, b in list(pairwise(track))[begins_inside:]:
        assert not forbidden(a + shares * (b - a), zones).any()


@pytest.mark.parametrize("kind", [IndependentPlanner, HorizonPlanner])
def test_other_planners_go_around_as_well(kind: Any) -> None:
    start, goal, constraints, most = SCENES["wall"]
    track = walked(kind, targets(goal), start, constraints, most)
    assert np.hypot(*(track[-1] - goal)) <= SIGHT


def test_the_nearest_target_is_the_one_with_the_shortest_path() -> None:
    """The first is 44 m off behind the wall, the second 70 m to the west."""
    belief, pose = targets([40.0, 0.0], [-74.0, 0.0]), [[-4.0, 0.0, 0.0]]
    assert planned(RulePlanner, belief, pose, ()).chosen_actions[0].tolist() == [STEP, 0.0]
    assert planned(RulePlanner, belief, pose, (WALL,)).chosen_actions[0].tolist() == [-STEP, 0.0]
    assigned = planned(RulePlanner, belief, pose, (WALL,), rule="assigned_target").chosen_actions[0]
    assert (assigned[0], abs(assigned[1])) == (0.0, STEP)


@pytest.mark.parametrize("kind", [JointPlanner, IndependentPlanner, HorizonPlanner, RulePlanner])
def test_plans_name_targets_that_no_path_brings_into_sight(kind: Any) -> None:
    """On an island of 400 m; the second target is near its shore, so that it is seen from the sea."""
    island, belief = box(100.0, 500.0, -200.0, 200.0), targets([300.0, 0.0], [140.0, 0.0], [0.0, 150.0])
    note = "target (0, 0): no path that the constraints allow brings a sensor within sight of it"
    assert planned(kind, belief, [[-100.0, 0.0, 0.0]], (island,)).notes.count(note) == 1
    told = planned(kind, belief, [[-100.0, 0.0, 0.0]], (island,)).notes
    assert not any("(0, 1)" in own or "(0, 2)" in own for own in told)
    assert note not in planned(kind, belief, [[-100.0, 0.0, 0.0]], ()).notes
    if kind is RulePlanner:  # a sensor that cannot move sees what it sees
        mixed = (*searchers(1, Stationary()), *searchers(1))
        poses = [[300.0, 30.0, 0.0], [-100.0, 0.0, 0.0]]
        assert note not in planned(kind, belief, poses, (island,), mixed).notes
        told = planned(kind, belief, [[-100.0, 0.0, 0.0]], (island,), searchers(1, Stationary())).notes
        assert [own for own in told if own.startswith("target (0, 1)")] != []


def test_unreachable_targets_draw_no_sensor() -> None:
    """Towards the one that can be seen, though the other is nearer."""
    island, belief = box(40.0, 1000.0, -400.0, 400.0), targets([200.0, 0.0], [-300.0, 0.0])
    assert planned(JointPlanner, belief, [[0.0, 0.0, 0.0]], (island,)).chosen_actions[0].tolist() == [-STEP, 0.0]


@pytest.mark.parametrize("scene", list(SCENES))
def test_continued_courses_stay_outside(scene: str) -> None:
    """At no more than their speed; what the course that approaches its target best makes of it, is the shortest."""
    start, goal, constraints, _ = SCENES[scene]
    belief, zones = targets(goal), [own.zone for own in constraints]
    sensors, graph = (
        searchers(1, HeadingPlatform(STEP, tuple(np.arange(-180.0, 180.0, 15.0)))),
        visibility_graph(constraints),
    )
    pose = np.array([*graph.outside(np.array([start]))[0], 0.0])
    options = options_of(sensors, pose[np.newaxis], ONCE)
    times = np.arange(1.0, 40.0)
    to_go = CostToGo.of(sensors, options, *attracting_targets(belief), graph, None)
    [later] = to_go.continued(ONCE.horizon_times(), times, np.full((1, len(times), 2), goal))
    allowed = ~graph.is_blocked(pose[:2], options[0].courses[:, :, :2])
    distances = graph.to(np.array([goal]), pose[:2]).distances
    ends = [options[0].courses[c, -1, :2] for c in np.flatnonzero(allowed)]
    best = int(np.flatnonzero(allowed)[distances(np.array(ends))[:, 0].argmin()])
    for c in np.flatnonzero(allowed).tolist():
        course = later.courses[c]
        assert not forbidden(course[:, :2], zones).any()
        assert np.hypot(*np.diff(course[:, :2], axis=0).T).max() <= STEP + 1e-6
    left = distances(np.ascontiguousarray(later.courses[best, :, :2]))[:, 0]
    np.testing.assert_allclose(left, np.maximum(left[0] - STEP * (times - 1.0), 0.0), atol=0.05)
    # It heads where it goes.
    moved = np.diff(later.courses[best, :, :2], axis=0)
    ways, turns = np.arctan2(moved[:, 1], moved[:, 0]), later.courses[best, 1:, 2]
    steady = (np.hypot(*moved.T) > STEP - 1e-6) & (np.abs(np.diff(turns, prepend=turns[0])) < 1e-9)
    np.testing.assert_allclose(np.cos(ways[steady] - turns[steady]), 1.0, atol=1e-3)


def test_sensors_without_courses_have_none_beyond() -> None:
    """Sequences of decisions are laid out for one sensor, while the others have no courses."""
    graph, poses = visibility_graph((WALL,)), np.array([[-4.0, 5.0, 0.0], [-24.0, 0.0, 0.0]])
    sensors = searchers(2)
    first, second = options_of(sensors, poses, ONCE)
    options = first, second._replace(courses=second.courses[:0])
    to_go = CostToGo.of(sensors, options, *attracting_targets(targets([85.0, 10.0])), graph, None)
    found = to_go.continued(ONCE.horizon_times(), np.arange(1.0, 9.0), np.full((1, 8, 2), [85.0, 10.0]))
    assert [own.courses.shape for own in found] == [(9, 8, 3), (0, 8, 3)]


@dataclass(frozen=True)
class Cable:
    """A constraint of a user's own, with a zone."""

    zone: tuple[Floats, ...]
    name: ClassVar[str] = "cable"
    needs_beliefs: ClassVar[bool] = False

    def courses(self, situation: Any) -> tuple[Bools, ...]:
        return KeepOut(self.zone[0]).courses(situation)

    def pairs(self, situation: Any, first: int, second: int) -> None:
        return None


def test_a_constraint_of_ones_own_may_have_a_zone() -> None:
    start, goal, _, most = SCENES["wall"]
    cable = Cable((WALL.zone[0],))
    assert isinstance(cable, ZoneConstraint)
    track = walked(JointPlanner, targets(goal), start, (cable,), most)
    assert np.hypot(*(track[-1] - goal)) <= SIGHT


def test_land_in_degrees_is_gone_around_in_metres() -> None:
    """A degree of latitude is 111.2 km, one of longitude at 50.78 degrees 70.5 km."""
    ring = [{"lon": lon, "lat": lat} for lon, lat in ((-1.1, 50.77), (-1.08, 50.77), (-1.08, 50.80), (-1.1, 50.80))]
    changes = {"origin": {"lon": -1.1, "lat": 50.78}, "control.constraints": [{"kind": "keep_out", "polygon": ring}]}
    planner: Any = build_planner(replace_fields(load_scenario("beyond-the-gap"), changes), "jdm", 1)
    graph = visibility_graph(planner.constraints)
    east, south, north = 0.02 * 70_500.0, -0.01 * 111_200.0, 0.02 * 111_200.0
    start, goal = np.array([-100.0, -200.0]), np.array([east + 100.0, -200.0])
    corners = np.array([start, (0.0, south), (east, south), goal])
    wanted = float(np.hypot(*np.diff(corners, axis=0).T).sum())
    found = graph.to(goal[np.newaxis], start).distances(start[np.newaxis])[0, 0]
    assert found == pytest.approx(wanted, rel=0.003)
    assert north > -south  # the other way round is longer


def test_boats_of_the_solent_keep_off_the_land() -> None:
    """Between random places at sea, along paths that are at most half as long again, by no line over land."""
    planner: Any = build_planner(load_scenario("solent-patrol"), "jdm", 1)
    graph = visibility_graph(planner.constraints)
    zones = [own.zone for own in planner.constraints if isinstance(own, ZoneConstraint)]
    places = np.random.default_rng(3).uniform(-2900.0, 2900.0, (12, 2))
    sea = places[~forbidden(places, zones, 0.0)]
    assert len(sea) >= 5
    paths = graph.to(sea, sea[0])
    shares, bends = np.linspace(0.0, 1.0, 50)[:, np.newaxis], 0
    for goal in np.flatnonzero(paths.left == 0.0).tolist():
        path = paths.paths(sea[:1], np.array([goal]))[0]
        bends += len(path) - 2
        for a, b in pairwise(path):
            assert not forbidden(a + shares * (b - a), zones).any()
    assert bends > 0
