"""What one label contributes to a reward: a function of its Bernoulli before and after the scans.

Three kinds. Power integrals of the prediction p and the update q, of which the log of

    (1 - r_p)^a (1 + K^(a + b - 1) integral of (o_p p)^a (o_q q)^b),   o = r / (1 - r),

is the part of Z(a, b) that the label has (q unnormalised by (1 - r_q)^b, the same for every reward that is one). The
expected loss of `vedette.control.ExpectedLoss`. And a model function of the two Bernoullis.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.bundle_types import typed_by_fields
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.information import log_integral_of_any, to_moments
from vedette.kernels.gaussian.linalg import cholesky, log_add
from vedette.kernels.planning.bernoulli_rows import unscale

POWER_INTEGRALS = 0
EXPECTED_LOSS = 1
FUNCTION = 2


@typed_by_fields
class Valuation(NamedTuple):
    """How a label is valued."""

    kind: int  # POWER_INTEGRALS, EXPECTED_LOSS or FUNCTION
    num: int  # numbers that a label contributes
    prior: Floats  # (num_labels, bernoulli_size) rows of the prediction
    own: Floats  # (num_labels, num) what of a number depends on the prediction alone
    exponents: Floats  # (num, 2) pairs (a, b) of power integrals
    log_volume: float  # log K
    params: Floats  # of the function; of the expected loss the squared cutoff
    function: Any  # of FUNCTION: see `vedette.models.model_function`, kind `label_reward`
    references: Floats  # (num_labels, state_dim) means of the prediction, about which rows are taken
    covs: Floats  # (num_labels, state_dim, state_dim) of the prediction


class ValueWork(NamedTuple):
    """Working arrays of one label."""

    total: Floats  # (bernoulli_size,)
    joint: Floats  # (bernoulli_size,)
    mean: Floats  # (state_dim,)
    cov: Floats  # (state_dim, state_dim)
    factor: Floats  # (state_dim, state_dim)


@kernel
def make_value_work(valuation: Valuation) -> ValueWork:
    size, dim = valuation.prior.shape[1], valuation.references.shape[1]
    return ValueWork(np.empty(size), np.empty(size), np.empty(dim), np.empty((dim, dim)), np.empty((dim, dim)))


@inlined
def _power_integrals(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    total, joint, prior, dim = work.total, work.joint, valuation.prior[label], valuation.references.shape[1]
    size = total.shape[0]
    logit, prior_logit = total[size - 2], prior[size - 2]
    for k in range(size - 2):
        joint[k] = total[k]
    alone = log_integral_of_any(joint, dim)
    quadratic = joint[size - 4]  # s - y'Y^-1 y, which the elimination leaves
    for e in range(valuation.num):
        a, b = valuation.exponents[e, 0], valuation.exponents[e, 1]
        out[e] = valuation.own[label, e]
        if b == 0.0:
            continue
        if a == 0.0:
            # b times the row: log integral q^b = log integral q - (b - 1) quadratic / 2 - d log(b) / 2.
            integral = alone - 0.5 * ((b - 1.0) * quadratic + dim * math.log(b))
        else:
            for k in range(size - 2):
                joint[k] = a * prior[k] + b * total[k]
            integral = log_integral_of_any(joint, dim)
        out[e] += log_add(0.0, integral + a * prior_logit + b * logit + (a + b - 1.0) * valuation.log_volume)


@inlined
def _position_trace(row: Floats, prior: Floats, share: float, work: ValueWork) -> float:
    """Trace of the position's covariance where the information is that of `prior` and `share` times what row adds."""
    n, at = work.cov.shape[0], 0
    for i in range(n):
        for j in range(i + 1):
            work.cov[i, j] = prior[at] + share * (row[at] - prior[at])
            at += 1
    if not cholesky(work.cov, work.factor):
        return math.nan
    trace = 0.0
    for axis in range(2):
        for i in range(axis, n):
            total = 1.0 if i == axis else 0.0
            for k in range(axis, i):
                total -= work.factor[i, k] * work.mean[k]
            work.mean[i] = total / work.factor[i, i]
            trace += work.mean[i] * work.mean[i]
    return trace


@inlined
def _expected_loss(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    """Less r (q min(tr P+, c^2) + (1 - q) min(tr P, c^2))."""
    size, unseen = work.total.shape[0], valuation.own[label, 0]
    prior = valuation.prior[label]
    existence = 1.0 / (1.0 + math.exp(-prior[size - 2]))
    detected = -math.expm1(work.total[size - 1])
    seen = unseen
    if detected > 0.0:
        seen = min(_position_trace(work.total, prior, 1.0 / detected, work), valuation.params[0])
    out[0] = -existence * (detected * seen + (1.0 - detected) * unseen)


@inlined
def _of_function(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    total, size, dim = work.total, work.total.shape[0], valuation.references.shape[1]
    for k in range(size - 2):
        work.joint[k] = total[k]
    logit = total[size - 2] + log_integral_of_any(work.joint, dim)
    if not to_moments(total, valuation.references[label], work.mean, work.cov, work.factor):
        for e in range(valuation.num):
            out[e] = math.nan
        return
    valuation.function(
        1.0 / (1.0 + math.exp(-valuation.prior[label, size - 2])),
        valuation.references[label],
        valuation.covs[label],
        1.0 / (1.0 + math.exp(-logit)),
        work.mean,
        work.cov,
        valuation.params,
        out,
    )


@borrowing
def value_label(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    """Write the numbers of a label whose joint row stands in `work.total`, which is used up; NaN where it is none."""
    if not work.total[work.total.shape[0] - 3] > 0.0:
        for e in range(valuation.num):
            out[e] = 0.0  # nobody who counts knows the label
        return
    unscale(work.total)
    if valuation.kind == POWER_INTEGRALS:
        _power_integrals(valuation, label, work, out)
    elif valuation.kind == EXPECTED_LOSS:
        _expected_loss(valuation, label, work, out)
    else:
        _of_function(valuation, label, work, out)


__all__ = ["EXPECTED_LOSS", "FUNCTION", "POWER_INTEGRALS", "Valuation", "ValueWork", "make_value_work", "value_label"]
