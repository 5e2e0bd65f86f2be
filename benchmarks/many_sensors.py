"""CPU time of one joint decision, on one thread, against sensors, targets, actions and samples.

    python benchmarks/many_sensors.py [--repeats 5]
    python benchmarks/many_sensors.py --figure many-sensors.png    # the cost in one figure

Targets and sensors are scattered at constant density: 500 m x 500 m a sensor, or a target where there are more. Sensors
see 400 m with a soft edge, measure bearing and range, and turn to one of several courses at 20 m/s; a plan is a
coordinate ascent from the independent decision and two restarts, with its bound. Medians of repeated decisions.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from timing import Figures, Measure, Once, cpu_seconds

from vedette import models
from vedette.control import (
    CauchySchwarzReward,
    CoordinateAscent,
    ExpectedLossReward,
    JointPlanner,
    MobileSensor,
    Plan,
    PlanningSettings,
)
from vedette.densities import LMB
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.platforms import HeadingPlatform
from vedette.tracking import State

REWARDS = {"expected loss": ExpectedLossReward(100.0), "Cauchy-Schwarz": CauchySchwarzReward("reference")}
BASE = {"sensors": 20, "targets": 20, "actions": 12, "samples": 40, "steps": 5}
SWEEPS = {
    "sensors": (1, 2, 5, 10, 20, 50, 100),
    "targets": (2, 5, 10, 20, 50, 100),
    "actions": (3, 6, 12, 24, 48),
    "samples": (5, 10, 20, 40, 80, 160),
}


def decision(sensors: int, targets: int, actions: int, samples: int, steps: int, reward: Any, reach: float) -> Any:
    """A planner, what is believed, and where the sensors are."""
    rng, half = np.random.default_rng(0), 250.0 * math.sqrt(max(sensors, targets))
    region = models.Region(-half - 500.0, half + 500.0, -half - 500.0, half + 500.0)
    model = models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(5.0, 5e-5, 0.02, 2e-5),
        models.soft_sector(0.95, reach, range_slope=0.05, hard_limit=True),
        models.region_clutter(5.0, region, "bearing_range"),
    )
    known = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.99), models.BirthModel.none(4))
    own = MobileSensor(
        LmbFilter(known, model), HeadingPlatform(20.0, np.linspace(-180.0, 180.0, actions, endpoint=False))
    )
    means = np.column_stack([rng.uniform(-half, half, (targets, 2)), rng.normal(0.0, 5.0, (targets, 2))])
    covs = np.tile(np.diag([20.0, 20.0, 3.0, 3.0]) ** 2, (targets, 1, 1))
    belief = LMB.from_bernoullis([(1, i) for i in range(targets)], rng.uniform(0.5, 0.999, targets), means, covs)
    settings = PlanningSettings(horizon_steps=steps, horizon_period=2.0, num_samples=samples, num_threads=1)
    planner = JointPlanner((own,) * sensors, ParallelUpdate(), settings, reward, CoordinateAscent(2))
    poses = np.column_stack([rng.uniform(-half, half, (sensors, 2)), rng.uniform(-math.pi, math.pi, sensors)])
    return planner, State((belief,) * sensors, belief, 1, 1.0), poses


def seconds(repeats: int, reward: Any, reach: float = 400.0, **sizes: int) -> tuple[float, Plan]:
    """Median CPU seconds of a decision, and the last plan."""
    planner, state, poses = decision(**{**BASE, **sizes}, reward=reward, reach=reach)
    plans = [planner.plan(state, poses, rng=np.random.default_rng(0))]

    def once(repeat: int) -> None:
        plans[0] = planner.plan(state, poses, rng=np.random.default_rng(repeat))

    taken = Figures.of([cpu_seconds(partial(once, repeat)) for repeat in range(repeats)])
    return taken.median, plans[0]


def prepared(reward: Any, reach: float = 400.0, **sizes: int) -> Once:
    """What gives the CPU milliseconds of a decision."""
    planner, state, poses = decision(**{**BASE, **sizes}, reward=reward, reach=reach)
    numbers = count(1)
    planner.plan(state, poses, rng=np.random.default_rng(0))
    return lambda: 1e3 * cpu_seconds(lambda: planner.plan(state, poses, rng=np.random.default_rng(next(numbers))))


def measures() -> Iterator[Measure]:
    """Decisions for 20 and for 100 sensors."""
    for name, reward in REWARDS.items():
        yield Measure("many sensors", f"20 sensors, 20 targets, {name}", partial(prepared, reward))
        hundred = partial(prepared, reward, sensors=100, targets=100)
        yield Measure("many sensors", f"100 sensors, 100 targets, {name}", hundred, rounds=3, long=True)


def table(repeats: int) -> None:
    """The sizes that are spoken of."""
    print("| Sensors x actions x targets x samples x steps | reach m | reward | CPU s | evaluated | bound |")
    print("| --- | ---: | --- | ---: | ---: | --- |")
    for sizes, reach in (
        ({"sensors": 20, "targets": 20}, 400.0),
        ({"sensors": 20, "targets": 20}, 1e5),
        ({"sensors": 100, "targets": 100}, 400.0),
        ({"sensors": 1000, "targets": 1000}, 400.0),
    ):
        for name, reward in REWARDS.items():
            if sizes["sensors"] == 1000 and name != "expected loss":
                continue
            taken, plan = seconds(repeats, reward, reach, **sizes)
            made = {**BASE, **sizes, **({"samples": 0} if name == "expected loss" else {})}
            size = " x ".join(str(made[key]) for key in ("sensors", "actions", "targets", "samples", "steps"))
            far = f"{reach:g}" if reach < 1e5 else "all"
            print(f"| {size} | {far} | {name} | {taken:.4f} | {int(plan.curve.evaluations[-1])} | {plan.bound} |")


def figure(path: str, repeats: int) -> None:
    """Cost against each size, the others as in `BASE`."""
    import matplotlib.pyplot as plt

    canvas, axes = plt.subplots(1, len(SWEEPS), figsize=(12.0, 3.4), sharey=True, layout="constrained")
    for axis, (size, values) in zip(axes, SWEEPS.items(), strict=True):
        for colour, (name, reward) in zip(("C0", "C1"), REWARDS.items(), strict=True):
            if size == "samples" and name == "expected loss":
                continue
            taken = [seconds(repeats, reward, **{size: value})[0] for value in values]
            axis.loglog(values, taken, "o-", markersize=4, color=colour, label=name)
        axis.set_xticks(values, [str(value) for value in values])
        axis.minorticks_off()
        axis.set_xlabel(f"{size} [-]")
        axis.grid(alpha=0.3, which="both")
    axes[0].set_ylabel("CPU time of a joint decision [s]")
    axes[0].legend(frameon=False)
    rest = ", ".join(f"{value} {size}" for size, value in BASE.items())
    canvas.suptitle(f"One thread; what is not varied: {rest}", fontsize=10)
    canvas.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--figure", metavar="FILE", help="draw the cost instead of printing the table")
    given = parser.parse_args()
    if given.figure:
        figure(given.figure, given.repeats)
    else:
        table(given.repeats)


if __name__ == "__main__":
    main()
