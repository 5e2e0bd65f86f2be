"""Divergence between one predicted density and the fusion of any choice of one case a sensor, without forming the
fusion.

A planner has for each sensor many cases (action, sample) of its belief, and needs for every combination of them the
fused density only through its divergence from the prediction. Every case is laid out once on the label sets that any
sensor has, its log weights and information rows scaled by the sensor's fusion weight; a fusion is then a sum of rows.
Single Gaussian tracks only; the rows of one label share one reference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.information import log_integral
from vedette.kernels.gaussian.linalg import log_add

_LOG_2 = math.log(2.0)


class Cases(NamedTuple):
    """Beliefs of all sensors in all their cases on common label sets (LMB: a set is one label).

    Below, w is the positive fusion weight of the case's sensor. set_offsets: (num_sets + 1,) into members, which are
    (label set, label). log_present: (num_cases, num_sets) w times the log weight of the set (LMB: of existence).
    log_absent: (num_cases, num_sets) w times the log probability of absence, LMB only. held: (num_cases, num_sets)
    false where the case lacks the set and a floor stands in.
    rows: (num_cases, num_members, row_size) of p^w; zeros where the case does not know the label.
    """

    set_offsets: Ints
    log_present: Floats
    log_absent: Floats
    held: Bools
    rows: Floats


class Prediction(NamedTuple):
    """The predicted density on the same label sets.

    log_present: (num_sets,) log weight (LMB: log existence), -inf where it lacks the set. log_absent: (num_sets,) log
    probability of absence, LMB only. rows: (num_members, row_size). log_rest: sum of the log probabilities of absence
    of its labels that no case has, LMB only. log_self: its log inner product with itself, over all its label sets.
    """

    log_present: Floats
    log_absent: Floats
    rows: Floats
    log_rest: float
    log_self: float


@borrowing
def _log_integral(row: Floats, dim: int) -> float:
    # The compiler unrolls a call of constant dimension, which makes the two usual ones more than twice as fast.
    if dim == 4:
        return log_integral(row, 4)
    if dim == 5:
        return log_integral(row, 5)
    return log_integral(row, dim)


@inlined
def _integrals(
    cases: Cases, chosen: Ints, member: int, prediction: Prediction, dim: int, work: Floats
) -> tuple[float, float, float]:
    """log of the integrals of g, g^2 and g p: g the product of the chosen cases' powers, p the predicted track."""
    product, joint = work[0], work[1]
    last = product.shape[0] - 1
    for k in range(last + 1):
        total = 0.0
        for s in range(chosen.shape[0]):
            total += cases.rows[chosen[s], member, k]
        product[k] = total
    if abs(product[last] - 1.0) > 1e-12:
        scale = 1.0 / product[last]
        for k in range(last + 1):
            product[k] *= scale
    for k in range(last + 1):
        joint[k] = product[k] + prediction.rows[member, k]
    overlap = _log_integral(product, dim)
    # The elimination has left s - y'Y^-1 y; g^2 has twice the row of g.
    squared = overlap - 0.5 * (product[last - 1] + dim * _LOG_2)
    return overlap, squared, _log_integral(joint, dim)


@inlined
def _weight(cases: Cases, chosen: Ints, at: int) -> tuple[float, bool]:
    total, held = 0.0, False
    for s in range(chosen.shape[0]):
        total += cases.log_present[chosen[s], at]
        held |= cases.held[chosen[s], at]
    return total, held


@borrowing
def fused_glmb_divergence(
    cases: Cases, chosen: Ints, prediction: Prediction, dim: int, log_unit_volume: float, work: Floats
) -> float:
    """Cauchy-Schwarz divergence from the prediction of the CM-delta-GLMB fusion of the `chosen` cases (eqs. 8, 11).

    chosen: (S,) one case of each sensor. work: (2, row_size). NaN where a fused precision is not positive definite.
    """
    cross, own = -math.inf, -math.inf
    for at in range(cases.set_offsets.shape[0] - 1):
        weight, held = _weight(cases, chosen, at)
        if not held:
            continue
        cross_term, own_term = weight + prediction.log_present[at], 2.0 * weight
        for member in range(cases.set_offsets[at], cases.set_offsets[at + 1]):
            _, squared, joint = _integrals(cases, chosen, member, prediction, dim, work)
            own_term += log_unit_volume + squared
            cross_term += log_unit_volume + joint
        own = log_add(own, own_term)
        cross = log_add(cross, cross_term)
    return 0.5 * (own + prediction.log_self) - cross


@borrowing
def fused_lmb_divergence(
    cases: Cases, chosen: Ints, prediction: Prediction, dim: int, log_unit_volume: float, work: Floats
) -> float:
    """Cauchy-Schwarz divergence from the prediction of the CLMB fusion of the `chosen` cases (eqs. 8, 12).

    chosen: (S,) one case of each sensor. work: (2, row_size). NaN where a fused precision is not positive definite.
    """
    total = 0.5 * prediction.log_self - prediction.log_rest
    for at in range(cases.set_offsets.shape[0] - 1):
        present, held = _weight(cases, chosen, at)
        if not held:
            total -= prediction.log_absent[at]
            continue
        absent = 0.0
        for s in range(chosen.shape[0]):
            absent += cases.log_absent[chosen[s], at]
        _, squared, joint = _integrals(cases, chosen, at, prediction, dim, work)
        total += 0.5 * log_add(2.0 * absent, 2.0 * present + log_unit_volume + squared)
        total -= log_add(
            absent + prediction.log_absent[at], present + prediction.log_present[at] + log_unit_volume + joint
        )
    return total


__all__ = ["Cases", "Prediction", "fused_glmb_divergence", "fused_lmb_divergence"]
