"""Prediction of Gaussians: the Chapman-Kolmogorov step of extended, unscented and cubature Kalman filters."""

import math

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Motion
from vedette.kernels.gaussian.linalg import sandwich
from vedette.kernels.gaussian.scratch import Scratch
from vedette.kernels.gaussian.sigma_points import LINEARISED, fill_sigma_points, moments_of_images


@borrowing
def _predict_sigma_points(
    motion: Motion, mode: int, dt: float, mean: Floats, cov: Floats, out_mean: Floats, out_cov: Floats, scratch: Scratch
) -> None:
    n = mean.shape[0]
    points, images, noise = scratch.points, scratch.images, scratch.noise
    weights = fill_sigma_points(motion.method, mean, cov, points, scratch.factor)
    for i in range(weights.num):
        motion.transition(points[i], dt, motion.transition_params[mode], out_mean)
        for j in range(n):
            images[i, j] = out_mean[j]
    moments_of_images(images, weights, n, scratch.no_periods, out_mean, out_cov)
    for i in range(n):
        for j in range(n):
            out_cov[i, j] += 0.5 * (noise[i, j] + noise[j, i])


@inlined
def predict(
    motion: Motion, mode: int, dt: float, mean: Floats, cov: Floats, out_mean: Floats, out_cov: Floats, scratch: Scratch
) -> None:
    """m <- f(m), P <- F P F' + Q over `dt` seconds, F the Jacobian of f at m, or the moments of sigma points, and Q.

    The process noise Q is taken at the prior mean. mode: row of the parameters.
    """
    n = mean.shape[0]
    motion.process_noise_cov(mean, dt, motion.noise_params[mode], scratch.noise)
    if motion.method == LINEARISED:
        motion.transition(mean, dt, motion.transition_params[mode], out_mean)
        motion.transition_jacobian(mean, dt, motion.transition_params[mode], scratch.jacobian)
        # A constant size is unrolled by the compiler, which halves the cost of the two usual ones.
        if n == 4:
            sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, 4)
        elif n == 5:
            sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, 5)
        else:
            sandwich(scratch.jacobian, cov, scratch.noise, scratch.product, out_cov, n)
    else:
        _predict_sigma_points(motion, mode, dt, mean, cov, out_mean, out_cov, scratch)
    for i in range(n):
        if not (math.isfinite(out_mean[i]) and math.isfinite(out_cov[i, i])):
            raise ModelError("motion model: predicted mean or covariance is not finite")
        # Said here, of the motion model, before a Cholesky factor fails for a reason nobody can guess.
        if out_cov[i, i] <= 0.0:
            raise ModelError("motion model: predicted covariance is not positive definite, as with indefinite noise")


@kernel
def survival_probabilities(motion: Motion, dt: float, states: Floats) -> Floats:
    """Probability of survival over `dt` seconds at each of (num, state_dim) states, shape (num,)."""
    out = np.empty(len(states))
    for i in range(len(states)):
        out[i] = motion.prob_survival(states[i], dt, motion.survival_params)
        if not 0.0 <= out[i] <= 1.0:
            raise ModelError("survival model: probability is not in [0, 1]")
    return out
