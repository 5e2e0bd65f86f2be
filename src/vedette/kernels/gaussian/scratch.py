"""Working arrays of the Gaussian kernels, and angles."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats

FULL_TURN = 2.0 * math.pi  # period of an angle


class Scratch(NamedTuple):
    """Working arrays of one thread for a state of n components and measurements of m."""

    jacobian: Floats  # (n, n) of the motion
    product: Floats  # (n, n) Jacobian times covariance
    noise: Floats  # (n, n) of the motion; later K R K'
    factor: Floats  # (n, n) Cholesky factor of the covariance, for sigma points
    points: Floats  # (2 n + 1, n) sigma points
    images: Floats  # (2 n + 1, max(n, m)) their images, then the deviations of these from their mean
    measurement_jacobian: Floats  # (m, n)
    measurement_noise: Floats  # (m, m)
    noise_factor: Floats  # (m, m) Cholesky factor of the measurement noise
    innovation_cov: Floats  # (m, m)
    residual: Floats  # (m,)
    gain: Floats  # (m, n) transposed
    no_periods: Floats  # (n,) inf: no component of a state is wrapped


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
        np.empty((meas_dim, meas_dim)),
        np.empty(meas_dim),
        np.empty((meas_dim, state_dim)),
        np.full(state_dim, math.inf),
    )


@inlined
def wrap(value: float, period: float) -> float:
    """The same value in (-period / 2, period / 2]. With period inf: unchanged."""
    half = 0.5 * period
    if period == math.inf or not (value <= -half or value > half):  # NaN stays
        return value
    wrapped = value - period * math.floor((value + half) / period)
    return half if wrapped <= -half else wrapped


@inlined
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    return wrap(angle, FULL_TURN)


@inlined
def is_folded(period: float) -> bool:
    """Return True for the period of a quantity that is measured modulo an interval, and is no angle."""
    return period < math.inf and period != FULL_TURN
