"""Sigma points: 2 n + 1 or 2 n states whose weighted mean and covariance are those of a Gaussian.

UNSCENTED has 2 n + 1 points with kappa = 1 (Julier and Uhlmann 1997, all weights positive, so that covariances stay
positive definite), CUBATURE the 2 n points of the third-degree rule (Arasaratnam and Haykin 2009). LINEARISED uses
Jacobians and no points. SWITCHED does too, except for a Gaussian over which measurements bend (`innovation.bends`).
"""

import math
from typing import NamedTuple

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import cholesky
from vedette.kernels.gaussian.scratch import wrap

LINEARISED = 0
UNSCENTED = 1
CUBATURE = 2
SWITCHED = 3  # of measurements alone
UNSCENTED_KAPPA = 1.0


class PointWeights(NamedTuple):
    """Number and weights of sigma points."""

    num: int  # 0 where a model is linearised
    first: float  # of the mean; 0 where it is no point of the rule
    other: float  # of every other point


@borrowing
def fill_sigma_points(method: int, mean: Floats, cov: Floats, points: Floats, factor: Floats) -> PointWeights:
    """Fill `points` with mean and mean +- sqrt(n + kappa) L_i, L_i the columns of the Cholesky factor of `cov`."""
    n = mean.shape[0]
    if not cholesky(cov, factor):
        raise NumericalError("covariance of a track is not positive definite")
    kappa = 0.0 if method == CUBATURE else UNSCENTED_KAPPA
    spread = math.sqrt(n + kappa)
    for j in range(n):
        points[0, j] = mean[j]
    for i in range(n):
        for j in range(n):
            step = spread * factor[j, i] if j >= i else 0.0
            points[1 + i, j] = mean[j] + step
            points[1 + n + i, j] = mean[j] - step
    return PointWeights(2 * n + 1, kappa / (n + kappa), 0.5 / (n + kappa))


@borrowing
def moments_of_images(
    images: Floats, weights: PointWeights, dim: int, periods: Floats, mean: Floats, cov: Floats
) -> None:
    """Weighted mean and covariance of the images. They are left as deviations from the mean.

    Components with a period, such as angles, are averaged as deviations from the first image, so that a cloud across
    +-pi has its mean inside the cloud.
    """
    num, first, other = weights.num, weights.first, weights.other
    for j in range(dim):
        base = images[0, j]
        total = 0.0
        for i in range(num):
            # Relative to an image in the cloud, angles need no circular mean.
            images[i, j] = wrap(images[i, j] - base, periods[j])
            if i > 0:
                total += other * images[i, j]
        mean[j] = wrap(base + total, periods[j])
        for i in range(num):
            images[i, j] -= total
    for a in range(dim):
        for b in range(a + 1):
            total = first * images[0, a] * images[0, b]
            for i in range(1, num):
                total += other * images[i, a] * images[i, b]
            cov[a, b] = total
            cov[b, a] = total
