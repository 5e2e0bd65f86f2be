"""Power integrals of labelled densities: the one primitive behind all rewards of a planner.

Of a prediction p and the product g = prod_s pi_s^(w_s) of chosen cases of some sensors, each a product of factors with
a weighted list of label sets (a GLMB is one factor, an LMB one a label, with the sets {} and {l}),

    Z(a, b) = log of the set integral of K^((a + b - 1) |X|) p(X)^a g(X)^b
            = sum over factors of logsumexp over the factor's label sets L of
              a w_p(L) + b sum_s w_s log weight_s(L) + (a + b - 1) |L| log K + sum over l in L of log integral p^a g^b,

where the last p and g are of one label. Every case is laid out once on the label sets of the prediction, its log
weights and information rows scaled by its sensor's power; a product is then a sum of rows. Single Gaussians only; the
rows of one label share one reference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.information import log_integral_of_any, to_information
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import match_components

_SAME_POWER = 1e-12
_LARGEST_PRODUCT = 1e200


class SensorCases(NamedTuple):
    """One sensor's densities on its own label sets; a member is a (label set, label)."""

    log_weights: Floats  # (num_cases, num_sets)
    held: Bools  # (num_cases, num_sets) false where the case has lost the set
    means: Floats  # (num_cases, num_members, state_dim)
    covs: Floats  # (num_cases, num_members, state_dim, state_dim)


class Places(NamedTuple):
    """Where a sensor's members stand among those of a layout."""

    members: Ints  # (num_members,) the sensor's own member, -1 where it lacks the label set
    version_offsets: Ints  # (num_members + 1,) into versions
    versions: Ints  # the sensor's members of the same label
    own_sets: Ints  # (num_own_members,) label set of each of the sensor's members
    references: Floats  # (num_members, state_dim) about which the rows are taken


class Laid(NamedTuple):
    """Cases of all sensors on one list of factors, label sets and members; w is the power of the case's sensor."""

    factor_offsets: Ints  # (num_factors + 1,) into the label sets
    set_offsets: Ints  # (num_sets + 1,) into the members
    log_weights: Floats  # (num_cases, num_sets) w times the log weight, or that of a stand-in
    held: Bools  # (num_cases, num_sets) false where a stand-in is put
    all_held: bool  # whether every label set is held by some case of any choice
    rows: Floats  # (num_cases, num_members, row_size) of p^w; zeros where the case does not know the label


class Terms(NamedTuple):
    """What exponents and prediction contribute, whatever is chosen: pairs (0, b), then (a, b), then (a, 0)."""

    powers: Floats  # (num_changing,) b of each pair (0, b), then of each (a, b)
    own_powers: Floats  # (num_crossed,) a of each pair (a, b)
    log_weights: Floats  # (num_changing, num_sets) the part of a term that is the same for all cases
    rows: Floats  # (num_crossed, num_members, row_size) a times the prediction's rows
    own: Floats  # (num_own, num_sets) whole terms of pairs (a, 0)
    own_totals: Floats  # (num_own,) their Z where no label set is left out
    dim: int  # of a target's state


class Work(NamedTuple):
    """Working arrays of one product."""

    product: Floats  # (row_size,)
    joint: Floats  # (row_size,)
    crossed: Floats  # (num_crossed,) log integrals of p^a g^b over the labels of a set
    peaks: Floats  # (num_changing,) largest term among the label sets of a factor
    sums: Floats  # (num_changing,) of the terms' exponentials, relative to it
    products: Floats  # (num_changing,) of such sums over factors, of which one logarithm is taken for all


@kernel
def write_rows(cases: SensorCases, places: Places, power: float, first: int, last: int, rows: Floats) -> None:
    """Information rows of cases `first:last`, scaled by the sensor's power.

    Where a case lacks a label set, the row is of the Gaussian of the label's mean and covariance over the sets that it
    has; zeros where it knows the label in none.
    """
    dim, most = cases.means.shape[2], 1
    for m in range(len(places.members)):
        most = max(most, places.version_offsets[m + 1] - places.version_offsets[m])
    factor, precision, mean, cov = np.empty((dim, dim)), np.empty((dim, dim)), np.empty(dim), np.empty((dim, dim))
    pool, shares = np.empty(most, np.int64), np.empty(most)
    for case in range(first, last):
        peak = -math.inf
        for weight in cases.log_weights[case]:
            peak = max(peak, weight)
        for m in range(len(places.members)):
            own, count = places.members[m], 0
            if own >= 0 and cases.held[case, places.own_sets[own]]:
                pool[0], count = own, 1
            else:
                for v in range(places.version_offsets[m], places.version_offsets[m + 1]):
                    at = places.own_sets[places.versions[v]]
                    if cases.held[case, at]:
                        pool[count] = places.versions[v]
                        shares[count] = math.exp(cases.log_weights[case, at] - peak)
                        count += 1
            if count == 0:
                for k in range(rows.shape[2]):
                    rows[case, m, k] = 0.0
                continue
            match_components(pool, shares, count, cases.means[case], cases.covs[case], mean, cov)
            if not to_information(mean, cov, places.references[m], power, rows[case, m], factor, precision):
                raise NumericalError("covariance of a track is not positive definite")


@inlined
def _multiply(laid: Laid, chosen: Ints, member: int, product: Floats) -> None:
    """Row of the product of the chosen cases' powers; where some do not know the label, the others' sum to one."""
    last = product.shape[0] - 1
    for k in range(last + 1):
        total = 0.0
        for s in range(chosen.shape[0]):
            total += laid.rows[chosen[s], member, k]
        product[k] = total
    if abs(product[last] - 1.0) > _SAME_POWER:
        scale = 1.0 / product[last]
        for k in range(last + 1):
            product[k] *= scale


@inlined
def _integrate(laid: Laid, chosen: Ints, at: int, terms: Terms, work: Work) -> tuple[float, float]:
    """Over the labels of a set: the sums of log integral g and of q (see `_add_terms`), and those of `work.crossed`."""
    product, joint, last = work.product, work.joint, work.product.shape[0] - 1
    overlap, quadratic, num_crossed = 0.0, 0.0, terms.own_powers.shape[0]
    num_alone = terms.powers.shape[0] - num_crossed
    for e in range(num_crossed):
        work.crossed[e] = 0.0
    for member in range(laid.set_offsets[at], laid.set_offsets[at + 1]):
        _multiply(laid, chosen, member, product)
        for e in range(num_crossed):
            power = terms.powers[num_alone + e]
            for k in range(last + 1):
                joint[k] = power * product[k] + terms.rows[e, member, k]
            value = log_integral_of_any(joint, terms.dim)
            if math.isnan(value) and min(terms.own_powers[e], power) < 0.0:
                value = math.inf  # a quotient of Gaussians that is not integrable
            work.crossed[e] += value
        if num_alone > 0:
            overlap += log_integral_of_any(product, terms.dim)
            quadratic += product[last - 1]
    return overlap, quadratic


@inlined
def _add_terms(at: int, weight: float, overlap: float, quadratic: float, terms: Terms, work: Work) -> None:
    """Add the terms of a label set to the sums of its factor.

    One elimination serves every b: g^b has b times the row of g, so that, with q = s - y'Y^-1 y which it leaves,
    log integral g^b = (d log(2 pi) - log det Y - d log b - b q) / 2 = log integral g - (b - 1) q / 2 - d log(b) / 2.
    """
    num_alone = terms.powers.shape[0] - terms.own_powers.shape[0]
    for e in range(terms.powers.shape[0]):
        given = terms.log_weights[e, at]  # with - d log(b) / 2 of each label
        term = given + terms.powers[e] * weight
        if e < num_alone:
            term += overlap - 0.5 * (terms.powers[e] - 1.0) * quadratic
        else:
            term += work.crossed[e - num_alone]
        if math.isnan(term) and (math.isinf(weight) or math.isinf(given)):
            term = -math.inf  # both densities are zero, or one is whose power is positive
        peak = work.peaks[e]
        if term > peak:
            work.sums[e] = 1.0 + (work.sums[e] * math.exp(peak - term) if peak > -math.inf else 0.0)
            work.peaks[e] = term
        elif -math.inf < term < math.inf:
            work.sums[e] += math.exp(term - peak)
        elif math.isnan(term):
            work.peaks[e] = term


@inlined
def _add_factor(work: Work, out: Floats) -> None:
    """Add the log of a factor's sum to each total, but for what stays in `work.products`."""
    for e in range(out.shape[0]):
        out[e] += work.peaks[e]
        if work.sums[e] > 0.0:
            work.products[e] *= work.sums[e]
        if work.products[e] > _LARGEST_PRODUCT:
            out[e] += math.log(work.products[e])
            work.products[e] = 1.0


@inlined
def _is_held(laid: Laid, chosen: Ints, at: int) -> bool:
    held = False
    for s in range(chosen.shape[0]):
        held |= laid.held[chosen[s], at]
    return held


@inlined
def _power_integrals(laid: Laid, chosen: Ints, terms: Terms, work: Work, out: Floats) -> None:
    """Z of all pairs for one product. A label set that no case holds is left out, also of Z(a, 0)."""
    num, all_held = work.sums.shape[0], True
    for e in range(num):
        out[e], work.products[e] = 0.0, 1.0
    for factor in range(laid.factor_offsets.shape[0] - 1):
        any_held = False
        for e in range(num):
            work.peaks[e], work.sums[e] = -math.inf, 0.0
        for at in range(laid.factor_offsets[factor], laid.factor_offsets[factor + 1]):
            if not (laid.all_held or _is_held(laid, chosen, at)):
                all_held = False
                continue
            any_held, weight = True, 0.0
            for s in range(chosen.shape[0]):
                weight += laid.log_weights[chosen[s], at]
            overlap, quadratic = _integrate(laid, chosen, at, terms, work)
            _add_terms(at, weight, overlap, quadratic, terms, work)
        if any_held:
            _add_factor(work, out[:num])
    for e in range(num):
        out[e] += math.log(work.products[e])
    for e in range(terms.own_totals.shape[0]):
        out[num + e] = terms.own_totals[e] if all_held else _own_of_held(laid, chosen, terms.own[e])


@borrowing
def _own_of_held(laid: Laid, chosen: Ints, own: Floats) -> float:
    """Z(a, 0) over the label sets that some chosen case holds."""
    total = 0.0
    for factor in range(laid.factor_offsets.shape[0] - 1):
        factor_sum, any_held = -math.inf, False
        for at in range(laid.factor_offsets[factor], laid.factor_offsets[factor + 1]):
            if _is_held(laid, chosen, at):
                factor_sum, any_held = log_add(factor_sum, own[at]), True
        if any_held:
            total += factor_sum
    return total


@kernel
def power_table(laid: Laid, first_cases: Ints, actions: Ints, terms: Terms, first: int, last: int, out: Floats) -> None:
    """Z (num_joint, num_samples, num_pairs) of joint actions `first:last`, the pairs in the order of `terms`.

    actions: (num_joint, num_sensors) one action of each sensor; with a sample it is the sensor's case
    `first_cases + action * num_samples + sample`. NaN where a precision of positive powers is not positive definite.
    """
    num_sensors, num_samples, size = len(first_cases), out.shape[1], laid.rows.shape[2]
    chosen, num = np.empty(num_sensors, np.int64), len(terms.log_weights)
    sums = np.empty((3, num))
    work = Work(np.empty(size), np.empty(size), np.empty(len(terms.own_powers)), sums[0], sums[1], sums[2])
    for joint in range(first, last):
        for sample in range(num_samples):
            for s in range(num_sensors):
                chosen[s] = first_cases[s] + actions[joint, s] * num_samples + sample
            _power_integrals(laid, chosen, terms, work, out[joint, sample])


__all__ = ["Laid", "Places", "SensorCases", "Terms", "power_table", "write_rows"]
