"""Optimal sub-pattern assignment (OSPA) distance between sets of points, with its two parts.

D. Schuhmacher, B.-T. Vo and B.-N. Vo, "A Consistent Metric for Performance Evaluation of Multi-Object Filters",
IEEE Trans. Signal Processing 56(8), 2008: eq. (3) and (4) for the distance, section III-C for the parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.kernels.types import Bools, Floats
from vedette.simulation.truth import Truth

_HIGH_ORDER = 30.0


@dataclass(frozen=True, slots=True)
class OspaResult:
    """OSPA distance and its parts, in the unit of the points.

    For a finite order p, `localisation ** p + cardinality ** p == total ** p`; for an infinite order the total is the
    larger of the two.

    Attributes:
        total: the OSPA distance.
        localisation: the part that comes from matched points that lie apart.
        cardinality: the part that comes from points too many or too few.
    """

    total: float
    localisation: float
    cardinality: float


def ospa(estimates: ArrayLike, truths: ArrayLike, *, cutoff: float, order: float) -> OspaResult:
    """OSPA distance between two finite sets of points, by exact assignment.

    Args:
        estimates: (num_estimates, point_dim).
        truths: (num_truths, point_dim).
        cutoff: distance c > 0 at which a matched pair counts as missed; also the price of a point too many or too few.
            May be infinite: then sets of unequal size are infinitely far apart.
        order: exponent p >= 1; may be infinite.

    Two empty sets are at distance 0; an empty and a non-empty set at `cutoff`.
    Raises `InputError` for points that are not finite or of unequal dimension, or a cutoff or order out of range.
    """
    _check_parameters(cutoff, order)
    first, second = _points(estimates, "estimates"), _points(truths, "truths")
    if first.size and second.size and first.shape[1] != second.shape[1]:
        raise InputError(
            f"estimates, truths: expected points of equal dimension; got {first.shape[1]} and {second.shape[1]}"
        )
    return _ospa(first, second, cutoff, order)


def ospa_of_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float) -> Floats:
    """OSPA of the estimated positions at every scan of a run.

    Returns (num_scans, 3): total, localisation and cardinality parts, m.
    Raises `InputError` as `ospa` does, and if there is not one estimate a scan.
    """
    _check_parameters(cutoff, order)
    if len(estimates) != truth.num_scans:
        raise InputError(f"estimates: expected one for each of {truth.num_scans} scans; got {len(estimates)}")
    parts = np.empty((len(estimates), 3))
    for scan, estimate in enumerate(estimates):
        _, states = truth.at(scan)
        found = _points(estimate.means[:, :2], f"estimates[{scan}]")
        result = _ospa(found, _points(states[:, :2], f"truth at scan {scan}"), cutoff, order)
        parts[scan] = result.total, result.localisation, result.cardinality
    return parts


def _check_parameters(cutoff: float, order: float) -> None:
    if not cutoff > 0.0:
        raise InputError(f"cutoff: expected a distance above 0; got {cutoff}")
    if not order >= 1.0:
        raise InputError(f"order: expected a number of at least 1; got {order}")


def _points(values: ArrayLike, name: str) -> Floats:
    try:
        points = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected an array of points; got {values!r}") from error
    if points.size == 0:
        return points.reshape(0, points.shape[1] if points.ndim == 2 else 0)
    if points.ndim != 2:
        raise InputError(f"{name}: expected shape (number, dimension); got {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"{name}: expected finite coordinates; got {points[~np.isfinite(points)][0]}")
    return points


def _ospa(first: Floats, second: Floats, cutoff: float, order: float) -> OspaResult:
    smaller, larger = sorted((len(first), len(second)))
    if larger == 0:
        return OspaResult(0.0, 0.0, 0.0)
    localisation = _localisation(first, second, cutoff, order) if smaller else 0.0
    cardinality = _share_root(larger - smaller, larger, order) * cutoff if larger > smaller else 0.0
    return OspaResult(_combine(localisation, cardinality, order), localisation, cardinality)


def _localisation(first: Floats, second: Floats, cutoff: float, order: float) -> float:
    distances = np.minimum(np.sqrt(((first[:, None, :] - second[None, :, :]) ** 2).sum(axis=2)), cutoff)
    if math.isinf(order):
        return _bottleneck(distances)
    # Powers of ratios: powers of metres overflow, or all vanish, at a high order. There the ratio must be to what the
    # best assignment cannot avoid, for beside a larger distance everything that matters would vanish too.
    scale = float(distances.max()) if order <= _HIGH_ORDER else _bottleneck(distances)
    if scale == 0.0:
        return 0.0
    with np.errstate(over="ignore", under="ignore"):  # an infinite cost only says: never this pair
        costs = (distances / scale) ** order
    matched = costs[linear_sum_assignment(costs)].sum()
    return float(scale * (matched / max(distances.shape)) ** (1.0 / order))


def _bottleneck(distances: Floats) -> float:
    """The least bound under which every point of the smaller set has a partner of its own."""
    candidates = np.unique(distances)
    low, high = 0, len(candidates) - 1
    while low < high:
        middle = (low + high) // 2
        if _is_matchable(distances <= candidates[middle]):
            high = middle
        else:
            low = middle + 1
    return float(candidates[low])


def _is_matchable(allowed: Bools) -> bool:
    return bool(allowed[linear_sum_assignment(~allowed)].all())


def _share_root(part: int, whole: int, order: float) -> float:
    return float((part / whole) ** (1.0 / order))  # an infinite order gives 1


def _combine(localisation: float, cardinality: float, order: float) -> float:
    larger = max(localisation, cardinality)
    if larger == 0.0 or math.isinf(larger) or math.isinf(order):
        return larger
    return float(larger * ((localisation / larger) ** order + (cardinality / larger) ** order) ** (1.0 / order))
