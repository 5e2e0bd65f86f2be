"""What constraints say of a situation, put together as a mask."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
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
    single, notes = _single(constraints, situation)
    return opened(Mask(single, _together(constraints, situation), notes))[0]


def _single(constraints: Sequence[Constraint], situation: Situation) -> tuple[tuple[Bools, ...], tuple[str, ...]]:
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
    names = ", ".join(constraint.name for constraint in constraints)
    blocked = [s for s, own in enumerate(allowed) if not own.any()]
    for s in blocked:
        allowed[s][:] = True
    notes = (f"sensor {s + 1}: no course meets its constraints ({names}); it may take any" for s in blocked)
    return tuple(allowed), tuple(notes)


def _together(constraints: Sequence[Constraint], situation: Situation) -> dict[tuple[int, int], Bools]:
    """The tables of the pairs of sensors of which something is forbidden."""
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
    if math.isinf(reach):
        return combinations(range(len(gaps)), 2)
    return iter([(first, second) for first, second in np.argwhere(np.triu(gaps < reach, 1)).tolist()])


def _least_distances(situation: Situation) -> Floats:
    """(num_sensors, num_sensors) no more than the distance that sensors keep: of the circles around all their ways."""
    ways = [situation.ways(s).reshape(-1, 2) for s in range(len(situation.courses))]
    centres = np.array([(own.min(axis=0) + own.max(axis=0)) / 2.0 for own in ways]).reshape(-1, 2)
    radii = np.array(
        [np.sqrt(((own - centre) ** 2).sum(axis=1).max()) for own, centre in zip(ways, centres, strict=True)]
    )
    apart = np.sqrt(((centres[:, np.newaxis] - centres) ** 2).sum(axis=2))
    return np.asarray(apart - radii[:, np.newaxis] - radii)


def _checked(constraint: Constraint, answer: Any, shape: tuple[int, ...]) -> Bools:
    table = np.asarray(answer)
    if table.dtype != bool or table.shape != shape:
        got = f"{table.dtype} of shape {table.shape}"
        raise InputError(f"constraint {constraint.name}: expected booleans of shape {shape}; got {got}")
    return table
