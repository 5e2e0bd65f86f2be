"""Tracker that runs as a separate program in any language: it gets the scans of a time as a line of JSON."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.internal.programs import Program, start_program
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel, TargetModel

# m^2 and m^2/s^2: variance of state components that a program does not estimate.
UNKNOWN_VARIANCE = 1e12


@dataclass(slots=True, eq=False)
class ProgramFilter:
    """A `CentralFilter` that gets its estimates from a program. See docs/benchmark.md for messages and answers.

    The belief is an LMB of the program's answer. A program processes the scans of a run in order. It is started at the
    first scan, with a seed drawn from that scan's random generator.

    Attributes:
        targets: target model of the scene.
        sensors: models of all sensors.
        command: the program and its arguments.
        scene: function that returns the first message to the program, as plain data.
        folder: working directory of the program.
        seconds: time limit for an answer in s.
        start_seconds: time limit in s for the first answer, which reports that the program is ready.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]
    command: Sequence[str]
    scene: Callable[[], dict[str, Any]] = dict
    folder: Path = Path()
    seconds: float = 1.0
    start_seconds: float = 60.0
    _program: Program | None = field(init=False, default=None, repr=False)
    _step: int = field(init=False, default=0, repr=False)
    _time: float = field(init=False, default=0.0, repr=False)
    _names: dict[Hashable, tuple[int, int]] = field(init=False, default_factory=dict, repr=False)

    def initial(self) -> LMB:
        """Return the belief without targets."""
        return LMB.empty(self.targets.birth)

    def step(
        self,
        belief: Any,
        scans: Any,
        poses: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[LMB, FilterInfo]:
        """Return the program's answer as an LMB, and a report. `belief` and `births` are not used.

        Raises:
            InputError: a step that is not the next, or a command that cannot be started.
            VedetteError: no answer in time, or an invalid answer. The program is then terminated.
        """
        if step == 1:
            scene = self.scene()
            self._program = start_program(self.command, self.folder, "tracker", scene, rng, self.start_seconds)
            self._time, self._names = float(scene.get("time", {}).get("start", dt)) - dt, {}
        elif self._program is None or step != self._step + 1:
            raise InputError(f"step: expected {self._step + 1}, as a program goes through scans in order; got {step}")
        self._step, self._time = step, self._time + dt
        measured = [
            None if scan is None else {"pose": np.asarray(pose).tolist(), "measurements": np.asarray(scan).tolist()}
            for scan, pose in zip(scans, poses, strict=True)
        ]
        answer = self._program.ask({"step": step, "time": self._time, "dt": dt, "scans": measured}, self.seconds)
        given = answer.get("estimates")
        if not isinstance(given, list):
            self._program.refuse('"estimates": a list', repr(given))
        rows = [_Row(self._program, i, each, self.targets.state_dim) for i, each in enumerate(given)]
        labels = [self._names.setdefault(row.label, (step, i)) for i, row in enumerate(rows)]
        if len(set(labels)) < len(labels):
            self._program.refuse("estimates of different labels", str([row.label for row in rows]))
        info = FilterInfo(nan, 1, len(rows))
        if not rows:
            return self.initial(), info
        numbers = [row.existence for row in rows], [row.mean for row in rows], [row.cov for row in rows]
        try:
            return LMB.from_bernoullis(labels, *numbers), info
        except InputError as error:
            self._program.refuse("states, covariances and existences", str(error))


class _Row:
    """One estimate of an answer, with its form checked."""

    def __init__(self, program: Program, index: int, given: Any, dim: int) -> None:
        keys = {"state", "cov", "existence", "label"}
        if not isinstance(given, dict) or not {"state"} <= set(given) <= keys:
            program.refuse(
                f'estimates[{index}] with "state" and perhaps "cov", "existence", "label"', repr(given)[:200]
            )
        state = _numbers(
            program, f"estimates[{index}].state", given["state"], tuple({dim: (dim,), 4: (4,), 2: (2,)}.values())
        )
        self.mean = np.zeros(dim)
        self.mean[: len(state)] = state
        self.cov = UNKNOWN_VARIANCE * np.eye(dim)
        if given.get("cov") is not None:
            cov = _numbers(program, f"estimates[{index}].cov", given["cov"], ((len(state), len(state)),))
            self.cov[: len(state), : len(state)] = 0.5 * (cov + cov.T)
        self.existence = float(_numbers(program, f"estimates[{index}].existence", given.get("existence", 1.0), ((),)))
        label = given.get("label")
        if isinstance(label, list):
            label = tuple(label)
        self.label: Hashable = ("unnamed", index) if label is None else label
        try:
            hash(label)
        except TypeError:
            program.refuse(f"estimates[{index}].label: a number or text", repr(given["label"])[:200])


def _numbers(program: Program, name: str, given: Any, shapes: tuple[tuple[int, ...], ...]) -> Floats:
    """Return `given` as finite numbers in one of the shapes. Otherwise refuse the program's answer."""
    try:
        numbers = np.array(given, np.float64)
    except (TypeError, ValueError):
        numbers = np.array(nan)
    if numbers.shape not in shapes or not np.isfinite(numbers).all():
        wanted = " or ".join("x".join(map(str, shape)) + " finite numbers" if shape else "a number" for shape in shapes)
        program.refuse(f"{name}: {wanted}", repr(given)[:200])
    return numbers
