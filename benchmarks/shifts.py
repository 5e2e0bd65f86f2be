"""Error against the share of scans that are made: who scans, chosen by a plan, in turn, at random or by distance.

    python benchmarks/shifts.py                                # eight-mobile and paper-a, 10 runs
    python benchmarks/shifts.py --scenes six-cameras --runs 20
    python benchmarks/shifts.py --write docs/deciding.md

All sensors can be switched off, and after each decision at most so many scan (`MaxActive`). "plan" is `jdm` under that
constraint, which chooses courses and who scans together. The others take the courses of `jdm` without the constraint
and then choose who scans: "in turn" the next ones in printed order, "random" any, "nearest" those that are nearest to
an estimated target. `paper-a` is run under the default filter and fusion: where each sensor keeps its own tracks,
covariance intersection weighs those of sensors that are off as much as the others. Runs are paired. The table has the
share of scans that are made from the first decision on, the mean OSPA as the scenario scores it with one standard
error, and how much more that is than with all scans, in paired runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from deciding_scenes import FILTERS, SILENT
from pages import write_between

from vedette.control import Plan, Planner
from vedette.densities import Estimator
from vedette.evaluation import ospa_of_run
from vedette.platforms.base import SWITCH
from vedette.scenarios import Scenario, load_scenario, with_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

SEED = 1
RULES = ("in turn", "random", "nearest")
# As where nothing is said.
DEFAULTS = {"paper-a": FILTERS[SILENT]}
NUMBERS = {"eight-mobile": (4, 2, 1), "six-cameras": (3, 1), "paper-a": (1,)}


@dataclass
class Shift:
    """A planner's courses, with the sensors that scan chosen by a rule of thumb.

    Attributes:
        planner: gives the courses.
        most: number of sensors that scan.
        rule: one of `RULES`.
        estimate: reads targets off the fused belief, for the rule nearest.
    """

    planner: Planner
    most: int
    rule: str
    estimate: Estimator
    name: str = "shift"
    _decision: int = field(default=0, init=False)

    def plan(self, state: Any, poses: Any, *, rng: np.random.Generator) -> Plan:
        """The courses, with some sensors off."""
        plan, num = self.planner.plan(state, poses, rng=rng), len(poses)
        if self.rule == "in turn":
            on = (self._decision * self.most + np.arange(self.most)) % num
        elif self.rule == "random":
            on = rng.permutation(num)[: self.most]
        else:
            places = np.asarray(self.estimate(state.fused, state.step).means)[:, :2]
            gaps = np.linalg.norm(poses[:, np.newaxis, :2] - places, axis=2).min(axis=1, initial=np.inf)
            on = np.argsort(gaps, kind="stable")[: self.most]
        self._decision += 1
        chosen = tuple(
            _switched(own, index, s in on) for s, (own, index) in enumerate(zip(plan.actions, plan.chosen, strict=True))
        )
        return replace(plan, chosen=chosen, questions=None, bound=None)


def _switched(actions: Any, index: int, on: bool) -> int:
    """The action of the same course with the sensor on or off."""
    wanted = actions.values[index].copy()
    wanted[actions.columns.index(SWITCH)] = float(on)
    return int(np.flatnonzero((actions.values == wanted).all(axis=1))[0])


def with_most(scenario: Scenario, most: int | None) -> Scenario:
    """All sensors can be switched off, and so many scan at most; None: all."""
    given = [own.model_dump() for own in scenario.model.control.constraints]
    more = [] if most is None else [{"kind": "max_active", "sensors": most}]
    return with_fields(scenario, {"sensors.*.switchable": True, "control.constraints": [*given, *more]})


def measured(scenario: Scenario, run: int, most: int | None = None, rule: str | None = None) -> tuple[float, float]:
    """Mean OSPA of a run, m, and the share of scans that are made from the first decision on."""
    experiment, ospa = build_experiment(scenario), scenario.model.ospa
    planner: Any = build_planner(scenario, "jdm", 1)
    if rule is not None and most is not None:
        planner = Shift(planner, most, rule, experiment.estimate)
    score = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    record = simulate(experiment, planner, seed=SEED, run=run, score=score)
    first = scenario.model.decision_steps[0]
    scored = slice((ospa.from_step or first + 1) - 1, ospa.to_step)
    return float(record.ospa[scored, 0].mean()), float(1.0 - record.off[first:].mean())


def rows(name: str, numbers: Sequence[int], runs: int) -> Iterator[str]:
    """The lines of a scene."""
    scene = with_fields(load_scenario(name), DEFAULTS.get(name, {}))
    every = np.array([measured(with_most(scene, None), run) for run in range(runs)])
    mean, error = every[:, 0].mean(), every[:, 0].std(ddof=1) / np.sqrt(runs)
    yield f"| {name} | {len(scene.model.sensors)} | 100 % | all | {mean:.2f} ± {error:.2f} | | |"
    for most in numbers:
        for rule in (None, *RULES):
            scenario = with_most(scene, most if rule is None else None)
            found = np.array([measured(scenario, run, most, rule) for run in range(runs)])
            gains = found[:, 0] - every[:, 0]
            less, error = gains.mean(), gains.std(ddof=1) / np.sqrt(runs)
            yield (
                f"| {name} | {most} | {100.0 * found[:, 1].mean():.0f} % | {rule or 'plan'} | {found[:, 0].mean():.2f} "
                f"| {less:+.2f} ± {error:.2f} | {100.0 * less / mean:+.0f} % |"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=tuple(NUMBERS), default=["eight-mobile", "paper-a"])
    parser.add_argument("--runs", type=int, default=10, help="of each scene and choice; at least 2")
    parser.add_argument("--write", type=Path, help="page with the two marks between which the table goes")
    given = parser.parse_args()
    lines = ["| scene | sensors that scan | scans | chosen | OSPA, m | more than with all, m | of it |"]
    lines.append("| --- | ---: | ---: | --- | ---: | ---: | ---: |")
    print("\n".join(lines), flush=True)
    for name in given.scenes:
        for line in rows(name, NUMBERS[name], given.runs):
            print(line, flush=True)
            lines.append(line)
    if given.write is not None:
        write_between(given.write, "shifts.py", "\n".join(lines))


if __name__ == "__main__":
    main()
