"""What constraints say of a situation, put together as a mask."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from vedette.control.constraints.feasible import opened
from vedette.control.constraints.mask import Mask
from vedette.control.constraints.protocol import Constraint, Situation
from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats


def mask_of(constraints: Sequence[Constraint], situation: Situation) -> Mask:
    """The courses and pairs of courses that all constraints allow.

    A sensor for which none is left keeps all of its courses, and so do pairs of sensors that no joint action was found
    to keep apart (`opened`); the mask's notes say of whom.

    Raises:
        InputError: a constraint that needs beliefs where there are none, or an answer of another shape.
    """
    for constraint in constraints:
        if constraint.needs_beliefs and len(situation.beliefs) != len(situation.times):
            wanted = f"{len(situation.times)} predicted beliefs, one a time"
            raise InputError(f"constraint {constraint.name}: expected {wanted}; got {len(situation.beliefs)}")
    single = courses_allowed(constraints, situation)
    blocked = [s for s, own in enumerate(single) if not own.any()]
    for s in blocked:
        single[s][:] = True
    notes = tuple(
        f"sensor {s + 1}: no course meets its constraints ({names_of(constraints)}); it may take any" for s in blocked
    )
    return opened(Mask(single, pairs_allowed(constraints, situation), notes))[0]


def names_of(constraints: Sequence[Constraint]) -> str:
    """As notes name them."""
    return ", ".join(constraint.name for constraint in constraints)


def courses_allowed(constraints: Sequence[Constraint], situation: Situation) -> tuple[Bools, ...]:
    """(num_courses,) which courses of each sensor all constraints allow; perhaps none. Raises as `mask_of`."""
    shape = [len(own) for own in situation.courses]
    allowed = [np.ones(num, bool) for num in shape]
    for constraint in constraints:
        answer = constraint.courses(situation)
        if len(answer) != len(shape):
            raise InputError(
                f"constraint {constraint.name}: expected courses of {len(shape)} sensors; got {len(answer)}"
            )
        for s, own in enumerate(answer):
            allowed[s] &= _checked(constraint, own, (shape[s],))
    return tuple(allowed)


def pairs_allowed(constraints: Sequence[Constraint], situation: Situation) -> dict[tuple[int, int], Bools]:
    """(num_courses of i, of j) the tables of the pairs of sensors i < j of which something is forbidden.

    Sensors without courses are not asked about. Raises as `mask_of`.
    """
    gaps = _least_distances(situation)
    found: dict[tuple[int, int], Bools] = {}
    for constraint in constraints:
        for first, second in _near(gaps, getattr(constraint, "reach", math.inf)):
            answer = constraint.pairs(situation, first, second)
            if answer is not None:
                shape = (len(situation.courses[first]), len(situation.courses[second]))
                table = _checked(constraint, answer, shape) & found.get((first, second), True)
                if not table.all():
                    found[first, second] = table
    return dict(sorted(found.items()))


def _near(gaps: Floats, reach: float) -> Iterator[tuple[int, int]]:
    """Pairs of sensors that may come nearer to each other than `reach`."""
    return iter([(first, second) for first, second in np.argwhere(np.triu(gaps < reach, 1)).tolist()])


def _least_distances(situation: Situation) -> Floats:
    """(num_sensors, num_sensors) no more than the distance that sensors keep: of the circles around all their ways.

    inf: one of them has no courses.
    """
    ways = [situation.ways(s).reshape(-1, 2) for s in range(len(situation.courses))]
    centres, radii = np.zeros((len(ways), 2)), np.full(len(ways), -math.inf)
    for s, own in enumerate(ways):
        if len(own):
            centres[s] = (own.min(axis=0) + own.max(axis=0)) / 2.0
            radii[s] = np.sqrt(((own - centres[s]) ** 2).sum(axis=1).max())
    apart = np.sqrt(((centres[:, np.newaxis] - centres) ** 2).sum(axis=2))
    return np.asarray(apart - radii[:, np.newaxis] - radii)


def _checked(constraint: Constraint, answer: Any, shape: tuple[int, ...]) -> Bools:
    table = np.asarray(answer)
    if table.dtype != bool or table.shape != shape:
        got = f"{table.dtype} of shape {table.shape}"
        raise InputError(f"constraint {constraint.name}: expected booleans of shape {shape}; got {got}")
    return table
