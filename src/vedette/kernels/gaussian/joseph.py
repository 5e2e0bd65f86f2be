"""Posterior covariance as a sum of squares, without cancellation (Joseph's form)."""

from vedette.kernels.base.compile import borrowing
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import sandwich
from vedette.kernels.gaussian.scratch import Scratch
from vedette.kernels.gaussian.sigma_points import PointWeights


@borrowing
def _fill_gain(factor: Floats, whitened_cross: Floats, noise: Floats, gain: Floats, out: Floats) -> None:
    """gain = K' = factor^-T whitened_cross, and out = K noise K'."""
    m, n = gain.shape
    for j in range(n):
        for a in range(m - 1, -1, -1):
            total = whitened_cross[a, j]
            for b in range(a + 1, m):
                total -= factor[b, a] * gain[b, j]
            gain[a, j] = total / factor[a, a]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for a in range(m):
                for b in range(m):
                    total += gain[a, i] * 0.5 * (noise[a, b] + noise[b, a]) * gain[b, j]
            out[i, j] = total
            out[j, i] = total


@borrowing
def posterior_of_squares(
    mean: Floats,
    cov: Floats,
    factor: Floats,
    whitened_cross: Floats,
    weights: PointWeights,
    scratch: Scratch,
    out: Floats,
) -> None:
    """Posterior covariance of one Gaussian into `out`.

    With the gain K and the noise R: (I - K H) cov (I - K H)' + K R K'. Of sigma points (`weights.num` is not 0) that
    deviate by d from the mean and by e from the predicted measurement: sum of w (d - K e) (d - K e)' + K R K'.
    """
    n, m = cov.shape[0], factor.shape[0]
    gain, points, images = scratch.gain, scratch.points, scratch.images
    _fill_gain(factor, whitened_cross, scratch.measurement_noise, gain, scratch.noise)
    num = weights.num
    # Scratch is free again: the noise of the motion and its Jacobian are not needed after the prediction.
    if num == 0:
        rest = scratch.jacobian
        for i in range(n):
            for j in range(n):
                total = 1.0 if i == j else 0.0
                for a in range(m):
                    total -= gain[a, i] * scratch.measurement_jacobian[a, j]
                rest[i, j] = total
        sandwich(rest, cov, scratch.noise, scratch.product, out, n)
        return
    for k in range(num):
        for j in range(n):
            total = points[k, j] - mean[j]
            for a in range(m):
                total -= gain[a, j] * images[k, a]
            points[k, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = scratch.noise[i, j] + weights.first * points[0, i] * points[0, j]
            for k in range(1, num):
                total += weights.other * points[k, i] * points[k, j]
            out[i, j] = total
            out[j, i] = total
