"""Predicted Gaussians side by side: their arrays and their prediction, in loops that the compiler vectorises.

The formulas are those of `vedette.kernels.gaussian.prediction`. If a number is not valid, the Gaussians are predicted
one by one by that kernel, whose result or error is final.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Bools, Floats, Motion
from vedette.kernels.gaussian.innovation import Innovation, make_innovation
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import Scratch, make_scratch
from vedette.kernels.planning.batched_models import ModelForms, Offsets, make_offsets
from vedette.kernels.planning.lanes import (
    add_scaled,
    place,
    place_in_symmetric,
    put_matrix,
    put_state,
    set_row,
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


@borrowing
def _predict_linear(
    forms: ModelForms, means: Floats, covs: Floats, num: int, batch: BatchedGaussians, work: BatchWork
) -> int:
    """Apply m <- F m, P <- F P F' + Q. Returns how many are not finite or not positive on the diagonal."""
    dim, transition, noise, wrong = means.shape[0], forms.transition, forms.motion_noise, 0
    for i in range(dim):
        set_row(0.0, num, batch.means[i])
        for k in range(dim):
            add_scaled(transition[i, k], means[k], num, batch.means[i])
            set_row(0.0, num, work.product[i * dim + k])
            for j in range(dim):
                add_scaled(transition[i, j], covs[place_in_symmetric(j, k)], num, work.product[i * dim + k])
    for i in range(dim):
        for j in range(i + 1):
            out = batch.covs[place(i, j)]
            set_row(0.5 * (noise[i, j] + noise[j, i]), num, out)
            for k in range(dim):
                add_scaled(transition[j, k], work.product[i * dim + k], num, out)
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
        predict(motion, 0, dt, work.mean, work.cov, work.out_mean, work.out_cov, work.scratch)
        put_state(work.out_mean, s, batch.means)
        put_matrix(work.out_cov, s, batch.covs)
