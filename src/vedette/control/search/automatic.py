"""The search that suits the number of sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.search.ascent import CoordinateAscent
from vedette.control.search.exhaustive import ExhaustiveSearch
from vedette.control.search.problem import JointProblem
from vedette.models.arguments import dimension

# Beyond so many sensors, every joint action is more than a decision has time for.
_MAX_SENSORS = 3


@dataclass(frozen=True, slots=True)
class AutomaticSearch:
    """Every joint action of up to three sensors; coordinate ascent with two restarts for more.

    Attributes:
        max_joint_actions: above which two or three sensors are searched by coordinate ascent, too.

    Raises:
        InputError: a bound below 1.
    """

    max_joint_actions: int = 1_000_000

    def __post_init__(self) -> None:
        dimension("max_joint_actions", self.max_joint_actions)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """As the search that it is."""
        few = len(problem.shape) <= _MAX_SENSORS and math.prod(problem.shape) <= self.max_joint_actions
        search = ExhaustiveSearch(self.max_joint_actions) if few else CoordinateAscent()
        return search.search(problem, rng=rng)
