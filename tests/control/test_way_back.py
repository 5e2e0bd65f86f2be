"""Sensors that start where they must not be: of courses that all violate constraints, those that do so least."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import A, B, C, Situation, decided, lmb, mobile_sensor, situation
from vedette.control import ConstraintContext as Shown
from vedette.control import (
    HorizonPlanner,
    IndependentPlanner,
    JointPlanner,
    KeepOut,
    PlanningSettings,
    RandomPlanner,
    StayInside,
    VoidProbability,
    feasible_action_mask,
)
from vedette.errors import InputError
from vedette.fusion import ParallelUpdate
from vedette.models import Region
from vedette.platforms import HeadingPlatform

FENCE = StayInside(Region(-350.0, 350.0, -350.0, 350.0))
# 160 m wide and 1000 m high: from its middle the way out is to the east or the west.
WALL = KeepOut(Region(-80.0, 80.0, -500.0, 500.0))


def scene(poses: Any) -> Situation:
    """One belief of sensors that go 100 m within the horizon, in twelve directions; default settings."""
    platform = HeadingPlatform(10.0, np.arange(-150.0, 181.0, 30.0).tolist())
    belief = lmb((A, B, C), np.random.default_rng(3))
    given = situation("lmb", len(poses), settings=PlanningSettings(num_threads=1))
    sensors = (mobile_sensor("lmb", platform),) * len(poses)
    beliefs = (belief,) * len(poses)
    return replace(given, sensors=sensors, fusion=ParallelUpdate(), beliefs=beliefs, fused=belief, poses=poses)


def planners(given: Situation, constraint: Any) -> list[Any]:
    parts = given.sensors, given.fusion, given.settings
    shared: dict[str, Any] = {"constraints": (constraint,)}
    return [
        JointPlanner(*parts, **shared),
        IndependentPlanner(*parts, **shared),
        HorizonPlanner(*parts, depth=2, budget=200, **shared),
        RandomPlanner(given.sensors, given.settings, **shared),
    ]


def flown(given: Situation, planner: Any, num: int) -> tuple[Any, list[Any]]:
    """(num + 1, num_sensors, 3) poses at decisions 10 s apart, and the plans."""
    poses, plans = [given.poses], []
    for decision in range(num):
        plan = planner.plan(given.state, poses[-1], rng=np.random.default_rng(decision))
        headings = np.radians([float(own[0]) for own in plan.chosen_actions])
        away = 100.0 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
        poses.append(np.concatenate([poses[-1][:, :2] + away, headings[:, np.newaxis]], axis=1))
        plans.append(plan)
    return np.array(poses), plans


@pytest.mark.parametrize("which", range(4), ids=["jdm", "idm", "lookahead", "random"])
def test_who_starts_outside_a_fence_goes_back_and_stays(which: int) -> None:
    given = scene(np.array([[388.0, 0.0, 0.0], [-200.0, 600.0, 1.0]]))
    ways, plans = flown(given, planners(given, FENCE)[which], 5)
    beyond = np.maximum(np.abs(ways[:, :, :2]) - 350.0, 0.0).max(axis=2)
    np.testing.assert_allclose(beyond[:, 0], [38.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(beyond[:, 1], [250.0, 150.0, 50.0, 0.0, 0.0, 0.0], atol=1e-9)
    # By the shortest: straight to the west, and straight to the south.
    assert plans[0].chosen_actions[0].tolist() == [180.0]
    assert [plan.chosen_actions[1].tolist() for plan in plans[:2]] == [[-90.0]] * 2
    said = "sensor 1: no course meets its constraints (stay_inside); it may take those that violate them least"
    assert said in plans[0].notes
    assert not any("no course" in note for note in plans[3].notes)


@pytest.mark.parametrize("which", range(4), ids=["jdm", "idm", "lookahead", "random"])
def test_who_starts_inside_a_zone_leaves_it_by_the_shortest(which: int) -> None:
    given = scene(np.array([[20.0, 30.0, 0.0], [-20.0, -300.0, 1.0]]))
    ways, plans = flown(given, planners(given, WALL)[which], 3)
    assert [own.tolist() for own in plans[0].chosen_actions] == [[0.0], [180.0]]
    assert (np.abs(ways[1:, :, 0]) > 80.0).all()
    assert not any("no course" in note for plan in plans[1:] for note in plan.notes)


def test_lookahead_goes_back_at_every_decision_of_a_sequence() -> None:
    given = scene(np.array([[650.0, 0.0, 0.0]]))
    plan = decided(given, HorizonPlanner, depth=3, constraints=(FENCE,), seed=0)
    assert plan.sequence[0].tolist() == [[180.0]] * 3
    assert len([note for note in plan.notes if "no course" in note]) == 3


def courses(*ways: Any) -> Shown:
    """One sensor."""
    return Shown((np.array(ways, float),), np.arange(1.0, len(ways[0]) + 1.0), (), np.zeros((1, 3)))


def test_violations_are_what_they_say() -> None:
    shown = courses([[360.0, 0.0], [353.0, 354.0]], [[0.0, 0.0], [350.0, 350.0]])
    np.testing.assert_allclose(FENCE.violations(shown)[0], [(10.0 + 5.0) / 2.0, 0.0])
    # From inside, 80 m deep: to 50 m deep and out of it; across a corner; past it.
    shown = courses([[30.0, 0.0], [90.0, 0.0]], [[0.0, 510.0], [0.0, 520.0]])
    deep, crossing = WALL.violations(shown)[0]
    assert deep == pytest.approx(50.0 / 3.0)
    assert crossing == 0.0  # whose first leg leaves it
    outside = shown._replace(poses=np.array([[90.0, 0.0, 0.0]]), courses=(np.array([[[70.0, 510.0], [0.0, 600.0]]]),))
    crossing = WALL.violations(outside)[0][0]
    assert 0.0 < crossing < 1e-300
    for constraint in (FENCE, WALL):
        for own, forbidden in zip(constraint.violations(shown), constraint.courses(shown), strict=True):
            np.testing.assert_array_equal(own == 0.0, forbidden)


def test_violations_of_several_constraints_are_summed() -> None:
    shown = courses([[360.0, 0.0]], [[0.0, 353.0]], [[352.0, 0.0]])
    north = StayInside(Region(-1000.0, 1000.0, 50.0, 1000.0))
    assert feasible_action_mask([FENCE, north], shown).single[0].tolist() == [False, True, False]
    assert feasible_action_mask([FENCE], shown).single[0].tolist() == [False, False, True]


class Own:
    """Forbids everything, the last course by less."""

    name, needs_beliefs = "own", False

    def courses(self, situation: Shown) -> Any:
        return tuple(np.zeros(len(own), bool) for own in situation.courses)

    def pairs(self, situation: Shown, first: int, second: int) -> None:
        return None


class Measured(Own):
    def __init__(self, given: Any) -> None:
        self.given = given

    def violations(self, situation: Shown) -> Any:
        return self.given


def test_constraints_of_ones_own_may_measure_too() -> None:
    shown = courses([[1.0, 0.0]], [[2.0, 0.0]])
    assert feasible_action_mask([Own()], shown).single[0].tolist() == [True, True]
    assert feasible_action_mask([Measured([[2.0, 1.0]])], shown).single[0].tolist() == [False, True]
    assert (
        feasible_action_mask(
            [VoidProbability(1.0, 0.5)], shown._replace(beliefs=(lmb((), np.random.default_rng(0)),))
        ).notes
        == ()
    )


@pytest.mark.parametrize("given", [[[2.0, 0.0]], [[2.0, -1.0]], [[1.0]], [[np.nan, 1.0]], []])
def test_violations_must_fit_what_is_allowed(given: Any) -> None:
    with pytest.raises(InputError, match="constraint own: expected violations of 2 numbers of sensor 1"):
        feasible_action_mask([Measured(given)], courses([[1.0, 0.0]], [[2.0, 0.0]]))
