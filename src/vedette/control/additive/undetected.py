"""What a decision is worth for targets that were not found yet: the expected number that its scans find."""

from __future__ import annotations

import numpy as np

from vedette.control.additive.situation import SensorGroup, Start
from vedette.control.additive.table import LEAST_DETECTION, places_of_courses
from vedette.densities import UndetectedIntensity
from vedette.densities.checks import offsets_of
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.kernels.planning.cells import cells_in_view

# No cell is searched so well that nothing can be left in it.
_LEAST_LOG_MISS = float(np.log(1e-12))


def no_cells(num_courses: int) -> Cells:
    """Nothing to be found."""
    none = np.empty(0)
    return Cells(np.zeros(num_courses + 1, np.int64), np.empty(0, np.int64), none, none)


def cells_of(start: Start, undetected: UndetectedIntensity, worth: float, first_courses: Ints, state_dim: int) -> Cells:
    """The cells that each course sees, of a grid of targets not found yet that are taken to stay where they are.

    worth: of finding a target, in units of the reward. first_courses: (num_sensors + 1,) of each sensor.
    Raises `ModelError` as the sensors.
    """
    num_courses = int(first_courses[-1])
    found: list[tuple[Ints, Floats]] = [(np.empty(0, np.int64), np.empty(0))] * num_courses
    states, weights = undetected.grid.states(state_dim), undetected.grid.node_weights()
    with model_errors():
        for group in start.groups:
            offsets, cells, log_miss = _view(group, states, weights)
            for i, course in enumerate(places_of_courses(group, first_courses).tolist()):
                own = slice(offsets[i], offsets[i + 1])
                found[course] = (cells[own], np.maximum(log_miss[own], _LEAST_LOG_MISS))
    return Cells(
        offsets_of([len(cells) for cells, _ in found]),
        np.concatenate([np.empty(0, np.int64), *(cells for cells, _ in found)]),
        np.concatenate([np.empty(0), *(log_miss for _, log_miss in found)]),
        worth * undetected.expected,
    )


def _view(group: SensorGroup, states: Floats, weights: Floats) -> tuple[Ints, Ints, Floats]:
    decision, horizon = group.decision, group.decision.horizon
    poses = np.ascontiguousarray(horizon.poses[:, horizon.scans])
    found: tuple[Ints, Ints, Floats] = cells_in_view(
        decision.sensor, poses, states, weights, LEAST_DETECTION, group.reach
    )
    return found
