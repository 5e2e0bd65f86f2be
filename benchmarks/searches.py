"""How good the searches of joint actions are at equal numbers of evaluations, on rewards that cost nothing.

    python benchmarks/searches.py [--scenes N] [--sensors N ...] [--kinds KIND ...]

Course a of sensor s sees target l with probability p[s, a, l]. Rewards, with targets of several values: that of the
targets seen by anyone ("spread": most courses see several targets a little; "sharp": few see one well, most none), and
one that needs two looks ("together": q^2 / (1 + q^2) of the sum q of the probabilities). "near": "spread" where sensors
stand in a row, and 15 % of the pairs of courses of neighbours are forbidden; "clash": 30 % of those of any two sensors.
Gap: to the best joint action, of all of them or, where there are too many, of those that any search found. Simulated
annealing is here to be compared only: one sensor's course is changed at a time, at a temperature that falls from 2 % of
the reward to a hundredth of that.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator

import numpy as np

from vedette.control import (
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    JointProblem,
    JointSearch,
    Mask,
    SequentialGreedy,
)
from vedette.control.search.known import Known

KINDS = ("spread", "sharp", "together", "near", "clash")
FORBIDDEN = {"near": 0.15, "clash": 0.3}
SMALL = 100_000  # joint actions up to which all are evaluated
HOT, COLD = 2e-2, 2e-4


def scene(kind: str, num_sensors: int, num_courses: int, rng: np.random.Generator) -> JointProblem:
    """A random problem."""
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
    best_alone = tuple((seen @ value).argmax(axis=1).tolist())
    return JointProblem(shape, partial, lambda: best_alone, mask, partial=partial)


def annealed(problem: JointProblem, budget: int, rng: np.random.Generator) -> tuple[float, int]:
    """Reward that simulated annealing finds with so many evaluations, or until it finds nothing new."""
    known = Known(problem)
    at = known.allowed(problem.independent())
    now = scale = float(known.rewards([at])[0])
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
    for order in ("printed", "best_first"):
        yield f"greedy, {order}", *searched(SequentialGreedy(order), problem, rng)
    yield "ascent", *searched(CoordinateAscent(0), problem, rng)
    for restarts in (2, 8):
        reward, budget = searched(CoordinateAscent(restarts), problem, rng)
        yield f"ascent, {restarts} restarts", reward, budget
        yield f"  annealing like {restarts}", *annealed(problem, budget, rng)
        yield f"  cross-entropy like {restarts}", *searched(CrossEntropy(max(20, budget // 5)), problem, rng)
    yield "cross-entropy", *searched(CrossEntropy(), problem, rng)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--sensors", type=int, nargs="+", default=[3, 5, 8, 20])
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=KINDS)
    arguments = parser.parse_args()
    for kind in arguments.kinds:
        for num_sensors in arguments.sensors:
            num_courses, table = 9 if num_sensors <= 5 else 12, dict[str, list[tuple[float, int]]]()
            for number in range(arguments.scenes):
                rng = np.random.default_rng([number, num_sensors, KINDS.index(kind)])
                found = list(compared(scene(kind, num_sensors, num_courses, rng), rng))
                best = max(reward for _, reward, _ in found)
                for name, reward, count in found:
                    table.setdefault(name, []).append((1.0 - reward / best, count))
            print(f"\n{kind}, {num_sensors} sensors of {num_courses} courses: best found, gap, evaluations", flush=True)
            for name, rows in table.items():
                gaps = np.array([gap for gap, _ in rows])
                error = gaps.std() / math.sqrt(len(gaps))
                share = 100.0 * np.mean(gaps < 1e-9)
                count = np.mean([count for _, count in rows])
                print(f"  {name:24s} {share:4.0f} %   {100 * gaps.mean():7.3f} +- {100 * error:.3f} %   {count:7.0f}")


if __name__ == "__main__":
    main()
