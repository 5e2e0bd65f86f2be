"""Constraints on sensors: which of their courses, and which pairs of courses, are allowed."""

from vedette.control.constraints.active import Active, MaxActive, active_of
from vedette.control.constraints.mask import Mask, nearest_feasible, relaxed
from vedette.control.constraints.masks import (
    courses_allowed,
    feasible_action_mask,
    infeasible_note,
    pairs_allowed,
    violation_notes,
)
from vedette.control.constraints.paths import Paths, VisibilityGraph, visibility_graph
from vedette.control.constraints.protocol import (
    ActivationConstraint,
    Constraint,
    ConstraintContext,
    QuantifiedConstraint,
    RangeLimitedConstraint,
    TimeInvariantConstraint,
    ZoneConstraint,
    interaction_range_of,
)
from vedette.control.constraints.regions import KeepOut, StayInside
from vedette.control.constraints.revisit import Revisit
from vedette.control.constraints.separation import Separation
from vedette.control.constraints.void import VoidProbability, void_probability

__all__ = [
    "ActivationConstraint",
    "Active",
    "Constraint",
    "ConstraintContext",
    "KeepOut",
    "Mask",
    "MaxActive",
    "Paths",
    "QuantifiedConstraint",
    "RangeLimitedConstraint",
    "Revisit",
    "Separation",
    "StayInside",
    "TimeInvariantConstraint",
    "VisibilityGraph",
    "VoidProbability",
    "ZoneConstraint",
    "active_of",
    "courses_allowed",
    "feasible_action_mask",
    "infeasible_note",
    "interaction_range_of",
    "nearest_feasible",
    "pairs_allowed",
    "relaxed",
    "violation_notes",
    "visibility_graph",
    "void_probability",
]
