"""Probability mass of a Gaussian within a disc."""

import math

import numpy as np

from vedette.kernels.base.types import Floats, Ints

# Beyond this number of standard deviations a Gaussian in the plane has 1.3e-14 of its mass, and one on a line less.
_FAR = 8.0

# Number of quadrature nodes held in memory at a time.
_BLOCK = 1 << 19


def near_pairs(centres: Floats, means: Floats, covs: Floats, radius: float) -> tuple[Ints, Ints]:
    """Return indices of the discs (num_discs, 2) and Gaussians (num_gaussians, 2) that are close enough to matter.

    The omitted pairs have less than exp(-32) = 1.3e-14 in the disc, the mass of a Gaussian beyond 8 of its largest
    standard deviations.
    """
    reach = radius + _FAR * np.sqrt(_largest_variance(covs))
    off_x = centres[:, 0, np.newaxis] - means[:, 0]
    off_y = centres[:, 1, np.newaxis] - means[:, 1]
    disc, gaussian = np.nonzero(off_x**2 + off_y**2 <= reach**2)
    return disc, gaussian


def disc_probabilities(offsets: Floats, gaussians: Ints, covs: Floats, radius: float) -> Floats:
    """Return the probability (num,) that a Gaussian of mean 0 is within `radius` of `offsets` (num, 2), to about 1e-13.

    Along the axes of the covariance, with standard deviations s <= l and offset (x, y),

        P = integral over t in [-pi / 2, pi / 2] of N(x + r sin t; 0, s^2) (Phi((y + h) / l) - Phi((y - h) / l)) h,

    where h = r cos t. As a function of t on the full circle the integrand is periodic and analytic, so the midpoint
    rule converges geometrically: 8 r / s + 40 nodes. Nodes beyond 8 s from the mean are omitted.

    covs: (num_gaussians, 2, 2). `gaussians` (num,) are their indices. Discs wholly within 8 l have probability 1, discs
    beyond it 0.
    """
    variances, axes = np.linalg.eigh(covs)
    small, large = np.sqrt(np.maximum(variances, np.finfo(float).tiny))[gaussians].T
    x, y = (axes[gaussians] * offsets[:, :, np.newaxis]).sum(axis=1).T
    distance = np.hypot(offsets[:, 0], offsets[:, 1])
    probabilities = (distance + _FAR * large <= radius).astype(np.float64)
    rest = np.flatnonzero((probabilities == 0.0) & (distance <= radius + _FAR * large))
    half = np.ceil(4.0 * radius / small[rest]) + 20.0
    first = _node(x[rest], -1.0, small[rest], half, radius)
    last = _node(x[rest], 1.0, small[rest], half, radius)
    num = np.asarray(last - first + 1.0, np.int64)
    start, block = 0, np.cumsum(num) // _BLOCK
    while start < len(rest):
        end = int(np.searchsorted(block, block[start], side="right"))
        part = slice(start, end)
        chosen = rest[part]
        shape = (x[chosen], y[chosen], small[chosen], large[chosen])
        probabilities[chosen] = _midpoints(shape, radius, half[part], first[part], num[part])
        start = end
    return np.asarray(probabilities)


def _node(x: Floats, side: float, small: Floats, half: Floats, radius: float) -> Floats:
    """Return the index of the node at x + r sin t = 8 s to one side, among the nodes in [-pi / 2, pi / 2]."""
    angle = np.arcsin(np.clip((side * _FAR * small - x) / radius, -1.0, 1.0))
    return np.asarray(np.clip(np.floor((angle + math.pi / 2.0) * half / math.pi), 0.0, half - 1.0))


def _midpoints(shape: tuple[Floats, ...], radius: float, half: Floats, first: Floats, num: Ints) -> Floats:
    """Return sums (num_pairs,) over the nodes first .. first + num - 1 of `half` in [-pi / 2, pi / 2]."""
    from scipy.special import ndtr

    pair = np.repeat(np.arange(len(num)), num)
    begins = np.cumsum(num) - num
    node = np.arange(len(pair)) - begins[pair] + first[pair] + 0.5
    angle = node * (math.pi / half)[pair] - math.pi / 2.0
    x, y, small, large = shape
    h = radius * np.cos(angle)
    across = (x[pair] + radius * np.sin(angle)) / small[pair]
    upper, lower = (y[pair] + h) / large[pair], (y[pair] - h) / large[pair]
    values = np.exp(-0.5 * across**2) * h * (ndtr(upper) - ndtr(lower))
    weight = math.pi / half / (math.sqrt(2.0 * math.pi) * small)
    return np.asarray(np.minimum(weight * np.bincount(pair, values, minlength=len(num)), 1.0))


def _largest_variance(covs: Floats) -> Floats:
    """Return the larger eigenvalue (num,) of each covariance (num, 2, 2)."""
    middle, apart = (covs[:, 0, 0] + covs[:, 1, 1]) / 2.0, (covs[:, 0, 0] - covs[:, 1, 1]) / 2.0
    return np.asarray(middle + np.hypot(apart, covs[:, 0, 1]))
