"""The sequences of one sensor that its constraints allow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from vedette.control.lookahead.ahead import Ahead, Place
from vedette.control.lookahead.courses import CourseTree, Sequence, place_of
from vedette.kernels.base.types import Bools

# Places that are looked at, for the dead ends of one sensor. What lies beyond is taken to be open: a decision must not
# wait for the proof that there is no way out.
_MOST_PLACES = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class ConstrainedTree(CourseTree):
    """Sequences of allowed courses; dead ends are left out.

    Where no course is allowed, those that violate constraints least are kept. Of these those are kept after which there
    is the least number of further decisions with no course allowed: a beginning after which nothing is allowed is left
    out, unless that is so after all of them.

    Attributes:
        name, platform, pose, stages: as of `CourseTree`.
        ahead: the constraints.
        sensor: whose courses they are.
        now: (num_courses,) which courses are allowed at the first decision, at least one.
        far_sighted: whether dead ends are left out.
    """

    ahead: Ahead = field(kw_only=True)
    sensor: int = field(kw_only=True)
    now: Bools = field(kw_only=True)
    far_sighted: bool = field(kw_only=True, default=True)
    _places: dict[Sequence, bytes] = field(default_factory=dict)
    _allowed: dict[tuple[bytes, int], Sequence] = field(default_factory=dict)
    _open: dict[tuple[bytes, int], tuple[Sequence, bool]] = field(default_factory=dict)
    _blocked: dict[tuple[bytes, int], int] = field(default_factory=dict)

    @classmethod
    def of(cls, tree: CourseTree, ahead: Ahead, sensor: int, now: Bools) -> ConstrainedTree:
        """The tree without constraints, with some."""
        given = tree.name, tree.platform, tree.pose, tree.stages, tree._found, tree._at_poses
        return cls(*given, ahead=ahead, sensor=sensor, now=now)

    def allowed(self, taken: Sequence) -> Sequence:
        """Those that meet the constraints and lead to no dead end; at least one."""
        key = self.place(taken), len(taken)
        if key not in self._allowed:
            found, _ = self._open_after(taken)
            if self.far_sighted and len(found) > 1 and len(taken) + 1 < self.stages.depth:
                blocked = [self._least_blocked((*taken, course)) for course in found]
                found = tuple(course for course, num in zip(found, blocked, strict=True) if num == min(blocked))
            self._allowed[key] = found
        return self._allowed[key]

    def short_sighted(self) -> ConstrainedTree:
        """The same with its dead ends."""
        return replace(self, far_sighted=False, _allowed={})

    def blocked(self, sequence: Sequence) -> list[int]:
        """The decisions of a sequence but the first, counted from 1, at which no course is allowed."""
        return [k + 1 for k in range(1, len(sequence)) if not self._open_after(sequence[:k])[1]]

    def place(self, taken: Sequence) -> bytes:
        """What is equal where it decides at one place: there it may do the same."""
        if taken not in self._places:
            self._places[taken] = place_of(self.pose_after(taken))
        return self._places[taken]

    def _moment(self, taken: Sequence) -> tuple[bytes, int]:
        """What is equal where constraints allow the same."""
        return self.place(taken), self.ahead.moment(len(taken) + 1)

    def _open_after(self, taken: Sequence) -> tuple[Sequence, bool]:
        """The courses that meet the constraints, or violate them least; and whether they meet them."""
        if not taken:
            return tuple(np.flatnonzero(self.now).tolist()), True
        key = self._moment(taken)
        if key not in self._open:
            allowed, met = self.ahead.courses(self.sensor, len(taken) + 1, Place.after(self, taken))
            self._open[key] = tuple(np.flatnonzero(allowed).tolist()), met
        return self._open[key]

    def _least_blocked(self, taken: Sequence) -> int:
        """The least number of decisions from here on at which no course is allowed."""
        if len(taken) == self.stages.depth:
            return 0
        key = self.place(taken), len(taken)
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
