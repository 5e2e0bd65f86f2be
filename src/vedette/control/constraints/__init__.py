"""What sensors must not do: which of their courses, and which pairs of courses, are allowed."""

from vedette.control.constraints.active import Active, MaxActive, active_of
from vedette.control.constraints.mask import Mask, opened, repaired
from vedette.control.constraints.masks import courses_allowed, mask_of, pairs_allowed, violated, without_course
from vedette.control.constraints.paths import Paths, VisibilityGraph, visibility_graph
from vedette.control.constraints.protocol import (
    Constraint,
    Situation,
    Timeless,
    WithMostActive,
    WithReach,
    WithViolations,
    WithZone,
    reach_of,
)
from vedette.control.constraints.regions import KeepOut, StayInside
from vedette.control.constraints.revisit import Revisit
from vedette.control.constraints.separation import Separation
from vedette.control.constraints.void import VoidProbability, void_probability

__all__ = [
    "Active",
    "Constraint",
    "KeepOut",
    "Mask",
    "MaxActive",
    "Paths",
    "Revisit",
    "Separation",
    "Situation",
    "StayInside",
    "Timeless",
    "VisibilityGraph",
    "VoidProbability",
    "WithMostActive",
    "WithReach",
    "WithViolations",
    "WithZone",
    "active_of",
    "courses_allowed",
    "mask_of",
    "opened",
    "pairs_allowed",
    "reach_of",
    "repaired",
    "violated",
    "visibility_graph",
    "void_probability",
    "without_course",
]
