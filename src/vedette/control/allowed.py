"""What the sensors may do at a decision, as constraints say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.constraints import Constraint, Mask, Situation, mask_of
from vedette.control.priors import predicted
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Labelled
from vedette.filters import shared_targets
from vedette.kernels.base.types import Floats
from vedette.kernels.planning.ascent import Allowed
from vedette.models.arguments import reject
from vedette.platforms import Options

# A table of which courses go together is formed for so many courses at most; beyond, searches ask the mask.
_MOST_COURSES = 20_000


def mask_of_decision(
    constraints: Sequence[Constraint],
    sensors: Sequence[MobileSensor],
    options: Sequence[Options],
    fused: Any,
    poses: Floats,
    settings: PlanningSettings,
) -> Mask | None:
    """What constraints allow; None where there are none.

    fused: the fused belief now, of which constraints may ask where targets will be.
    Raises `InputError` as `mask_of`.
    """
    if not constraints:
        return None
    beliefs = beliefs_ahead(constraints, sensors, fused, settings, 1, settings.horizon_steps)
    situation = Situation(tuple(own.courses for own in options), settings.horizon_times(), beliefs, poses)
    return mask_of(constraints, situation)


def beliefs_ahead(
    constraints: Sequence[Constraint],
    sensors: Sequence[MobileSensor],
    fused: Any,
    settings: PlanningSettings,
    first: int,
    last: int,
) -> tuple[Labelled, ...]:
    """The fused belief predicted by `first` to `last` steps of the horizon; none where no constraint looks at it.

    Raises `InputError` for one without labels.
    """
    asking = [constraint.name for constraint in constraints if constraint.needs_beliefs]
    if fused is None or not asking:
        return ()
    if not isinstance(fused, Labelled):
        expected = f"a density with labels, as the constraint {asking[0]} asks where targets will be"
        raise reject("state.fused", expected, type(fused).__name__)
    motion = shared_targets([sensor.filter for sensor in sensors]).motion
    return tuple(predicted(fused, motion, step, settings.horizon_period) for step in range(first, last + 1))


def single_mask(mask: Mask | None, sensor: int, num_courses: int) -> np.ndarray:
    """(num_courses,) what one sensor may do, whatever the others do."""
    return np.ones(num_courses, np.bool_) if mask is None else mask.single[sensor]


def allowed_of(mask: Mask | None, shape: Sequence[int]) -> Allowed | None:
    """The mask as the compiled ascent takes it; None where it would be too large."""
    none, num = np.ones((0, 0), np.bool_), sum(shape)
    if mask is None:
        return Allowed(np.ones(num, np.bool_), none)
    single = np.concatenate(mask.single)
    if not mask.together:
        return Allowed(single, none)
    if num > _MOST_COURSES:
        return None
    together, firsts = np.ones((num, num), np.bool_), np.concatenate([[0], np.cumsum(shape)])
    for (i, j), table in mask.together.items():
        rows, columns = slice(firsts[i], firsts[i + 1]), slice(firsts[j], firsts[j + 1])
        together[rows, columns], together[columns, rows] = table, table.T
    return Allowed(single, together)
