"""What one sensor may do over several decisions, as a tree that grows where it is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Options, Platform, options_at

# The numbers of the courses taken at each decision, among the different ones that there are then.
Sequence: TypeAlias = tuple[int, ...]

# Poses that are equal to so many decimals, in metres and radians, are one.
_SAME_DIGITS = 9


class Stages(NamedTuple):
    """Decisions `stride` pseudo-updates apart; after the last, the horizon of a single decision."""

    depth: int
    stride: int  # pseudo-updates from a decision to the next
    steps: int  # pseudo-updates of the horizon of a decision
    period: float  # s between pseudo-updates

    def num_steps(self, stage: int) -> int:
        """Pseudo-updates to the end of the horizon of a decision, counted from 1."""
        return (stage - 1) * self.stride + self.steps

    def times(self, stage: int) -> Floats:
        """s from a decision to the pseudo-updates that its courses are told apart by."""
        num = self.steps if stage == self.depth else max(self.stride, self.steps)
        return self.period * np.arange(1.0, num + 1)


@dataclass(frozen=True, slots=True, eq=False)
class CourseTree:
    """The sequences of one sensor.

    Attributes:
        name: of the platform in errors.
        platform: what it may do.
        pose: where it is now.
        stages: the decisions.
    """

    name: str
    platform: Platform
    pose: Floats
    stages: Stages
    _found: dict[Sequence, Options] = field(default_factory=dict)
    _at_poses: dict[tuple[bytes, int], Options] = field(default_factory=dict)

    def pose_after(self, taken: Sequence) -> Floats:
        """Where it decides after the courses taken so far."""
        return self.options(taken[:-1]).courses[taken[-1], self.stages.stride - 1] if taken else self.pose

    def options(self, taken: Sequence) -> Options:
        """What it may do after the courses taken so far. Raises `InputError` for actions or courses that are none."""
        if taken not in self._found:
            at = self.pose_after(taken)
            times = self.stages.times(len(taken) + 1)
            # Many ways lead to one pose, up to rounding: there it may do the same.
            key = place_of(at), len(times)
            if key not in self._at_poses:
                self._at_poses[key] = options_at(self.name, self.platform, at, times)
            self._found[taken] = self._at_poses[key]
        return self._found[taken]

    def different(self, taken: Sequence) -> Sequence:
        """The different courses that there are after those taken so far."""
        return tuple(range(len(self.options(taken).courses)))

    def allowed(self, taken: Sequence) -> Sequence:
        """Those of them that it may take; at least one."""
        return self.different(taken)

    def course(self, sequence: Sequence) -> Floats:
        """(num_steps, pose_dim) poses at the pseudo-updates, up to the end of the last decision's horizon."""
        parts = [
            self.options(sequence[:k]).courses[taken, : self.stages.stride] for k, taken in enumerate(sequence[:-1])
        ]
        last = self.options(sequence[:-1]).courses[sequence[-1], : self.stages.steps]
        return np.concatenate([*parts, last])

    def rows(self, sequence: Sequence) -> Floats:
        """(num_decisions, num_columns) the actions of a sequence."""
        found = [self.options(sequence[:k]) for k in range(len(sequence))]
        return np.array([own.actions.values[own.first_action(k)] for own, k in zip(found, sequence, strict=True)])

    def nearest(self, taken: Sequence, among: Sequence) -> list[int]:
        """Courses after those taken so far, those first whose actions are nearest to the last one taken.

        Where nothing was taken yet, in their order.
        """
        if not taken:
            return list(among)
        before, own = self.options(taken[:-1]), self.options(taken)
        last = before.actions.values[before.first_action(taken[-1])]
        order = own.which[np.argsort(_apart(own.actions.columns, own.actions.values, last), kind="stable")]
        wanted = set(among)
        return [course for course in dict.fromkeys(order.tolist()) if course in wanted]

    def kept(self, taken: Sequence) -> Sequence:
        """The sequence that keeps to the last action, or to the one nearest to it, until the end.

        Where nothing was taken yet it begins with the first action.
        """
        while len(taken) < self.stages.depth:
            taken = (*taken, self.nearest(taken, self.allowed(taken))[0])
        return taken

    def count(self, most: int) -> int:
        """Number of all sequences; where there are more than `most`, some number above that."""
        level: list[Sequence] = [()]
        for _ in range(self.stages.depth - 1):
            level = [(*taken, k) for taken in level for k in self.allowed(taken)]
            if len(level) > most:
                return len(level)
        return sum(len(self.allowed(taken)) for taken in level)

    def all(self) -> Iterator[Sequence]:
        """Every sequence, the last decision's courses fastest."""
        level: list[Sequence] = [()]
        for _ in range(self.stages.depth):
            level = [(*taken, k) for taken in level for k in self.allowed(taken)]
        return iter(level)


def place_of(pose: Floats) -> bytes:
    """What is equal for poses that are one."""
    return (np.round(pose, _SAME_DIGITS) + 0.0).tobytes()  # -0 is 0


def _apart(columns: tuple[str, ...], values: Floats, last: Floats) -> Floats:
    """(num_actions,) how far actions are from one, angles up to whole turns."""
    off = values - last
    angles = [name.endswith("_deg") for name in columns]
    off[:, angles] = np.degrees(np.abs(wrap_angles(np.radians(off[:, angles]))))
    return np.asarray((off**2).sum(axis=1))
