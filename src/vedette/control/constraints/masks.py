"""The mask of feasible joint actions from the answers of several constraints."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.constraints.active import active_of
from vedette.control.constraints.mask import Mask, relaxed
from vedette.control.constraints.protocol import (
    Constraint,
    ConstraintContext,
    QuantifiedConstraint,
    interaction_range_of,
)
from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import provides

# Violations are equal if they differ by at most this, relative to the smallest or to 1.
_SAME = 1e-9


def feasible_action_mask(constraints: Sequence[Constraint], situation: ConstraintContext) -> Mask:
    """Return the courses and pairs of courses that all constraints allow.

    A sensor without a feasible course keeps the courses with the least violation. Pairs of sensors that no joint action
    was found to satisfy keep all courses (`relaxed`). The mask's notes name the sensors.

    Raises:
        InputError: a constraint that needs beliefs when there are none, or an answer of the wrong shape.
    """
    for constraint in constraints:
        if constraint.needs_beliefs and len(situation.beliefs) != len(situation.times):
            expected = f"{len(situation.times)} predicted beliefs, one a time"
            raise InputError(f"constraint {constraint.name}: expected {expected}; got {len(situation.beliefs)}")
    single, blocked = courses_allowed(constraints, situation)
    notes = tuple(f"sensor {s + 1}: {infeasible_note(constraints)}" for s in blocked)
    active = active_of(constraints, situation.courses, situation.scans)
    return relaxed(Mask(single, pairs_allowed(constraints, situation), notes, active))[0]


def infeasible_note(constraints: Sequence[Constraint]) -> str:
    """Return the note on a sensor that has no feasible course."""
    names = ", ".join(constraint.name for constraint in constraints)
    return f"no course meets its constraints ({names}); it may take those that violate them least"


def courses_allowed(
    constraints: Sequence[Constraint], situation: ConstraintContext
) -> tuple[tuple[Bools, ...], tuple[int, ...]]:
    """Return (num_courses,) the allowed courses of each sensor, and the sensors without a feasible course.

    The latter may take the courses with the least violation. Raises as `feasible_action_mask`.
    """
    shape = [len(own) for own in situation.courses]
    answers = [_answers(constraint, situation) for constraint in constraints]
    every = [np.ones(num, bool) for num in shape]
    allowed = [np.logical_and.reduce(own) for own in zip(every, *answers, strict=True)]
    blocked = tuple(s for s, own in enumerate(allowed) if len(own) and not own.any())
    if blocked:
        total = [np.zeros(num) for num in shape]
        for constraint, own in zip(constraints, answers, strict=True):
            for s, violations in enumerate(_violations(constraint, situation, own)):
                total[s] += violations
        for s in blocked:
            least = float(total[s].min())
            allowed[s] = total[s] <= least + _SAME * max(least, 1.0)
    return tuple(allowed), blocked


def violation_notes(constraints: Sequence[Constraint], situation: ConstraintContext) -> tuple[str, ...]:
    """Return notes of a plan on the constraints that each sensor's only course violates.

    Raises as `feasible_action_mask`.
    """
    notes = []
    for constraint in constraints:
        single, pairs = _answers(constraint, situation), pairs_allowed([constraint], situation)
        notes += [
            f"sensor {s + 1}: its course violates {constraint.name}" for s, own in enumerate(single) if not own[0]
        ]
        notes += [f"sensors {i + 1} and {j + 1}: their courses violate {constraint.name}" for i, j in pairs]
    active = active_of(constraints, situation.courses, situation.scans)
    if active is not None and (excess := int(active.excess(np.zeros((1, len(situation.courses)), np.int64))[0])):
        notes.append(f"{active.limit + excess} sensors scan; expected at most {active.limit}")
    return tuple(notes)


def _answers(constraint: Constraint, situation: ConstraintContext) -> list[Bools]:
    """Return (num_courses,) the courses of each sensor that a constraint allows."""
    answer, num = constraint.courses(situation), len(situation.courses)
    if len(answer) != num:
        raise InputError(f"constraint {constraint.name}: expected courses of {num} sensors; got {len(answer)}")
    return [_checked(constraint, own, (len(each),)) for own, each in zip(answer, situation.courses, strict=True)]


def _violations(constraint: Constraint, situation: ConstraintContext, answers: Sequence[Bools]) -> Sequence[Floats]:
    """Return (num_courses,) the violation of each course, or 1 for a forbidden course if the amount is not given."""
    if not provides(constraint, QuantifiedConstraint):
        return [np.asarray(~own, np.float64) for own in answers]
    given = [np.asarray(own, np.float64) for own in constraint.violations(situation)]
    for s, own in enumerate(answers):
        fits = s < len(given) and given[s].shape == own.shape
        if not fits or not (np.isfinite(given[s]).all() and ((given[s] > 0.0) == ~own).all()):
            expected = f"{len(own)} numbers of sensor {s + 1}, above 0 where a course is not allowed and else 0"
            got = given[s].tolist() if s < len(given) else "none"
            raise InputError(f"constraint {constraint.name}: expected violations of {expected}; got {got}")
    return given


def pairs_allowed(constraints: Sequence[Constraint], situation: ConstraintContext) -> dict[tuple[int, int], Bools]:
    """Return tables (num_courses of i, of j) for the pairs of sensors i < j with forbidden pairs of courses.

    Constraints are not evaluated for sensors without courses. Raises as `feasible_action_mask`.
    """
    gaps = _least_distances(situation)
    allowed_pairs: dict[tuple[int, int], Bools] = {}
    for constraint in constraints:
        for first, second in np.argwhere(np.triu(gaps < interaction_range_of(constraint), 1)).tolist():
            answer = constraint.pairs(situation, first, second)
            if answer is not None:
                shape = (len(situation.courses[first]), len(situation.courses[second]))
                table = _checked(constraint, answer, shape) & allowed_pairs.get((first, second), True)
                if not table.all():
                    allowed_pairs[first, second] = table
    return dict(sorted(allowed_pairs.items()))


def _least_distances(situation: ConstraintContext) -> Floats:
    """Return lower bounds (num_sensors, num_sensors) on the distances between sensors, from circles around their paths.

    inf: one of them has no courses.
    """
    paths = [situation.ways(s).reshape(-1, 2) for s in range(len(situation.courses))]
    centres, radii = np.zeros((len(paths), 2)), np.full(len(paths), -math.inf)
    for s, path in enumerate(paths):
        if len(path):
            centres[s] = (path.min(axis=0) + path.max(axis=0)) / 2.0
            radii[s] = np.sqrt(((path - centres[s]) ** 2).sum(axis=1).max())
    apart = np.sqrt(((centres[:, np.newaxis] - centres) ** 2).sum(axis=2))
    return np.asarray(apart - radii[:, np.newaxis] - radii)


def _checked(constraint: Constraint, answer: Any, shape: tuple[int, ...]) -> Bools:
    table = np.asarray(answer)
    if table.dtype != bool or table.shape != shape:
        got = f"{table.dtype} of shape {table.shape}"
        raise InputError(f"constraint {constraint.name}: expected booleans of shape {shape}; got {got}")
    return table
