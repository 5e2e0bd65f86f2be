"""Small situations to plan in: a few targets, two or three sensors, beliefs that differ between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from vedette import models
from vedette.control import (
    CauchySchwarzReward,
    Evaluator,
    IndependentPlanner,
    JointPlanner,
    MobileSensor,
    Plan,
    PlanningSettings,
    planning_limits,
)
from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.inputs import options_of
from vedette.control.pseudo_posterior_rewards import PseudoPosteriorRewards
from vedette.control.search.problem import all_joint_actions
from vedette.densities import GLMB, LMB, TrackTable
from vedette.filters import DeltaGlmbFilter, LmbFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.platforms import HeadingPlatform
from vedette.tracking import State

Label = tuple[int, int]
LabelSet = tuple[Label, ...]

A, B, C = (0, 0), (0, 1), (3, 0)
STATES: dict[Label, list[float]] = {
    A: [-60.0, 250.0, 8.0, -3.0],
    B: [180.0, -120.0, -4.0, 9.0],
    C: [-220.0, -300.0, 0.0, 5.0],
}
POSES = np.array([[-500.0, 300.0, 0.2], [-450.0, -350.0, -0.4], [400.0, 350.0, 2.0]])
STD = np.array([25.0, 25.0, 4.0, 4.0, 0.03])  # of the states above, and of a turn rate
HEADINGS = (-90.0, 0.0, 45.0)
EXACT_LIMITS = replace(planning_limits(), max_hypotheses=1_000_000, min_relative_weight=0.0)
SETTINGS = PlanningSettings(
    horizon_steps=2,
    horizon_period=4.0,
    num_samples=3,
    association="full",
    max_prior_hypotheses=50,
    limits=EXACT_LIMITS,
    num_threads=1,
)
KNOWN = replace(SETTINGS, association="known")


def sensor_model(**parts: Any) -> models.SensorModel:
    """Bearing and range, noise and detection that depend on the distance; any part may be another."""
    standard: dict[str, Any] = {
        "measurement": models.bearing_range(),
        "noise": models.range_dependent_noise(5.0, 5e-5, 0.02, 2e-5),
        "detection": models.gaussian_detection(500.0),
        "clutter": models.region_clutter(5.0, models.Region(-1000.0, 1000.0, -1000.0, 1000.0), "bearing_range"),
    }
    return models.SensorModel(**(standard | parts))


@cache
def target_model(dim: int) -> models.TargetModel:
    """Of 4 state components, or 5 with a turn rate; the same one for all sensors."""
    motion = models.constant_velocity(2.0) if dim == 4 else models.coordinated_turn(2.0, 0.02)
    birth = models.BirthModel(np.full(1, 0.05), np.zeros((1, dim)), 2.0 * np.diag(STD[:dim] ** 2)[np.newaxis])
    return models.TargetModel(motion, models.constant_survival(0.9), birth)


def mobile_sensor(kind: str, platform: Any = None, dim: int = 4, **parts: Any) -> MobileSensor:
    """A sensor with a filter of a `kind`: lmb, or else delta-GLMB. dim: 4, or 5 with a turn rate."""
    build = LmbFilter if kind == "lmb" else DeltaGlmbFilter
    local = build(target_model(dim), sensor_model(**parts))
    return MobileSensor(local, HeadingPlatform(30.0, HEADINGS) if platform is None else platform)


def mixture(label: Label, num_components: int, dim: int, rng: np.random.Generator) -> tuple[Any, Any, Any]:
    """A Gaussian mixture near the label's place: weights, means, covariances."""
    means = np.array([*STATES[label], 0.1])[:dim] + rng.normal(size=(num_components, dim)) * STD[:dim]
    factors = np.diag(STD[:dim]) @ (np.eye(dim) + 0.2 * rng.normal(size=(num_components, dim, dim)))
    return rng.dirichlet(np.full(num_components, 3.0)), means, factors @ factors.transpose(0, 2, 1)


def glmb(sets: Sequence[LabelSet], rng: np.random.Generator, num_components: int = 1, dim: int = 4) -> GLMB:
    """One hypothesis a given label set, which may be given more than once; each has tracks of its own."""
    labels = [label for labels in sets for label in labels]
    if not labels:
        return GLMB.empty(dim)
    tracks = TrackTable.from_mixtures(labels, [mixture(label, num_components, dim, rng) for label in labels])
    ends = np.cumsum([len(labels) for labels in sets]).tolist()
    hyps = [list(range(end - len(labels), end)) for end, labels in zip(ends, sets, strict=True)]
    return GLMB.from_hypotheses(tracks, hyps, rng.dirichlet(np.ones(len(sets))))


def lmb(labels: Sequence[Label], rng: np.random.Generator, num_components: int = 1, dim: int = 4) -> LMB:
    """One track a label, of existence between 0.3 and 0.99."""
    if not labels:
        return LMB.empty(dim)
    tracks = TrackTable.from_mixtures(labels, [mixture(label, num_components, dim, rng) for label in labels])
    existence = rng.uniform(0.3, 0.99, len(labels))
    return LMB(tracks, np.log(existence) - np.log1p(-existence))


@dataclass(frozen=True)
class Situation:
    """What a planner is given."""

    sensors: tuple[MobileSensor, ...]
    fusion: Any
    settings: PlanningSettings
    beliefs: tuple[Any, ...]
    fused: Any
    poses: Any
    undetected: Any = None

    @property
    def state(self) -> State:
        """After the first scan."""
        return State(self.beliefs, self.fused, 1, 1.0, undetected=self.undetected)

    @property
    def arguments(self) -> tuple[State, Any]:
        """Of `Planner.plan`."""
        return self.state, self.poses


# Sensor by sensor: sets and labels that all have, that one lacks, and a label that only one knows.
_SETS = (
    ((A, B), (A,), (A, B), (B,), ()),
    ((A, B), (A,), (A, B, C), (A, B)),
    ((B,), (A, B), (), (A, B)),
)
_LABELS = ((A, B), (A, C), (A, B))


def situation(
    kind: str, num_sensors: int = 2, seed: int = 0, settings: PlanningSettings = SETTINGS, dim: int = 4, **sensor: Any
) -> Situation:
    """Beliefs of a `kind`: delta (sets repeat), marginal (sets do not, tracks are mixtures), lmb."""
    rng = np.random.default_rng(seed)
    sensors = tuple(mobile_sensor(kind, dim=dim, **sensor) for _ in range(num_sensors))
    weights = np.arange(2.0, 2.0 + num_sensors)
    weights /= weights.sum()
    beliefs: tuple[Any, ...]
    fusion: Any = Clmb(weights) if kind == "lmb" else CmDeltaGlmb(weights)
    if kind == "lmb":
        beliefs = tuple(lmb(labels, rng, 2, dim) for labels in _LABELS[:num_sensors])
    elif kind == "delta":
        beliefs = tuple(glmb(sets, rng, 1, dim) for sets in _SETS[:num_sensors])
    else:
        beliefs = tuple(glmb(sorted(set(sets)), rng, 2, dim) for sets in _SETS[:num_sensors])
    return Situation(sensors, fusion, settings, beliefs, fusion.fuse(beliefs)[0], POSES[:num_sensors])


# Of two steps of 4 s each, from 1 s on.
FIRST: Any = [3.0, 11.0]
SECOND: Any = [1.0, 9.0]
NEVER: Any = [0.5, 1.0, 9.5]


def scanning(example: Situation, *times: Any) -> Situation:
    """The sensors with these scan times."""
    sensors = tuple(replace(own, scan_times=when) for own, when in zip(example.sensors, times, strict=True))
    return replace(example, sensors=sensors)


def crowded(num_targets: int) -> Situation:
    """Targets so near each other that each may have given any of the measurements."""
    rng = np.random.default_rng(4)
    labels, spread = np.array([(0, i) for i in range(num_targets)]), np.array([6.0, 6.0, 1.0, 1.0])
    covs = np.tile(np.diag(np.square([20.0, 20.0, 3.0, 3.0])), (num_targets, 1, 1))
    beliefs = tuple(
        LMB.from_bernoullis(
            labels, rng.uniform(0.6, 0.999, num_targets), STATES[A] + spread * rng.normal(size=(num_targets, 4)), covs
        )
        for _ in range(2)
    )
    fusion = Clmb((0.5, 0.5))
    sensors = tuple(mobile_sensor("lmb", platform=HeadingPlatform(30.0, (-90.0, 30.0))) for _ in range(2))
    settings = replace(SETTINGS, limits=planning_limits(), num_samples=4)
    return Situation(sensors, fusion, settings, beliefs, fusion.fuse(beliefs)[0], POSES[:2])


# As in the paper: sensors presume that there are no others.
ABSENT: Any = partial(IndependentPlanner, others="absent")


def decided(
    example: Situation,
    kind: Any = JointPlanner,
    reward: Any = None,
    *,
    seed: int = 1,
    undetected: Any = None,
    **parts: Any,
) -> Plan:
    """A valid plan, by a planner of this kind; by default joint, by K that weighs number and places alike."""
    reward = CauchySchwarzReward("reference") if reward is None else reward
    planner = kind(example.sensors, example.fusion, example.settings, reward, **parts)
    state = replace(example.state, undetected=undetected)
    plan: Plan = planner.plan(state, example.poses, rng=np.random.default_rng(seed))
    plan.validate()
    return plan


def assert_same_plan(one: Plan, other: Plan) -> None:
    """To the last bit."""
    assert (one.chosen, one.bound, one.certainty, one.counts) == (
        other.chosen,
        other.bound,
        other.certainty,
        other.counts,
    )
    for mine, its in zip(one.tables, other.tables, strict=True):
        np.testing.assert_array_equal(mine.mean, its.mean)
        np.testing.assert_array_equal(mine.standard_error, its.standard_error)


def evaluator_of(situation: Situation, reward: Any = None, seed: int = 5) -> Evaluator:
    """The evaluator of a situation, by default with K = 1."""
    return Evaluator.of_cases(
        situation.sensors,
        options_of(situation.sensors, situation.poses, situation.settings),
        situation.fusion,
        situation.settings,
        CauchySchwarzReward() if reward is None else reward,
        situation.state,
        rng=np.random.default_rng(seed),
    )


def sample_rewards(evaluator: Evaluator, which: Sequence[int], fusion: Any) -> Any:
    """(num_joint, num_samples) rewards of all joint actions of the sensors `which`, the last one's fastest."""
    shape = evaluator.joint_shape()
    return cases_of(evaluator).rewards(which, fusion)(all_joint_actions(tuple(shape[s] for s in which)))


def cases_of(evaluator: Evaluator) -> PseudoPosteriorRewards:
    """What an evaluator makes rewards of, case by case."""
    assert isinstance(evaluator.source, PseudoPosteriorRewards)
    return evaluator.source


def sums_of(evaluator: Evaluator) -> AdditiveRewards:
    """What an evaluator makes rewards of, by sums over labels."""
    assert evaluator.additive is not None
    return evaluator.additive


def additive_of(situation: Situation, reward: Any = None, seed: int = 5, horizons: Any = ()) -> Evaluator:
    """The evaluator by sums over labels, of LMB beliefs; by default with K = 1.

    horizons: settings of those after the first; None: those of a `JointPlanner`.
    """
    rule, state = situation.fusion.log_linear_pool(len(situation.sensors)), situation.state
    if getattr(situation.fusion, "requires_common_prior", False):
        state = replace(state, local=(situation.fused,) * len(situation.sensors))
    return Evaluator.of_sums(
        situation.sensors,
        options_of(situation.sensors, situation.poses, situation.settings),
        rule,
        situation.settings,
        CauchySchwarzReward() if reward is None else reward,
        state,
        horizons=horizons,
        rng=np.random.default_rng(seed),
    )


def told(plan: Plan) -> tuple[str, ...]:
    """The notes of a plan but those on how far it looks ahead."""
    return tuple(note for note in plan.notes if not note.startswith("depth "))
