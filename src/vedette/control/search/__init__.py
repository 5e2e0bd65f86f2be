"""Searches over the joint actions of all sensors for the largest mean reward."""

from vedette.control.search.ascent import AutomaticSearch, CoordinateAscent
from vedette.control.search.cross_entropy import CrossEntropy
from vedette.control.search.greedy import SequentialGreedy
from vedette.control.search.problem import (
    ExhaustiveSearch,
    JointProblem,
    JointSearch,
    all_joint_actions,
    first_best,
    tie_tolerance,
)

__all__ = [
    "AutomaticSearch",
    "CoordinateAscent",
    "CrossEntropy",
    "ExhaustiveSearch",
    "JointProblem",
    "JointSearch",
    "SequentialGreedy",
    "all_joint_actions",
    "first_best",
    "tie_tolerance",
]
