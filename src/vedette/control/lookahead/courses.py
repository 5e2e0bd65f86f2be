"""What one sensor may do over several decisions, as a tree that grows where it is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from vedette.control.lookahead.constraints import MultiStepConstraints, Place, Stages
from vedette.kernels.base.types import Bools, Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Options, Platform, options_at

# The numbers of the courses taken at each decision, among the different ones that there are then.
Sequence: TypeAlias = tuple[int, ...]

# Poses that are equal to so many decimals, in metres and radians, are one.
_SAME_DIGITS = 9

# Places that are looked at, for the dead ends of one sensor. What lies beyond is taken to be open: a decision must not
# wait for the proof that there is no way out.
_MOST_PLACES = 10_000


@dataclass(slots=True, eq=False)
class CourseTree:
    """The sequences of one sensor: of all courses, or of those that constraints allow.

    Where no course is allowed, those that violate constraints least are kept. Of these those are kept after which there
    is the least number of further decisions with no course allowed: a beginning after which nothing is allowed is left
    out, unless that is so after all of them.

    Attributes:
        sensor: its number.
        platform: what it may do.
        pose: where it is now.
        stages: the decisions.
        ahead: the constraints; None: there are none.
        now: (num_courses,) which courses are allowed at the first decision, at least one.
        far_sighted: whether dead ends are left out.
    """

    sensor: int
    platform: Platform
    pose: Floats
    stages: Stages
    ahead: MultiStepConstraints | None = None
    now: Bools = field(default_factory=lambda: np.empty(0, np.bool_))
    far_sighted: bool = True
    _found: dict[Sequence, Options] = field(default_factory=dict)
    _at_poses: dict[tuple[bytes, int], Options] = field(default_factory=dict)
    _spots: dict[Sequence, bytes] = field(default_factory=dict)
    _allowed: dict[tuple[bytes, int], Sequence] = field(default_factory=dict)
    _open: dict[tuple[bytes, int], tuple[Sequence, bool]] = field(default_factory=dict)
    _blocked: dict[tuple[bytes, int], int] = field(default_factory=dict)

    def short_sighted(self) -> CourseTree:
        """The same with its dead ends."""
        return replace(self, far_sighted=False, _allowed={})

    def place(self, taken: Sequence) -> Place:
        """Where it decides after the courses taken so far, and between what."""
        options = self.options(taken)
        return Place(self.pose_after(taken), options.courses, options.scans)

    def pose_after(self, taken: Sequence) -> Floats:
        """Where it decides after the courses taken so far."""
        return self.options(taken[:-1]).courses[taken[-1], self.stages.stride - 1] if taken else self.pose

    def options(self, taken: Sequence) -> Options:
        """What it may do after the courses taken so far. Raises `InputError` for actions or courses that are none."""
        if taken not in self._found:
            at = self.pose_after(taken)
            times = self.stages.times(len(taken) + 1)
            # Many ways lead to one pose, up to rounding: there it may do the same.
            key = _spot_of(at), len(times)
            if key not in self._at_poses:
                self._at_poses[key] = options_at(f"sensors[{self.sensor}].platform", self.platform, at, times)
            self._found[taken] = self._at_poses[key]
        return self._found[taken]

    def allowed(self, taken: Sequence) -> Sequence:
        """The different courses that it may take after those taken so far, at least one."""
        if self.ahead is None:
            return tuple(range(len(self.options(taken).courses)))
        key = self.spot(taken), len(taken)
        if key not in self._allowed:
            found, _ = self._open_after(taken)
            if self.far_sighted and len(found) > 1 and len(taken) + 1 < self.stages.depth:
                blocked = [self._least_blocked((*taken, course)) for course in found]
                found = tuple(course for course, num in zip(found, blocked, strict=True) if num == min(blocked))
            self._allowed[key] = found
        return self._allowed[key]

    def course(self, sequence: Sequence) -> tuple[Floats, Bools]:
        """Poses (num_steps, pose_dim) at the pseudo-updates, up to the end of the last decision's horizon, and
        (num_steps,) whether it scans there."""
        stages, found = self.stages, [(self.options(sequence[:k]), taken) for k, taken in enumerate(sequence)]
        nums = [stages.stride] * (len(found) - 1) + [stages.steps]
        parts = list(zip(found, nums, strict=True))
        poses = np.concatenate([own.courses[taken, :num] for (own, taken), num in parts])
        return poses, np.concatenate([own.scans[taken, :num] for (own, taken), num in parts])

    def price(self, sequence: Sequence, first: int) -> float:
        """What the actions of a sequence cost, from decision `first` (from 0) on."""
        return sum(float(self.options(sequence[:k]).prices[sequence[k]]) for k in range(first, len(sequence)))

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

    def blocked(self, sequence: Sequence) -> list[int]:
        """The decisions of a sequence but the first, counted from 1, at which no course is allowed."""
        return [k + 1 for k in range(1, len(sequence)) if not self._open_after(sequence[:k])[1]]

    def spot(self, taken: Sequence) -> bytes:
        """What is equal where it decides at one place: there it may do the same."""
        if taken not in self._spots:
            self._spots[taken] = _spot_of(self.pose_after(taken))
        return self._spots[taken]

    def _moment(self, taken: Sequence) -> tuple[bytes, int]:
        """What is equal where constraints allow the same."""
        assert self.ahead is not None
        return self.spot(taken), self.ahead.moment(len(taken) + 1)

    def _open_after(self, taken: Sequence) -> tuple[Sequence, bool]:
        """The courses that meet the constraints, or violate them least; and whether they meet them."""
        if not taken or self.ahead is None:
            return tuple(np.flatnonzero(self.now).tolist()), True
        key = self._moment(taken)
        if key not in self._open:
            allowed, met = self.ahead.courses(self.sensor, len(taken) + 1, self.place(taken))
            self._open[key] = tuple(np.flatnonzero(allowed).tolist()), met
        return self._open[key]

    def _least_blocked(self, taken: Sequence) -> int:
        """The least number of decisions from here on at which no course is allowed."""
        if len(taken) == self.stages.depth:
            return 0
        key = self.spot(taken), len(taken)
        if key not in self._blocked:
            if len(self._blocked) >= _MOST_PLACES:
                return 0
            self._blocked[key] = 0  # counted among the places from now on
            found, met = self._open_after(taken)
            ways = [(*taken, course) for course in found]
            if len(taken) + 1 < self.stages.depth:
                # One way out is enough: first those to places that are known.
                ways.sort(key=lambda way: self._moment(way) not in self._open)
            least = self.stages.depth
            for way in ways:
                least = min(least, self._least_blocked(way))
                if least == 0:
                    break
            self._blocked[key] = least + (not met)
        return self._blocked[key]


def _spot_of(pose: Floats) -> bytes:
    """What is equal for poses that are one."""
    return (np.round(pose, _SAME_DIGITS) + 0.0).tobytes()  # -0 is 0


def _apart(columns: tuple[str, ...], values: Floats, last: Floats) -> Floats:
    """(num_actions,) how far actions are from one, angles up to whole turns."""
    off = values - last
    angles = [name.endswith("_deg") for name in columns]
    off[:, angles] = np.degrees(np.abs(wrap_angles(np.radians(off[:, angles]))))
    return np.asarray((off**2).sum(axis=1))
