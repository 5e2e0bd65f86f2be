"""Power integrals of labelled densities, from which all rewards of a planner are computed.

For a prediction p and the product g = prod_s pi_s^(w_s) of chosen cases of some sensors, each a product of factors with
a weighted list of label sets (a GLMB is one factor, an LMB one per label, with the sets {} and {l}),

    Z(a, b) = log of the set integral of K^((a + b - 1) |X|) p(X)^a g(X)^b
            = sum over factors of logsumexp over the factor's label sets L of
              a w_p(L) + b sum_s w_s log weight_s(L) + (a + b - 1) |L| log K + sum over l in L of log integral p^a g^b,

where the last p and g are of one label. Every case is prepared once on the label sets of the prediction, its log
weights and information rows scaled by its sensor's power. A product is then a sum of rows. Single Gaussians only. The
rows of one label share one reference.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.elementary import logs
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.information import to_information
from vedette.kernels.gaussian.integrals import Integrals, integrate_rows, make_integrals
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import match_components

_SAME_POWER = 1e-12
_LARGEST_PRODUCT = 1e200

# A term this far below another one is negligible next to it, whatever the number of label sets.
_LOST = 60.0


class SensorCases(NamedTuple):
    """One sensor's densities on its own label sets. A member is a (label set, label)."""

    log_weights: Floats  # (num_cases, num_sets)
    held: Bools  # (num_cases, num_sets) False if the case has lost the set
    means: Floats  # (num_cases, num_members, state_dim)
    covs: Floats  # (num_cases, num_members, state_dim, state_dim)


class Places(NamedTuple):
    """Places of a sensor's members among those of the target label sets."""

    members: Ints  # (num_members,) the sensor's own member, -1 if it lacks the label set
    version_offsets: Ints  # (num_members + 1,) into versions
    versions: Ints  # the sensor's members of the same label
    own_sets: Ints  # (num_own_members,) label set of each of the sensor's members
    references: Floats  # (num_members, state_dim) reference points of the rows


class PreparedCases(NamedTuple):
    """Cases of all sensors on one list of factors, label sets and members. Here w is the power of the case's sensor."""

    factor_offsets: Ints  # (num_factors + 1,) into the label sets
    set_offsets: Ints  # (num_sets + 1,) into the members
    log_weights: Floats  # (num_cases, num_sets) w times the log weight, or that of a substitute
    held: Bools  # (num_cases, num_sets) False if a substitute is used
    all_held: bool  # whether every label set is held by some case of any choice
    rows: Floats  # (num_cases, num_members, row_size) of p^w; zeros if the case does not know the label


class Terms(NamedTuple):
    """Contribution of exponents and prediction, the same for all choices: pairs (0, b), then (a, b), then (a, 0)."""

    powers: Floats  # (num_changing,) b of each pair (0, b), then of each (a, b)
    own_powers: Floats  # (num_crossed,) a of each pair (a, b)
    log_weights: Floats  # (num_changing, num_sets) the part of a term that is the same for all cases
    rows: Floats  # (num_crossed, num_members, row_size) a times the prediction's rows
    own: Floats  # (num_own, num_sets) whole terms of pairs (a, 0)
    own_totals: Floats  # (num_own,) their Z if no label set is left out
    dim: int  # of a target's state


class Work(NamedTuple):
    """Working arrays of one product, with all samples in the last axis."""

    product: Floats  # (row_size, num_samples)
    joint: Floats  # (row_size, num_samples)
    integrals: Integrals
    overlaps: Floats  # (num_samples,) sums of log integral g over the labels of a set
    quadratics: Floats  # (num_samples,) of q, see `_add_terms`
    crossed: Floats  # (num_crossed, num_samples) log integrals of p^a g^b over the labels of a set
    peaks: Floats  # (num_changing, num_samples) largest term among the label sets of a factor
    sums: Floats  # (num_changing, num_samples) of the terms' exponentials, relative to it
    products: Floats  # (num_changing, num_samples) of such sums over factors, so that one logarithm is enough
    any_held: Bools  # (num_samples,) whether some label set of the factor is held
    is_whole: Bools  # (num_samples,) whether no label set was left out so far


@kernel
def _make_work(size: int, num_changing: int, num_crossed: int, num_samples: int) -> Work:
    return Work(
        np.empty((size, num_samples)),
        np.empty((size, num_samples)),
        make_integrals(num_samples),
        np.empty(num_samples),
        np.empty(num_samples),
        np.empty((num_crossed, num_samples)),
        np.empty((num_changing, num_samples)),
        np.empty((num_changing, num_samples)),
        np.empty((num_changing, num_samples)),
        np.empty(num_samples, np.bool_),
        np.empty(num_samples, np.bool_),
    )


@kernel
def write_rows(cases: SensorCases, places: Places, power: float, first: int, last: int, rows: Floats) -> None:
    """Write the information rows of cases `first:last`, scaled by the sensor's power.

    If a case lacks a label set, the row is of the Gaussian of the label's mean and covariance over the sets that it
    has, or zeros if it has the label in none.
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
def _fill(value: float, out: Floats) -> None:
    for i in range(out.shape[0]):
        for s in range(out.shape[1]):
            out[i, s] = value


@inlined
def _multiply(laid: PreparedCases, chosen: Ints, member: int, product: Floats) -> None:
    """Write the rows of the products of the chosen cases' powers.

    If some lack the label, the others' powers sum to one.

    chosen: each sensor's case with the first sample. The other samples' follow it.
    """
    size, num_samples, away = product.shape[0], product.shape[1], 0
    for sample in range(num_samples):
        for k in range(size):
            total = 0.0
            for s in range(chosen.shape[0]):
                total += laid.rows[chosen[s] + sample, member, k]
            product[k, sample] = total
    powers = product[size - 1]
    for sample in range(num_samples):
        away += 1 if abs(powers[sample] - 1.0) > _SAME_POWER else 0
    if away == 0:
        return
    for sample in range(num_samples):
        if abs(powers[sample] - 1.0) > _SAME_POWER:
            scale = 1.0 / powers[sample]
            for k in range(size):
                product[k, sample] *= scale


@inlined
def _add_log_integrals(rows: Floats, dim: int, from_quotient: bool, integrals: Integrals, out: Floats) -> None:
    """Add log integrals of rows, which are overwritten, to out (num_samples,).

    from_quotient: the integral is infinite if it does not exist.
    """
    integrate_rows(rows, dim, integrals)
    factors, exponents = integrals.factors, integrals.exponents
    logs(factors, integrals.bits, integrals.more_bits)
    for s in range(len(out)):
        value = exponents[s] + factors[s]
        # A quotient of Gaussians that is not integrable.
        out[s] += math.inf if from_quotient and math.isnan(value) else value


@inlined
def _integrate(laid: PreparedCases, chosen: Ints, at: int, terms: Terms, work: Work) -> None:
    """Integrate over the labels of a set: the overlaps, the quadratics and the crossed integrals."""
    product, joint, num_crossed = work.product, work.joint, terms.own_powers.shape[0]
    size, num_samples = product.shape
    num_alone = terms.powers.shape[0] - num_crossed
    for s in range(num_samples):
        work.overlaps[s], work.quadratics[s] = 0.0, 0.0
    _fill(0.0, work.crossed)
    for member in range(laid.set_offsets[at], laid.set_offsets[at + 1]):
        _multiply(laid, chosen, member, product)
        for e in range(num_crossed):
            power, given = terms.powers[num_alone + e], terms.rows[e, member]
            for k in range(size):
                entries, out = product[k], joint[k]
                for s in range(num_samples):
                    out[s] = power * entries[s] + given[k]
            is_quotient = min(terms.own_powers[e], power) < 0.0
            _add_log_integrals(joint, terms.dim, is_quotient, work.integrals, work.crossed[e])
        if num_alone > 0:
            _add_log_integrals(product, terms.dim, False, work.integrals, work.overlaps)
            rest = product[size - 2]
            for s in range(num_samples):
                work.quadratics[s] += rest[s]


@inlined
def _add_terms(at: int, sample: int, weight: float, terms: Terms, work: Work) -> None:
    """Add the terms of a label set to the sums of its factor.

    One elimination serves every b: g^b has b times the row of g, so that, with q = s - y'Y^-1 y which it leaves,
    log integral g^b = (d log(2 pi) - log det Y - d log b - b q) / 2 = log integral g - (b - 1) q / 2 - d log(b) / 2.
    """
    num_alone = terms.powers.shape[0] - terms.own_powers.shape[0]
    for e in range(terms.powers.shape[0]):
        given = terms.log_weights[e, at]  # with - d log(b) / 2 of each label
        term = given + terms.powers[e] * weight
        if e < num_alone:
            term += work.overlaps[sample] - 0.5 * (terms.powers[e] - 1.0) * work.quadratics[sample]
        else:
            term += work.crossed[e - num_alone, sample]
        if math.isnan(term) and (math.isinf(weight) or math.isinf(given)):
            term = -math.inf  # both densities are zero, or one with a positive power is
        peak = work.peaks[e, sample]
        if term > peak:
            work.sums[e, sample] = 1.0 + (work.sums[e, sample] * math.exp(peak - term) if term < peak + _LOST else 0.0)
            work.peaks[e, sample] = term
        elif peak - _LOST < term < math.inf:
            work.sums[e, sample] += math.exp(term - peak)
        elif math.isnan(term):
            work.peaks[e, sample] = term


@inlined
def _add_factor(work: Work, out: Floats) -> None:
    """Add the logs of a factor's sums to the totals, except for the part that stays in `work.products`."""
    for sample in range(out.shape[0]):
        if not work.any_held[sample]:
            continue
        for e in range(work.sums.shape[0]):
            out[sample, e] += work.peaks[e, sample]
            if work.sums[e, sample] > 0.0:
                work.products[e, sample] *= work.sums[e, sample]
            if work.products[e, sample] > _LARGEST_PRODUCT:
                out[sample, e] += math.log(work.products[e, sample])
                work.products[e, sample] = 1.0


@inlined
def _is_held(laid: PreparedCases, chosen: Ints, sample: int, at: int) -> bool:
    held = False
    for s in range(chosen.shape[0]):
        held |= laid.held[chosen[s] + sample, at]
    return held


@inlined
def _power_integrals(laid: PreparedCases, chosen: Ints, terms: Terms, work: Work, out: Floats) -> None:
    """Write Z (num_samples, num_pairs) of one product. A label set that no case holds is left out, also of Z(a, 0)."""
    num, num_samples = work.sums.shape
    _fill(0.0, out)
    _fill(1.0, work.products)
    for sample in range(num_samples):
        work.is_whole[sample] = True
    for factor in range(laid.factor_offsets.shape[0] - 1):
        for sample in range(num_samples):
            work.any_held[sample] = False
        _fill(-math.inf, work.peaks)
        _fill(0.0, work.sums)
        for at in range(laid.factor_offsets[factor], laid.factor_offsets[factor + 1]):
            _integrate(laid, chosen, at, terms, work)
            for sample in range(num_samples):
                if not (laid.all_held or _is_held(laid, chosen, sample, at)):
                    work.is_whole[sample] = False
                    continue
                weight = 0.0
                for s in range(chosen.shape[0]):
                    weight += laid.log_weights[chosen[s] + sample, at]
                work.any_held[sample] = True
                _add_terms(at, sample, weight, terms, work)
        _add_factor(work, out)
    for sample in range(num_samples):
        for e in range(num):
            out[sample, e] += math.log(work.products[e, sample])
        for e in range(terms.own_totals.shape[0]):
            whole = work.is_whole[sample]
            out[sample, num + e] = terms.own_totals[e] if whole else _own_of_held(laid, chosen, sample, terms.own[e])


@borrowing
def _own_of_held(laid: PreparedCases, chosen: Ints, sample: int, own: Floats) -> float:
    """Return Z(a, 0) over the label sets that some chosen case holds."""
    total = 0.0
    for factor in range(laid.factor_offsets.shape[0] - 1):
        factor_sum, any_held = -math.inf, False
        for at in range(laid.factor_offsets[factor], laid.factor_offsets[factor + 1]):
            if _is_held(laid, chosen, sample, at):
                factor_sum, any_held = log_add(factor_sum, own[at]), True
        if any_held:
            total += factor_sum
    return total


@kernel
def power_table(
    laid: PreparedCases, first_cases: Ints, actions: Ints, terms: Terms, first: int, last: int, out: Floats
) -> None:
    """Write Z (num_joint, num_samples, num_pairs) of joint actions `first:last`, the pairs in the order of `terms`.

    actions: (num_joint, num_sensors) one action of each sensor. With a sample it is the sensor's case
    `first_cases + action * num_samples + sample`. NaN if a precision of positive powers is not positive definite.
    """
    num_sensors, num_samples, size = len(first_cases), out.shape[1], laid.rows.shape[2]
    chosen = np.empty(num_sensors, np.int64)
    work = _make_work(size, len(terms.log_weights), len(terms.own_powers), num_samples)
    for joint in range(first, last):
        for s in range(num_sensors):
            chosen[s] = first_cases[s] + actions[joint, s] * num_samples
        _power_integrals(laid, chosen, terms, work, out[joint])
