"""What a target adds to a reward, as model functions of its Bernoulli before and after the scans.

Arguments: existence, mean (state_dim,), covariance (state_dim, state_dim) of the prediction; the same of the update;
the function's own vector; and the numbers to be written. Positions are the first two components of a state.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower
from vedette.models.functions import model_function

# A probability below this is taken as this in a quotient.
_LEAST = 1e-300


@model_function("label_reward")
def kullback_leibler_of_label(
    existence: float,
    mean: Floats,
    cov: Floats,
    new_existence: float,
    new_mean: Floats,
    new_cov: Floats,
    params: Floats,
    out: Floats,
) -> None:
    """Kullback-Leibler divergence of the update from the prediction, of Bernoulli and Gaussian.

    (1 - r') ln((1 - r') / (1 - r)) + r' (ln(r' / r) + (tr(P^-1 P') + d'P^-1 d - n + ln|P| - ln|P'|) / 2), d = m' - m.
    """
    n, total = mean.shape[0], 0.0
    if new_existence < 1.0:
        total += (1.0 - new_existence) * math.log((1.0 - new_existence) / max(1.0 - existence, _LEAST))
    if new_existence > 0.0:
        factor, new_factor, column = np.zeros((n, n)), np.zeros((n, n)), np.empty(n)
        if not (cholesky(cov, factor) and cholesky(new_cov, new_factor)):
            out[0] = math.nan
            return
        gaussian = log_det_from_factor(factor) - log_det_from_factor(new_factor) - n
        for j in range(n + 1):
            for i in range(n):
                # tr(P^-1 P') is the sum of squares of L^-1 L'.
                column[i] = new_factor[i, j] if j < n else new_mean[i] - mean[i]
            solve_lower(factor, column, column)
            for i in range(n):
                gaussian += column[i] * column[i]
        total += new_existence * (math.log(new_existence / max(existence, _LEAST)) + 0.5 * gaussian)
    out[0] = total


@model_function("label_reward")
def cardinality_variance_of_label(
    existence: float,
    mean: Floats,
    cov: Floats,
    new_existence: float,
    new_mean: Floats,
    new_cov: Floats,
    params: Floats,
    out: Floats,
) -> None:
    """r' (1 - r')."""
    out[0] = new_existence * (1.0 - new_existence)


@model_function("label_reward")
def gospa_of_label(
    existence: float,
    mean: Floats,
    cov: Floats,
    new_existence: float,
    new_mean: Floats,
    new_cov: Floats,
    params: Floats,
    out: Floats,
) -> None:
    """Mean squared GOSPA (alpha = 2, p = 2) of the better of reporting the target and not; params: squared cutoff.

    min(r' min(tr P', c^2) + (1 - r') c^2 / 2, r' c^2 / 2).
    """
    square = params[0]
    error = min(new_cov[0, 0] + new_cov[1, 1], square)
    reported = new_existence * error + 0.5 * (1.0 - new_existence) * square
    out[0] = min(reported, 0.5 * new_existence * square)


@model_function("label_reward")
def peecs_of_label(
    existence: float,
    mean: Floats,
    cov: Floats,
    new_existence: float,
    new_mean: Floats,
    new_cov: Floats,
    params: Floats,
    out: Floats,
) -> None:
    """r' (1 - r'); r' times the share of its position's variance in the squared cutoff, params[0]; r'; and 1."""
    out[0] = new_existence * (1.0 - new_existence)
    out[1] = new_existence * min((new_cov[0, 0] + new_cov[1, 1]) / params[0], 1.0)
    out[2] = new_existence
    out[3] = 1.0
