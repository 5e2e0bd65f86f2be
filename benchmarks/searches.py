"""How good the searches of joint actions are at equal numbers of evaluations, on rewards that cost nothing.

    python benchmarks/searches.py [--scenes N] [--sensors N ...] [--kinds KIND ...]

Course a of sensor s sees target l with probability p[s, a, l]. Rewards, with targets of several values: that of the
targets seen by anyone ("spread": most courses see several targets a little; "sharp": few see one well, most none), and
one that needs two looks ("together": q^2 / (1 + q^2) of the sum q of the probabilities). "near": "spread" where sensors
stand in a row, and 15 % of the pairs of courses of neighbours are forbidden; "clash": 30 % of those of any two sensors.
"loss" and "views" are joint decisions by the expected loss: targets and sensors drawn in a square, all-seeing bearing
and range, or seen to 300 m.
Gap: to the best joint action, of all of them or, where there are too many, of those that any search found; "worst" that
of one scene, in per cent of what lies between the best and the worst joint action, of all or of those found. Simulated
annealing is here to be compared only: one sensor's course is changed at a time, at a temperature that falls from 2 % of
the reward to a hundredth of that.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator

import numpy as np

from vedette import models
from vedette.control import (
    AutomaticSearch,
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    ExpectedLossReward,
    JointProblem,
    JointSearch,
    Mask,
    MobileSensor,
    PlanningSettings,
    SequentialGreedy,
)
from vedette.control.evidence import Evidence
from vedette.control.preparation import Preparation
from vedette.control.problem import joint_problem
from vedette.control.search.problem import RewardCache, all_joint_actions
from vedette.densities import LMB
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.platforms import HeadingPlatform
from vedette.tracking import State

KINDS = ("spread", "sharp", "together", "near", "clash", "loss", "views")
FORBIDDEN = {"near": 0.15, "clash": 0.3}
SMALL = 100_000  # joint actions up to which all are evaluated
HOT, COLD = 2e-2, 2e-4
SPACING = 600.0  # m, the square root of a sensor's area


def scene(kind: str, num_sensors: int, num_courses: int, rng: np.random.Generator) -> JointProblem:
    """A random problem."""
    if kind in ("loss", "views"):
        return decision(kind, num_sensors, num_courses, rng)
    num_targets, shape = 2 * num_sensors, (num_courses,) * num_sensors
    seen = rng.beta(0.5, 2.0, (num_sensors, num_courses, num_targets))
    if kind == "sharp":
        seen = (rng.random(seen.shape) < 0.15) * rng.uniform(0.5, 0.99, seen.shape)
    value, sensors = rng.uniform(0.2, 1.0, num_targets), np.arange(num_sensors)

    def partial(actions: np.ndarray) -> np.ndarray:
        own = np.where(actions[:, :, np.newaxis] >= 0, seen[sensors, actions], 0.0)
        if kind == "together":
            return np.asarray((own.sum(axis=1) ** 2 / (1.0 + own.sum(axis=1) ** 2)) @ value)
        return np.asarray((1.0 - np.prod(1.0 - own, axis=1)) @ value)

    mask = None
    if kind in FORBIDDEN:
        pairs = [(i, j) for j in range(num_sensors) for i in range(j) if kind == "clash" or i == j - 1]
        together = {pair: rng.random(shape[:2]) >= FORBIDDEN[kind] for pair in pairs}
        mask = Mask((np.ones(num_courses, bool),) * num_sensors, together)
    best_alone, most = tuple((seen @ value).argmax(axis=1).tolist()), seen.max(axis=1)
    looks = most.sum(axis=0) ** 2
    upper = float((looks / (1.0 + looks) if kind == "together" else 1.0 - np.prod(1.0 - most, axis=0)) @ value)
    return JointProblem(shape, partial, lambda: best_alone, mask, partial=partial, bound=lambda: upper)


def decision(kind: str, num_sensors: int, num_courses: int, rng: np.random.Generator) -> JointProblem:
    """A joint decision about twice as many targets as sensors."""
    side = SPACING * math.sqrt(num_sensors)
    reach = models.gaussian_detection(10_000.0) if kind == "loss" else models.limited_range(0.95, 300.0)
    place = rng.uniform(0.0, side, (3 * num_sensors, 2))
    seen = models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(10.0, 5e-5, math.radians(1.0), 5e-6),
        reach,
        models.region_clutter(5.0, models.Region(0.0, side, 0.0, side), "bearing_range"),
    )
    born = models.BirthModel(np.full(1, 0.05), np.zeros((1, 4)), np.eye(4)[np.newaxis])
    targets = models.TargetModel(models.constant_velocity(5.0), models.constant_survival(0.98), born)
    means = np.concatenate([place[num_sensors:], rng.normal(0.0, 10.0, (2 * num_sensors, 2))], axis=1)
    covs = [np.diag([std, std, 5.0, 5.0]) ** 2 for std in rng.uniform(10.0, 40.0, len(means))]
    belief = LMB.from_bernoullis([(0, i) for i in range(len(means))], [0.95] * len(means), means, covs)
    platform = HeadingPlatform(50.0, tuple(360.0 * i / num_courses for i in range(num_courses)))
    sensors = (MobileSensor(LmbFilter(targets, seen), platform),) * num_sensors
    fusion, settings = ParallelUpdate(), PlanningSettings(num_threads=1)
    state = State((belief,) * num_sensors, belief, 1, 1.0)
    poses = np.concatenate([place[:num_sensors], np.zeros((num_sensors, 1))], axis=1)
    prepared = Preparation.of(sensors, fusion, settings, ExpectedLossReward(), state, poses)
    evaluator = prepared.evaluator(settings.num_samples, rng=rng)
    # Without the compiled ascent, whose evaluations nobody sees here; without lines, which are not counted either.
    evidence = Evidence(evaluator, tuple(range(num_sensors)), evaluator.joint())
    problem = joint_problem(evidence, None)
    assert problem.partial is not None
    return problem._replace(evaluate=problem.partial, line=None, ascend=None)


def annealed(problem: JointProblem, budget: int, rng: np.random.Generator) -> tuple[float, int]:
    """Reward that simulated annealing finds with so many evaluations, or until it finds nothing new."""
    known = RewardCache(problem)
    at = known.allowed(problem.independent())
    now = float(known.rewards([at])[0])
    scale = abs(now)
    for _ in range(20 * budget):
        if len(known.values) >= budget:
            break
        sensor = int(rng.integers(len(at)))
        free = known.actions(at, sensor)
        new = (*at[:sensor], free[int(rng.integers(len(free)))], *at[sensor + 1 :])
        reward = float(known.rewards([new])[0])
        temperature = scale * HOT * (COLD / HOT) ** (len(known.values) / budget)
        if reward >= now or rng.random() < math.exp((reward - now) / temperature):
            at, now = new, reward
    return max(known.values.values()), len(known.values)


def searched(search: JointSearch, problem: JointProblem, rng: np.random.Generator) -> tuple[float, int]:
    """Reward that a search finds, and how many joint actions it evaluated for that."""
    count = 0

    def counted(actions: np.ndarray) -> np.ndarray:
        nonlocal count
        count += len(actions)
        return problem.evaluate(actions)

    found = search.search(problem._replace(evaluate=counted, partial=counted), rng=rng)
    return float(problem.evaluate(np.array([found]))[0]), count


def compared(problem: JointProblem, rng: np.random.Generator) -> Iterator[tuple[str, float, int]]:
    """Every way with what it found and evaluated."""
    if math.prod(problem.shape) <= SMALL:
        yield "exhaustive", *searched(ExhaustiveSearch(), problem, rng)
    for order in ("sensor_order", "best_first"):
        yield f"greedy, {order}", *searched(SequentialGreedy(order), problem, rng)
    yield "ascent", *searched(CoordinateAscent(0), problem, rng)
    for restarts in (2, 8):
        reward, budget = searched(CoordinateAscent(restarts), problem, rng)
        yield f"ascent, {restarts} restarts", reward, budget
        yield f"  annealing like {restarts}", *annealed(problem, budget, rng)
        yield f"  cross-entropy like {restarts}", *searched(CrossEntropy(max(20, budget // 5)), problem, rng)
    yield "automatic", *searched(AutomaticSearch(), problem, rng)
    yield "cross-entropy", *searched(CrossEntropy(), problem, rng)


def least(problem: JointProblem, found: list[float]) -> float:
    """The worst reward of all allowed joint actions, or of those found where they are too many."""
    if math.prod(problem.shape) > SMALL:
        return min(found)
    actions = all_joint_actions(problem.shape)
    kept = actions if problem.mask is None else actions[problem.mask.allows(actions)]
    return float(problem.evaluate(kept).min()) if len(kept) else min(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--sensors", type=int, nargs="+", default=[3, 5, 8, 20])
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=KINDS)
    arguments = parser.parse_args()
    for kind in arguments.kinds:
        for num_sensors in arguments.sensors:
            num_courses, table = 9 if num_sensors <= 5 else 12, dict[str, list[tuple[float, float, int]]]()
            for number in range(arguments.scenes):
                rng = np.random.default_rng([number, num_sensors, KINDS.index(kind)])
                problem = scene(kind, num_sensors, num_courses, rng)
                found = list(compared(problem, rng))
                best = max(reward for _, reward, _ in found)
                span = best - least(problem, [reward for _, reward, _ in found])
                for name, reward, count in found:
                    missing = best - reward
                    table.setdefault(name, []).append((missing / abs(best), missing / span if span else 0.0, count))
            print(
                f"\n{kind}, {num_sensors} sensors of {num_courses} courses: best found, gap, worst, evaluations",
                flush=True,
            )
            for name, rows in table.items():
                gaps, shares, counts = np.array(rows).T
                error = gaps.std() / math.sqrt(len(gaps))
                best_found = 100.0 * np.mean(gaps < 1e-9)
                print(
                    f"  {name:24s} {best_found:4.0f} %   {100 * gaps.mean():7.3f} +- {100 * error:.3f} %   "
                    f"{100 * shares.max():5.1f} %   {counts.mean():7.0f}"
                )


if __name__ == "__main__":
    main()
