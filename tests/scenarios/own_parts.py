"""Parts of every kind that a user keeps beside a scenario file."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.control import Plan
from vedette.densities import Estimate, marginal_estimate
from vedette.filters import Limits, LmbFilter
from vedette.fusion import Clmb
from vedette.platforms import Actions
from vedette.simulation.records import RunRecord


class Hopper:
    """Hops by a step in two directions, or stays."""

    columns = ("dx", "dy")

    def __init__(self, step: float = 5.0) -> None:
        self.step = step

    def actions(self, pose: Any) -> Any:
        return [[0.0, 0.0], [self.step, 0.0], [0.0, self.step]]

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        poses = np.tile(pose[:3], (len(times), 1))
        poses[:, :2] += action
        return poses


class Ferry:
    """Goes 5 m to the east for a fare, or stays."""

    columns = ("dx", "fare")

    def actions(self, pose: Any) -> Any:
        return [[0.0, 0.0], [5.0, 1e6]]

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        poses = np.tile(pose[:3], (len(times), 1))
        poses[:, 0] += action[0]
        return poses


class Filter:
    """An LMB filter under another name."""

    def __init__(self, targets: Any, sensor: Any, max_hypotheses: int = 20) -> None:
        self.targets, self.sensor = targets, sensor
        self.inner = LmbFilter(targets, sensor, Limits(max_hypotheses=max_hypotheses))

    def initial(self) -> Any:
        return self.inner.initial()

    def step(self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: Any) -> Any:
        return self.inner.step(belief, scan, pose, dt, step, rng=rng)


def fusion(num_sensors: int, first: float = 0.5) -> Clmb:
    """CLMB that trusts the first sensor as much as it is told to."""
    return Clmb((first, *((1.0 - first) / (num_sensors - 1),) * (num_sensors - 1)))


class Overlap:
    """A reward of power integrals."""

    def __init__(self, power: float) -> None:
        self.exponents = ((power, 1.0 - power),)

    def combine(self, z: Any) -> Any:
        return -z[..., 0]


def reward(predicted: Any, updated: Any, scale: float = 1.0) -> float:
    """By how much the update is surer of the number of targets."""
    spread = [float(np.var(np.arange(len(p)) * p)) for p in map(cardinality, (predicted, updated))]
    return scale * (spread[0] - spread[1])


def cardinality(density: Any) -> Any:
    from vedette.densities import cardinality_distribution

    return cardinality_distribution(density)


class Powers:
    """A reward of power integrals alone: no function of two densities."""

    def __init__(self, order: float = 0.5) -> None:
        self.order = order

    @property
    def exponents(self) -> Any:
        return (self.order, 1.0 - self.order), (0.0, 1.0)

    def combine(self, z: Any) -> Any:
        return (1.0 - self.order) * z[..., 1] - z[..., 0]


class FirstOfAll:
    """Looks at one joint action."""

    def search(self, problem: Any, *, rng: Any) -> tuple[int, ...]:
        return (0,) * len(problem.shape)


class OddOnes:
    """No sensor but the first takes a course of even number."""

    name, needs_beliefs = "odd_ones", False

    def __init__(self, spared: int = 1) -> None:
        self.spared = spared

    def courses(self, situation: Any) -> Any:
        numbers = [np.arange(len(own)) for own in situation.courses]
        return tuple((own % 2 == 1) | (s < self.spared) for s, own in enumerate(numbers))

    def pairs(self, situation: Any, first: int, second: int) -> None:
        return None


class Last:
    """Every sensor takes the last of what it may do."""

    def __init__(self, sensors: Any, skip: int = 0) -> None:
        self.sensors, self.skip = sensors, skip

    def plan(self, *situation: Any, rng: Any) -> Plan:
        platforms = [sensor.platform for sensor in self.sensors]
        actions = tuple(
            Actions(platform.columns, np.array(platform.actions(pose)))
            for platform, pose in zip(platforms, situation[-1], strict=True)
        )
        return Plan("last", actions, tuple(len(own) - 1 - self.skip for own in actions), (), {})


class Breaks(Last):
    """Raises in the middle of a run."""

    def plan(self, *situation: Any, rng: Any) -> Plan:
        raise RuntimeError("no fuel")


def sure(density: Any, step: int, threshold: float = 0.5) -> Estimate:
    """Every label that is probable enough."""
    return marginal_estimate(density, threshold)


def count(record: RunRecord, factor: float = 1.0) -> Any:
    """How many targets are estimated."""
    return [factor * len(estimate.labels) for estimate in record.estimates]


class NoPlan:
    """Nothing that plans."""


def plans_otherwise(sensors: Any) -> Any:
    class Otherwise:
        def plan(self) -> None: ...

    return Otherwise()


def short_count(record: RunRecord) -> Any:
    """One number too few."""
    return count(record)[1:]
