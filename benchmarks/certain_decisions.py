"""Decisions that take as many samples as they need, against those of 10,000 samples and of a fixed 40.

    python benchmarks/certain_decisions.py [--decisions 1000] [--scenes paper-a-lmb eight-mobile] [--indifference 0.01]
                                          [--samples 10000]

Beliefs and poses are recorded when decisions are due in runs under joint control. Each is decided again with
`PlanningSettings(confidence=0.95, indifference=...)` and with the fixed number of samples of the scenario, and both
decisions are judged by 10,000 other samples of the same engine: whether they are the joint action that the same search
takes on those, and whether they are within the indifference of it. On one thread; CPU time is that of the process.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.control import JointPlanner, Plan
from vedette.control.preparation import Preparation
from vedette.control.search.problem import JointProblem, all_joint_actions, first_best
from vedette.kernels.base.types import Floats, Ints
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation.loop import simulate
from vedette.tracking import State

# Name of a scene: the scenario, and kinds of filter and fusion in place of its own.
SCENES = {
    "paper-a-lmb": ("paper-a", "lmb", "clmb"),
    "paper-a": ("paper-a", None, None),
    "eight-mobile": ("eight-mobile", None, None),
    "six-cameras": ("six-cameras", None, None),
    "solent": ("solent", "m_delta_glmb", "cm_delta_glmb"),
}
SEED, CONFIDENCE, BLOCK = 1, 0.95, 500


def scene(name: str) -> Scenario:
    """A scenario with the filter and the fusion of a scene."""
    file, local, fusion = SCENES[name]
    scenario = load_scenario(file)
    if local is None:
        return scenario
    model = scenario.model
    changed = {
        "filter": model.filter.model_copy(update={"kind": local}),
        "fusion": model.fusion.model_copy(update={"kind": fusion}),
    }
    return replace(scenario, model=model.model_copy(update=changed))


@dataclass
class Recording:
    """A planner that keeps what it was asked."""

    planner: JointPlanner
    asked: list[tuple[State, Floats]] = field(default_factory=list)

    @property
    def name(self) -> str:
        return self.planner.name

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        self.asked.append((state, poses.copy()))
        return self.planner.plan(state, poses, rng=rng)


def recorded(scenario: Scenario, planner: JointPlanner, most: int) -> Iterator[tuple[State, Floats]]:
    """Beliefs and poses of decisions, run after run."""
    experiment, num, run = build_experiment(scenario), 0, 0
    nothing = np.zeros((len(experiment.times), 3))
    while num < most:
        recording = Recording(planner)
        simulate(experiment, recording, seed=SEED, run=run, score=lambda truth, estimates: nothing)
        yield from recording.asked[: most - num]
        num, run = num + len(recording.asked), run + 1


class Reference:
    """The mean rewards of joint actions over many samples, in blocks."""

    def __init__(self, planner: JointPlanner, state: State, poses: Floats, num_samples: int, seed: int) -> None:
        self.planner, self.rng = planner, np.random.default_rng([SEED, seed, 1])
        prepared = Preparation.of(planner.sensors, planner.fusion, planner.settings, planner.reward, state, poses)
        self.options, self.known = prepared.options, {}
        shape = tuple(len(own.courses) for own in self.options)
        blocks = range(0, num_samples, BLOCK)
        if np.prod([float(size) for size in shape]) <= 4096:
            every, total = all_joint_actions(shape), 0.0
            for _ in blocks:
                total += prepared.evaluator(BLOCK, rng=self.rng).joint()(every).mean(axis=1)
            self.known = dict(zip(map(tuple, every.tolist()), (total / len(blocks)).tolist(), strict=True))
            self.choice = tuple(every[first_best(total)].tolist())
            return
        self.evaluators = [prepared.evaluator(BLOCK, rng=self.rng) for _ in blocks]
        problem = JointProblem(shape, self.means, lambda: self.independent(shape))
        self.choice = planner.search.search(problem, rng=self.rng)

    def means(self, actions: Ints) -> Floats:
        """Of joint actions, one a row."""
        if self.known:
            return np.array([self.known[tuple(row)] for row in actions.tolist()])
        return np.mean([each.joint()(actions).mean(axis=1) for each in self.evaluators], axis=0)

    def independent(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """The best course of every sensor alone."""
        alone = lambda s, each: each.alone(s)(all_joint_actions((shape[s],))).mean(axis=1)  # noqa: E731
        return tuple(
            first_best(np.mean([alone(s, each) for each in self.evaluators], axis=0)) for s in range(len(shape))
        )

    def loss(self, plan: Plan) -> tuple[bool, float]:
        """Whether a plan takes the same joint action, and what it gives away, relative to the reward."""
        courses = tuple(int(own.which[index]) for own, index in zip(self.options, plan.chosen, strict=True))
        best, taken = self.means(np.array([self.choice, courses]))
        return courses == self.choice, float((best - taken) / abs(best)) if best != taken else 0.0


def timed(planner: Any, state: State, poses: Floats, seed: int) -> tuple[Plan, float]:
    """A plan and its CPU time in seconds."""
    began = time.process_time()
    plan = planner.plan(state, poses, rng=np.random.default_rng([SEED, seed, 0]))
    return plan, time.process_time() - began


def report(rows: list[dict[str, float]], indifference: float) -> None:
    """Figures of the decisions so far."""
    column = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    print(f"  {len(rows)} decisions, {100 * column['certain'].mean():.1f} % ended certain")
    for name in ("confidence", "fixed"):
        loss, num, spent = (column[f"{name} {what}"] for what in ("loss", "samples", "time"))
        same, near = column[f"{name} same"].mean(), (loss <= indifference).mean()
        print(
            f"    {name:10s} same action {100 * same:5.1f} %, within {100 * indifference:g} %: {100 * near:5.1f} %, "
            f"mean loss {100 * loss.mean():.3f} %; samples: median {np.median(num):g}, mean {num.mean():.1f}; "
            f"CPU: median {1e3 * np.median(spent):.0f} ms, mean {1e3 * spent.mean():.0f} ms",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--decisions", type=int, default=1000, help="of each scene")
    parser.add_argument("--scenes", nargs="+", choices=sorted(SCENES), default=["paper-a-lmb", "eight-mobile"])
    parser.add_argument("--indifference", type=float, default=0.01)
    parser.add_argument("--samples", type=int, default=10_000, help="of the decision that is compared with")
    parser.add_argument("--max-samples", type=int, default=2000)
    asked = parser.parse_args()
    for name in asked.scenes:
        scenario = scene(name)
        planner = build_planner(scenario, "jdm", num_threads=1)
        assert isinstance(planner, JointPlanner)
        more = {"confidence": CONFIDENCE, "indifference": asked.indifference, "max_samples": asked.max_samples}
        certain = replace(planner, settings=replace(planner.settings, **more))
        print(f"{name}, {planner.settings.num_samples} samples fixed", flush=True)
        rows: list[dict[str, float]] = []
        for number, (state, poses) in enumerate(recorded(scenario, planner, asked.decisions)):
            reference, row = Reference(planner, state, poses, asked.samples, number), {}
            for each, kind in ((certain, "confidence"), (planner, "fixed")):
                plan, row[f"{kind} time"] = timed(each, state, poses, number)
                row[f"{kind} same"], row[f"{kind} loss"] = reference.loss(plan)
                row[f"{kind} samples"] = planner.settings.num_samples
                if plan.certainty is not None:
                    row["confidence samples"], row["certain"] = plan.certainty.samples, plan.certainty.certain
            rows.append(row)
            if len(rows) % 10 == 0 or len(rows) == asked.decisions:
                report(rows, asked.indifference)


if __name__ == "__main__":
    main()
