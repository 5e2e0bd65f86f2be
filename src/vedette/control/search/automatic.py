"""The search that suits the number of sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.search.ascent import ascents, first_starts
from vedette.control.search.exhaustive import ExhaustiveSearch
from vedette.control.search.known import Known
from vedette.control.search.problem import JointProblem
from vedette.models.fields import Count, check_fields, part

# Beyond so many sensors, every joint action is more than a decision has time for.
_MAX_SENSORS = 3

# Restarts: so many at least. Where the bound leaves a larger share than this to be gained, as many as try some thousand
# courses in their first sweep: 27 of four sensors with nine courses each, 13 of eight. Of 560 problems of four and five
# sensors (`benchmarks/searches.py`) 2 found the best in 76 %, 8 in 90 %, 23 in 97 %, 31 in 99 %.
_NUM_RESTARTS, _LEAST_GAP, _FIRST_TRIES = 2, 0.01, 1000


@part("automatic", "search")
@dataclass(frozen=True, slots=True)
class AutomaticSearch:
    """Every joint action of up to three sensors; coordinate ascent with restarts for more.

    Two restarts, or up to 1000 over the number of all sensors' courses where the problem has a bound that leaves more
    than 1 % to be gained.

    Attributes:
        max_joint_actions: number above which two or three sensors are searched by coordinate ascent, too.

    Raises:
        InputError: a bound below 1.
    """

    max_joint_actions: Count = 1_000_000

    def __post_init__(self) -> None:
        check_fields(self)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """As the search that it is."""
        if len(problem.shape) <= _MAX_SENSORS and math.prod(problem.shape) <= self.max_joint_actions:
            return ExhaustiveSearch(self.max_joint_actions).search(problem, rng=rng)
        known = Known(problem)
        ascents(known, first_starts(known, _NUM_RESTARTS, rng=rng))
        more = _FIRST_TRIES // sum(problem.shape) - _NUM_RESTARTS
        if more > 0 and problem.bound is not None and _may_be_far(max(known.values.values()), problem.bound()):
            ascents(known, known.drawn(more, rng=rng))
        return known.best()


def _may_be_far(best: float, upper: float) -> bool:
    return upper - best > _LEAST_GAP * max(abs(upper), abs(best))
