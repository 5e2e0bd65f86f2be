"""The course sequences of one sensor over several decisions, as a tree that grows where it is visited."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from vedette.control.lookahead.constraints import MultiStepConstraints, Place, Stages
from vedette.kernels.base.types import Bools, Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Options, Platform, options_at

# Indices of the courses taken at each decision, among the distinct courses there.
Sequence: TypeAlias = tuple[int, ...]

# Poses are the same if they are equal to this number of decimals, in metres and radians.
_SAME_DIGITS = 9

# Maximum number of places visited in the search for dead ends of one sensor. Places beyond count as open: a decision
# must not wait for the proof that there is no way out.
_MOST_PLACES = 10_000


@dataclass(slots=True, eq=False)
class CourseTree:
    """The course sequences of one sensor: all courses, or those that constraints allow.

    If no course is allowed, those with the least violation are kept. Of these, only the courses are kept after which
    there is the least number of further decisions without an allowed course. So a beginning that leads to a dead end is
    left out, unless all of them do.
    """

    sensor: int  # its index
    platform: Platform  # its platform
    pose: Floats  # its present pose
    stages: Stages  # the decisions
    ahead: MultiStepConstraints | None = None  # the constraints. None: there are none
    # (num_courses,) which courses are allowed at the first decision, at least one
    now: Bools = field(default_factory=lambda: np.empty(0, np.bool_))
    omits_dead_ends: bool = True  # whether dead ends are left out
    _found: dict[Sequence, Options] = field(default_factory=dict)
    _at_poses: dict[tuple[bytes, int], Options] = field(default_factory=dict)
    _spots: dict[Sequence, bytes] = field(default_factory=dict)
    _allowed: dict[tuple[bytes, int], Sequence] = field(default_factory=dict)
    _open: dict[tuple[bytes, int], tuple[Sequence, bool]] = field(default_factory=dict)
    _blocked: dict[tuple[bytes, int], int] = field(default_factory=dict)

    def with_dead_ends(self) -> "CourseTree":
        """Return the tree that includes dead ends."""
        return replace(self, omits_dead_ends=False, _allowed={})

    def place(self, sequence: Sequence) -> Place:
        """Return the pose and the courses of the decision after the courses taken so far."""
        options = self.options(sequence)
        return Place(self.pose_after(sequence), options.courses, options.scans)

    def pose_after(self, sequence: Sequence) -> Floats:
        """Return the pose at the decision after the courses taken so far."""
        return self.options(sequence[:-1]).courses[sequence[-1], self.stages.stride - 1] if sequence else self.pose

    def options(self, sequence: Sequence) -> Options:
        """Return the options after the courses taken so far. Raises `InputError` for invalid actions or courses."""
        if sequence not in self._found:
            at = self.pose_after(sequence)
            times = self.stages.times(len(sequence) + 1)
            # Many ways lead to the same pose, up to rounding; the options there are the same.
            key = _pose_key(at), len(times)
            if key not in self._at_poses:
                self._at_poses[key] = options_at(f"sensors[{self.sensor}].platform", self.platform, at, times)
            self._found[sequence] = self._at_poses[key]
        return self._found[sequence]

    def allowed(self, sequence: Sequence) -> Sequence:
        """Return the distinct courses that it may take after those taken so far, at least one."""
        if self.ahead is None:
            return tuple(range(len(self.options(sequence).courses)))
        key = self.pose_key(sequence), len(sequence)
        if key not in self._allowed:
            allowed_options, _ = self._open_after(sequence)
            if self.omits_dead_ends and len(allowed_options) > 1 and len(sequence) + 1 < self.stages.depth:
                blocked = [self._least_blocked((*sequence, course)) for course in allowed_options]
                allowed_options = tuple(
                    course for course, num in zip(allowed_options, blocked, strict=True) if num == min(blocked)
                )
            self._allowed[key] = allowed_options
        return self._allowed[key]

    def course(self, sequence: Sequence) -> tuple[Floats, Bools]:
        """Return poses (num_steps, pose_dim) at the pseudo-updates, and (num_steps,) whether it scans there.

        The pseudo-updates extend to the end of the last decision's horizon.
        """
        stages, options = self.stages, [(self.options(sequence[:k]), taken) for k, taken in enumerate(sequence)]
        num_steps = [stages.stride] * (len(options) - 1) + [stages.steps]
        parts = list(zip(options, num_steps, strict=True))
        poses = np.concatenate([own.courses[taken, :count] for (own, taken), count in parts])
        return poses, np.concatenate([own.scans[taken, :count] for (own, taken), count in parts])

    def price(self, sequence: Sequence, first: int) -> float:
        """Return the price of a sequence's actions, from decision `first` (from 0) on."""
        return sum(float(self.options(sequence[:k]).prices[sequence[k]]) for k in range(first, len(sequence)))

    def rows(self, sequence: Sequence) -> Floats:
        """Return (num_decisions, num_columns) the actions of a sequence."""
        options = [self.options(sequence[:k]) for k in range(len(sequence))]
        return np.array([own.actions.values[own.first_action(k)] for own, k in zip(options, sequence, strict=True)])

    def nearest(self, sequence: Sequence, among: Sequence) -> list[int]:
        """Return courses after those taken so far, ordered by how near their actions are to the last one taken.

        If nothing was taken yet, in their order.
        """
        if not sequence:
            return list(among)
        before, own = self.options(sequence[:-1]), self.options(sequence)
        last = before.actions.values[before.first_action(sequence[-1])]
        order = own.which[np.argsort(_apart(own.actions.columns, own.actions.values, last), kind="stable")]
        wanted = set(among)
        return [course for course in dict.fromkeys(order.tolist()) if course in wanted]

    def completed(self, sequence: Sequence) -> Sequence:
        """Return the sequence that repeats the last action, or the nearest one to it, until the end.

        If nothing was taken yet it begins with the first action.
        """
        while len(sequence) < self.stages.depth:
            sequence = (*sequence, self.nearest(sequence, self.allowed(sequence))[0])
        return sequence

    def count(self, limit: int) -> int:
        """Return the number of all sequences, or if there are more than `limit`, a number above that."""
        level: list[Sequence] = [()]
        for _ in range(self.stages.depth - 1):
            level = [(*taken, k) for taken in level for k in self.allowed(taken)]
            if len(level) > limit:
                return len(level)
        return sum(len(self.allowed(taken)) for taken in level)

    def all(self) -> Iterator[Sequence]:
        """Yield every sequence, the last decision's courses fastest."""
        level: list[Sequence] = [()]
        for _ in range(self.stages.depth):
            level = [(*taken, k) for taken in level for k in self.allowed(taken)]
        return iter(level)

    def blocked(self, sequence: Sequence) -> list[int]:
        """Return the decisions of a sequence except the first, counted from 1, at which no course is allowed."""
        return [k + 1 for k in range(1, len(sequence)) if not self._open_after(sequence[:k])[1]]

    def pose_key(self, sequence: Sequence) -> bytes:
        """Return a key that is equal for decisions at the same pose, where the options are the same."""
        if sequence not in self._spots:
            self._spots[sequence] = _pose_key(self.pose_after(sequence))
        return self._spots[sequence]

    def _moment(self, sequence: Sequence) -> tuple[bytes, int]:
        """Return a key that is equal where constraints allow the same courses."""
        assert self.ahead is not None
        return self.pose_key(sequence), self.ahead.moment(len(sequence) + 1)

    def _open_after(self, sequence: Sequence) -> tuple[Sequence, bool]:
        """Return the feasible courses, or those with the least violation, and whether they are feasible."""
        if not sequence or self.ahead is None:
            return tuple(np.flatnonzero(self.now).tolist()), True
        key = self._moment(sequence)
        if key not in self._open:
            allowed, met = self.ahead.courses(self.sensor, len(sequence) + 1, self.place(sequence))
            self._open[key] = tuple(np.flatnonzero(allowed).tolist()), met
        return self._open[key]

    def _least_blocked(self, sequence: Sequence) -> int:
        """Return the least number of decisions from here on at which no course is allowed."""
        if len(sequence) == self.stages.depth:
            return 0
        key = self.pose_key(sequence), len(sequence)
        if key not in self._blocked:
            if len(self._blocked) >= _MOST_PLACES:
                return 0
            self._blocked[key] = 0  # counted among the visited places from now on
            least_blocked, met = self._open_after(sequence)
            continuations = [(*sequence, course) for course in least_blocked]
            if len(sequence) + 1 < self.stages.depth:
                # One way out is enough; ways to visited places come first.
                continuations.sort(key=lambda continuation: self._moment(continuation) not in self._open)
            least = self.stages.depth
            for continuation in continuations:
                least = min(least, self._least_blocked(continuation))
                if least == 0:
                    break
            self._blocked[key] = least + (not met)
        return self._blocked[key]


def _pose_key(pose: Floats) -> bytes:
    """Return a key that is equal for poses that are the same up to rounding."""
    return (np.round(pose, _SAME_DIGITS) + 0.0).tobytes()  # -0 is 0


def _apart(columns: tuple[str, ...], values: Floats, last: Floats) -> Floats:
    """Return (num_actions,) the distance of actions from one action, angles modulo full turns."""
    off = values - last
    angles = [name.endswith("_deg") for name in columns]
    off[:, angles] = np.degrees(np.abs(wrap_angles(np.radians(off[:, angles]))))
    return np.asarray((off**2).sum(axis=1))
