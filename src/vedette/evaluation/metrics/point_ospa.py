"""Optimal sub-pattern assignment (OSPA) distance between sets of points, with its two parts.

D. Schuhmacher, B.-T. Vo and B.-N. Vo, "A Consistent Metric for Performance Evaluation of Multi-Object Filters",
IEEE Trans. Signal Processing 56(8), 2008: eq. (3) and (4) for the distance, section III-C for the parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.assignment import (
    assign,
    assign_points,
    check_parameters,
    combine,
    point_set,
    point_sets,
    power_mean,
)
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject
from vedette.simulation.truth import Truth

_COMPONENTS = {"position": slice(2), "state": slice(None)}
_DIMENSIONS_DIFFER = "position, as true states have {} components and estimated ones {}"


@dataclass(frozen=True, slots=True)
class OspaResult:
    """OSPA distance and its parts, in the unit of the points.

    For a finite order p, `localisation ** p + cardinality ** p == total ** p`. For an infinite order the total is the
    larger of the two.

    Attributes:
        total: the OSPA distance.
        localisation: part from the distances of matched points.
        cardinality: part from extra or missing points.
    """

    total: float
    localisation: float
    cardinality: float


def ospa(estimates: ArrayLike, truths: ArrayLike, *, cutoff: float, order: float) -> OspaResult:
    """Return the OSPA distance between two finite sets of points, by exact assignment.

    Args:
        estimates: (num_estimates, point_dim).
        truths: (num_truths, point_dim).
        cutoff: distance c > 0 at which a matched pair counts as missed, also the cost of an extra or missing point.
            May be infinite: then the distance between sets of unequal size is infinite.
        order: exponent p >= 1, which may be infinite.

    Two empty sets are at distance 0, and an empty and a non-empty set at `cutoff`.
    Raises `InputError` for points that are not finite or of unequal dimension, or a cutoff or order out of range.
    """
    check_parameters(cutoff, order)
    first, second = point_sets(estimates, truths)
    return _ospa_of_points(first, second, cutoff, order)


def ospa_of_run(
    truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float, components: ArrayLike = "position"
) -> Floats:
    """Return the OSPA of the estimates at every scan of a run.

    Args:
        truth: the targets at every scan.
        estimates: one per scan.
        cutoff: c > 0, m, without a unit for full states.
        order: p >= 1.
        components: "position", the distance in the plane; "state", the Euclidean distance over all components, ignoring
            the units m, m/s and rad/s; or places in states, such as [0, 1, 4] for the distance in space.

    Returns (num_scans, 3): total, localisation and cardinality parts, m, without a unit for full states.
    Raises `InputError` as `ospa` does, for other components, and unless there is one estimate per scan.
    """
    check_parameters(cutoff, order)
    check_scans(truth, estimates)
    if isinstance(components, str) and components not in _COMPONENTS:
        raise reject("components", "position, state or places in states", components)
    counted = _COMPONENTS[components] if isinstance(components, str) else np.asarray(components)
    parts = np.empty((len(estimates), 3))
    for scan, estimate in enumerate(estimates):
        _, states = truth.at(scan)
        for points in (estimate.means, states):
            if isinstance(counted, np.ndarray) and points.shape[1] <= counted.max():
                raise reject("components", f"position, as states have {points.shape[1]} components", components)
        estimated, true = estimate.means[:, counted], states[:, counted]
        if len(estimated) and len(true) and estimated.shape[1] != true.shape[1]:
            raise reject("components", _DIMENSIONS_DIFFER.format(true.shape[1], estimated.shape[1]), components)
        result = _ospa_of_points(
            point_set(estimated, f"estimates[{scan}]"), point_set(true, f"truth at scan {scan}"), cutoff, order
        )
        parts[scan] = result.total, result.localisation, result.cardinality
    return parts


def check_scans(truth: Truth, estimates: Sequence[Estimate]) -> None:
    """Raise `InputError` unless there is one estimate per scan."""
    if len(estimates) != truth.num_scans:
        raise InputError(f"estimates: expected one for each of {truth.num_scans} scans; got {len(estimates)}")


def ospa_of_distances(distances: Floats, cutoff: float, order: float) -> OspaResult:
    """Return the OSPA of two sets from the distances between their elements.

    Args:
        distances: (num_first, num_second), none above the cutoff. Either number may be 0.
        cutoff: c > 0, in the unit of the distances.
        order: exponent p >= 1.
    """
    return _ospa_of_pairs(distances[assign(distances, order)], distances.shape, cutoff, order)


def _ospa_of_points(first: Floats, second: Floats, cutoff: float, order: float) -> OspaResult:
    _, _, distances = assign_points(first, second, cutoff, order)
    beyond = np.full(min(len(first), len(second)) - len(distances), cutoff)
    return _ospa_of_pairs(np.concatenate([distances, beyond]), (len(first), len(second)), cutoff, order)


def _ospa_of_pairs(distances: Floats, numbers: tuple[int, ...], cutoff: float, order: float) -> OspaResult:
    """Return the OSPA from the distances of the matched pairs, (min(numbers),), of sets with these sizes."""
    smaller, larger = sorted(numbers)
    if larger == 0:
        return OspaResult(0.0, 0.0, 0.0)
    localisation = power_mean(distances, larger, order)
    # For an infinite order, the root of the share is 1.
    cardinality = cutoff * ((larger - smaller) / larger) ** (1.0 / order) if larger > smaller else 0.0
    return OspaResult(combine(localisation, cardinality, order), localisation, cardinality)
