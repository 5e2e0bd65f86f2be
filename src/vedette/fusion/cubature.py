"""A cubature rule for expectations under a Gaussian."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from vedette.kernels.base.types import Floats

MAX_DIM = 7


def _simplex(dim: int) -> Floats:
    """(dim + 1, dim) corners of a regular simplex on the unit sphere."""
    corners = np.zeros((dim + 1, dim))
    for i in range(dim):
        corners[i, i] = math.sqrt((dim + 1) * (dim - i) / (dim * (dim - i + 1)))
        corners[i + 1 :, i] = -corners[i, i] / (dim - i)
    return corners


@cache
def fifth_degree_rule(dim: int) -> tuple[Floats, Floats]:
    """Points and weights that integrate all polynomials of degree 5 and less under the standard normal of `dim` <= 7.

    The centre, the corners of a regular simplex and its opposite, and the midpoints of their edges pushed out to the
    same sphere: dim^2 + 3 dim + 3 points (Lu and Darmofal 2004, "Higher-dimensional integration with Gaussian weight
    for applications in probabilistic design", after Mysovskikh). No weight is negative, so a covariance taken with
    these points is never indefinite; for larger `dim` one would be.
    """
    corners = _simplex(dim)
    first, second = np.triu_indices(dim + 1, 1)
    edges = corners[first] + corners[second]
    edges *= math.sqrt(dim / (2.0 * (dim - 1))) if dim > 1 else 0.0
    radius = math.sqrt(dim + 2.0)
    points = radius * np.concatenate([np.zeros((1, dim)), corners, -corners, edges, -edges])
    weights = np.full(len(points), 2.0 * (dim - 1) ** 2 / ((dim + 1) ** 2 * (dim + 2) ** 2))
    weights[: 2 * dim + 3] = dim**2 * (7 - dim) / (2.0 * (dim + 1) ** 2 * (dim + 2) ** 2)
    weights[0] = 2.0 / (dim + 2)
    return points, weights
