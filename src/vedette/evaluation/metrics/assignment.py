"""Optimal assignment between two sets of points, the basis of all distances between sets."""

import math

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import as_array

_HIGH_ORDER = 30.0
# Largest number of distances that are stored in full; of more, only those below the cutoff are stored.
_MAX_FULL_DISTANCES = 1_000_000


def check_parameters(cutoff: float, order: float, *, finite: bool = False) -> None:
    """Raise `InputError` unless cutoff > 0 and order >= 1, and with `finite` both are finite."""
    if not cutoff > 0.0 or (finite and math.isinf(cutoff)):
        raise InputError(f"cutoff: expected a{' finite' * finite} distance above 0; got {cutoff}")
    if not order >= 1.0 or (finite and math.isinf(order)):
        raise InputError(f"order: expected a{' finite' * finite} number of at least 1; got {order}")


def point_set(values: ArrayLike, name: str) -> Floats:
    """Return finite points, (num, dim). An empty set may have any shape.

    Raises `InputError`, with `name`, for anything else.
    """
    points = as_array(name, values, "fiu", "an array of points").astype(np.float64)
    if points.size == 0:
        return points.reshape(0, points.shape[1] if points.ndim == 2 else 0)
    if points.ndim != 2:
        raise InputError(f"{name}: expected shape (number, dimension); got {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"{name}: expected finite coordinates; got {points[~np.isfinite(points)][0]}")
    return points


def point_sets(estimates: ArrayLike, truths: ArrayLike) -> tuple[Floats, Floats]:
    """Return both sets as `point_set` does, and also raise `InputError` if they differ in dimension."""
    first, second = point_set(estimates, "estimates"), point_set(truths, "truths")
    if first.size and second.size and first.shape[1] != second.shape[1]:
        raise InputError(
            f"estimates, truths: expected points of equal dimension; got {first.shape[1]} and {second.shape[1]}"
        )
    return first, second


def cut_distances(first: Floats, second: Floats, cutoff: float) -> Floats:
    """Return min(Euclidean distance, cutoff), (len(first), len(second)). Either set may be empty."""
    if not (len(first) and len(second)):
        return np.empty((len(first), len(second)))
    distances = np.sqrt(((first[:, None, :] - second[None, :, :]) ** 2).sum(axis=2))
    return np.asarray(np.minimum(distances, cutoff))


def assign(distances: Floats, order: float) -> tuple[Ints, Ints]:
    """Return rows and columns, each used at most once, that pair all of the smaller set at the lowest cost.

    Args:
        distances: (num_rows, num_columns), finite, at least 0.
        order: exponent. The cost is the sum of distance ** order, or the largest distance for an infinite order.
    """
    if not distances.size:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    if math.isinf(order):
        return _pairs(distances > _bottleneck(distances))
    if order == 1.0:
        return _pairs(distances)
    # Powers of ratios, because powers of metres overflow or underflow at a high order. The ratio is then to the largest
    # distance of the best assignment; relative to a larger one, all relevant powers would underflow too.
    scale = float(distances.max()) if order <= _HIGH_ORDER else _bottleneck(distances)
    if scale == 0.0:
        return _pairs(distances > 0.0)
    with np.errstate(over="ignore", under="ignore"):  # a pair of infinite cost is never chosen
        return _pairs((distances / scale) ** order)


def assign_points(first: Floats, second: Floats, cutoff: float, order: float) -> tuple[Ints, Ints, Floats]:
    """Return rows of the two sets, each used at most once, that pair them at the lowest cost, and their distances.

    The result is that of `assign` of `cut_distances`, except that for sets of more than a million distances it has only
    the pairs closer than the cutoff: a point without such a neighbour costs the cutoff in any pair. The pairs are found
    within groups of points that share neighbours, so that time and memory grow with the number of points and not with
    its square.
    """
    if len(first) * len(second) <= _MAX_FULL_DISTANCES or math.isinf(cutoff) or math.isinf(order):
        costs = cut_distances(first, second, cutoff)
        rows, columns = assign(costs, order)
        return rows, columns, costs[rows, columns]
    # Imported here, because large sets are rare and these imports take as long as the rest of the module.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    near = KDTree(first).sparse_distance_matrix(KDTree(second), cutoff, output_type="coo_matrix")
    edges = coo_array(
        (np.ones(len(near.row)), (near.row, near.col + len(first))), shape=(total := len(first) + len(second), total)
    )
    _, groups = connected_components(edges, directed=False)
    # In each group, the points of the first set come before those of the second, both in order.
    members = np.argsort(groups, kind="stable")
    pairs = []
    for group in np.split(members, np.flatnonzero(np.diff(groups[members])) + 1):
        split = int(np.searchsorted(group, len(first)))
        if 0 < split < len(group):
            in_first, in_second = group[:split], group[split:] - len(first)
            costs = cut_distances(first[in_first], second[in_second], cutoff)
            rows, columns = assign(costs, order)
            pairs.append((in_first[rows], in_second[columns], costs[rows, columns]))
    if not pairs:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    rows, columns, distances = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    by_row = np.argsort(rows, kind="stable")
    by_row = by_row[distances[by_row] < cutoff]
    return rows[by_row], columns[by_row], distances[by_row]


def power_mean(values: Floats, number: float, order: float) -> float:
    """Return (sum of values ** order / number) ** (1 / order) without overflow, or the largest for an infinite order.

    Args:
        values: (num,) at least 0.
        number: divisor of the sum, above 0, at least `num` for a mean, 1 for a root of the sum.
        order: exponent, at least 1.
    """
    scale = float(values.max()) if len(values) else 0.0
    if scale == 0.0 or math.isinf(scale) or math.isinf(order):
        return scale
    if order == 1.0:  # the same result without powers
        return float(scale * (float((values / scale).sum()) / number))
    with np.errstate(under="ignore"):
        total = float(((values / scale) ** order).sum())
    return float(scale * (total / number) ** (1.0 / order))


def combine(first: float, second: float, order: float) -> float:
    """Return (first ** order + second ** order) ** (1 / order) without overflow, or the larger for infinite order."""
    scale = max(first, second)
    if order == 1.0 and 0.0 < scale < math.inf:
        return scale * (first / scale + second / scale)
    return power_mean(np.array([first, second]), 1.0, order)


def _pairs(costs: Floats | Bools) -> tuple[Ints, Ints]:
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(costs)
    return rows, columns


def _bottleneck(distances: Floats) -> float:
    """Return the smallest bound on distances at which every point of the smaller set has its own partner."""
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
    from scipy.optimize import linear_sum_assignment

    return bool(allowed[linear_sum_assignment(~allowed)].all())
