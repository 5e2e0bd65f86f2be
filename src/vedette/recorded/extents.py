"""Places and extent of measurements in the plane, and rows of a recording far beyond all others."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from vedette.internal.quantities import PLACED, is_position
from vedette.kernels.base.types import Bools, Floats
from vedette.models.heights import PLACES_WITH_HEIGHT
from vedette.models.scan_rows import ScanLike, values_of
from vedette.models.turns import own_places

MARGIN = 0.05  # around an extent, as a share of its longer side
_LONELY = 0.9  # a value is far from all others if the third on its side is nearer than this share of its distance
_FEWEST, _FEWEST_TIMES = 20, 10  # rows and times of a recording; with fewer, no row counts as wild
_MOST_WILD = 50  # one row in this number may be wild on a side


def places_of(scan: ScanLike, pose: Floats, kind: str) -> Floats:
    """Return the (num, 2) places in m of a scan by a sensor at a pose, or none if the kind measures no places.

    Slant ranges without a height count as ranges in the plane.
    """
    if kind not in PLACED:
        return np.empty((0, 2))
    measured = values_of(scan)
    if is_position(kind):
        return measured[:, :2]
    if kind in PLACES_WITH_HEIGHT:
        return PLACES_WITH_HEIGHT[kind](measured, pose)[:, :2]
    bearings = measured[:, 0]
    away = measured[:, 1:2] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    return np.asarray(own_places(bearings, pose) + away)


def place_stds(kind: str, stds: Sequence[float] | Floats, scan: Floats) -> Floats:
    """Return the larger standard deviation of each measured place, shape (num,), m; empty if it measures no places."""
    if kind not in PLACED:
        return np.empty(0)
    if is_position(kind):
        return np.full(len(scan), max(stds[:2]))
    return np.asarray(np.maximum(stds[1], stds[0] * scan[:, 1]))


def box_of(places: Floats, share: float = MARGIN) -> Floats:
    """Return the (2, 2) lower left and upper right corners around places, with a share of the longer side around."""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = share * float((high - low).max())
    return np.array([low - margin, high + margin])


def is_within(places: Floats, box: Floats) -> Bools:
    """Return True for each place in a box, (num,)."""
    inside: Bools = ((places >= box[0]) & (places <= box[1])).all(axis=1)
    return inside


def beyond_reach(places: Floats, own: Floats, reaches: ArrayLike) -> Bools:
    """Return True for each place more than 5 % beyond the reach, m, of the sensors at `own`, (num, 2) or (2,)."""
    return np.asarray(np.hypot(*(places - own).T) > (1.0 + MARGIN) * np.asarray(reaches))


def wild(times: Floats, places: Floats, own: Floats, reaches: Floats) -> Bools:
    """Return True for each row of a recording beyond its sensor's reach or far beyond all others, (num,).

    On each side of the median an extent ends at the outermost value whose distance is at most 1 / 0.9 times that of two
    others that are not all at its place. At most one row in 50, and at least one, is left out of it on a side, and rows
    within 5 % of its longer side belong to it, too. One more row therefore moves a side of the extent by at most a
    ninth of its distance from the median, and so do rows at one place, up to one in 50. Rows within a known reach are
    not far beyond the others, and no row is if there are fewer than 20 rows or 10 times.

    Args:
        times: (num,) s.
        places: (num, 2) m, of the measurements.
        own: (num, 2) m, of the sensors at these times.
        reaches: (num,) m, inf if unknown.
    """
    beyond = beyond_reach(places, own, reaches)
    near = ~beyond
    if np.count_nonzero(near) < _FEWEST or len(np.unique(times)) < _FEWEST_TIMES:
        return beyond
    corners = np.concatenate([_extent(places[near]), _extent(own)])
    return np.asarray(beyond | (np.isinf(reaches) & ~is_within(places, box_of(corners))))


def _extent(places: Floats) -> Floats:
    """Return lower left and upper right corners of places without those far beyond all others, (2, 2)."""
    return np.array([[_end(places, axis, side) for axis in (0, 1)] for side in (-1.0, 1.0)])


def _end(places: Floats, axis: int, side: float) -> float:
    """Return the lower or upper end of places along an axis."""
    middle, max_outliers = float(np.median(places[:, axis])), max(len(places) // _MOST_WILD, 1)
    order = np.argsort(-side * places[:, axis], kind="stable")
    distances, i = side * (places[order, axis] - middle), 0
    while i < max_outliers:
        group = order[i:][distances[i:] >= _LONELY * distances[i]]
        apart = np.hypot(*(places[group] - places[order[i]]).T)
        inner = i + len(group)
        at_one_place = inner <= max_outliers and bool((apart <= (1.0 - _LONELY) * distances[i]).all())
        if at_one_place and distances[inner] < _LONELY * distances[inner - 1]:
            i = inner
        elif len(group) <= 2:
            i += 1
        else:
            break
    return middle + side * float(distances[i])
