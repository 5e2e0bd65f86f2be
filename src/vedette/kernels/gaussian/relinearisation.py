"""Updates of a Gaussian by one measurement that bends over it: an iterated extended Kalman filter, then one regression.

From the unscented update, Gauss-Newton steps find the peak of prior times likelihood (Bell and Cathey 1993). There the
measurement is linearised once more, by statistical regression over the posterior at the peak, as in the posterior
linearisation filter (Garcia-Fernandez, Svensson, Morelande and Sarkka 2015): what the regression leaves over is added
to the noise. Mean, covariance and likelihood are then those of a Kalman filter with this linear measurement.
"""

import math
from typing import NamedTuple

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, RowNoise, Sensor
from vedette.kernels.gaussian.innovation import (
    Innovation,
    bends_over,
    condition_linear,
    expect_measurement,
    ignore_ambiguous,
    log_norm_of_factor,
    make_innovation,
    update_mean,
    whiten,
    write_posterior,
)
from vedette.kernels.gaussian.linalg import cholesky, solve_lower, solve_upper
from vedette.kernels.gaussian.row_noise import replace_noise
from vedette.kernels.gaussian.scratch import Scratch, make_scratch, wrap
from vedette.kernels.gaussian.sigma_points import (
    SWITCHED,
    UNSCENTED,
    fill_sigma_points,
    moments_of_images,
)

# Two or three steps suffice unless the prior is as wide as the target is far; then the search follows a curved ridge.
_MOST_STEPS = 20
_MOST_HALVINGS = 8
_LEAST_GAIN = 1e-3  # of the squared distance; steps that gain less end the search
_LOST = 64.0  # squared distance above which the search has not found the peak: the unscented update stands


class Pair(NamedTuple):
    """A Gaussian and a measurement from a pose."""

    pose: Floats  # (pose_dim,)
    mean: Floats  # (state_dim,)
    cov: Floats  # (state_dim, state_dim)
    measurement: Floats  # (meas_dim,)
    noise: RowNoise  # that the measurement brings


class PairWork(NamedTuple):
    """Working arrays of the update of one pair."""

    innovation: Innovation  # of one entry
    scratch: Scratch


@kernel
def make_pair_work(state_dim: int, meas_dim: int) -> PairWork:
    return PairWork(make_innovation(1, state_dim, meas_dim), make_scratch(state_dim, meas_dim))


@borrowing
def _squared_distance(sensor: Sensor, pair: Pair, state: Floats, scratch: Scratch) -> float:
    """Squared distance of a state from the prior and of its measurement from the one made, in standard deviations."""
    deviation, residual, total = scratch.images[0], scratch.residual, 0.0
    for j in range(state.shape[0]):
        deviation[j] = state[j] - pair.mean[j]
        for k in range(j):
            deviation[j] -= scratch.factor[j, k] * deviation[k]
        deviation[j] /= scratch.factor[j, j]
        total += deviation[j] * deviation[j]
    sensor.measurement(state, pair.pose, sensor.measurement_params, residual)
    for a in range(residual.shape[0]):
        residual[a] = wrap(pair.measurement[a] - residual[a], sensor.periods[a])
    solve_lower(scratch.noise_factor, residual, residual)
    for a in range(residual.shape[0]):
        total += residual[a] * residual[a]
    return total


@borrowing
def _update(sensor: Sensor, pair: Pair, state: Floats, work: PairWork) -> float:
    """Update by z = predicted + H (x - state) + noise. Returns the squared distance of the measurement.

    H and the covariance of the noise are those of the scratch, where the whitened residual is left. Only the nonlinear
    part of the residual is wrapped.
    """
    innovation, scratch, n, m = work.innovation, work.scratch, pair.mean.shape[0], work.innovation.predicted.shape[1]
    jacobian, residual, factor, distance = scratch.measurement_jacobian, scratch.residual, innovation.factor[0], 0.0
    condition_linear(pair.mean, pair.cov, factor, innovation.whitened_cross[0], scratch, innovation.covs[0])
    for a in range(m):
        total = wrap(pair.measurement[a] - innovation.predicted[0, a], sensor.periods[a])
        for j in range(n):
            total += jacobian[a, j] * (state[j] - pair.mean[j])
        for k in range(a):
            total -= factor[a, k] * residual[k]
        residual[a] = total / factor[a, a]
        distance += residual[a] * residual[a]
    return distance


@borrowing
def _linearise(sensor: Sensor, pair: Pair, state: Floats, work: PairWork) -> None:
    """Update by the measurement's Jacobian at a state."""
    sensor.measurement(state, pair.pose, sensor.measurement_params, work.innovation.predicted[0])
    sensor.measurement_jacobian(state, pair.pose, sensor.measurement_params, work.scratch.measurement_jacobian)
    _update(sensor, pair, state, work)


@borrowing
def _climb(sensor: Sensor, pair: Pair, work: PairWork) -> float:
    """Move `points[0]` of the scratch to a peak of prior times likelihood. Returns its squared distance.

    By Gauss-Newton steps, halved until the distance decreases.
    """
    scratch = work.scratch
    state, goal, trial = scratch.points[0], scratch.points[1], scratch.points[2]
    least = _squared_distance(sensor, pair, state, scratch)
    for _ in range(_MOST_STEPS):
        _linearise(sensor, pair, state, work)
        update_mean(work.innovation, 0, scratch.residual, pair.mean, goal)
        before, share = least, 1.0
        for _ in range(_MOST_HALVINGS):
            for j in range(state.shape[0]):
                trial[j] = state[j] + share * (goal[j] - state[j])
            reached = _squared_distance(sensor, pair, trial, scratch)
            if reached < least:
                least = reached
                for j in range(state.shape[0]):
                    state[j] = trial[j]
                break
            share *= 0.5
        if not before - least > _LEAST_GAIN:
            break
    return least


@inlined
def _leave_sensor(pair: Pair, state: Floats, cov: Floats) -> None:
    """Move the position of a peak along its ray from the sensor to where the density of the distance has its peak.

    With distance r and standard deviation s along the ray it maximises log x - (x - r)^2 / (2 s^2) over x: next to the
    sensor, where a Jacobian holds nowhere else, the density of the position has a peak that says little.
    """
    dx, dy = state[0] - pair.pose[0], state[1] - pair.pose[1]
    square = dx * dx + dy * dy
    if square == 0.0:
        return
    variance = (dx * dx * cov[0, 0] + 2.0 * dx * dy * cov[1, 0] + dy * dy * cov[1, 1]) / square
    scale = 0.5 + 0.5 * math.sqrt(1.0 + 4.0 * variance / square)
    state[0], state[1] = pair.pose[0] + scale * dx, pair.pose[1] + scale * dy


@borrowing
def _regress(sensor: Sensor, pair: Pair, work: PairWork) -> None:
    """Linearise by regression over the posterior at `points[0]`: predicted measurement, H, and what is left to noise.

    With the Cholesky factor L of the posterior covariance and images z of the points x +- s L_i, the regression is
    H L = B, B_i = (z(+i) - z(-i)) / (2 s), and the covariance of the images exceeds H P H' = B B' by what is left.
    """
    scratch, predicted, n = work.scratch, work.innovation.predicted[0], pair.mean.shape[0]
    points, images, noise, m = scratch.points, scratch.images, scratch.measurement_noise, predicted.shape[0]
    weights = fill_sigma_points(UNSCENTED, points[0], work.innovation.covs[0], points, scratch.factor)
    for i in range(weights.num):
        sensor.measurement(points[i], pair.pose, sensor.measurement_params, scratch.residual)
        for a in range(m):
            images[i, a] = scratch.residual[a]
    moments_of_images(images, weights, m, sensor.periods, predicted, scratch.innovation_cov)
    half, rows = 0.5 * math.sqrt(2.0 * weights.other), scratch.measurement_jacobian
    for a in range(m):
        for i in range(n):
            rows[a, i] = half * (images[1 + i, a] - images[1 + n + i, a])
    for a in range(m):
        for b in range(m):
            noise[a, b] += scratch.innovation_cov[a, b]
            for i in range(n):
                noise[a, b] -= rows[a, i] * rows[b, i]
    for a in range(m):
        solve_upper(scratch.factor, rows[a], rows[a])


@borrowing
def _expect_and_whiten(sensor: Sensor, pair: Pair, work: PairWork) -> float:
    """Fill the innovation of the Gaussian (noise of the pair). Returns the squared distance of the measurement."""
    expect_measurement(sensor, pair.pose, pair.mean, pair.cov, pair.noise, 0, work.innovation, work.scratch)
    return whiten(work.innovation, 0, pair.measurement, sensor.periods, math.inf, work.scratch.residual)


@borrowing
def relinearise(sensor: Sensor, pair: Pair, work: PairWork) -> float:
    """Update a pair. Returns the squared distance of its measurement under the last linearisation.

    The innovation holds that of the Gaussian (sigma points) before, and that of the pair afterwards. Its `predicted` is
    of no use then: the whitened residual is left in `work.scratch.residual`.
    """
    innovation, scratch = work.innovation, work.scratch
    whiten(innovation, 0, pair.measurement, sensor.periods, math.inf, scratch.residual)
    update_mean(innovation, 0, scratch.residual, pair.mean, scratch.points[0])
    sensor.measurement_noise_cov(pair.mean, pair.pose, sensor.noise_params, scratch.measurement_noise)
    replace_noise(pair.noise, scratch.measurement_noise)
    sensor.measurement_jacobian(pair.mean, pair.pose, sensor.measurement_params, scratch.measurement_jacobian)
    log_uniform = ignore_ambiguous(sensor, scratch.measurement_jacobian, pair.cov, scratch.measurement_noise)
    if not cholesky(pair.cov, scratch.factor):
        raise NumericalError("covariance of a track is not positive definite")
    if not cholesky(scratch.measurement_noise, scratch.noise_factor):
        raise NumericalError("measurement noise: covariance is not positive definite")
    if _climb(sensor, pair, work) > _LOST:
        return _expect_and_whiten(sensor, pair, work)
    _leave_sensor(pair, scratch.points[0], innovation.covs[0])
    _linearise(sensor, pair, scratch.points[0], work)
    _regress(sensor, pair, work)
    distance = _update(sensor, pair, scratch.points[0], work)
    innovation.log_norm[0] = log_norm_of_factor(innovation.factor[0]) + log_uniform
    return distance


@borrowing
def learn_at_mean(sensor: Sensor, pair: Pair, share: float, work: PairWork) -> None:
    """Write the posterior covariance (-> that of the innovation) of a part of a measurement of a target at the mean.

    For linearised measurements. The peak of prior times likelihood is then the mean, and a `share` of the information
    of a linear measurement is a measurement with so much more noise. pair: its measurement is not read.
    """
    innovation, scratch, n, m = work.innovation, work.scratch, pair.mean.shape[0], work.innovation.predicted.shape[1]
    state, jacobian, noise = scratch.points[0], scratch.measurement_jacobian, scratch.measurement_noise
    factor, cross, posterior = innovation.factor[0], innovation.whitened_cross[0], innovation.covs[0]
    sensor.measurement_noise_cov(pair.mean, pair.pose, sensor.noise_params, noise)
    sensor.measurement_jacobian(pair.mean, pair.pose, sensor.measurement_params, jacobian)
    ignore_ambiguous(sensor, jacobian, pair.cov, noise)
    if sensor.method == SWITCHED and bends_over(pair.pose, pair.mean, pair.cov, jacobian, noise, sensor.height, n, m):
        condition_linear(pair.mean, pair.cov, factor, cross, scratch, posterior)
        for j in range(n):
            state[j] = pair.mean[j]
        _leave_sensor(pair, state, posterior)
        sensor.measurement_jacobian(state, pair.pose, sensor.measurement_params, jacobian)
        condition_linear(pair.mean, pair.cov, factor, cross, scratch, posterior)
        _regress(sensor, pair, work)
    for a in range(m):
        for b in range(m):
            noise[a, b] /= share
    condition_linear(pair.mean, pair.cov, factor, cross, scratch, posterior)


@inlined
def update_pair(sensor: Sensor, pair: Pair, gate: float, work: PairWork, out: Floats) -> float:
    """Update a pair and write posterior mean and covariance to the rows of `out`, mean first.

    By `relinearise`, but by the linear update if the measurement brings a noise with which it does not bend. Returns
    the squared distance of the measurement. Above `gate` nothing is written.
    """
    distance, bends = 0.0, True
    if len(pair.noise.own) + len(pair.noise.added) > 0:
        distance = _expect_and_whiten(sensor, pair, work)
        bends = work.innovation.bends[0]
    if bends and distance <= gate:
        distance = relinearise(sensor, pair, work)
    if distance <= gate:
        write_posterior(work.innovation, 0, work.scratch.residual, pair.mean, out)
    return distance


@inlined
def copy_updated(updated: Floats, mean: Floats, cov: Floats) -> None:
    """Copy mean and covariance from the rows that `update_pair` wrote."""
    for i in range(mean.shape[0]):
        mean[i] = updated[0, i]
        for j in range(mean.shape[0]):
            cov[i, j] = updated[1 + i, j]
