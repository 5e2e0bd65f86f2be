"""One sensor at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.control.search.known import Joint, Known
from vedette.control.search.problem import JointProblem
from vedette.models.fields import Repeats, check_fields, part


@part("coordinate_ascent", "search")
@dataclass(frozen=True, slots=True)
class CoordinateAscent:
    """One sensor at a time, the others held, until no sensor alone can do better; for many sensors.

    The first ascent starts at the independent decision, so that its end is never worse than that. The end is a local
    maximum: no change of one sensor's action improves it, a change of two might. No joint action is evaluated twice.

    With a mask it goes from one allowed joint action to another. A start that is not allowed is first moved to one near
    it that is; where none is, the mask is opened (`vedette.control.constraints.opened`).

    Attributes:
        num_restarts: ascents from random joint actions, after that from the independent decision.

    Raises:
        InputError: a number below 0.
    """

    num_restarts: Repeats = 2

    def __post_init__(self) -> None:
        check_fields(self)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all ascents; of equal ones that were evaluated the first in printed order."""
        known = Known(problem)
        ascents(known, first_starts(known, self.num_restarts, rng=rng))
        return known.best()


def first_starts(known: Known, num_restarts: int, *, rng: np.random.Generator) -> list[Joint]:
    """The independent decision, and joint actions drawn at random."""
    return [known.allowed(known.problem.independent()), *known.drawn(num_restarts, rng=rng)]


def ascents(known: Known, starts: Sequence[Joint]) -> list[Joint]:
    """The ends of ascents, which are known then, and so is the first start."""
    climb = known.problem.ascend
    ends = [_ascend(known, start) if climb is None else known.allowed(climb(start)) for start in starts]
    known.rewards([starts[0], *ends])
    return ends


def _ascend(known: Known, start: Joint) -> Joint:
    """One ascent. Along a line the first of the largest is taken, to the last digit, so that none goes in circles."""
    at, settled, sensor, num_sensors = start, 0, 0, len(start)
    while settled < num_sensors:
        line = known.line(at, sensor)
        best = max(line, key=known.values.__getitem__)
        settled = settled + 1 if best == at else 1
        at, sensor = best, (sensor + 1) % num_sensors
    return at
