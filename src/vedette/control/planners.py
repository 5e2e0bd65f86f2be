"""Planners: joint decision making, independent decision making, random and fixed courses (paper, Algorithms 2 and 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from vedette.control.actions import distinct_headings
from vedette.control.evaluator import Evaluator
from vedette.control.plan import Plan
from vedette.control.reward import CauchySchwarzReward, Reward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB
from vedette.errors import InputError
from vedette.fusion import Fusion
from vedette.kernels.types import Floats


class Planner(Protocol):
    """Chooses a heading for every sensor."""

    @property
    def name(self) -> str:
        """Name of the strategy, as in `Plan.planner`."""
        ...

    def plan(
        self, beliefs: Sequence[GLMB | LMB], fused: GLMB | LMB, poses: Floats, *, rng: np.random.Generator
    ) -> Plan:
        """Decide from the local posteriors, the fused one and the poses (num_sensors, 3)."""
        ...


def _check_inputs(sensors: Sequence[MobileSensor], beliefs: Sequence[Any], poses: Any) -> Floats:
    if len(beliefs) != len(sensors):
        raise InputError(f"beliefs: expected {len(sensors)}, one a sensor; got {len(beliefs)}")
    array = np.asarray(poses, dtype=np.float64)
    if array.shape != (len(sensors), 3) or not np.isfinite(array).all():
        raise InputError(f"poses: expected finite numbers of shape ({len(sensors)}, 3); got {poses!r}")
    return array


@dataclass(frozen=True, slots=True, eq=False)
class JointPlanner:
    """Joint decision making: the reward of every combination of actions, after fusion (paper, Algorithm 2).

    Attributes:
        sensors: the sensors, in the order of the beliefs and of the fusion weights.
        fusion: how their pseudo-updated densities become one.
        settings: horizon, samples, caps.
        reward: Cauchy-Schwarz divergence, or a reward of the user's own.
        max_joint_actions: bound on the size of the joint table.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion[Any, Any]
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: Reward = field(default_factory=CauchySchwarzReward)
    max_joint_actions: int = 1_000_000

    @property
    def name(self) -> str:
        return "jdm"

    def plan(
        self, beliefs: Sequence[GLMB | LMB], fused: GLMB | LMB, poses: Floats, *, rng: np.random.Generator
    ) -> Plan:
        """The joint action of largest mean reward; of equal ones the first in printed order.

        Args:
            beliefs: local posterior of each sensor, as its filter left it.
            fused: their fusion, from which samples and prediction are taken.
            poses: (num_sensors, 3) present poses.
            rng: draws the samples.

        Raises:
            InputError: inputs that do not fit, or more joint actions than `max_joint_actions`.
            ModelError, NumericalError: as the filters; a reward that is not finite.
        """
        at = _check_inputs(self.sensors, beliefs, poses)
        evaluator = Evaluator.prepare(
            self.sensors, self.fusion, self.settings, self.reward, beliefs, fused, at, rng=rng
        )
        shape = evaluator.joint_shape()
        if int(np.prod(shape)) > self.max_joint_actions:
            raise InputError(f"joint actions: expected at most {self.max_joint_actions}; got {' x '.join(map(str, shape))}")
        everyone = range(len(self.sensors))
        rewards = evaluator.sample_rewards(everyone, self.fusion)
        best = np.unravel_index(int(rewards.mean(axis=1).argmax()), shape)
        chosen = tuple(evaluator.first_heading(s, int(direction)) for s, direction in enumerate(best))
        return Plan(self.name, evaluator.headings, chosen, (evaluator.table(everyone, rewards),), dict(evaluator.counts))


@dataclass(frozen=True, slots=True, eq=False)
class IndependentPlanner:
    """Independent decision making: each sensor maximises the reward of its own update alone (paper, Algorithm 3).

    Attributes: as `JointPlanner`; the fusion is not used in the decision itself.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion[Any, Any]
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: Reward = field(default_factory=CauchySchwarzReward)

    @property
    def name(self) -> str:
        return "idm"

    def plan(
        self, beliefs: Sequence[GLMB | LMB], fused: GLMB | LMB, poses: Floats, *, rng: np.random.Generator
    ) -> Plan:
        """Each sensor's action of largest mean reward; arguments, ties and errors as `JointPlanner.plan`."""
        at = _check_inputs(self.sensors, beliefs, poses)
        evaluator = Evaluator.prepare(
            self.sensors, self.fusion, self.settings, self.reward, beliefs, fused, at, rng=rng
        )
        chosen, tables = [], []
        for s in range(len(self.sensors)):
            rewards = evaluator.sample_rewards((s,), None)
            chosen.append(evaluator.first_heading(s, int(rewards.mean(axis=1).argmax())))
            tables.append(evaluator.table((s,), rewards))
        return Plan(self.name, evaluator.headings, tuple(chosen), tuple(tables), dict(evaluator.counts))


@dataclass(frozen=True, slots=True, eq=False)
class RandomPlanner:
    """Every sensor takes one of its different directions at random, each as likely (the paper's baseline)."""

    sensors: tuple[MobileSensor, ...]

    @property
    def name(self) -> str:
        return "random"

    def plan(
        self, beliefs: Sequence[GLMB | LMB], fused: GLMB | LMB, poses: Floats, *, rng: np.random.Generator
    ) -> Plan:
        """Drawn from `rng`; the beliefs are not looked at."""
        at = _check_inputs(self.sensors, beliefs, poses)
        headings = tuple(sensor.actions.headings(pose) for sensor, pose in zip(self.sensors, at, strict=True))
        chosen = []
        for values in headings:
            distinct, which = distinct_headings(values)
            chosen.append(int(np.flatnonzero(which == rng.integers(len(distinct)))[0]))
        return Plan(self.name, headings, tuple(chosen), (), {})


@dataclass(frozen=True, slots=True, eq=False)
class FixedPlanner:
    """Every sensor keeps to a course set beforehand.

    Attributes:
        headings_deg: absolute heading of each sensor in degrees.
    """

    headings_deg: tuple[float, ...]

    @property
    def name(self) -> str:
        return "fixed"

    def plan(
        self, beliefs: Sequence[GLMB | LMB], fused: GLMB | LMB, poses: Floats, *, rng: np.random.Generator
    ) -> Plan:
        """The set courses, whatever is believed."""
        if len(poses) != len(self.headings_deg):
            raise InputError(f"headings_deg: expected {len(poses)}, one a sensor; got {len(self.headings_deg)}")
        headings = tuple(np.radians([float(heading)]) for heading in self.headings_deg)
        return Plan(self.name, headings, (0,) * len(headings), (), {})
