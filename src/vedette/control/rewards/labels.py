"""Rewards that are sums over targets, each evaluated by its Bernoulli before and after the scans.

Model functions take existence, mean (state_dim,) and covariance (state_dim, state_dim) of the prediction; the same of
the update; the parameter vector of the function; and the output numbers. Positions are the first two components of a
state.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import cholesky, log_det_from_factor, solve_lower
from vedette.models.fields import Checked, Positive, Probability, part
from vedette.models.functions import ModelFunction, model_function

# Lower limit of probabilities in a quotient.
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
    """Write the Kullback-Leibler divergence of the update from the prediction, for Bernoulli and Gaussian.

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
    """Write r' (1 - r')."""
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
    """Write the mean squared GOSPA (alpha = 2, p = 2) of the better choice, to report the target or not.

    min(r' min(tr P', c^2) + (1 - r') c^2 / 2, r' c^2 / 2). params: squared cutoff.
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
    """Write r' (1 - r'); r' times the position variance relative to the squared cutoff, params[0]; r'; and 1."""
    out[0] = new_existence * (1.0 - new_existence)
    out[1] = new_existence * min((new_cov[0, 0] + new_cov[1, 1]) / params[0], 1.0)
    out[2] = new_existence
    out[3] = 1.0


class _OneSum:
    """A reward that is one sum over the labels, of a function without parameters by default."""

    __slots__ = ()
    num_terms: ClassVar[int] = 1
    sign: ClassVar[float] = -1.0  # sign of the sum in the reward

    @property
    def params(self) -> Floats:
        """Empty vector: the function has no parameters."""
        return np.empty(0)

    @property
    def coefficients(self) -> Floats:
        """Coefficients of the sums."""
        return np.array([self.sign])

    def combine(self, sums: Floats) -> Floats:
        """Return the sum times its sign."""
        return np.asarray(self.sign * sums[..., 0])


@part("kullback_leibler", "reward")
@dataclass(frozen=True, slots=True)
class KullbackLeiblerReward(_OneSum):
    """Kullback-Leibler divergence of the update from the prediction, label by label: the information gained, in nats.

    This holds with ideal measurements. Under `ideal_measurements: sampled` its mean estimates the mutual information of
    targets and measurements.
    """

    sign: ClassVar[float] = 1.0
    words: ClassVar[str] = "KL divergence, nats"
    function: ClassVar[ModelFunction] = kullback_leibler_of_label


@part("cardinality_variance", "reward")
@dataclass(frozen=True, slots=True)
class CardinalityVarianceReward(_OneSum):
    """Negative variance of the number of targets: the sum of r (1 - r) over the labels (of a GLMB, of its LMB)."""

    words: ClassVar[str] = "minus variance of cardinality"
    function: ClassVar[ModelFunction] = cardinality_variance_of_label


@part("expected_gospa", "reward")
@dataclass(frozen=True, slots=True)
class ExpectedGospaReward(_OneSum, Checked):
    """Negative mean squared GOSPA (alpha = 2, p = 2) expected of the best estimate after the update.

    Label by label a target is reported if that costs less:
    min(r min(tr P, c^2) + (1 - r) c^2 / 2, r c^2 / 2), P the covariance of the position.

    Attributes:
        cutoff: error that counts as a lost target, c [m].
    """

    cutoff: Positive = 100.0
    words: ClassVar[str] = "minus squared GOSPA, m²"
    function: ClassVar[ModelFunction] = gospa_of_label

    @property
    def missed_cost(self) -> float:
        """Cost of a target that is not reported, c^2 / 2 [m^2]."""
        return 0.5 * self.cutoff**2

    @property
    def params(self) -> Floats:
        """The squared cutoff."""
        return np.array([self.cutoff**2])


@part("peecs", "reward")
@dataclass(frozen=True, slots=True)
class PeecsReward(Checked):
    """Negative posterior expected error of cardinality and states (Gostar, Hoseinnezhad, Bab-Hadiashar 2013, 2015).

    share * 4 / n * sum r (1 - r) + (1 - share) * sum r min(tr P / c^2, 1) / sum r over n labels: the variance of the
    number of targets relative to its largest possible value, and the mean error of their positions relative to a cutoff
    (instead of the publication's scale, which is that of its particles).

    Attributes:
        share: weight of the error of the number of targets.
        cutoff: error of a position that counts as 1, c [m].
    """

    share: Probability = 0.5
    cutoff: Positive = 100.0
    num_terms: ClassVar[int] = 4
    words: ClassVar[str] = "minus PEECS"
    function: ClassVar[ModelFunction] = peecs_of_label

    @property
    def params(self) -> Floats:
        """The squared cutoff."""
        return np.array([self.cutoff**2])

    def combine(self, sums: Floats) -> Floats:
        """Return the negative weighted errors, or 0 if there is no label."""
        variance, error, existence, num = np.moveaxis(sums, -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            cardinality = np.where(num > 0.0, 4.0 * variance / num, 0.0)
            state = np.where(existence > 0.0, error / existence, 0.0)
        return np.asarray(-(self.share * cardinality + (1.0 - self.share) * state))
