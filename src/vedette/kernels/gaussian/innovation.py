"""Expected measurement of a Gaussian and its update: extended, unscented and cubature Kalman filters."""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, RowNoise, Sensor
from vedette.kernels.gaussian.beam import own_height
from vedette.kernels.gaussian.detection import detection_and_edge
from vedette.kernels.gaussian.joseph import posterior_of_squares
from vedette.kernels.gaussian.linalg import LOG_2PI, cholesky_of_size, log_det_from_factor
from vedette.kernels.gaussian.row_noise import MISSING, no_row_noise, replace_noise
from vedette.kernels.gaussian.scratch import Scratch, is_folded, wrap
from vedette.kernels.gaussian.sigma_points import (
    LINEARISED,
    SWITCHED,
    PointWeights,
    fill_sigma_points,
    moments_of_images,
)

# Where a scan leaves less than this of the volume that was expected of it, cov - cross' cross cancels too many digits.
LEAST_SHRINKAGE = 1e-8

# A folded component counts if its predicted standard deviation, this number of times, is within half of its period.
FOLDED_STDS = 3.0

# Second-order error of a measurement over a Gaussian, in standard deviations of the noise, from which SWITCHED treats
# the measurement as bent. Below it the normalised error squared of the extended filter is at most 2.4 (2 is exact).
LARGEST_BEND = 0.3


class Innovation(NamedTuple):
    """Expected measurements of components: everything that an update needs except the measurement.

    With the state-measurement covariance C and the innovation covariance S = L L', the whitened cross W = L^-1 C' gives
    the gain K = W' L^-1, the posterior covariance P - W'W, and the posterior mean m + W' v of a whitened residual v.
    """

    predicted: Floats  # (num, meas_dim) expected measurement
    factor: Floats  # (num, meas_dim, meas_dim) L, in the lower triangle
    whitened_cross: Floats  # (num, meas_dim, state_dim) W
    covs: Floats  # (num, state_dim, state_dim) posterior covariances, the same for all measurements
    log_norm: Floats  # (num,) log of the normalising constant of the predicted measurement's Gaussian
    prob_detection: Floats  # (num,)
    at_edge: Bools  # (num,) whether the probability of detection differs over it, see `detection`
    bends: Bools  # (num,) whether each measurement has an update of its own, see `relinearisation`


@kernel
def make_innovation(num: int, state_dim: int, meas_dim: int) -> Innovation:
    return Innovation(
        np.empty((num, meas_dim)),
        np.empty((num, meas_dim, meas_dim)),
        np.empty((num, meas_dim, state_dim)),
        np.empty((num, state_dim, state_dim)),
        np.empty(num),
        np.empty(num),
        np.zeros(num, np.bool_),
        np.empty(num, np.bool_),
    )


@inlined
def copy_innovation(innovation: Innovation, source: int, out: Innovation, target: int) -> None:
    """Copy the entry of one component into another bundle."""
    m, n = innovation.whitened_cross.shape[1:]
    for a in range(m):
        out.predicted[target, a] = innovation.predicted[source, a]
        for b in range(m):
            out.factor[target, a, b] = innovation.factor[source, a, b]
        for j in range(n):
            out.whitened_cross[target, a, j] = innovation.whitened_cross[source, a, j]
    for i in range(n):
        for j in range(n):
            out.covs[target, i, j] = innovation.covs[source, i, j]
    out.log_norm[target] = innovation.log_norm[source]
    out.prob_detection[target] = innovation.prob_detection[source]
    out.at_edge[target] = innovation.at_edge[source]
    out.bends[target] = innovation.bends[source]


@borrowing
def _expect_sigma_points(
    sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, predicted: Floats, cross: Floats, scratch: Scratch
) -> PointWeights:
    """Predicted measurement, innovation covariance without noise, and cross. The images are left as deviations."""
    n, m = mean.shape[0], predicted.shape[0]
    points, images = scratch.points, scratch.images
    weights = fill_sigma_points(sensor.method, mean, cov, points, scratch.factor)
    for i in range(weights.num):
        sensor.measurement(points[i], pose, sensor.measurement_params, scratch.residual)
        for a in range(m):
            images[i, a] = scratch.residual[a]
    moments_of_images(images, weights, m, sensor.periods, predicted, scratch.innovation_cov)
    for a in range(m):
        for j in range(n):
            total = 0.0
            for i in range(1, weights.num):
                total += weights.other * images[i, a] * (points[i, j] - mean[j])
            cross[a, j] = total
    return weights


@inlined
def project(jacobian: Floats, cov: Floats, cross: Floats, innovation: Floats, n: int, m: int) -> None:
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
    """Return True if det(noise) is at least `LEAST_SHRINKAGE` times that of the innovation covariance L L'.

    That share bounds from below what any direction of the state keeps of its variance. work: to be written.
    """
    expected = 1.0
    for a in range(m):
        expected *= factor[a, a] * factor[a, a]
    if m == 1:
        return noise[0, 0] > LEAST_SHRINKAGE * expected
    if m == 2:
        skew = 0.5 * (noise[0, 1] + noise[1, 0])
        return noise[0, 0] * noise[1, 1] - skew * skew > LEAST_SHRINKAGE * expected
    if not cholesky_of_size(noise, work, m):
        return False
    own = 1.0
    for a in range(m):
        own *= work[a, a] * work[a, a]
    return own > LEAST_SHRINKAGE * expected


@inlined
def condition(
    cov: Floats, noise: Floats, innovation: Floats, factor: Floats, cross: Floats, posterior: Floats, n: int, m: int
) -> bool:
    """Add the noise to `innovation` and factor it, whiten `cross`. Then posterior = cov - cross' cross.

    False where that difference cancels so much that it must be taken by `posterior_of_squares`.
    """
    for a in range(m):
        for b in range(a + 1):
            innovation[a, b] += 0.5 * (noise[a, b] + noise[b, a])
    if not cholesky_of_size(innovation, factor, m):
        raise ModelError("measurement model: innovation covariance is not positive definite or not finite")
    # W = L^-1 C': then K = W' L^-1, and K S K' = W'W needs no gain.
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


@inlined
def condition_linear(
    mean: Floats, cov: Floats, factor: Floats, cross: Floats, scratch: Scratch, posterior: Floats
) -> None:
    """Write factor, cross and posterior of a measurement by the Jacobian and the noise of the scratch."""
    n, m, jacobian, noise = cov.shape[0], factor.shape[0], scratch.measurement_jacobian, scratch.measurement_noise
    innovation = scratch.innovation_cov
    # A constant size is unrolled by the compiler.
    if n == 4 and m == 2:
        project(jacobian, cov, cross, innovation, 4, 2)
        exact = condition(cov, noise, innovation, factor, cross, posterior, 4, 2)
    else:
        project(jacobian, cov, cross, innovation, n, m)
        exact = condition(cov, noise, innovation, factor, cross, posterior, n, m)
    if not exact:
        posterior_of_squares(mean, cov, factor, cross, PointWeights(0, 0.0, 0.0), scratch, posterior)


@inlined
def bends_over(
    pose: Floats, mean: Floats, cov: Floats, jacobian: Floats, noise: Floats, height: int, n: int, m: int
) -> bool:
    """Return True if the second-order error of a component exceeds `LARGEST_BEND` standard deviations of its noise.

    A measurement of a position at distance d has second derivatives of about |H| / d. Over a position of variance V,
    both axes together, component a is then off by |H_a| V / (2 d), which is the sagitta V / (2 d) of a range, and by
    |H_aj| sqrt(V P_jj) / d with another component j of the state. A height that is measured is part of the position,
    `height` is its place in the state, or -1.
    """
    dx, dy, variance = mean[0] - pose[0], mean[1] - pose[1], cov[0, 0] + cov[1, 1]
    square = dx * dx + dy * dy
    if height >= 0:
        dz = mean[height] - own_height(pose)
        square, variance = square + dz * dz, variance + cov[height, height]
    limit = 4.0 * LARGEST_BEND * LARGEST_BEND * square
    for a in range(m):
        slope = jacobian[a, 0] * jacobian[a, 0] + jacobian[a, 1] * jacobian[a, 1]
        if height >= 0:
            slope += jacobian[a, height] * jacobian[a, height]
        slope *= variance
        for j in range(2, n):
            if j != height:
                slope += 4.0 * jacobian[a, j] * jacobian[a, j] * cov[j, j]
        if variance * slope > limit * noise[a, a]:
            return True
    return False


@inlined
def _ignore_if_ambiguous(variance: float, component: int, period: float, noise: Floats) -> float:
    """Give a folded component so wide a noise that it has no effect, if it may be one of several periods.

    variance: of the component without noise. Returns what to add to the log likelihood, as the component is uniform
    over its period instead.
    """
    if not is_folded(period) or variance <= (0.5 * period / FOLDED_STDS) ** 2 or noise[component, component] >= MISSING:
        return 0.0
    for a in range(noise.shape[0]):
        noise[component, a] = 0.0
        noise[a, component] = 0.0
    noise[component, component] = MISSING
    return 0.5 * (LOG_2PI + math.log(MISSING)) - math.log(period)


@inlined
def ignore_ambiguous(sensor: Sensor, jacobian: Floats, cov: Floats, noise: Floats) -> float:
    """Give folded components that may be one of several periods so wide a noise that they have no effect.

    They stand behind the first two. Returns what to add to the log likelihood.
    """
    total = 0.0
    for a in range(2, noise.shape[0]):
        if is_folded(sensor.periods[a]):
            variance = 0.0
            for i in range(cov.shape[0]):
                for j in range(cov.shape[0]):
                    variance += jacobian[a, i] * cov[i, j] * jacobian[a, j]
            total += _ignore_if_ambiguous(variance, a, sensor.periods[a], noise)
    return total


@inlined
def log_norm_of_factor(factor: Floats) -> float:
    """Log of the normalising constant of a Gaussian with covariance L L'."""
    return -0.5 * (log_det_from_factor(factor) + factor.shape[0] * LOG_2PI)


@inlined
def expect(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, at: int, out: Innovation, scratch: Scratch) -> None:
    """Fill entry `at` of `out`. Noise is taken at the predicted mean (paper-notes 3), detection as the sensor says."""
    expect_measurement(sensor, pose, mean, cov, no_row_noise(out.factor), at, out, scratch)
    out.prob_detection[at], out.at_edge[at] = detection_and_edge(sensor, pose, mean, cov, scratch.points[0])


@inlined
def expect_measurement(
    sensor: Sensor,
    pose: Floats,
    mean: Floats,
    cov: Floats,
    own: RowNoise,
    at: int,
    out: Innovation,
    scratch: Scratch,
) -> None:
    """Fill entry `at` of `out` except the detection probability, see `expect`.

    own: noise that the measurement brings. The noise model has the rest.
    """
    n, m = mean.shape[0], out.predicted.shape[1]
    jacobian, noise, innovation = scratch.measurement_jacobian, scratch.measurement_noise, scratch.innovation_cov
    factor, cross, posterior = out.factor[at], out.whitened_cross[at], out.covs[at]
    linearised, log_uniform = sensor.method == LINEARISED or sensor.method == SWITCHED, 0.0
    sensor.measurement_noise_cov(mean, pose, sensor.noise_params, noise)
    replace_noise(own, noise)
    if linearised:
        sensor.measurement(mean, pose, sensor.measurement_params, out.predicted[at])
        sensor.measurement_jacobian(mean, pose, sensor.measurement_params, jacobian)
        log_uniform = ignore_ambiguous(sensor, jacobian, cov, noise)
    out.bends[at] = sensor.method == SWITCHED and bends_over(pose, mean, cov, jacobian, noise, sensor.height, n, m)
    if out.bends[at] or not linearised:
        weights = _expect_sigma_points(sensor, pose, mean, cov, out.predicted[at], cross, scratch)
        for a in range(2, m):
            log_uniform += _ignore_if_ambiguous(innovation[a, a], a, sensor.periods[a], noise)
        if not condition(cov, noise, innovation, factor, cross, posterior, n, m):
            posterior_of_squares(mean, cov, factor, cross, weights, scratch, posterior)
    else:
        condition_linear(mean, cov, factor, cross, scratch, posterior)
    out.log_norm[at] = log_norm_of_factor(factor) + log_uniform


@inlined
def whiten(innovation: Innovation, at: int, measurement: Floats, periods: Floats, gate: float, out: Floats) -> float:
    """Whitened residual of a measurement against component `at`. Returns its squared Mahalanobis distance.

    Once that is known to be above `gate` the rest is left undone and a lower bound of it is returned.
    """
    factor = innovation.factor[at]
    distance = 0.0
    for a in range(innovation.predicted.shape[1]):
        total = wrap(measurement[a] - innovation.predicted[at, a], periods[a])
        for k in range(a):
            total -= factor[a, k] * out[k]
        out[a] = total / factor[a, a]
        distance += out[a] * out[a]
        # The distance only grows: what is gated out need not be whitened to the end.
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


@inlined
def write_posterior(innovation: Innovation, at: int, whitened: Floats, mean: Floats, out: Floats) -> None:
    """Write mean and covariance of component `at` after a measurement to the rows of `out`, mean first."""
    update_mean(innovation, at, whitened, mean, out[0])
    for i in range(mean.shape[0]):
        for j in range(mean.shape[0]):
            out[1 + i, j] = innovation.covs[at, i, j]
