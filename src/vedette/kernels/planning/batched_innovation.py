"""Innovations of many Gaussians side by side, by the extended Kalman filter, in loops that the compiler vectorises.

The formulas are those of `vedette.kernels.gaussian.innovation`. If a number is not valid (a matrix that is not
definite, a difference that cancels), and for sigma points, a Gaussian is processed alone by that kernel, whose result
is final.
"""

import math

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.elementary import logs
from vedette.kernels.base.types import Bools, Floats, Sensor
from vedette.kernels.gaussian.innovation import (
    LARGEST_BEND,
    LEAST_SHRINKAGE,
    bends_over,
    expect,
    expect_measurement,
)
from vedette.kernels.gaussian.linalg import LOG_2PI
from vedette.kernels.gaussian.relinearisation import Pair, PairWork, relinearise
from vedette.kernels.gaussian.row_noise import no_row_noise
from vedette.kernels.gaussian.sigma_points import LINEARISED, SWITCHED
from vedette.kernels.planning.batched_models import (
    ANY,
    ModelForms,
    fill_detection_of_gaussians,
    fill_jacobians,
    fill_measurements,
    fill_noise,
    find_offsets,
    jacobian_width,
)
from vedette.kernels.planning.batched_prediction import BatchedGaussians, BatchWork
from vedette.kernels.planning.lanes import (
    add_product,
    copy_rows,
    place,
    place_in_symmetric,
    put_matrix,
    put_rows,
    put_state,
    set_row,
    subtract_product,
    take_matrix,
    take_state,
)


@inlined
def _project(width: int, num: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Write W = H P, and the lower triangle of H P H' + R into the factor."""
    dim, meas_dim = batch.means.shape[0], batch.predicted.shape[0]
    for a in range(meas_dim):
        for j in range(dim):
            cross = batch.whitened_cross[a * dim + j]
            set_row(0.0, num, cross)
            for k in range(width):
                add_product(work.jacobian[a * dim + k], batch.covs[place_in_symmetric(k, j)], num, cross)
        for b in range(a + 1):
            entries, noise = batch.factor[place(a, b)], work.noise[place(a, b)]
            set_row(0.0, num, entries)
            for k in range(width):
                add_product(batch.whitened_cross[a * dim + k], work.jacobian[b * dim + k], num, entries)
            for s in range(num):
                entries[s] += noise[s]


@inlined
def _condition(num: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Factor the innovation covariances, whiten the cross-covariances, and write the posterior covariances."""
    dim, meas_dim, volume = batch.means.shape[0], batch.predicted.shape[0], work.volume
    set_row(1.0, num, volume)
    for a in range(meas_dim):
        pivots = batch.factor[place(a, a)]
        for b in range(a + 1):
            entries = batch.factor[place(a, b)]
            for k in range(b):
                subtract_product(batch.factor[place(a, k)], batch.factor[place(b, k)], num, entries)
            if b < a:
                divisors = batch.factor[place(b, b)]
                for s in range(num):
                    entries[s] /= divisors[s]
        for s in range(num):
            # NaN from the first pivot that is not above zero.
            volume[s] *= pivots[s] if pivots[s] > 0.0 else math.nan
        for s in range(num):
            pivots[s] = math.sqrt(pivots[s] if pivots[s] > 0.0 else math.nan)
        for j in range(dim):
            cross = batch.whitened_cross[a * dim + j]
            for k in range(a):
                subtract_product(batch.factor[place(a, k)], batch.whitened_cross[k * dim + j], num, cross)
            for s in range(num):
                cross[s] /= pivots[s]
    copy_rows(batch.covs, num, batch.posterior)
    for i in range(dim):
        for j in range(i + 1):
            for a in range(meas_dim):
                crosses = batch.whitened_cross[a * dim + i], batch.whitened_cross[a * dim + j]
                subtract_product(crosses[0], crosses[1], num, batch.posterior[place(i, j)])


@inlined
def _mark_bent(form: int, height: int, pose: Floats, num: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Set the volumes of Gaussians with too nonlinear measurements to NaN, see `innovation.bends_over`."""
    volume, dim, meas_dim = work.volume, batch.means.shape[0], batch.predicted.shape[0]
    if form == ANY:
        jacobian, noise = work.scratch.measurement_jacobian, work.scratch.measurement_noise
        for s in range(num):
            take_state(batch.means, s, work.mean)
            take_matrix(batch.covs, s, work.cov)
            take_matrix(work.noise, s, noise)
            for a in range(meas_dim):
                for j in range(dim):
                    jacobian[a, j] = work.jacobian[a * dim + j, s]
            if bends_over(pose, work.mean, work.cov, jacobian, noise, height, dim, meas_dim):
                volume[s] = math.nan
        return
    squares, first, second = work.offsets.squares, batch.covs[0], batch.covs[place(1, 1)]
    scale = 4.0 * LARGEST_BEND * LARGEST_BEND
    for a in range(meas_dim):
        along, across, own = work.jacobian[a * dim], work.jacobian[a * dim + 1], work.noise[place(a, a)]
        for s in range(num):
            variance = first[s] + second[s]
            slope = (along[s] * along[s] + across[s] * across[s]) * variance
            volume[s] = math.nan if variance * slope > scale * squares[s] * own[s] else volume[s]


@inlined
def _mark_cancelled(num: int, batch: BatchedGaussians, work: BatchWork) -> int:
    """Set the volumes of Gaussians that must be processed alone to NaN, see `innovation`. Returns their number."""
    volume, noise, wrong = work.volume, work.noise, 0
    if batch.predicted.shape[0] == 1:
        own = noise[0]
        for s in range(num):
            volume[s] = volume[s] if LEAST_SHRINKAGE * volume[s] < own[s] else math.nan
    else:
        first, skew, second = noise[0], noise[1], noise[2]
        for s in range(num):
            own_volume = first[s] * second[s] - skew[s] * skew[s]
            volume[s] = volume[s] if LEAST_SHRINKAGE * volume[s] < own_volume else math.nan
    for s in range(num):
        wrong += 0 if 1e-290 < volume[s] < 1e290 else 1
    return wrong


@inlined
def _put_innovation(s: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Write the innovation of one Gaussian into the batch, except its detection probability."""
    innovation = work.innovation
    put_state(innovation.predicted[0], s, batch.predicted)
    put_matrix(innovation.factor[0], s, batch.factor)
    put_rows(innovation.whitened_cross[0], s, batch.whitened_cross)
    put_matrix(innovation.covs[0], s, batch.posterior)
    batch.log_norm[s] = innovation.log_norm[0]


@borrowing
def _expect_alone(sensor: Sensor, pose: Floats, s: int, batch: BatchedGaussians, work: BatchWork) -> None:
    take_state(batch.means, s, work.mean)
    take_matrix(batch.covs, s, work.cov)
    expect(sensor, pose, work.mean, work.cov, 0, work.innovation, work.scratch)
    _put_innovation(s, batch, work)
    batch.prob_detection[s], work.bends[s] = work.innovation.prob_detection[0], work.innovation.bends[0]


@borrowing
def expect_batch(
    sensor: Sensor, forms: ModelForms, pose: Floats, num: int, batch: BatchedGaussians, work: BatchWork
) -> None:
    """Write the innovations of the first `num` predicted Gaussians for a scan from a pose, as `innovation.expect`."""
    meas_dim, scratch, offsets = batch.predicted.shape[0], work.scratch, work.offsets
    for s in range(num):
        work.bends[s] = False
    if sensor.method not in (LINEARISED, SWITCHED) or meas_dim > 2:
        for s in range(num):
            _expect_alone(sensor, pose, s, batch, work)
        return
    means = batch.means
    find_offsets(pose, means, num, offsets)
    fill_measurements(sensor, forms.measurement, pose, means, offsets, num, scratch, batch.predicted)
    fill_jacobians(sensor, forms.measurement, pose, means, offsets, num, scratch, work.jacobian)
    fill_noise(sensor, forms.noise, pose, means, offsets, num, scratch, work.noise)
    width = jacobian_width(forms.measurement, means.shape[0])
    _project(width, num, batch, work)
    _condition(num, batch, work)
    if sensor.method == SWITCHED:
        _mark_bent(forms.measurement, sensor.height, pose, num, batch, work)
    wrong = _mark_cancelled(num, batch, work)
    for s in range(num):
        batch.log_norm[s] = work.volume[s]
    logs(batch.log_norm[:num], offsets.bits, offsets.more_bits)
    for s in range(num):
        batch.log_norm[s] = -0.5 * (batch.log_norm[s] + meas_dim * LOG_2PI)
    fill_detection_of_gaussians(sensor, forms, pose, means, batch.covs, offsets, num, scratch, batch.prob_detection)
    if wrong > 0:
        for s in range(num):
            if not 1e-290 < work.volume[s] < 1e290:
                _expect_alone(sensor, pose, s, batch, work)


@borrowing
def relinearise_batch(
    sensor: Sensor,
    pose: Floats,
    measurements: Floats,
    is_seen: Bools,
    num: int,
    batch: BatchedGaussians,
    work: BatchWork,
) -> None:
    """Replace innovations of strongly nonlinear Gaussians by those near their measurements, if these are detected.

    measurements: (meas_dim, room). Those of such Gaussians become whitened residuals, whose expectation is zero with
    unit covariance.
    """
    for s in range(num):
        if not (work.bends[s] and is_seen[s]):
            continue
        take_state(batch.means, s, work.mean)
        take_matrix(batch.covs, s, work.cov)
        take_state(measurements, s, work.measurement)
        none = no_row_noise(work.innovation.factor)
        expect_measurement(sensor, pose, work.mean, work.cov, none, 0, work.innovation, work.scratch)
        pair = Pair(pose, work.mean, work.cov, work.measurement, none)
        relinearise(sensor, pair, PairWork(work.innovation, work.scratch))
        _put_innovation(s, batch, work)
        for a in range(len(work.measurement)):
            measurements[a, s], batch.predicted[a, s] = work.scratch.residual[a], 0.0
            for b in range(a + 1):
                batch.factor[place(a, b), s] = 1.0 if a == b else 0.0
