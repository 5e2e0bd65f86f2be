"""The contribution of one label to a reward: a function of its Bernoulli before and after the scans.

There are three kinds. Power integrals of the prediction p and the update q, for which the log of

    (1 - r_p)^a (1 + K^(a + b - 1) integral of (o_p p)^a (o_q q)^b),   o = r / (1 - r),

is the label's part of Z(a, b) (q unnormalised by (1 - r_q)^b, the same for every reward of this kind). The expected
loss of `vedette.control.ExpectedLossReward`. And a model function of the two Bernoullis.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.bundle_types import typed_by_fields
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.information import to_moments
from vedette.kernels.gaussian.integrals import Integrals, integrate_rows, logs_of_one_and_integrals, make_integrals
from vedette.kernels.planning.bernoulli_rows import normalise_powers

POWER_INTEGRALS = 0
EXPECTED_LOSS = 1
FUNCTION = 2

# A smaller probability of detection is rounding: sums of log (1 - q), each of at most 28, keep 1e-14 of scans that were
# subtracted again. Real ones are at least 1e-6, as labels seen less are out of reach.
_LEAST_DETECTED = 1e-12


@typed_by_fields
class Valuation(NamedTuple):
    """The rule by which a label is valued."""

    kind: int  # POWER_INTEGRALS, EXPECTED_LOSS or FUNCTION
    num: int  # numbers that a label contributes
    prior: Floats  # (num_labels, bernoulli_size) rows of the prediction
    own: Floats  # (num_labels, num) terms that depend on the prediction alone
    exponents: Floats  # (num, 2) pairs (a, b) of power integrals
    log_volume: float  # log K
    params: Floats  # of the function; for the expected loss: squared cutoff c^2, half the order p, and a factor
    function: Any  # for FUNCTION: see `vedette.models.model_function`, kind `label_reward`
    references: Floats  # (num_labels, state_dim) means of the prediction, reference points of the rows
    covs: Floats  # (num_labels, state_dim, state_dim) of the prediction


class ValueWork(NamedTuple):
    """Working arrays of one label and all samples, side by side."""

    total: Floats  # (bernoulli_size, num_samples)
    joint: Floats  # (bernoulli_size, num_samples)
    integrals: Integrals  # of the samples
    row: Floats  # (bernoulli_size,)
    values: Floats  # (num,)
    mean: Floats  # (state_dim,)
    cov: Floats  # (state_dim, state_dim)
    factor: Floats  # (state_dim, state_dim)


@kernel
def make_value_work(valuation: Valuation, num_samples: int) -> ValueWork:
    size, dim = valuation.prior.shape[1], valuation.references.shape[1]
    return ValueWork(
        np.empty((size, num_samples)),
        np.empty((size, num_samples)),
        make_integrals(num_samples),
        np.empty(size),
        np.empty(valuation.num),
        np.empty(dim),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
    )


@borrowing
def _power_integral(valuation: Valuation, label: int, e: int, work: ValueWork, out: Floats) -> None:
    """Write out (num_samples,) for one pair of exponents."""
    total, joint, prior, dim = work.total, work.joint, valuation.prior[label], valuation.references.shape[1]
    size, num_samples = total.shape
    a, b, own = valuation.exponents[e, 0], valuation.exponents[e, 1], valuation.own[label, e]
    if b == 0.0:
        for s in range(num_samples):
            out[s] = own
        return
    # For q alone the row is used as it is, with log integral q^b = log integral q - (b - 1) rest / 2 - d log(b) / 2
    # with the rest s - y'Y^-1 y that the elimination leaves.
    power = 1.0 if a == 0.0 else b
    for k in range(size - 3):
        entries, given = joint[k], total[k]
        for s in range(num_samples):
            entries[s] = a * prior[k] + power * given[s]
    integrate_rows(joint, dim, work.integrals)
    exponents = work.integrals.exponents
    rest = joint[size - 4]
    logits = total[size - 2]
    constant = a * prior[size - 2] + (a + b - 1.0) * valuation.log_volume - 0.5 * dim * math.log(b / power)
    for s in range(num_samples):
        exponents[s] += constant + b * logits[s] - 0.5 * (b - power) * rest[s]
    logs_of_one_and_integrals(work.integrals, out)
    for s in range(num_samples):
        out[s] += own


@inlined
def _position_trace(total: Floats, sample: int, prior: Floats, share: float, cov: Floats, n: int) -> float:
    """Return the trace of the position's covariance for the information of `prior` plus `share` times the increment.

    cov: (n, n) to be written.
    """
    at = 0
    for i in range(n):
        for j in range(i + 1):
            cov[i, j] = prior[at] + share * (total[at, sample] - prior[at])
            at += 1
    # Eliminating the rest of the state leaves the inverse of the position's covariance.
    for k in range(n - 1, 1, -1):
        if not cov[k, k] > 0.0:
            return math.nan
        for i in range(k):
            slope = cov[k, i] / cov[k, k]
            for j in range(i + 1):
                cov[i, j] -= slope * cov[k, j]
    volume = cov[0, 0] * cov[1, 1] - cov[1, 0] * cov[1, 0]
    return (cov[0, 0] + cov[1, 1]) / volume if cov[0, 0] > 0.0 and volume > 0.0 else math.nan


@inlined
def _expected_loss(valuation: Valuation, label: int, sample: int, work: ValueWork) -> float:
    """Return -r (q min(tr P+, c^2)^(p/2) + (1 - q) min(tr P, c^2)^(p/2)), times the factor."""
    size, unseen = work.total.shape[0], valuation.own[label, 0]
    prior = valuation.prior[label]
    existence = 1.0 / (1.0 + math.exp(-prior[size - 2]))
    detected = -math.expm1(work.total[size - 1, sample])
    seen = unseen
    if detected > _LEAST_DETECTED:
        share, n = 1.0 / detected, work.cov.shape[0]
        if n == 4:  # a constant size is unrolled by the compiler
            trace = _position_trace(work.total, sample, prior, share, work.cov, 4)
        else:
            trace = _position_trace(work.total, sample, prior, share, work.cov, n)
        seen, half = min(trace, valuation.params[0]), valuation.params[1]
        seen = math.sqrt(seen) if half == 0.5 else seen**half
    return float(-valuation.params[2] * existence * (detected * seen + (1.0 - detected) * unseen))


@borrowing
def _of_functions(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    """Write out (num, num_samples) by the model function."""
    total, joint, row, dim = work.total, work.joint, work.row, valuation.references.shape[1]
    size, num_samples = total.shape
    for k in range(size - 2):
        for sample in range(num_samples):
            joint[k, sample] = total[k, sample]
    integrate_rows(joint, dim, work.integrals)
    existence = 1.0 / (1.0 + math.exp(-valuation.prior[label, size - 2]))
    for sample in range(num_samples):
        for k in range(size):
            row[k] = total[k, sample]
        known = row[size - 3] > 0.0
        if known and to_moments(row, valuation.references[label], work.mean, work.cov, work.factor):
            logit = row[size - 2] + work.integrals.exponents[sample] + math.log(work.integrals.factors[sample])
            valuation.function(
                existence,
                valuation.references[label],
                valuation.covs[label],
                1.0 / (1.0 + math.exp(-logit)),
                work.mean,
                work.cov,
                valuation.params,
                work.values,
            )
        else:
            for e in range(valuation.num):
                work.values[e] = math.nan
        for e in range(valuation.num):
            out[e, sample] = work.values[e]


@inlined
def value_label(valuation: Valuation, label: int, work: ValueWork, out: Floats) -> None:
    """Write the numbers (num, num_samples) of a label whose joint rows are in `work.total`, which are overwritten.

    NaN if a joint row is not a valid Bernoulli.
    """
    normalise_powers(work.total)
    if valuation.kind == POWER_INTEGRALS:
        for e in range(valuation.num):
            _power_integral(valuation, label, e, work, out[e])
    elif valuation.kind == EXPECTED_LOSS:
        for sample in range(out.shape[1]):
            out[0, sample] = _expected_loss(valuation, label, sample, work)
    else:
        _of_functions(valuation, label, work, out)
    powers = work.total[work.total.shape[0] - 3]
    for sample in range(out.shape[1]):
        if not powers[sample] > 0.0:
            for e in range(valuation.num):
                out[e, sample] = 0.0  # no sensor with a positive power has the label
