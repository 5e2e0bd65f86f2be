"""Constraints as masks: regions, distances between platforms, and constraints of the user's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vedette import models
from vedette.control import Constraint, ConstraintContext, KeepOut, Mask, Separation, StayInside, feasible_action_mask
from vedette.control.search.problem import all_joint_actions
from vedette.densities import LMB
from vedette.errors import InputError

TIMES = np.array([2.0, 4.0, 6.0])


def situation(seed: int, num_sensors: int = 4, spread: float = 150.0, *, start: bool = True) -> ConstraintContext:
    """Sensors with a few courses each, straight and crooked."""
    draw = np.random.default_rng(seed)
    poses = np.concatenate([draw.uniform(-spread, spread, (num_sensors, 2)), np.zeros((num_sensors, 1))], axis=1)
    courses = tuple(
        pose + np.cumsum(draw.normal(0.0, 40.0, (draw.integers(1, 5), len(TIMES), 3)), axis=1) for pose in poses
    )
    return ConstraintContext(courses, TIMES, (), poses if start else None)


def on_the_way(scene: ConstraintContext, sensor: int, course: int, num: int = 400) -> Any:
    """Many points of the way of a course, and whether each is later than the first leg."""
    corners = scene.courses[sensor][course, :, :2]
    if scene.poses is not None:
        corners = np.concatenate([scene.poses[sensor, np.newaxis, :2], corners])
    shares = np.linspace(0.0, 1.0, num)[:, np.newaxis]
    return np.concatenate([a + shares * (b - a) for a, b in pairwise(corners)])


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_separation_is_the_least_distance_on_the_way(seed: int, start: bool) -> None:
    scene, distance = situation(seed, start=start), 60.0
    mask = feasible_action_mask([Separation(distance)], scene)
    for (first, second), table in mask.together.items():
        apart = 0.0 if scene.poses is None else np.hypot(*(scene.poses[first, :2] - scene.poses[second, :2]))
        for i, j in np.ndindex(*table.shape):
            gaps = np.hypot(*(on_the_way(scene, first, i) - on_the_way(scene, second, j)).T)
            if start and apart < distance:
                gaps = gaps[400:]
            if abs(gaps.min() - distance) > 0.5:
                assert table[i, j] == (gaps.min() >= distance)
    rest = {(i, j) for j in range(4) for i in range(j)} - set(mask.together)
    if not mask.notes:
        for first, second in rest:
            pairs = Separation(distance).pairs(scene, first, second)
            assert pairs is not None
            assert pairs.all()


def test_platforms_that_pass_through_each_other_come_too_near() -> None:
    there, back = np.array([[[0.0, 0.0], [100.0, 0.0]]]), np.array([[[100.0, 1.0], [0.0, 1.0]]])
    scene = ConstraintContext((there, back), TIMES[:2])
    pairs = Separation(2.0).pairs(scene, 0, 1)
    assert pairs is not None
    assert not pairs.any()
    assert Separation(1.0).pairs(scene, 0, 1)


def test_who_is_too_near_already_may_go_away() -> None:
    ways = tuple(np.array([[[side * 30.0, 0.0]], [[0.0, 0.0]]]) for side in (-1.0, 1.0))
    scene = ConstraintContext(ways, TIMES[:1], (), np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    pairs = Separation(31.0).pairs(scene, 0, 1)
    assert pairs is not None
    assert pairs.tolist() == [[True, False], [False, False]]


def test_sensors_far_from_each_other_are_not_asked_about(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, pairs = [], Separation.pairs

    def watch(self: Separation, scene: ConstraintContext, first: int, second: int) -> Any:
        asked.append((first, second))
        return pairs(self, scene, first, second)

    monkeypatch.setattr(Separation, "pairs", watch)
    courses = tuple(np.array([[[x, 0.0, 0.0]], [[x + 10.0, 0.0, 0.0]]]) for x in (0.0, 30.0, 1000.0))
    mask = feasible_action_mask([Separation(25.0)], ConstraintContext(courses, TIMES[:1]))
    assert asked == [(0, 1)]
    assert mask.together[0, 1].tolist() == [[True, True], [False, True]]


@given(st.integers(0, 2**32 - 1))
def test_stay_inside_is_at_all_times(seed: int) -> None:
    scene = situation(seed)
    region = models.Region(-150.0, 120.0, -100.0, 150.0)
    for own, allowed in zip(scene.courses, StayInside(region).courses(scene), strict=True):
        assert allowed.tolist() == [all(region.contains([place])[0] for place in course[:, :2]) for course in own]


CORNERS = np.array([[-80.0, -60.0], [60.0, -90.0], [20.0, 0.0], [90.0, 70.0], [-50.0, 80.0]])


def inside(points: Any, corners: Any) -> Any:
    """By the angle that the corners turn through, seen from a point: none, or once around."""
    off = corners[np.newaxis] - points[:, np.newaxis]
    angles = np.arctan2(off[..., 1], off[..., 0])
    turns = np.angle(np.exp(1j * (np.roll(angles, -1, axis=1) - angles)))
    return np.abs(turns.sum(axis=1)) > 1.0


def from_edge(points: Any, corners: Any) -> Any:
    """(num_points,) distance to the nearest edge."""
    found = np.full(len(points), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found = np.minimum(found, np.hypot(*(points - a - share[:, np.newaxis] * (b - a)).T))
    return found


RECTANGLE = np.array([[-30.0, -40.0], [50.0, -40.0], [50.0, 20.0], [-30.0, 20.0]])


@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from(["polygon", "clockwise", "region"]))
def test_keep_out_is_on_the_way_too(seed: int, start: bool, kind: str) -> None:
    scene = situation(seed, start=start)
    corners = {"polygon": CORNERS, "clockwise": CORNERS[::-1], "region": RECTANGLE}[kind]
    area = models.Region(-30.0, 50.0, -40.0, 20.0) if kind == "region" else corners
    for s, allowed in enumerate(KeepOut(area).courses(scene)):
        for course in range(len(allowed)):
            points = on_the_way(scene, s, course)
            if scene.poses is not None and inside(scene.poses[s : s + 1, :2], corners)[0]:
                points = points[400:]
            touched = inside(points, corners)
            doubtful = (
                from_edge(points, corners).min() < 0.5 and not (touched & (from_edge(points, corners) > 0.5)).any()
            )
            if not doubtful:
                assert allowed[course] == (not touched.any())


def test_a_thin_area_is_not_jumped_over() -> None:
    over = np.array([[[-50.0, 0.0], [50.0, 0.0]], [[-50.0, 0.0], [-40.0, 0.0]]])
    wall = [[-1.0, -500.0], [1.0, -500.0], [1.0, 500.0], [-1.0, 500.0]]
    (allowed,) = KeepOut(wall).courses(ConstraintContext((over,), TIMES[:2]))  # type: ignore[arg-type]
    assert allowed.tolist() == [False, True]
    first_leg = ConstraintContext((over[:, 1:] + [0.0, 0.0],), TIMES[:1], (), np.array([[-45.0, 0.0, 0.0]]))
    (allowed,) = KeepOut(wall).courses(first_leg)  # type: ignore[arg-type]
    assert allowed.tolist() == [False, True]
    inside_it = first_leg._replace(poses=np.array([[0.0, 0.0, 0.0]]))
    (allowed,) = KeepOut(wall).courses(inside_it)  # type: ignore[arg-type]
    assert allowed.tolist() == [True, True]


@pytest.mark.parametrize("constraint", [KeepOut(CORNERS), StayInside(models.Region(900.0, 999.0, 900.0, 999.0))])
def test_what_cannot_move_may_be_where_it_is(constraint: Constraint) -> None:
    """A radar on the shore; a boat beside it that can go, or stop, is asked."""
    pose = np.array([*CORNERS.mean(axis=0), 0.0])
    still = np.tile(pose, (2, len(TIMES), 1))
    moving = still.copy()
    moving[1, -1, 0] += 1e-6
    (radar, boat) = constraint.courses(ConstraintContext((still, moving), TIMES, poses=np.stack([pose, pose])))
    assert radar.all()
    assert not boat.any()
    scene = ConstraintContext((still,), TIMES, poses=pose[np.newaxis])
    assert feasible_action_mask([constraint], scene).notes == ()
    assert not constraint.courses(ConstraintContext((still,), TIMES))[0].any()  # nothing is known of where it is


def test_one_time_is_one_place() -> None:
    places = np.array([[[0.0, 0.0]], [[500.0, 0.0]], [[90.0, 70.0]]])
    (allowed,) = KeepOut(CORNERS).courses(ConstraintContext((places,), TIMES[:1]))
    assert allowed.tolist() == [False, True, False]  # the last is on a corner


@dataclass
class Own:
    """A constraint of the user's own: sensors do not take the course of the same number, nor any of `forbidden`."""

    forbidden: tuple[int, ...] = ()
    answer: Any = None
    needs_beliefs: bool = False
    name: str = "own"

    def courses(self, situation: ConstraintContext) -> Any:
        return tuple(~np.isin(np.arange(len(own)), self.forbidden) for own in situation.courses)

    def pairs(self, situation: ConstraintContext, first: int, second: int) -> Any:
        shape = (len(situation.courses[first]), len(situation.courses[second]))
        return ~np.eye(*shape, dtype=bool) if self.answer is None else self.answer


def three(num_sensors: int = 3) -> ConstraintContext:
    return ConstraintContext((np.zeros((3, 1, 3)),) * num_sensors, TIMES[:1])


def allowed(mask: Mask) -> Iterator[tuple[int, ...]]:
    actions = all_joint_actions(mask.shape)
    return map(tuple, actions[mask.allows(actions)].tolist())


def test_constraints_of_the_users_own_are_asked_about_every_pair() -> None:
    mask = feasible_action_mask([Own()], three())
    assert sorted(allowed(mask)) == [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    assert mask.notes == ()


def test_all_constraints_hold_at_once() -> None:
    scene = ConstraintContext(
        tuple(np.array([[[x + 5.0 * a, 0.0, 0.0]] for a in range(3)]) for x in (0.0, 3.0)), TIMES[:1]
    )
    one, other = (
        feasible_action_mask([Own()], scene).together[0, 1],
        feasible_action_mask([Separation(6.0)], scene).together[0, 1],
    )
    both = feasible_action_mask([Own(), Separation(6.0), StayInside(models.Region(-1.0, 9.0, -1.0, 1.0))], scene)
    np.testing.assert_array_equal(both.together[0, 1], one & other)
    assert [own.tolist() for own in both.single] == [[True, True, False], [True, True, False]]


def test_a_sensor_without_a_course_keeps_all_and_the_mask_says_so() -> None:
    mask = feasible_action_mask(
        [Own((0, 1, 2)), Separation(1.0)], ConstraintContext((np.zeros((3, 1, 3)), np.full((4, 1, 3), 9.0)), TIMES[:1])
    )
    assert [own.tolist() for own in mask.single] == [[True] * 3, [False] * 3 + [True]]
    said = "sensor 1: no course meets its constraints (own, separation); it may take those that violate them least"
    assert mask.notes == (said,)


def test_sensors_that_cannot_all_have_their_way() -> None:
    """Four sensors of three courses each: two have to take the same."""
    mask = feasible_action_mask([Own()], three(4))
    assert len(mask.together) == 5
    assert len(mask.notes) == 1
    assert "no courses were found that go together; the constraint is given up" in mask.notes[0]
    strict = Mask(mask.single, {(i, j): ~np.eye(3, dtype=bool) for j in range(4) for i in range(j)})
    fewest = strict.violations(all_joint_actions(mask.shape)).min()
    assert all(strict.violations(np.array([joint]))[0] == fewest for joint in allowed(mask))


def test_no_constraint_forbids_nothing() -> None:
    mask = feasible_action_mask([], situation(1))
    assert all(own.all() for own in mask.single)
    assert mask.together == {}


def test_one_sensor_has_no_pairs() -> None:
    assert feasible_action_mask([Separation(10.0), Own()], situation(1, 1)).together == {}


@pytest.mark.parametrize(
    "constraint", [StayInside(models.Region(0, 1, 0, 1)), KeepOut(CORNERS), Separation(1.0), Own()]
)
def test_they_meet_the_protocol(constraint: Constraint) -> None:
    assert constraint.name.isidentifier()
    assert not constraint.needs_beliefs
    assert len(constraint.courses(three(2))) == 2


@pytest.mark.parametrize(
    ("constraint", "message"),
    [
        (
            Own(answer=np.ones((2, 2), bool)),
            r"constraint own: expected booleans of shape \(3, 3\); got bool of shape \(2, 2\)",
        ),
        (
            Own(answer=np.ones((3, 3))),
            r"constraint own: expected booleans of shape \(3, 3\); got float64 of shape \(3, 3\)",
        ),
        (Own(needs_beliefs=True), "constraint own: expected 1 predicted beliefs, one a time; got 0"),
    ],
)
def test_answers_that_are_none(constraint: Constraint, message: str) -> None:
    with pytest.raises(InputError, match=message):
        feasible_action_mask([constraint], three())


def test_courses_of_too_few_sensors() -> None:
    class Short(Own):
        def courses(self, situation: ConstraintContext) -> Any:
            return super().courses(situation)[1:]

    with pytest.raises(InputError, match="constraint own: expected courses of 3 sensors; got 2"):
        feasible_action_mask([Short()], three())


def test_beliefs_for_all_times_are_enough() -> None:
    beliefs = (LMB.empty(4),)
    assert feasible_action_mask([Own(needs_beliefs=True)], three()._replace(beliefs=beliefs)).notes == ()
