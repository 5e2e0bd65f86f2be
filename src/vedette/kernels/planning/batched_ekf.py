"""Extended Kalman steps of many Gaussians side by side, in loops that the compiler vectorises.

The formulas are those of `vedette.kernels.gaussian.prediction` and `innovation`. Entry (i, j) of all matrices is one
row of numbers, one per Gaussian. If a number is not valid (a matrix that is not definite, a difference that cancels),
and for sigma points, a Gaussian is processed alone by those kernels, whose result is final.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.elementary import logs
from vedette.kernels.base.types import Bools, Floats, Motion, Sensor
from vedette.kernels.gaussian.innovation import (
    LARGEST_BEND,
    LEAST_SHRINKAGE,
    Innovation,
    bends_over,
    expect,
    expect_measurement,
    make_innovation,
)
from vedette.kernels.gaussian.linalg import LOG_2PI
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.relinearisation import Pair, PairWork, relinearise
from vedette.kernels.gaussian.scratch import Scratch, make_scratch
from vedette.kernels.gaussian.sigma_points import LINEARISED, SWITCHED
from vedette.kernels.planning.batched_models import (
    ANY,
    ModelForms,
    Offsets,
    fill_detection_of_gaussians,
    fill_jacobians,
    fill_measurements,
    fill_noise,
    find_offsets,
    jacobian_width,
    make_offsets,
    place,
    take_matrix,
    take_state,
)


class BatchedGaussians(NamedTuple):
    """Predicted Gaussians and their expected measurements, as in `Innovation`, with lower triangles of the matrices."""

    means: Floats  # (state_dim, room)
    covs: Floats  # (state_dim (state_dim + 1) / 2, room)
    predicted: Floats  # (meas_dim, room)
    factor: Floats  # (meas_dim (meas_dim + 1) / 2, room) L
    whitened_cross: Floats  # (meas_dim * state_dim, room) W, row by row
    posterior: Floats  # (state_dim (state_dim + 1) / 2, room)
    log_norm: Floats  # (room,)
    prob_detection: Floats  # (room,)


class BatchWork(NamedTuple):
    """Working arrays."""

    offsets: Offsets
    product: Floats  # (state_dim * state_dim, room) Jacobian of the motion times covariance
    jacobian: Floats  # (meas_dim * state_dim, room) Jacobian of the measurement
    noise: Floats  # (meas_dim (meas_dim + 1) / 2, room)
    volume: Floats  # (room,) determinant of the innovation covariance; NaN if processed alone
    bends: Bools  # (room,) see `innovation`
    scratch: Scratch
    measurement: Floats  # (meas_dim,) of one Gaussian, like the following arrays
    mean: Floats  # (state_dim,)
    cov: Floats  # (state_dim, state_dim)
    out_mean: Floats  # (state_dim,)
    out_cov: Floats  # (state_dim, state_dim)
    innovation: Innovation


@kernel
def make_batch(dim: int, meas_dim: int, room: int) -> BatchedGaussians:
    size, meas_size = place(dim, 0), place(meas_dim, 0)
    return BatchedGaussians(
        np.empty((dim, room)),
        np.empty((size, room)),
        np.empty((meas_dim, room)),
        np.empty((meas_size, room)),
        np.empty((meas_dim * dim, room)),
        np.empty((size, room)),
        np.empty(room),
        np.empty(room),
    )


@kernel
def make_batch_work(dim: int, meas_dim: int, room: int) -> BatchWork:
    return BatchWork(
        make_offsets(room),
        np.empty((dim * dim, room)),
        np.empty((meas_dim * dim, room)),
        np.empty((place(meas_dim, 0), room)),
        np.empty(room),
        np.empty(room, np.bool_),
        make_scratch(dim, meas_dim),
        np.empty(meas_dim),
        np.empty(dim),
        np.empty((dim, dim)),
        np.empty(dim),
        np.empty((dim, dim)),
        make_innovation(1, dim, meas_dim),
    )


@inlined
def _set(value: float, num: int, out: Floats) -> None:
    for s in range(num):
        out[s] = value


@inlined
def _add_scaled(scale: float, row: Floats, num: int, out: Floats) -> None:
    # Jacobians of motion models are mostly zero.
    if scale != 0.0:
        for s in range(num):
            out[s] += scale * row[s]


@inlined
def _add_product(a: Floats, b: Floats, num: int, out: Floats) -> None:
    for s in range(num):
        out[s] += a[s] * b[s]


@inlined
def _subtract_product(a: Floats, b: Floats, num: int, out: Floats) -> None:
    for s in range(num):
        out[s] -= a[s] * b[s]


@inlined
def _lower(i: int, j: int) -> int:
    """Return the index of entry (i, j) of a symmetric matrix."""
    return place(i, j) if i >= j else place(j, i)


@borrowing
def _predict_linear(
    forms: ModelForms, means: Floats, covs: Floats, num: int, batch: BatchedGaussians, work: BatchWork
) -> int:
    """Apply m <- F m, P <- F P F' + Q. Returns how many are not finite or not positive on the diagonal."""
    dim, transition, noise, wrong = means.shape[0], forms.transition, forms.motion_noise, 0
    for i in range(dim):
        _set(0.0, num, batch.means[i])
        for k in range(dim):
            _add_scaled(transition[i, k], means[k], num, batch.means[i])
            _set(0.0, num, work.product[i * dim + k])
            for j in range(dim):
                _add_scaled(transition[i, j], covs[_lower(j, k)], num, work.product[i * dim + k])
    for i in range(dim):
        for j in range(i + 1):
            out = batch.covs[place(i, j)]
            _set(0.5 * (noise[i, j] + noise[j, i]), num, out)
            for k in range(dim):
                _add_scaled(transition[j, k], work.product[i * dim + k], num, out)
        mean, variance = batch.means[i], batch.covs[place(i, i)]
        for s in range(num):
            wrong += 0 if 0.0 < variance[s] < math.inf and abs(mean[s]) < math.inf else 1
    return wrong


@borrowing
def predict_batch(
    motion: Motion,
    forms: ModelForms,
    dt: float,
    means: Floats,
    covs: Floats,
    num: int,
    batch: BatchedGaussians,
    work: BatchWork,
) -> None:
    """Predict the first `num` Gaussians of means (state_dim, room) and covs into the batch, as `prediction.predict`."""
    if forms.is_linear == 1 and _predict_linear(forms, means, covs, num, batch, work) == 0:
        return
    for s in range(num):
        take_state(means, s, work.mean)
        take_matrix(covs, s, work.cov)
        predict(motion, dt, work.mean, work.cov, work.out_mean, work.out_cov, work.scratch)
        for i in range(len(work.mean)):
            batch.means[i, s] = work.out_mean[i]
            for j in range(i + 1):
                batch.covs[place(i, j), s] = work.out_cov[i, j]


@inlined
def _project(width: int, num: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Write W = H P, and the lower triangle of H P H' + R into the factor."""
    dim, meas_dim = batch.means.shape[0], batch.predicted.shape[0]
    for a in range(meas_dim):
        for j in range(dim):
            cross = batch.whitened_cross[a * dim + j]
            _set(0.0, num, cross)
            for k in range(width):
                _add_product(work.jacobian[a * dim + k], batch.covs[_lower(k, j)], num, cross)
        for b in range(a + 1):
            entries, noise = batch.factor[place(a, b)], work.noise[place(a, b)]
            _set(0.0, num, entries)
            for k in range(width):
                _add_product(batch.whitened_cross[a * dim + k], work.jacobian[b * dim + k], num, entries)
            for s in range(num):
                entries[s] += noise[s]


@inlined
def _condition(num: int, batch: BatchedGaussians, work: BatchWork) -> None:
    """Factor the innovation covariances, whiten the cross-covariances, and write the posterior covariances."""
    dim, meas_dim, volume = batch.means.shape[0], batch.predicted.shape[0], work.volume
    _set(1.0, num, volume)
    for a in range(meas_dim):
        pivots = batch.factor[place(a, a)]
        for b in range(a + 1):
            entries = batch.factor[place(a, b)]
            for k in range(b):
                _subtract_product(batch.factor[place(a, k)], batch.factor[place(b, k)], num, entries)
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
                _subtract_product(batch.factor[place(a, k)], batch.whitened_cross[k * dim + j], num, cross)
            for s in range(num):
                cross[s] /= pivots[s]
    for i in range(dim):
        for j in range(i + 1):
            given, out = batch.covs[place(i, j)], batch.posterior[place(i, j)]
            for s in range(num):
                out[s] = given[s]
            for a in range(meas_dim):
                _subtract_product(batch.whitened_cross[a * dim + i], batch.whitened_cross[a * dim + j], num, out)


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
    dim, innovation = batch.means.shape[0], work.innovation
    for a in range(batch.predicted.shape[0]):
        batch.predicted[a, s] = innovation.predicted[0, a]
        for b in range(a + 1):
            batch.factor[place(a, b), s] = innovation.factor[0, a, b]
        for j in range(dim):
            batch.whitened_cross[a * dim + j, s] = innovation.whitened_cross[0, a, j]
    for i in range(dim):
        for j in range(i + 1):
            batch.posterior[place(i, j), s] = innovation.covs[0, i, j]
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
        expect_measurement(sensor, pose, work.mean, work.cov, work.measurement, 0, work.innovation, work.scratch)
        pair = Pair(pose, work.mean, work.cov, work.measurement)
        relinearise(sensor, pair, PairWork(work.innovation, work.scratch))
        _put_innovation(s, batch, work)
        for a in range(len(work.measurement)):
            measurements[a, s], batch.predicted[a, s] = work.scratch.residual[a], 0.0
            for b in range(a + 1):
                batch.factor[place(a, b), s] = 1.0 if a == b else 0.0
