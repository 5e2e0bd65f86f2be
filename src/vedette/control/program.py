"""A planner that is an external program, in any language, which answers a line of JSON per decision."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from vedette.control.constraints.mask import Mask
from vedette.control.constraints.protocol import Constraint
from vedette.control.inputs import check_control_inputs, check_poses, mask_of_decision, options_of, single_mask
from vedette.control.plan import Plan
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Estimate, Estimator, LabelledDensity, best_estimate
from vedette.internal.programs import Program, start_program
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, instance
from vedette.platforms import Options
from vedette.tracking import State

COUNTED = ("filter_steps", "fusions", "rewards")


@dataclass(slots=True, eq=False)
class ProgramPlanner:
    """A planner that runs an external program. The page docs/benchmark.md describes its input and output.

    The program is started at the first decision of a run, and again if time goes backwards. Its seed is drawn from the
    generator of that decision.

    Attributes:
        sensors: the sensors.
        command: the program and its arguments.
        scene: first message to the program, as plain data.
        settings: the horizon, over which courses are distinguished.
        constraints: limits on the sensors' courses. An answer that violates them is refused.
        estimate: estimator that extracts targets from the fused belief.
        folder: working directory of the program.
        seconds: time limit for an answer.
        start_seconds: time limit for its first answer, that it is ready.
    """

    sensors: tuple[MobileSensor, ...]
    command: Sequence[str]
    scene: Callable[[], dict[str, Any]] = dict
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    constraints: tuple[Constraint, ...] = ()
    estimate: Estimator = best_estimate
    folder: Path = Path()
    seconds: float = 1.0
    start_seconds: float = 60.0
    _program: Program | None = field(init=False, default=None, repr=False)
    _step: int = field(init=False, default=0, repr=False)
    name: ClassVar[str] = "program"

    def __post_init__(self) -> None:
        check_control_inputs(self)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the program's answer as a plan.

        Raises:
            InputError: invalid inputs, or a command that cannot be started.
            VedetteError: no answer in time, or an invalid one. The program is ended.
        """
        generator(rng)
        instance("state", state, State)
        options, at = options_of(self.sensors, poses, self.settings), check_poses(poses, len(self.sensors))
        mask = mask_of_decision(self.constraints, self.sensors, options, state, at, self.settings)
        if self._program is None or state.step <= self._step:
            self._program = start_program(self.command, self.folder, "planner", self.scene(), rng, self.start_seconds)
        self._step = state.step
        question = {"step": state.step, "time": state.time, "sensors": _choices(options, mask)}
        if mask is not None and mask.together:
            pairs = mask.together.items()
            question["pairs"] = [{"sensors": list(pair), "allowed": table.tolist()} for pair, table in pairs]
        if mask is not None and mask.active is not None:
            question["max_active"] = mask.active.limit
        estimate = self.estimate(state.fused, state.step)
        question |= {"estimates": _target_list(estimate), "tracks": _target_list(state.fused)}
        answer = self._program.ask(question, self.seconds)
        joint, counts = _joint(self._program, answer, options, mask), _counts(self._program, answer)
        chosen = tuple(own.first_action(course) for own, course in zip(options, joint, strict=True))
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), counts, mask.notes if mask else ())


def _choices(options: Sequence[Options], mask: Mask | None) -> list[dict[str, Any]]:
    """Return for each sensor its pose and its distinct courses, each with the first action that leads to it."""
    return [
        {
            "pose": own.pose.tolist(),
            "columns": list(own.actions.columns),
            "actions": [own.actions.values[own.first_action(course)].tolist() for course in range(len(own.courses))],
            "courses": own.courses.tolist(),
            "allowed": single_mask(mask, s, len(own.courses)).tolist(),
        }
        for s, own in enumerate(options)
    ]


def _target_list(belief: Any) -> list[dict[str, Any]]:
    """Return the targets of an estimate, or of a labelled density."""
    if not isinstance(belief, Estimate | LabelledDensity):
        return []
    return [
        {
            "label": list(target.label or ()),
            "existence": float(target.existence),
            "mean": target.mean.tolist(),
            "cov": target.cov.tolist(),
        }
        for target in belief.targets()
    ]


def _joint(program: Program, answer: dict[str, Any], options: Sequence[Options], mask: Mask | None) -> tuple[int, ...]:
    """Return the course of each sensor in the answer. Refuses an invalid choice and a forbidden one."""
    given, num_sensors = answer.get("actions"), len(options)
    if not isinstance(given, list) or len(given) != num_sensors or any(type(each) is not int for each in given):
        got = repr(given)[:200] if "actions" in answer else f"only {', '.join(answer) or 'an empty object'}"
        program.refuse(f'"actions": {num_sensors} whole numbers, one a sensor', got)
    for s, (course, own) in enumerate(zip(given, options, strict=True)):
        if not 0 <= course < len(own.courses):
            program.refuse(f"actions[{s}] from 0 to {len(own.courses) - 1}", str(course))
        if not single_mask(mask, s, len(own.courses))[course]:
            program.refuse(f"actions[{s}] that is allowed", str(course))
    if mask is not None:
        for (first, second), table in mask.together.items():
            if not table[given[first], given[second]]:
                expected = f"actions[{first}] and actions[{second}] that are allowed together"
                program.refuse(expected, f"{given[first]} and {given[second]}")
        if mask.active is not None and (excess := int(mask.active.excess(np.array([given]))[0])):
            program.refuse(f"actions with at most {mask.active.limit} sensors on", f"{mask.active.limit + excess} on")
    return tuple(given)


def _counts(program: Program, answer: dict[str, Any]) -> dict[str, int]:
    """Return the evaluation counts that the program reports."""
    counts = answer.get("counts", {})
    is_valid = isinstance(counts, dict) and set(counts) <= set(COUNTED)
    if not is_valid or any(type(each) is not int or not 0 <= each < 2**53 for each in counts.values()):
        program.refuse(f'"counts": whole numbers of {", ".join(COUNTED)}', repr(counts))
    return dict(counts)
