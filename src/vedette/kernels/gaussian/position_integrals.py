"""Means over a Gaussian of functions of the position: in closed form, along rays, and by nodes."""

import math

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats

# At a straight edge, where detection falls from 1 to 0, 64 nodes are wrong by at most 0.05 (root mean square 0.012);
# 7 x 7 Gauss-Hermite nodes by 0.22 (0.042). Where detection is smooth, both are far better (docs/concepts/filters.md).
NUM_NODES = 64

# Deviations beyond which a Gaussian is taken as 0.
_REACH = 6.5
# Gauss-Legendre rule of a panel of angles. A panel is halved until that changes it by no more than the tolerance, or
# it is as narrow as that; where the whitened disc is long and thin, its edge is crossed within a tiny angle.
_ANGLES, _ANGLE_WEIGHTS = np.polynomial.legendre.leggauss(16)
_TOLERANCE, _NARROWEST = 1e-7, 1e-10
# Of a variance, where the other coordinate as good as gives it: rounding must not leave it at 0 or below.
_LEAST_SHARE = 1e-14


def spread_nodes(num: int = NUM_NODES) -> Floats:
    """(num, 3) equal weights and standard deviates of nodes in two dimensions, with mean 0 and covariance I.

    They lie on a spiral of the golden angle, each ring with its share of the Gaussian, so that a straight edge in any
    direction and at any distance parts them nearly as it parts the Gaussian.
    """
    rank = np.arange(num)
    radius, angle = np.sqrt(-2.0 * np.log1p(-(rank + 0.5) / num)), rank * math.pi * (3.0 - math.sqrt(5.0))
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    points -= points.mean(axis=0)
    points = np.linalg.solve(np.linalg.cholesky(points.T @ points / num), points.T).T
    return np.ascontiguousarray(np.column_stack([np.full(num, 1.0 / num), points]))


@kernel
def gaussian_mean(dx: float, dy: float, cov: Floats, variance: float) -> float:
    """Mean of exp(-|x|^2 / (2 variance)) over x with mean (dx, dy) and the covariance P of the position.

    |I + P / variance|^(-1/2) exp(-d' (variance I + P)^(-1) d / 2)
    """
    xx, yy, xy = variance + cov[0, 0], variance + cov[1, 1], 0.5 * (cov[0, 1] + cov[1, 0])
    det = xx * yy - xy * xy
    square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det
    return variance / math.sqrt(det) * math.exp(-0.5 * square)


@kernel
def _of_ray(distance: float, off: float, end: float) -> float:
    """Integral of rho N(rho e; D, I) over 0 <= rho <= end: a ray from 0 at angle `off` from D, |D| = distance."""
    along, across = distance * math.cos(off), distance * math.sin(off)
    near = math.exp(-0.5 * along * along) - math.exp(-0.5 * (end - along) * (end - along))
    share = 0.5 * (math.erf((end - along) * math.sqrt(0.5)) + math.erf(along * math.sqrt(0.5)))
    return (
        math.exp(-0.5 * across * across) * (near / math.sqrt(2.0 * math.pi) + along * share) / math.sqrt(2.0 * math.pi)
    )


@kernel
def _of_wedge(
    start: float, stop: float, distance: float, toward: float, a: float, b: float, c: float, r: float
) -> float:
    """Integral of `_of_ray` over whitened angles in [start, stop], the rays ending at r metres."""
    middle, half, total = 0.5 * (start + stop), 0.5 * (stop - start), 0.0
    for i in range(len(_ANGLES)):
        angle = middle + half * _ANGLES[i]
        x, y = a * math.cos(angle), b * math.cos(angle) + c * math.sin(angle)
        total += _ANGLE_WEIGHTS[i] * _of_ray(distance, angle - toward, r / math.sqrt(x * x + y * y))
    return half * total


@kernel
def _of_panels(
    start: float, stop: float, distance: float, toward: float, a: float, b: float, c: float, r: float
) -> float:
    """`_of_wedge` by panels as narrow as they must be, one after the other."""
    low, high, total = start, stop, 0.0
    whole = _of_wedge(low, high, distance, toward, a, b, c, r)
    while True:
        middle = 0.5 * (low + high)
        left = _of_wedge(low, middle, distance, toward, a, b, c, r)
        right = _of_wedge(middle, high, distance, toward, a, b, c, r)
        if abs(whole - left - right) > _TOLERANCE and high - low > _NARROWEST:
            high, whole = middle, left
            continue
        total += left + right
        if high >= stop:
            return total
        low, high = high, min(3.0 * high - 2.0 * low, stop)  # twice as wide
        whole = _of_wedge(low, high, distance, toward, a, b, c, r)


@kernel
def _near(start: float, stop: float, distance: float, toward: float, a: float, b: float, c: float, r: float) -> float:
    """`_of_wedge` over the part of [start, stop], shorter than a turn, where the Gaussian is.

    Panels end at the axes of the whitened disc, so that none can miss its ends between two nodes.
    """
    window = math.asin(_REACH / distance) if distance > _REACH else math.pi
    axis, quarter = 0.5 * math.atan2(2.0 * b * c, a * a + b * b - c * c), 0.5 * math.pi
    total = 0.0
    for turn in range(-1, 2):
        centre = toward + 2.0 * math.pi * turn
        low, high = max(start, centre - window), min(stop, centre + window)
        end = axis + quarter * (math.floor((low - axis) / quarter) + 1.0)
        while low < high:
            total += _of_panels(low, min(end, high), distance, toward, a, b, c, r)
            low, end = end, end + quarter
    return total


@kernel
def _share(total: float) -> float:
    """Return a share limited to [0, 1], which rounding may leave slightly."""
    return min(max(total, 0.0), 1.0)


@kernel
def share_in_sector(dx: float, dy: float, cov: Floats, max_range: float, middle: float, half_width: float) -> float:
    """Share of a Gaussian within `max_range` of the origin and `half_width` of the direction `middle`, in [0, 1].

    The integral in polar coordinates about the origin, after whitening x = L y by the Cholesky factor of the covariance
    of the position: along each ray in closed form, over the angles by Gauss and Legendre on panels that are halved
    until the errors are below 5e-6, however long and thin the Gaussian is.

    Args:
        dx, dy: its mean, m.
        cov: covariance whose first block of 2 is the position's, m^2.
        max_range: m.
        middle, half_width: rad. half_width pi: all round.
    """
    away, reach = math.sqrt(dx * dx + dy * dy), _REACH * math.sqrt(cov[0, 0] + cov[1, 1])
    if away - reach > max_range:
        return 0.0
    if half_width >= math.pi and away + reach < max_range:
        return 1.0
    a = math.sqrt(cov[0, 0])
    b = 0.5 * (cov[0, 1] + cov[1, 0]) / a
    c = math.sqrt(max(cov[1, 1] - b * b, _LEAST_SHARE * cov[1, 1]))
    u = dx / a
    v = (dy - b * u) / c
    distance, toward = math.sqrt(u * u + v * v), math.atan2(v, u)
    if half_width >= math.pi:
        return _share(_near(toward - math.pi, toward + math.pi, distance, toward, a, b, c, max_range))
    # A linear map with a positive determinant keeps the order of directions, and opposite ones opposite.
    total = 0.0
    for side in range(2):
        other = middle + (half_width if side == 1 else -half_width)
        low, high = (middle, other) if side == 1 else (other, middle)
        x, y = math.cos(low) / a, (math.sin(low) - b * math.cos(low) / a) / c
        start = math.atan2(y, x)
        x, y = math.cos(high) / a, (math.sin(high) - b * math.cos(high) / a) / c
        stop = math.atan2(y, x)
        if stop < start:
            stop += 2.0 * math.pi
        total += _near(start, stop, distance, toward, a, b, c, max_range)
    return _share(total)
