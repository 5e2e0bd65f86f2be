"""Sequences of decisions under constraints against all sequences written out, each tested in plain NumPy."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    HEADINGS,
    KNOWN,
    POSES,
    Situation,
    assert_same_plan,
    decided,
    mobile_sensor,
    situation,
    told,
)
from control.test_lookahead import SEARCHES, of_sequences
from vedette import models
from vedette.control import (
    ExpectedLossReward,
    HorizonPlanner,
    JointPlanner,
    KeepOut,
    KullbackLeiblerReward,
    Plan,
    Separation,
    StayInside,
    VoidProbability,
    void_probability,
)
from vedette.control.lookahead import courses as courses_module
from vedette.control.lookahead import feasibility as rules_module
from vedette.control.lookahead.constraints import Stages
from vedette.densities import LMB, track_moments
from vedette.fusion import Clmb
from vedette.platforms import GridPlatform

BOX = (-480.0, -100.0, -200.0, 310.0)  # that is not entered
INSIDE = (-900.0, 700.0, -700.0, 700.0)  # that is not left
VOID = (150.0, 0.965)
LATE = 9.0  # s, from when on the second sensor must be north of its start


class Own:
    """The second sensor is to be north of its start from a time on; not two sensors may be in the west then."""

    name = "own"
    needs_beliefs = False

    def courses(self, situation: Any) -> tuple[Any, ...]:
        allowed = tuple(np.ones(len(own), bool) for own in situation.courses)
        late = situation.times > LATE
        allowed[1][(situation.courses[1][:, late, 1] < POSES[1, 1]).any(axis=1)] = False
        return allowed

    def pairs(self, situation: Any, first: int, second: int) -> Any:
        late = situation.times > LATE
        west = [(situation.courses[s][:, late, 0] < -440.0).any(axis=1) for s in (first, second)]
        return ~(west[0][:, np.newaxis] & west[1])


CONSTRAINTS: dict[str, Any] = {
    "keep out": KeepOut(models.Region(*BOX)),
    "stay inside": StayInside(models.Region(*INSIDE)),
    "separation": Separation(500.0),
    "void": VoidProbability(*VOID),
    "own": Own(),
}


def lmbs(num_sensors: int = 2) -> Situation:
    return situation("lmb", num_sensors, settings=KNOWN)


def decide(given: Situation, constraints: Any, reward: Any = None, **arguments: Any) -> Plan:
    reward = ExpectedLossReward() if reward is None else reward
    arguments = {"discount": None, "constraints": tuple(constraints), **arguments}
    return decided(given, HorizonPlanner, reward, **arguments)


def ways(sensor: int, depth: int, stride: int) -> Any:
    """(num_sequences, depth, 3, 2) where each decision's course begins, and is after 4 and after 8 s."""
    headings = np.array(list(itertools.product(HEADINGS, repeat=depth)))
    steps = 30.0 * np.stack([np.cos(np.radians(headings)), np.sin(np.radians(headings))], axis=2)
    starts = POSES[sensor, :2] + 4.0 * stride * (np.cumsum(steps, axis=1) - steps)
    return starts[:, :, np.newaxis] + np.array([0.0, 4.0, 8.0])[:, np.newaxis] * steps[:, :, np.newaxis]


def outside_box(legs: Any) -> Any:
    """Whether straight legs, from their first to their last point, pass a box by; those from inside may leave it."""
    found = np.ones(legs.shape[:-2], bool)
    for place in np.ndindex(found.shape):
        points = legs[place][0] + np.linspace(0.0, 1.0, 2001)[:, np.newaxis] * (legs[place][-1] - legs[place][0])
        within = (points > [BOX[0], BOX[2]]).all(axis=1) & (points < [BOX[1], BOX[3]]).all(axis=1)
        found[place] = not within[1:].any()
    return found


def apart(one: Any, other: Any) -> Any:
    """Least distance of two that go straight and evenly, decision by decision."""
    shares = np.linspace(0.0, 1.0, 401)[:, np.newaxis]
    paths = [legs[..., :1, :] + shares * (legs[..., -1:, :] - legs[..., :1, :]) for legs in (one, other)]
    return np.sqrt(((paths[0] - paths[1]) ** 2).sum(axis=-1)).min(axis=-1)


def void(given: Situation, legs: Any, stride: int) -> Any:
    """Probability that nobody is near, the least of a decision's times."""
    means, covs = track_moments(given.fused.tracks)
    motion, noise = np.eye(4), np.zeros((4, 4))
    motion[:2, 2:] = 4.0 * np.eye(2)
    gain = np.vstack([8.0 * np.eye(2), 4.0 * np.eye(2)])
    noise = 4.0 * gain @ gain.T
    existence = 1.0 / (1.0 + np.exp(-given.fused.existence_logit))
    found = np.ones(legs.shape[:2])
    for step in range(1, stride * (legs.shape[1] - 1) + 3):
        means, covs = means @ motion.T, motion @ covs @ motion.T + noise
        belief = LMB.from_bernoullis(given.fused.tracks.labels, existence, means, covs)
        for d in range(legs.shape[1]):
            if step - stride * d in (1, 2):
                own = void_probability(belief, legs[:, d, step - stride * d], VOID[0])
                found[:, d] = np.minimum(found[:, d], own)
    return found


def oracle(given: Situation, names: Any, depth: int, stride: int) -> Any:
    """Whether each joint sequence is allowed at each decision: axes are the sensors' sequences, and the decisions."""
    num = len(given.sensors)
    legs = [ways(s, depth, stride) for s in range(num)]
    late = 4.0 * stride * np.arange(depth)[:, np.newaxis] + np.array([4.0, 8.0]) > LATE
    allowed = np.ones([3**depth] * num + [depth], bool)

    def along(table: Any, *axes: int) -> Any:
        shape = [3**depth if s in axes else 1 for s in range(num)]
        return table.reshape([*shape, depth])

    for s in range(num):
        single = np.ones((3**depth, depth), bool)
        if "keep out" in names:
            single &= outside_box(legs[s])
        if "stay inside" in names:
            low, high = np.array(INSIDE).reshape(2, 2).T
            single &= ((legs[s][:, :, 1:] >= low) & (legs[s][:, :, 1:] <= high)).all(axis=(2, 3))
        if "void" in names:
            single &= void(given, legs[s], stride) >= VOID[1]
        if "own" in names and s == 1:
            single &= ~((legs[s][:, :, 1:, 1] < POSES[1, 1]) & late).any(axis=2)
        allowed &= along(single, s)
        for other in range(s):
            if "separation" in names:
                near = apart(legs[other][:, np.newaxis], legs[s]) >= 500.0
                allowed &= along(near, other, s)
            if "own" in names:
                west = [((legs[k][:, :, 1:, 0] < -440.0) & late).any(axis=2) for k in (other, s)]
                allowed &= along(~(west[0][:, np.newaxis] & west[1]), other, s)
    return allowed


def values(given: Situation, depth: int, period: float, num_steps: int, reward: Any = None) -> Any:
    """Mean rewards of all joint sequences, as joint actions of another platform."""
    reward = ExpectedLossReward() if reward is None else reward
    return of_sequences(given, reward, depth, period, num_steps).tables[0].mean


def places(plan: Plan) -> tuple[int, ...]:
    """Which of the sequences in `oracle` each sensor's is."""
    found = [[HEADINGS.index(float(row[0])) for row in rows] for rows in plan.sequence]
    return tuple(int(np.ravel_multi_index(own, (3,) * len(own))) for own in found)


@pytest.mark.parametrize("names", [*([name] for name in CONSTRAINTS), ["keep out", "separation", "own"]], ids=", ".join)
@pytest.mark.parametrize("num_sensors", [2, 3])
def test_one_decision_is_that_of_the_joint_planner(num_sensors: int, names: Any) -> None:
    given, constraints = lmbs(num_sensors), tuple(CONSTRAINTS[name] for name in names)
    for reward in (ExpectedLossReward(), KullbackLeiblerReward()):
        joint = decided(given, JointPlanner, reward, constraints=constraints)
        ahead = decide(given, constraints, reward, depth=1)
        assert_same_plan(ahead, joint)
        assert ahead.notes == joint.notes


@pytest.mark.parametrize("names", [*([name] for name in CONSTRAINTS), ["keep out", "separation", "own"]], ids=", ".join)
@pytest.mark.parametrize(
    ("num_sensors", "depth", "period", "num_steps"), [(2, 2, 8.0, 4), (2, 3, 8.0, 6), (2, 3, 4.0, 4), (3, 2, 8.0, 4)]
)
def test_of_all_sequences_the_best_that_is_allowed(
    names: Any, num_sensors: int, depth: int, period: float, num_steps: int
) -> None:
    given = lmbs(num_sensors)
    allowed = oracle(given, names, depth, int(period / 4.0)).all(axis=-1)
    assert allowed.any()
    assert not allowed.all()
    mean = np.where(allowed, values(given, depth, period, num_steps), -np.inf)
    plan = decide(given, (CONSTRAINTS[name] for name in names), depth=depth, period=period)
    assert told(plan) == ()
    assert mean[places(plan)] == pytest.approx(mean.max(), rel=1e-12)
    split = [part for _ in range(num_sensors) for part in (3, 3 ** (depth - 1))]
    best = mean.reshape(split).max(axis=tuple(range(1, 2 * num_sensors, 2)))
    np.testing.assert_allclose(plan.tables[0].mean, np.where(np.isfinite(best), best, np.nan), rtol=1e-12)
    assert plan.curve is not None
    assert plan.curve.evaluations[-1] == allowed.sum()
    assert plan.bound is not None
    assert plan.bound.kind == "exhaustive"


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@pytest.mark.parametrize("names", [["keep out"], ["separation"], ["keep out", "separation", "own"]], ids=", ".join)
@pytest.mark.parametrize("num_sensors", [2, 3])
@pytest.mark.parametrize("budget", [1, 7, 60, 500])
def test_searches_evaluate_nothing_that_is_forbidden(search: Any, names: Any, num_sensors: int, budget: int) -> None:
    given, depth = lmbs(num_sensors), 3
    allowed = oracle(given, names, depth, 2).all(axis=-1)
    seen: list[Any] = []

    class Watched:
        def search(self, problem: Any, *, rng: np.random.Generator) -> None:
            search.search(problem, rng=rng)
            seen.extend(joint for joint in problem._values if None not in joint)

    plan = decide(given, (CONSTRAINTS[name] for name in names), depth=depth, search=Watched(), budget=budget)
    assert seen or plan.bound is not None  # where all fit in the budget no search is asked
    for joint in seen:
        assert allowed[tuple(int(np.ravel_multi_index(own, (3,) * depth)) for own in joint)]
    assert plan.curve is not None
    assert plan.curve.evaluations[-1] <= budget
    if num_sensors == 2:
        mean = np.where(allowed, values(given, depth, 8.0, 6), -np.inf)
        assert plan.expected_rewards[0][0] == pytest.approx(float(mean[places(plan)]), rel=1e-12)
        if budget == 500:
            worst = float(mean[allowed].min())
            assert plan.expected_rewards[0][0] >= mean.max() - 0.02 * (mean.max() - worst)


def scene(poses: Any, targets: Any, directions: Any, **steps: Any) -> Situation:
    """Sensors that see 50 m and take steps of 100 m."""
    detection = models.limited_range(0.95, 50.0)
    sensor = mobile_sensor("lmb", GridPlatform(100.0, 100.0, directions, **steps), detection=detection)
    num = len(targets)
    means, cov = [[x, y, 0.0, 0.0] for x, y in targets], np.diag([25.0, 25.0, 1.0, 1.0])
    belief = LMB.from_bernoullis([(0, i) for i in range(num)], [0.9] * num, means, [cov] * num)
    settings, weights = replace(KNOWN, horizon_steps=1, horizon_period=1.0), (1.0 / len(poses),) * len(poses)
    at = np.array([[x, y, 0.0] for x, y in poses])
    return Situation((sensor,) * len(poses), Clmb(weights), settings, (belief,) * len(poses), belief, at)


def single(given: Situation, constraints: Any) -> Plan:
    return decided(given, JointPlanner, ExpectedLossReward(), constraints=constraints)


POCKET = (
    KeepOut(np.array([[150.0, -50.0], [160.0, -50.0], [160.0, 150.0], [150.0, 150.0]])),
    KeepOut(np.array([[70.0, 50.0], [155.0, 50.0], [155.0, 60.0], [70.0, 60.0]])),
)


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@pytest.mark.parametrize("budget", [2, 5, 100])
def test_a_dead_end_is_not_entered(search: Any, budget: int) -> None:
    """To the east is a target, and behind it no way on, neither to the east nor to the north."""
    given = scene([(0.0, 0.0)], [(100.0, 0.0)], (0.0, 90.0), allow_staying=False)
    assert single(given, POCKET).chosen_actions[0].tolist() == [100.0, 0.0]
    plan = decide(given, POCKET, depth=3, search=search, budget=budget, discount=0.9)
    assert plan.chosen_actions[0].tolist() == [0.0, 100.0]
    assert told(plan) == ()
    # Whoever is in it already may go on, and reads so.
    inside = replace(given, poses=np.array([[100.0, 0.0, 0.0]]))
    plan = decide(inside, POCKET, depth=2, search=search, budget=budget)
    assert told(plan) == (
        "sensor 1: no course meets its constraints (keep_out, keep_out); it may take those that violate them least",
    )
    assert np.isfinite(plan.tables[0].mean).any()


def test_a_dead_end_that_cannot_be_avoided_is_told_of() -> None:
    given = scene([(0.0, 0.0)], [(100.0, 0.0)], (0.0,), allow_staying=False)
    plan = decide(given, POCKET, depth=3)
    assert told(plan) == (
        "sensor 1, decision 2 of the sequence: no course meets its constraints (keep_out, keep_out); "
        "it may take those that violate them least",
    )
    assert plan.sequence[0].tolist() == [[100.0, 0.0]] * 3


class NotBothAt:
    """Not two sensors are at a place, nor in some rectangle, at one time."""

    name = "not_both"
    needs_beliefs = False

    def __init__(self, x: float, y: float, size: float = 10.0) -> None:
        self.at, self.size = np.array([x, y]), size

    def courses(self, situation: Any) -> tuple[Any, ...]:
        return tuple(np.ones(len(own), bool) for own in situation.courses)

    def pairs(self, situation: Any, first: int, second: int) -> Any:
        near = [
            (np.abs(situation.courses[s][:, :, :2] - self.at) < self.size).all(axis=2).any(axis=1)
            for s in (first, second)
        ]
        return ~(near[0][:, np.newaxis] & near[1])


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@pytest.mark.parametrize("budget", [3, 12, 1000])
def test_sensors_that_would_lock_each_other_in_keep_apart(search: Any, budget: int) -> None:
    """From where the targets are both could only go on to one place."""
    given = scene([(0.0, 90.0), (0.0, -90.0)], [(100.0, 90.0), (100.0, -90.0)], (0.0, 180.0), allow_staying=False)
    constraints = (NotBothAt(250.0, 0.0, 100.0), OneWay())
    assert [row.tolist() for row in single(given, constraints).chosen_actions] == [[100.0, 0.0], [100.0, 0.0]]
    ahead = decide(given, constraints, depth=2, search=search, budget=budget, discount=0.9)
    assert sorted(row[0] for row in ahead.chosen_actions) == [-100.0, 100.0]
    assert told(ahead) == ()


class OneWay:
    """Who is in the east does not go west."""

    name = "one_way"
    needs_beliefs = False

    def courses(self, situation: Any) -> tuple[Any, ...]:
        return tuple(
            ~((own[:, -1, 0] < pose[0]) & (pose[0] > 50.0))
            for own, pose in zip(situation.courses, situation.poses, strict=True)
        )

    def pairs(self, situation: Any, first: int, second: int) -> Any:
        return None


def test_pairs_that_cannot_go_on_are_told_of() -> None:
    """Both can only go east, and at the second step both are in the same rectangle."""
    given = scene([(0.0, 90.0), (0.0, -90.0)], [(100.0, 90.0)], (0.0,), allow_staying=False)
    plan = decide(given, (NotBothAt(250.0, 0.0, 100.0),), depth=3)
    assert told(plan) == (
        "no joint sequence was found on which the sensors go together after decision 1; from there on that is given up",
    )


def test_two_that_must_not_both_avoid_a_dead_end() -> None:
    """East of both is a dead end, to the north not both may go: the pairs of the first decision come first."""
    given = scene([(0.0, 0.0), (0.0, 0.0)], [(100.0, 0.0)], (0.0, 90.0), allow_staying=False)
    plan = decide(given, (*POCKET, NotBothAt(0.0, 100.0)), depth=2)
    assert [row.tolist() for row in plan.chosen_actions] != [[0.0, 100.0]] * 2
    mean = plan.tables[0].mean
    assert np.isnan(mean[1, 1])
    assert np.isfinite(mean).sum() == 3
    assert any("decision 2 of the sequence" in note for note in plan.notes)


def test_bounds_on_tries_leave_a_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(courses_module, "_MOST_PLACES", 1)
    for search, tries in itertools.product(SEARCHES, (1, 3)):
        monkeypatch.setattr(rules_module, "_MOST_TRIES", tries)
        plan = decide(lmbs(3), [CONSTRAINTS["separation"]], depth=3, search=search, budget=20)
        assert plan.curve is not None
        assert plan.curve.evaluations[-1] <= 20


def test_between_decisions_far_apart_the_way_counts() -> None:
    """A decision every 12 s with a horizon of 8: a box on the way of the last 4 is seen."""
    given = lmbs(1)
    stages = Stages(2, 3, 2, 4.0)
    assert stages.times(1).tolist() == [4.0, 8.0, 12.0]
    at = POSES[0, :2] + 300.0 * np.array([1.0, 0.0])
    box = KeepOut(models.Region(at[0] - 5.0, at[0] + 5.0, at[1] - 5.0, at[1] + 5.0))
    assert np.isfinite(decide(given, [box], depth=1).tables[0].mean).all()
    mean = decide(given, [box], depth=2, period=12.0).tables[0].mean
    assert np.isnan(mean).tolist() == [heading == 0.0 for heading in HEADINGS]
