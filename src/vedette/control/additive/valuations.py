"""How the labels of a decision are valued, by the kind of reward."""

from __future__ import annotations

import math

import numpy as np

from vedette.control.rewards.base import LabelReward, PowerReward, unit_volume_of
from vedette.control.rewards.label_functions import cardinality_variance_of_label
from vedette.control.rewards.loss import ExpectedLossReward
from vedette.densities import LMB
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.linalg import LOG_2PI
from vedette.kernels.planning.label_values import EXPECTED_LOSS, FUNCTION, POWER_INTEGRALS, Valuation
from vedette.models.functions import ModelFunction
from vedette.probabilities import log_expit


def valuation_of(reward: PowerReward | LabelReward | ExpectedLossReward, prediction: LMB, prior: Floats) -> Valuation:
    """How a reward values the labels of a prediction, of one Gaussian each.

    prior: (num_labels, bernoulli_size) rows of the prediction.
    """
    if isinstance(reward, ExpectedLossReward):
        covs = prediction.tracks.covs
        unseen = np.minimum(covs[:, 0, 0] + covs[:, 1, 1], reward.cutoff**2)[:, np.newaxis] ** (0.5 * reward.order)
        params = np.array([reward.cutoff**2, 0.5 * reward.order, 1.0])
        return _valuation(EXPECTED_LOSS, 1, prediction, prior, unseen, params=params)
    if isinstance(reward, PowerReward):
        volume = unit_volume_of(reward, prediction)
        exponents = np.array([[float(a), float(b)] for a, b in reward.exponents])
        own = _of_prediction(prediction, exponents, math.log(volume), prior[:, -2])
        found = _valuation(POWER_INTEGRALS, len(exponents), prediction, prior, own, exponents=exponents)
        return found._replace(log_volume=math.log(volume))
    own, params = np.zeros((len(prior), reward.num_terms)), np.ascontiguousarray(reward.params, np.float64)
    return _valuation(FUNCTION, reward.num_terms, prediction, prior, own, params=params, function=reward.function)


def _valuation(
    kind: int,
    num: int,
    prediction: LMB,
    prior: Floats,
    own: Floats,
    *,
    exponents: Floats | None = None,
    params: Floats | None = None,
    function: ModelFunction = cardinality_variance_of_label,  # not asked but by FUNCTION
) -> Valuation:
    return Valuation(
        kind,
        num,
        prior,
        own,
        np.empty((0, 2)) if exponents is None else exponents,
        0.0,
        np.empty(0) if params is None else params,
        function,
        *prediction.tracks.to_kernel()[3:],
    )


def _of_prediction(prediction: LMB, exponents: Floats, log_volume: float, logits: Floats) -> Floats:
    """(num_labels, num_exponents) a log(1 - r), and of pairs (a, 0) the whole of their term."""
    dim = prediction.state_dim
    log_dets = np.linalg.slogdet(prediction.tracks.covs)[1] + dim * LOG_2PI
    terms = np.outer(log_expit(-logits), exponents[:, 0])
    for e, (a, b) in enumerate(exponents.tolist()):
        if b == 0.0 and a != 0.0:
            # log integral N(m, P)^a = -((a - 1) log|2 pi P| + d log a) / 2.
            integral = -0.5 * ((a - 1.0) * log_dets + dim * math.log(a)) if a > 0.0 else np.full(len(logits), np.inf)
            terms[:, e] += np.logaddexp(0.0, a * logits + integral + (a - 1.0) * log_volume)
    return terms
