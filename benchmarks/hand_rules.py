"""Rules by which a person would lead the sensors of `benchmarks/far_targets.py`: a lawnmower, a patrol and an index.

Each rule gives every sensor a goal. The rule of thumb `assigned_target` leads the sensors there, by shortest paths and
within the constraints.

- `lawnmower`: each sensor sweeps its strip of the region, lane by lane. A camera turns on, one way; one that is blind
  while it turns, and one that turns at once, by a field of view at a time. Targets do not matter.
- `patrol`: each label has one sensor, so that ways are short and sensors have equal numbers of labels. A sensor goes to
  the one of its labels that it has not seen for longest. Without a label it sweeps.
- `index`: each sensor goes to the label with the largest index: the error that a detection removes, over the time until
  the label is in view. No two sensors take one label while others are left. Without a label sensors sweep.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from vedette.control import Plan
from vedette.densities import Estimate
from vedette.kernels.base.types import HALF_WIDTH, POINTING, Floats
from vedette.models.measurement import wrap_angles
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_planner

LEAST_EXISTENCE, IN_VIEW, NOISE = 0.1, 0.8, 5.0  # of labels; share of the range within which they are seen; m
SAME = 1e-6  # rad, between pointings that are taken for one


class Lawnmower:
    """A planner that sweeps the region."""

    name = "lawnmower"

    def __init__(self, scenario: Scenario) -> None:
        """Return the planner at the start of a run."""
        model = scenario.model
        self.planner: Any = build_planner(scenario, "assigned_target", 1)
        self.platforms = [own.platform for own in model.sensors]
        self.reaches = np.array([IN_VIEW * getattr(own.detection, "max_range", math.inf) for own in model.sensors])
        self.speeds = np.array([own.top_speed for own in self.platforms])
        self.rates = np.radians([getattr(own, "turn_rate_deg", None) or math.inf for own in self.platforms])
        self.state_dim = 5 if model.motion.kind == "coordinated_turn" else 4
        self.cutoff, region = model.ospa.cutoff, model.region
        width = (region.x_max - region.x_min) / len(model.sensors)
        starts = [region.x_min + s * width for s in range(len(model.sensors))]
        self.lanes = [
            lanes(x, x + width, region.y_min, region.y_max, min(reach, 0.5 * width))
            for x, reach in zip(starts, self.reaches.tolist(), strict=True)
        ]
        self.next: list[int | None] = [None] * len(starts)
        self.left = [0.0] * len(starts)  # s, until a sensor gives up its waypoint
        self.time, self.passed = 0.0, 0.0

    def plan(self, state: Any, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the plan that leads to the goals."""
        self.passed, self.time = state.time - self.time, state.time
        goals = self.goals(state, poses)
        num = len(goals)
        means = np.concatenate([goals, np.zeros((num, self.state_dim - 2))], axis=1)
        labels = np.column_stack([np.zeros(num, np.int64), np.arange(num)])
        found = Estimate(labels, means, np.tile(np.eye(self.state_dim), (num, 1, 1)), np.ones(num))
        plan: Plan = replace(self.planner, estimate=lambda *_: found).plan(state, poses, rng=rng)
        return plan

    def goals(self, state: Any, poses: Floats) -> Floats:
        """Return (num_sensors, 2) m, a goal of each sensor."""
        return np.array([self.sweep(s, pose) for s, pose in enumerate(poses)])

    def sweep(self, s: int, pose: Floats) -> Floats:
        """Return the goal of a sensor that sweeps."""
        if self.is_camera(pose):
            ahead = 2.0 * math.pi / 3.0
            if self.platforms[s].blind_while_turning or math.isinf(self.rates[s]):
                ahead = 2.0 * float(pose[HALF_WIDTH])
            return self.turned_to(s, pose, ahead)
        points = self.lanes[s]
        gaps = np.hypot(*(points - pose[:2]).T)
        self.left[s] -= self.passed
        now = self.next[s]
        new = int(gaps.argmin()) if now is None else now
        if now is not None and (gaps[now] < self.speeds[s] or self.left[s] < 0.0):
            new = (now + 1) % len(points)
        if new != now:
            self.next[s], self.left[s] = new, 2.0 * gaps[new] / max(self.speeds[s], 1e-9) + 5.0
        return np.asarray(points[new])

    def turned_to(self, s: int, pose: Floats, ahead: float) -> Floats:
        """Return a place towards which a camera turns; a blind one keeps it until it has arrived."""
        now, pointings = float(pose[POINTING]), np.radians(self.platforms[s].pointings_deg)
        there = abs(math.remainder(now - self.left[s], math.tau)) < SAME
        if there or self.next[s] is None or not self.platforms[s].blind_while_turning:
            nearest = int(np.abs(wrap_angles(pointings - now - ahead)).argmin())
            self.next[s], self.left[s] = nearest, float(pointings[nearest])
        return np.asarray(pose[:2] + 100.0 * np.array([math.cos(self.left[s]), math.sin(self.left[s])]))

    def is_camera(self, pose: Floats) -> bool:
        """Return True for a pose with a field of view."""
        return len(pose) > HALF_WIDTH and bool(pose[HALF_WIDTH] > 0.0)

    def seconds(self, s: int, pose: Floats, places: Floats) -> Floats:
        """Return (num,) s, until a sensor has places (num, 2) in view."""
        offsets = places - pose[:2]
        gaps = np.maximum(np.hypot(*offsets.T) - self.reaches[s], 0.0)
        found = gaps / self.speeds[s] if self.speeds[s] > 0.0 else np.where(gaps > 0.0, 1e6, 0.0)
        if self.is_camera(pose):
            turns = np.abs(wrap_angles(np.arctan2(offsets[:, 1], offsets[:, 0]) - pose[POINTING]))
            found = np.maximum(found, np.maximum(turns - IN_VIEW * pose[HALF_WIDTH], 0.0) / self.rates[s])
        return np.asarray(found)


class Patrol(Lawnmower):
    """A planner under which each sensor visits its own labels in turn."""

    name = "patrol"

    def __init__(self, scenario: Scenario) -> None:
        """Return the planner at the start of a run."""
        super().__init__(scenario)
        self.owner: dict[tuple[int, int], int] = {}
        self.seen: dict[tuple[int, int], float] = {}

    def goals(self, state: Any, poses: Floats) -> Floats:
        """Return (num_sensors, 2) m, a goal of each sensor."""
        targets = {target.label: target for target in state.fused.targets() if target.existence >= LEAST_EXISTENCE}
        self.owner = {label: s for label, s in self.owner.items() if label in targets}
        places = np.array([own.mean[:2] for own in targets.values()]).reshape(-1, 2)
        waits = np.array([self.seconds(s, pose, places) for s, pose in enumerate(poses)])
        self.share(list(targets), waits)
        goals = np.array([self.sweep(s, pose) for s, pose in enumerate(poses)])
        for k, label in enumerate(targets):
            if waits[self.owner[label], k] == 0.0:
                self.seen[label] = self.time
        for s in range(len(poses)):
            ages = [(self.seen.get(own, 0.0), waits[s, k], k) for k, own in enumerate(targets) if self.owner[own] == s]
            if ages:
                goals[s] = places[min(ages)[2]]
        return goals

    def share(self, labels: list[tuple[int, int]], waits: Floats) -> None:
        """Give labels without a sensor to the sensors with the fewest, so that ways are short."""
        while free := [k for k, label in enumerate(labels) if label not in self.owner]:
            counts = [list(self.owner.values()).count(s) for s in range(len(waits))]
            least = [s for s, count in enumerate(counts) if count == min(counts)]
            for row, column in zip(*linear_sum_assignment(waits[np.ix_(least, free)]), strict=True):
                self.owner[labels[free[column]]] = least[row]


class Index(Lawnmower):
    """A planner under which each sensor goes to the label with the largest index."""

    name = "index"

    def goals(self, state: Any, poses: Floats) -> Floats:
        """Return (num_sensors, 2) m, a goal of each sensor."""
        targets = [target for target in state.fused.targets() if target.existence >= LEAST_EXISTENCE]
        goals = np.array([self.sweep(s, pose) for s, pose in enumerate(poses)])
        if not targets:
            return goals
        places = np.array([own.mean[:2] for own in targets])
        waits = np.array([self.seconds(s, pose, places) for s, pose in enumerate(poses)])
        index = np.array([[self.value(own, wait) for own, wait in zip(targets, row, strict=True)] for row in waits])
        index /= 1.0 + waits
        goals[:] = places[index.argmax(axis=1)]
        for s, k in zip(*linear_sum_assignment(index, maximize=True), strict=True):
            goals[s] = places[k]
        return goals

    def value(self, target: Any, wait: float) -> float:
        """Return the error, m, that a detection removes after a time of waiting, s."""
        position = np.diag(target.cov)[:2] + 2.0 * wait * np.diag(target.cov[:2, 2:4])
        position = position + wait**2 * np.diag(target.cov)[2:4]
        after = math.sqrt(float(np.sum(position * NOISE**2 / (position + NOISE**2))))
        return float(target.existence) * (min(math.sqrt(float(position.sum())), self.cutoff) - min(after, self.cutoff))


RULES = {own.name: own for own in (Lawnmower, Patrol, Index)}


def lanes(x_min: float, x_max: float, y_min: float, y_max: float, reach: float) -> Floats:
    """Return the waypoints (num, 2) m of lanes from south to north and back, two ranges apart."""
    num = max(1, math.ceil((x_max - x_min) / (2.0 * reach)))
    middles = x_min + (np.arange(num) + 0.5) * (x_max - x_min) / num
    low, high = min(y_min + reach, 0.5 * (y_min + y_max)), max(y_max - reach, 0.5 * (y_min + y_max))
    ends = [[(x, low), (x, high)] if k % 2 == 0 else [(x, high), (x, low)] for k, x in enumerate(middles.tolist())]
    return np.array(ends).reshape(-1, 2)
