"""Single-target Gaussian prediction and update: extended, unscented and cubature Kalman filters.

`method` of a model bundle: LINEARISED uses the Jacobian, UNSCENTED 2n+1 sigma points with kappa = 1 (all weights
positive, so covariances stay positive definite), CUBATURE 2n points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError, NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Motion, Sensor
from vedette.kernels.gaussian.linalg import LOG_2PI, cholesky, cholesky_of_size, log_det_from_factor

LINEARISED = 0
UNSCENTED = 1
CUBATURE = 2
UNSCENTED_KAPPA = 1.0

_TWO_PI = 2.0 * math.pi

# Where a scan leaves less than this of the volume that was expected of it, cov - cross' cross cancels too many digits.
_LEAST_SHRINKAGE = 1e-8


class Scratch(NamedTuple):
    """Working arrays of one thread for a given state and measurement dimension."""

    jacobian: Floats
    product: Floats
    noise: Floats
    factor: Floats
    points: Floats
    images: Floats
    measurement_jacobian: Floats
    measurement_noise: Floats
    innovation_cov: Floats
    residual: Floats
    gain: Floats
    angular_state: Bools


class Innovation(NamedTuple):
    """What a component expects of a scan, one entry a component; everything an update needs but the measurement.

    predicted: (num, meas_dim). factor: (num, meas_dim, meas_dim) lower Cholesky factor of the innovation covariance.
    whitened_cross: (num, meas_dim, state_dim) factor^-1 (state-measurement covariance)'. covs: posterior covariances.
    log_norm: (num,) log of the Gaussian's normalising constant. prob_detection: (num,).
    """

    predicted: Floats
    factor: Floats
    whitened_cross: Floats
    covs: Floats
    log_norm: Floats
    prob_detection: Floats


@kernel
def make_scratch(state_dim: int, meas_dim: int) -> Scratch:
    num_points = 2 * state_dim + 1
    return Scratch(
        np.empty((state_dim, state_dim)),
        np.empty((state_dim, state_dim)),
        np.empty((state_dim, state_dim)),
        np.empty((state_dim, state_dim)),
        np.empty((num_points, state_dim)),
        np.empty((num_points, max(state_dim, meas_dim))),
        np.empty((meas_dim, state_dim)),
        np.empty((meas_dim, meas_dim)),
        np.empty((meas_dim, meas_dim)),
        np.empty(meas_dim),
        np.empty((meas_dim, state_dim)),
        np.zeros(state_dim, np.bool_),
    )


@kernel
def make_innovation(num: int, state_dim: int, meas_dim: int) -> Innovation:
    return Innovation(
        np.empty((num, meas_dim)),
        np.empty((num, meas_dim, meas_dim)),
        np.empty((num, meas_dim, state_dim)),
        np.empty((num, state_dim, state_dim)),
        np.empty(num),
        np.empty(num),
    )


@inlined
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    if -math.pi < angle <= math.pi:
        return angle
    wrapped = angle - _TWO_PI * math.floor((angle + math.pi) / _TWO_PI)
    return math.pi if wrapped <= -math.pi else wrapped


@borrowing
def _sigma_points(method: int, mean: Floats, cov: Floats, points: Floats, factor: Floats) -> tuple[int, float, float]:
    """Fill `points`; return their number and the weights of the first (the mean, or 0) and of every other."""
    n = mean.shape[0]
    if not cholesky(cov, factor):
        raise NumericalError("covariance of a track is not positive definite")
    kappa = UNSCENTED_KAPPA if method == UNSCENTED else 0.0
    spread = math.sqrt(n + kappa)
    for j in range(n):
        points[0, j] = mean[j]
    for i in range(n):
        for j in range(n):
            step = spread * factor[j, i] if j >= i else 0.0
            points[1 + i, j] = mean[j] + step
            points[1 + n + i, j] = mean[j] - step
    return 2 * n + 1, kappa / (n + kappa), 0.5 / (n + kappa)


@borrowing
def _moments_of_images(
    images: Floats, num: int, dim: int, first: float, other: float, angular: Bools, mean: Floats, cov: Floats
) -> None:
    """Weighted mean and covariance of the images; they are left as deviations from the mean.

    Angles are averaged as deviations from the first image, so that a cloud across +-pi has its mean inside the cloud.
    """
    for j in range(dim):
        base = images[0, j]
        total = 0.0
        for i in range(num):
            images[i, j] -= base
            if angular[j]:
                images[i, j] = wrap_angle(images[i, j])
            if i > 0:
                total += other * images[i, j]
        mean[j] = wrap_angle(base + total) if angular[j] else base + total
        for i in range(num):
            images[i, j] -= total
    for a in range(dim):
        for b in range(a + 1):
            total = first * images[0, a] * images[0, b]
            for i in range(1, num):
                total += other * images[i, a] * images[i, b]
            cov[a, b] = total
            cov[b, a] = total


@inlined
def _sandwich(jacobian: Floats, cov: Floats, noise: Floats, product: Floats, out: Floats, n: int) -> None:
    """out = jacobian cov jacobian' + noise."""
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * cov[k, j]
            product[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (noise[i, j] + noise[j, i])
            for k in range(n):
                total += product[i, k] * jacobian[j, k]
            out[i, j] = total
            out[j, i] = total


@borrowing
def _predict_sigma_points(
    motion: Motion, dt: float, mean: Floats, cov: Floats, out_mean: Floats, out_cov: Floats, scratch: Scratch
) -> None:
    n = mean.shape[0]
    points, images, noise = scratch.points, scratch.images, scratch.noise
    num, first, other = _sigma_points(motion.method, mean, cov, points, scratch.factor)
    for i in range(num):
        motion.transition(points[i], dt, motion.transition_params, out_mean)
        for j in range(n):
            images[i, j] = out_mean[j]
    _moments_of_images(images, num, n, first, other, scratch.angular_state, out_mean, out_cov)
    for i in range(n):
        for j in range(n):
            out_cov[i, j] += 0.5 * (noise[i, j] + noise[j, i])


@inlined
def predict(
    motion: Motion, dt: float, mean: Floats, cov: Floats, out_mean: Floats, out_cov: Floats, scratch: Scratch
) -> None:
    """Chapman-Kolmogorov step of one Gaussian over `dt` seconds; the process noise is taken at the prior mean."""
    n = mean.shape[0]
    motion.process_noise_cov(mean, dt, motion.noise_params, scratch.noise)
    if motion.method == LINEARISED:
        motion.transition(mean, dt, motion.transition_params, out_mean)
        motion.transition_jacobian(mean, dt, motion.transition_params, scratch.jacobian)
        # A constant size is unrolled by the compiler, which halves the cost of the two usual ones.
        if n == 4:
            _sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, 4)
        elif n == 5:
            _sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, 5)
        else:
            _sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, n)
    else:
        _predict_sigma_points(motion, dt, mean, cov, out_mean, out_cov, scratch)
    for i in range(n):
        if not (math.isfinite(out_mean[i]) and math.isfinite(out_cov[i, i])):
            raise ModelError("motion model: predicted mean or covariance is not finite")
        if out_cov[i, i] <= 0.0:
            raise ModelError("motion model: predicted covariance is not positive definite, as with indefinite noise")


@borrowing
def _expect_sigma_points(
    sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, predicted: Floats, cross: Floats, scratch: Scratch
) -> tuple[int, float, float]:
    """Number of sigma points and their weights, as `_sigma_points`; the images are left as deviations."""
    n, m = mean.shape[0], predicted.shape[0]
    points, images = scratch.points, scratch.images
    num, first, other = _sigma_points(sensor.method, mean, cov, points, scratch.factor)
    for i in range(num):
        sensor.measurement(points[i], pose, sensor.measurement_params, scratch.residual)
        for a in range(m):
            images[i, a] = scratch.residual[a]
    _moments_of_images(images, num, m, first, other, sensor.angular, predicted, scratch.innovation_cov)
    for a in range(m):
        for j in range(n):
            total = 0.0
            for i in range(1, num):
                total += other * images[i, a] * (points[i, j] - mean[j])
            cross[a, j] = total
    return num, first, other


@inlined
def _project(jacobian: Floats, cov: Floats, cross: Floats, innovation: Floats, n: int, m: int) -> None:
    """cross = jacobian cov; innovation = cross jacobian', its lower triangle."""
    for a in range(m):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += jacobian[a, k] * cov[k, j]
            cross[a, j] = total
        for b in range(a + 1):
            total = 0.0
            for k in range(n):
                total += cross[a, k] * jacobian[b, k]
            innovation[a, b] = total


@inlined
def _has_volume(noise: Floats, factor: Floats, work: Floats, m: int) -> bool:
    """Whether the noise has at least `_LEAST_SHRINKAGE` of the determinant of the innovation covariance L L'.

    That share bounds from below what any direction of the state keeps of its variance. work: to be written.
    """
    expected = 1.0
    for a in range(m):
        expected *= factor[a, a] * factor[a, a]
    if m == 1:
        return noise[0, 0] > _LEAST_SHRINKAGE * expected
    if m == 2:
        skew = 0.5 * (noise[0, 1] + noise[1, 0])
        return noise[0, 0] * noise[1, 1] - skew * skew > _LEAST_SHRINKAGE * expected
    if not cholesky_of_size(noise, work, m):
        return False
    own = 1.0
    for a in range(m):
        own *= work[a, a] * work[a, a]
    return own > _LEAST_SHRINKAGE * expected


@inlined
def _condition(
    cov: Floats, noise: Floats, innovation: Floats, factor: Floats, cross: Floats, posterior: Floats, n: int, m: int
) -> bool:
    """Add the noise to `innovation` and factor it; whiten `cross`; posterior = cov - cross' cross.

    False where that difference cancels so much that it must be taken by `_posterior_of_squares`.
    """
    for a in range(m):
        for b in range(a + 1):
            innovation[a, b] += 0.5 * (noise[a, b] + noise[b, a])
    if not cholesky_of_size(innovation, factor, m):
        raise ModelError("measurement model: innovation covariance is not positive definite or not finite")
    for a in range(m):
        for j in range(n):
            total = cross[a, j]
            for k in range(a):
                total -= factor[a, k] * cross[k, j]
            cross[a, j] = total / factor[a, a]
    for i in range(n):
        for j in range(i + 1):
            total = cov[i, j]
            for a in range(m):
                total -= cross[a, i] * cross[a, j]
            posterior[i, j] = total
            posterior[j, i] = total
    return _has_volume(noise, factor, innovation, m)


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
def _posterior_of_squares(
    mean: Floats,
    cov: Floats,
    factor: Floats,
    whitened_cross: Floats,
    num: int,
    first: float,
    other: float,
    scratch: Scratch,
    out: Floats,
) -> None:
    """Posterior covariance as a sum of squares, in which nothing cancels (Joseph's form).

    With the gain K and the noise R: (I - K H) cov (I - K H)' + K R K'; of sigma points (`num` of them, 0 for none) that
    deviate by d from the mean and by e from the predicted measurement, sum of w (d - K e) (d - K e)' + K R K'.
    """
    n, m = cov.shape[0], factor.shape[0]
    gain, points, images = scratch.gain, scratch.points, scratch.images
    _fill_gain(factor, whitened_cross, scratch.measurement_noise, gain, scratch.noise)
    if num == 0:
        rest = scratch.jacobian
        for i in range(n):
            for j in range(n):
                total = 1.0 if i == j else 0.0
                for a in range(m):
                    total -= gain[a, i] * scratch.measurement_jacobian[a, j]
                rest[i, j] = total
        _sandwich(rest, cov, scratch.noise, scratch.product, out, n)
        return
    for k in range(num):
        for j in range(n):
            total = points[k, j] - mean[j]
            for a in range(m):
                total -= gain[a, j] * images[k, a]
            points[k, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = scratch.noise[i, j] + first * points[0, i] * points[0, j]
            for k in range(1, num):
                total += other * points[k, i] * points[k, j]
            out[i, j] = total
            out[j, i] = total


@inlined
def expect(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, at: int, out: Innovation, scratch: Scratch) -> None:
    """Fill entry `at` of `out`; noise and detection probability are taken at the predicted mean (paper-notes 3)."""
    n, m = mean.shape[0], out.predicted.shape[1]
    jacobian, noise, innovation = scratch.measurement_jacobian, scratch.measurement_noise, scratch.innovation_cov
    factor, cross, posterior = out.factor[at], out.whitened_cross[at], out.covs[at]
    linearised, num, first, other = sensor.method == LINEARISED, 0, 0.0, 0.0
    if linearised:
        sensor.measurement(mean, pose, sensor.measurement_params, out.predicted[at])
        sensor.measurement_jacobian(mean, pose, sensor.measurement_params, jacobian)
    else:
        num, first, other = _expect_sigma_points(sensor, pose, mean, cov, out.predicted[at], cross, scratch)
    sensor.measurement_noise_cov(mean, pose, sensor.noise_params, noise)
    if linearised and n == 4 and m == 2:
        _project(jacobian, cov, cross, innovation, 4, 2)
        exact = _condition(cov, noise, innovation, factor, cross, posterior, 4, 2)
    else:
        if linearised:
            _project(jacobian, cov, cross, innovation, n, m)
        exact = _condition(cov, noise, innovation, factor, cross, posterior, n, m)
    if not exact:
        _posterior_of_squares(mean, cov, factor, cross, num, first, other, scratch, posterior)
    out.log_norm[at] = -0.5 * (log_det_from_factor(factor) + m * LOG_2PI)
    detection = sensor.prob_detection(mean, pose, sensor.detection_params)
    if not 0.0 <= detection <= 1.0:
        raise ModelError("detection model: probability is not in [0, 1]")
    out.prob_detection[at] = detection


@inlined
def whiten(innovation: Innovation, at: int, measurement: Floats, angular: Bools, gate: float, out: Floats) -> float:
    """Whitened residual of a measurement against component `at`; returns its squared Mahalanobis distance.

    Once that is known to be above `gate` the rest is left undone and a lower bound of it is returned.
    """
    factor = innovation.factor[at]
    distance = 0.0
    for a in range(measurement.shape[0]):
        total = measurement[a] - innovation.predicted[at, a]
        if angular[a]:
            total = wrap_angle(total)
        for k in range(a):
            total -= factor[a, k] * out[k]
        out[a] = total / factor[a, a]
        distance += out[a] * out[a]
        if distance > gate:
            break
    return distance


@inlined
def update_mean(innovation: Innovation, at: int, whitened: Floats, mean: Floats, out: Floats) -> None:
    """Posterior mean of component `at` given the whitened residual of its measurement."""
    for j in range(mean.shape[0]):
        total = mean[j]
        for a in range(whitened.shape[0]):
            total += innovation.whitened_cross[at, a, j] * whitened[a]
        out[j] = total
