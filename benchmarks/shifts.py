"""The error where only a share of the sensors scans: which sensors scan, by the planner and by three plain rules.

    python benchmarks/shifts.py                                    # all scenes and shares, 5 runs
    python benchmarks/shifts.py six-cameras --shares 50 --runs 20
    python benchmarks/shifts.py --out shifts.jsonl --write docs/evidence/active-sensors.md

All sensors can be switched off, decide after every scan, and move by the joint decision of the expected loss. The
number of sensors that scan after a decision adds up to the share. `planner` decides which ones, with `MaxActive`; the
others fix them beforehand: `periodic` takes the sensors in turn, `random` draws them, `nearest` takes those nearest to
an estimated target, and `at once` has all scan after some decisions and none after the others. Runs are paired. The
table has the mean OSPA of the scenario in m with one standard error, and the paired differences of `planner` and of
`at once` to the runs in which all sensors scan.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pages import write_between

from vedette.control import MaxActive, Plan
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.kernels.base.types import Bools, Floats
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate

SCENES: dict[str, dict[str, Any]] = {
    "six-cameras": {},
    "eight-mobile": {},
    "paper-a": {
        "filter": {"kind": "lmb"},
        "fusion": {"kind": "sequential"},
        "control.reward": {"kind": "expected_loss", "cutoff": 100.0},
        "control.decision_steps": list(range(10, 40)),
        **dict.fromkeys(("control.horizon_steps", "control.horizon_period")),  # up to the next decision
    },
}
CHOICES, SHARES, SEED = ("planner", "periodic", "random", "nearest", "at once"), (50, 20, 10), 11


@dataclass(frozen=True)
class Only:
    """A constraint: certain sensors scan, and no others."""

    on: tuple[int, ...]
    name: str = "only"
    needs_beliefs: bool = False
    reach: float = 0.0

    def courses(self, situation: Any) -> tuple[Bools, ...]:
        """On for the sensors that scan, off for the others."""
        return tuple(own.any(axis=1) == (s in self.on) for s, own in enumerate(situation.scans))

    def pairs(self, situation: Any, first: int, second: int) -> None:
        """All."""


@dataclass
class Shifts:
    """A joint planner under which a share of the sensors scans."""

    planner: Any
    share: float
    choice: str
    rng: np.random.Generator
    decisions: int = 0
    begun: int = 0  # sensors that were on so far

    @property
    def name(self) -> str:
        """As in plans."""
        return self.choice

    def plan(self, state: Any, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """The plan of the joint planner, with as many sensors on as the share has come to."""
        self.decisions += 1
        unit = len(poses) if self.choice == "at once" else 1
        num = unit * int(self.decisions * self.share * len(poses) / unit + 1e-9) - self.begun
        constraint: Any = MaxActive(num) if self.choice == "planner" and num else Only(self.on(num, state, poses))
        self.begun += num
        return replace(self.planner, constraints=(constraint,)).plan(state, poses, rng=rng)

    def on(self, num: int, state: Any, poses: Floats) -> tuple[int, ...]:
        """The sensors that scan, by a plain rule."""
        size = len(poses)
        if self.choice in ("periodic", "at once") or num == 0:
            return tuple((self.begun + k) % size for k in range(num))
        if self.choice == "random":
            return tuple(self.rng.choice(size, num, replace=False).tolist())
        places = [target.mean[:2] for target in state.fused.targets() if target.existence >= 0.5]
        if not places:
            return tuple(range(num))
        gaps = np.linalg.norm(poses[:, np.newaxis, :2] - np.array(places), axis=2).min(axis=1)
        return tuple(np.argsort(gaps, kind="stable")[:num].tolist())


def scenario_of(name: str) -> Scenario:
    """The scene with sensors that can be switched off."""
    return replace_fields(load_scenario(name), {"sensors.*.switchable": True, "control.explain": False, **SCENES[name]})


def measured(scenario: Scenario, choice: str, share: int, run: int) -> tuple[float, float]:
    """Mean OSPA of a run, m, and the share of the sensors that scanned after the first decision, %."""
    experiment, ospa = build_experiment(scenario), scenario.model.ospa
    score = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=ospa.components)
    planner = Shifts(build_planner(scenario, "jdm", 1), share / 100.0, choice, np.random.default_rng([SEED, run]))
    record = simulate(experiment, planner, seed=SEED, run=run, score=score)
    first, last = (ospa.first_scan or 1) - 1, ospa.last_scan or scenario.model.time.num_steps
    scanned = ~record.off[scenario.model.decision_steps[0] :]
    return float(np.nanmean(record.ospa[first:last, 0])), 100.0 * float(scanned.mean())


def with_error(values: Floats, sign: str = "") -> str:
    """Mean and standard error."""
    return f"{values.mean():{sign}.2f} ± {values.std(ddof=1) / np.sqrt(len(values)):.2f}"


def rows(name: str, shares: list[int], runs: int, out: Path | None) -> list[str]:
    """The lines of a scene."""
    lines, scenario, found = list[str](), scenario_of(name), dict[tuple[str, int], Floats]()
    for share in (100, *shares):
        for choice in CHOICES if share < 100 else CHOICES[:1]:
            values = np.array([measured(scenario, choice, share, run) for run in range(runs)])
            found[choice, share] = values[:, 0]
            if out is not None:
                row = {"scene": name, "choice": choice, "share": share, "ospa": values[:, 0].tolist()}
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
            print(name, share, choice, with_error(values[:, 0]), f"{values[:, 1].mean():.0f} %", flush=True)
        if share == 100:
            lines.append(f"| {name} | 100 | {with_error(found['planner', 100])} {'| ' * 6}|")
            continue
        cells = [with_error(found[choice, share]) for choice in CHOICES]
        cells += [more(found[choice, share], found["planner", 100]) for choice in ("planner", "at once")]
        lines.append(f"| {name} | {share} | {' | '.join(cells)} |")
    return lines


def more(values: Floats, of_all: Floats) -> str:
    """The paired difference, and what share of the error it is."""
    gap = values - of_all
    return f"{with_error(gap, '+')} ({100.0 * gap.mean() / of_all.mean():+.0f} %)"


def main() -> None:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), help="of: " + ", ".join(SCENES))
    parser.add_argument("--shares", type=int, nargs="+", default=list(SHARES), help="of the sensors that scan, %%")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--out", type=Path, help="file to which the results of the runs are appended")
    parser.add_argument("--write", type=Path, help="page with the two marks between which the table goes")
    given = parser.parse_args()
    head = "| Scene | On, % | Planner | Periodic | Random | Nearest | At once | Planner, more | At once, more |"
    lines = [head, "| --- |" + " ---: |" * 8]
    for name in given.scenes:
        lines += rows(name, given.shares, given.runs, given.out)
    print("\n".join(lines))
    if given.write is not None:
        write_between(given.write, "shifts.py", "\n".join(lines))


if __name__ == "__main__":
    main()
