"""Rules of thumb against what their sentences say, worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from control.examples import mobile_sensor
from vedette.control import MobileSensor, RulePlanner, StayInside
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.models import Region
from vedette.platforms import GridPlatform, HeadingPlatform, Pointing
from vedette.tracking import State

PLACES = [[0.0, 500.0], [800.0, 0.0], [-300.0, -300.0]]
POSES = np.array([[0.0, 0.0, 0.0], [-20.0, 100.0, 0.0], [100.0, -50.0, 0.0], [5.0, 5.0, 0.0]])
PAPER = HeadingPlatform(50.0)


def belief(places: list[list[float]] = PLACES, existence: float = 0.99) -> State:
    means = [[*place, 3.0, -2.0] for place in places]
    labels = [(1, i) for i in range(len(places))]
    fused = LMB.empty(4)
    if places:
        fused = LMB.from_bernoullis(labels, [existence] * len(places), means, [np.eye(4)] * len(places))
    return State((fused,) * len(POSES), fused, step=3, time=3.0)


def headings(rule: Any, state: State, platform: Any = PAPER, **options: Any) -> list[float]:
    sensors = (mobile_sensor("lmb", platform),) * len(POSES)
    plan = RulePlanner(sensors, rule, **options).plan(state, POSES, rng=np.random.default_rng(0))
    plan.validate()
    assert plan.planner == rule
    return [float(row[0]) for row in plan.chosen_actions]


def nearest_heading(sensor: int, goal: Any) -> float:
    """Of the paper's thirteen; -180 and 180 are one."""
    wanted = np.arctan2(*(np.asarray(goal) - POSES[sensor, :2])[::-1])
    offered = np.arange(-180.0, 180.0, 30.0)
    return float(offered[np.cos(np.radians(offered) - wanted).argmax()])


def test_every_sensor_heads_for_the_target_of_its_number() -> None:
    wanted = [nearest_heading(s, PLACES[s % 3]) for s in range(4)]
    assert headings("assigned_target", belief()) == wanted


def test_numbers_of_targets_may_be_given() -> None:
    wanted = [nearest_heading(s, PLACES[number]) for s, number in enumerate((2, 2, 0, 1))]
    assert headings("assigned_target", belief(), targets=(3, 6, 1, 2)) == wanted


def test_every_sensor_heads_for_its_nearest_that_no_other_took() -> None:
    taken: list[int] = []
    for s in range(4):
        left = [i for i in range(3) if i not in taken[-(s % 3) :] or s % 3 == 0]
        taken.append(min(left, key=lambda i: float(np.hypot(*(np.array(PLACES[i]) - POSES[s, :2])))))
    assert headings("nearest", belief()) == [nearest_heading(s, PLACES[i]) for s, i in enumerate(taken)]


def test_all_head_for_the_centroid() -> None:
    centre = np.mean(PLACES, axis=0)
    assert headings("centroid", belief()) == [nearest_heading(s, centre) for s in range(4)]


def test_with_nobody_there_the_first_course_is_taken() -> None:
    for rule in ("nearest", "assigned_target", "centroid"):
        assert headings(rule, belief([])) == [-180.0] * 4
        assert headings(rule, belief(existence=0.1)) == [-180.0] * 4


def test_a_sensor_that_may_stay_stays_over_its_target() -> None:
    state = belief([[0.0, 0.0]])
    plan = RulePlanner((mobile_sensor("lmb", GridPlatform(30.0, 30.0)),), "nearest")
    [row] = plan.plan(state, POSES[:1], rng=np.random.default_rng(0)).chosen_actions
    assert row.tolist() == [0.0, 0.0]


def test_a_camera_turns_to_its_target() -> None:
    sensor = MobileSensor(mobile_sensor("lmb").filter, Pointing([0.0, 90.0, 180.0, -90.0], relative=False))
    poses = np.array([[0.0, 0.0, 0.0, 0.0, np.radians(45.0)]])
    for goal, wanted in (([0.0, 500.0], 90.0), ([-300.0, 10.0], 180.0)):
        plan = RulePlanner((sensor,), "nearest").plan(belief([goal]), poses, rng=np.random.default_rng(0))
        assert plan.chosen_actions[0].tolist() == [wanted]


def test_constraints_are_kept_to() -> None:
    fence, platform = StayInside(Region(-110.0, 110.0, -110.0, 110.0)), HeadingPlatform(10.0)
    different = 0
    for rule in ("nearest", "assigned_target", "centroid"):
        free, held = headings(rule, belief(), platform), headings(rule, belief(), platform, constraints=(fence,))
        different += free != held
        for s, heading in enumerate(held):
            end = POSES[s, :2] + 100.0 * np.array([np.cos(np.radians(heading)), np.sin(np.radians(heading))])
            assert (np.abs(end) <= 110.0 + 1e-9).all(), rule
    assert different > 0


def test_what_does_not_fit_is_refused() -> None:
    sensors = (mobile_sensor("lmb"),) * 2
    with pytest.raises(InputError, match="rule: expected one of nearest, assigned_target, centroid; got far"):
        RulePlanner(sensors, "far")  # type: ignore[arg-type]
    for rule, targets in (("nearest", (1, 2)), ("assigned_target", (1,))):
        with pytest.raises(InputError, match="targets: expected 2 numbers of targets"):
            RulePlanner(sensors, rule, targets=targets)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"targets\[1\]: expected a whole number of at least 1"):
        RulePlanner(sensors, "assigned_target", targets=(1, 0))
