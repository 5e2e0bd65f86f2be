"""A small policy, trained here, as an entrant: a network of 57 weights says what a course is good for.

    vedette benchmark --planner small-policy=benchmarks/entrants/small_policy.py:SmallPolicy
    python benchmarks/entrants/small_policy.py    # trains it anew on eight-mobile, by the cross-entropy method: minutes

Sensors choose one after the other. Of each target it is told how uncertain its place is, how far from it the course
ends, how far the sensor is now, whether it will be in range, and how many sensors before it have it in range.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vedette.control import Plan
from vedette.densities import marginal_estimate
from vedette.platforms import Actions

HIDDEN, TOLD = 8, 6
# fmt: off
WEIGHTS: list[float] = [
    -0.65, -0.44, -1.11, -0.61, -0.49, -1.42, 0.5, -1.36, -0.87, -0.89, 1.24, 0.48, -2.2, 2.79, -2.32, -0.13,
    -1.65, 0.8, -0.95, -0.34, 1.15, -0.08, 0.13, 0.49, -2.03, -0.43, -3.07, -0.39, 2.32, -0.76, 0.35, -2.3,
    1.31, 1.43, 0.89, -2.09, 2.93, 2.21, 1.1, 0.9, -1.1, -1.13, -0.27, -0.36, -1.24, -0.58, 1.13, 1.54,
    1.04, 1.03, 1.91, -1.83, 1.52, -2.62, 3.07, 1.62, 0.58,
]
# fmt: on


class SmallPolicy:
    """A planner."""

    name = "small-policy"

    def __init__(self, sensors: Any, settings: Any, weights: Any = None) -> None:
        self.sensors, self.times = sensors, settings.horizon_times()[-1:]
        given = np.array(WEIGHTS if weights is None else weights, float)
        self.first = given[: TOLD * HIDDEN].reshape(TOLD, HIDDEN)
        self.last = given[TOLD * HIDDEN : (TOLD + 1) * HIDDEN]
        self.stay = float(given[-1])

    def plan(self, state: Any, poses: Any, *, rng: Any) -> Plan:
        found = marginal_estimate(state.fused, 0.3)
        places, stds = found.means[:, :2], np.sqrt(np.trace(found.covs[:, :2, :2], axis1=1, axis2=2))
        taken, actions, chosen = np.zeros(len(places)), [], []
        for sensor, pose in zip(self.sensors, poses, strict=True):
            own = sensor.platform.actions(pose)
            ends = np.array([sensor.platform.course(pose, action, self.times)[-1] for action in own])
            seen = np.array([sensor.filter.sensor.detection.prob(found.means, end) for end in ends])
            best = int(self._scores(pose, ends, seen.reshape(len(ends), -1), places, stds, taken).argmax())
            taken += seen.reshape(len(ends), -1)[best]
            actions.append(Actions(sensor.platform.columns, own))
            chosen.append(best)
        return Plan(self.name, tuple(actions), tuple(chosen), (), {})

    def _scores(self, pose: Any, ends: Any, seen: Any, places: Any, stds: Any, taken: Any) -> Any:
        """(num_courses,) sums over the targets, and what it is worth to move."""
        gaps = np.hypot(*(ends[:, None, :2] - places).transpose(2, 0, 1)) / 100.0
        now = np.hypot(*(pose[:2] - places).T) / 100.0
        told = np.stack(
            np.broadcast_arrays(stds / 10.0, gaps, now, seen, taken, np.exp(-gaps) / (1.0 + taken)), axis=-1
        )
        moved = np.hypot(*(ends[:, :2] - pose[:2]).T) > 0.0
        return np.tanh(told @ self.first).dot(self.last).sum(axis=1) + self.stay * moved


def train(generations: int = 10, size: int = 24, elite: int = 6, scans: int = 40, runs: int = 2) -> None:
    """The cross-entropy method: draw weights, keep the best, draw around them; prints what it ends with."""
    from dataclasses import replace

    from vedette.evaluation import ospa_of_run
    from vedette.scenarios import load_scenario
    from vedette.scenarios.build import build_experiment, build_planner
    from vedette.scenarios.overrides import with_fields
    from vedette.simulation import simulate

    scene = load_scenario("eight-mobile")
    scene = with_fields(scene, {"time.num_steps": scans, "control.decision_steps": list(range(1, scans))})
    steered = build_planner(scene, "random")
    experiment = replace(build_experiment(scene), explain=False)
    rng, num = np.random.default_rng(0), (TOLD + 1) * HIDDEN + 1
    mean, std = np.zeros(num), np.ones(num)

    def cost(weights: Any, run: int) -> float:
        policy = SmallPolicy(steered.sensors, steered.settings, weights)
        record = simulate(
            experiment,
            policy,
            seed=1000,
            run=run,
            score=lambda truth, found: ospa_of_run(truth, found, cutoff=100.0, order=1.0),
        )
        return float(record.ospa[:, 0].mean())

    for generation in range(generations):
        drawn = mean + std * rng.standard_normal((size, num))
        costs = [np.mean([cost(each, runs * generation + run) for run in range(runs)]) for each in drawn]
        best = drawn[np.argsort(costs)[:elite]]
        mean, std = best.mean(axis=0), best.std(axis=0) + 0.3 * math.exp(-0.5 * generation)
        print(generation, round(min(costs), 2), round(float(np.mean(costs)), 2), flush=True)
    print([round(value, 2) for value in mean.tolist()])


if __name__ == "__main__":
    train()
