"""Generalised optimal sub-pattern assignment (GOSPA) distance between sets of points, with its three parts.

A. S. Rahmathullah, A. F. Garcia-Fernandez and L. Svensson, "Generalized optimal sub-pattern assignment metric",
20th Int. Conf. on Information Fusion, 2017: Definition 1 for the distance, Proposition 1 for the parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.assignment import (
    assign,
    check_parameters,
    combine,
    cut_distances,
    point_sets,
    power_mean,
)
from vedette.evaluation.metrics.matching import Matching, match_run, sum_by_scan
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class GospaResult:
    """GOSPA distance with alpha = 2, and its costs.

    The costs are p-th powers and add up: `localisation + missed + false == total ** p`. (If c ** p exceeds the range of
    a float, the costs are infinite. The total is still correct.)

    Attributes:
        total: the distance, in the unit of the points.
        localisation: sum of distance ** p over the matched pairs.
        missed: c ** p / 2 for each true point without a partner.
        false: c ** p / 2 for each estimated point without a partner.
        num_missed: number of true points without a partner closer than c.
        num_false: number of estimated points without a partner closer than c.
    """

    total: float
    localisation: float
    missed: float
    false: float
    num_missed: int
    num_false: int


@dataclass(frozen=True, slots=True, eq=False)
class GospaSeries:
    """GOSPA at each scan: (num_scans,) arrays, each as in `GospaResult`, with total in m, costs in m ** p."""

    total: Floats
    localisation: Floats
    missed: Floats
    false: Floats
    num_missed: Ints
    num_false: Ints


def gospa(estimates: ArrayLike, truths: ArrayLike, *, cutoff: float, order: float) -> GospaResult:
    """Return the GOSPA distance with alpha = 2, with its costs of localisation, missed and false points.

    Only alpha = 2 has these parts: only then do two unmatched points cost as much as a pair at the cutoff, so that
    every point is either matched or not (Proposition 1). For another alpha, use `gospa_distance`.

    Args:
        estimates: (num_estimates, point_dim).
        truths: (num_truths, point_dim).
        cutoff: c > 0, finite. A pair at this distance or more counts as a missed and a false point.
        order: p >= 1, finite.

    Raises `InputError` for points that are not finite or of unequal dimension, or a cutoff or order out of range.
    """
    check_parameters(cutoff, order, finite=True)
    first, second = point_sets(estimates, truths)
    distances = cut_distances(first, second, cutoff)
    matched = distances[assign(distances, order)]
    matched = matched[matched < cutoff]
    missed, false = (np.array([len(points) - len(matched)]) for points in (second, first))
    series = _series(np.zeros(len(matched), np.int64), matched, missed, false, cutoff, order)
    return GospaResult(*(getattr(series, each.name)[0].item() for each in fields(series)))


def gospa_distance(
    estimates: ArrayLike, truths: ArrayLike, *, cutoff: float, order: float, alpha: float = 2.0
) -> float:
    """Return the GOSPA distance for any alpha in (0, 2]: an extra or missing point costs c ** p / alpha.

    With alpha = 1 it is the OSPA distance without its division by the size of the larger set.
    Arguments and errors as in `gospa`.
    """
    check_parameters(cutoff, order, finite=True)
    if not 0.0 < alpha <= 2.0:
        raise InputError(f"alpha: expected a number above 0, at most 2; got {alpha}")
    first, second = point_sets(estimates, truths)
    distances = cut_distances(first, second, cutoff)
    localisation = power_mean(distances[assign(distances, order)], 1.0, order)
    surplus = abs(len(first) - len(second))
    return combine(localisation, cutoff * (surplus / alpha) ** (1.0 / order), order)


def gospa_of_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float) -> GospaSeries:
    """Return the GOSPA (alpha = 2) of the positions at every scan of a run. Raises `InputError` as `match_run`."""
    return gospa_of_matching(match_run(truth, estimates, cutoff=cutoff, order=order), cutoff, order)


def gospa_of_matching(matching: Matching, cutoff: float, order: float) -> GospaSeries:
    """Return the GOSPA (alpha = 2) at every scan, from a matching with the same cutoff and order."""
    return _series(matching.scans, matching.distances, matching.num_missed, matching.num_false, cutoff, order)


def _series(
    scans: Ints, distances: Floats, num_missed: Ints, num_false: Ints, cutoff: float, order: float
) -> GospaSeries:
    """Return the series from the distances of the matched pairs and their scans."""
    num_scans, unmatched = len(num_missed), num_missed + num_false
    # Ratios to the largest relevant distance, because a sum of powers of metres would overflow at high orders.
    scale = np.where(unmatched > 0, cutoff, 0.0)
    np.maximum.at(scale, scans, distances)
    ratios = np.divide(distances, scale[scans], out=np.zeros_like(distances), where=distances > 0.0)
    with np.errstate(over="ignore", under="ignore"):
        sums = sum_by_scan(scans, ratios**order, num_scans) + unmatched / 2.0
        localisation = sum_by_scan(scans, distances**order, num_scans)
        price = np.float64(cutoff) ** order / 2.0
    return GospaSeries(
        total=scale * sums ** (1.0 / order),
        localisation=localisation,
        missed=_costs(num_missed, price),
        false=_costs(num_false, price),
        num_missed=num_missed,
        num_false=num_false,
    )


def _costs(numbers: Ints, price: float) -> Floats:
    return np.multiply(numbers, price, out=np.zeros(len(numbers)), where=numbers > 0)  # 0 for no points at price inf
