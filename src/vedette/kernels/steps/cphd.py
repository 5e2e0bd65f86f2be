"""The Gaussian-mixture CPHD filter: one step of an iid cluster's cardinality and intensity (Vo, Vo, Cantoni 2007).

All cardinality computations use polynomials with non-negative coefficients, stored as logs: a generating function of a
cardinality distribution, or one whose coefficients are the elementary symmetric functions of the scan's likelihood
ratios. Sums of such terms neither cancel nor, as logs, overflow.
"""

import math

import numpy as np

from vedette.kernels.association.assignment import MISSED
from vedette.kernels.association.options import weighed_options
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Mixture, Motion, ScanInput, Sensor
from vedette.kernels.gaussian.components import components_between
from vedette.kernels.gaussian.linalg import log_add, log_sum, normalise_logs
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.steps.phd import IntensityReport, corrected_intensity, predict_intensity


@inlined
def times_linear(log_coefficients: Floats, degree: int, log_constant: float, log_slope: float) -> None:
    """Multiply the polynomial of the first `degree` + 1 coefficients by (constant + slope z), in place.

    `log_coefficients` must have room for one more coefficient, which is overwritten.
    """
    log_coefficients[degree + 1] = log_coefficients[degree] + log_slope
    for j in range(degree, 0, -1):
        log_coefficients[j] = log_add(log_coefficients[j] + log_constant, log_coefficients[j - 1] + log_slope)
    log_coefficients[0] += log_constant


@kernel
def predict_cardinality(log_cardinality: Floats, log_lived: float, log_died: float, birth_logit: Floats) -> Floats:
    """Log probabilities of 0, 1, ... targets after survival, the same for each target, and births at each site.

    log_lived, log_died: log of the mean probabilities of a target, which sum to one. birth_logit: (num_sites,) of the
    existence of each birth. The sums over binomials of Vo, Vo, Cantoni 2007 are computed by Horner's rule.
    """
    highest = len(log_cardinality) - 1
    predicted = np.full(highest + len(birth_logit) + 1, -math.inf)
    predicted[0] = log_cardinality[highest]
    # Horner: ((rho_n (d + s z) + rho_(n-1)) (d + s z) + ...), d death and s survival.
    for count in range(highest - 1, -1, -1):
        times_linear(predicted, highest - 1 - count, log_died, log_lived)
        predicted[0] = log_add(predicted[0], log_cardinality[count])
    for site in range(len(birth_logit)):
        log_absent, log_born = -log_add(0.0, birth_logit[site]), -log_add(0.0, -birth_logit[site])
        times_linear(predicted, highest + site, log_absent, log_born)
    return predicted


@kernel
def symmetric_functions(log_ratios: Floats) -> Floats:
    """Log elementary symmetric functions, (num + 1, num + 1): entry [k, j] of order j of the first k ratios."""
    num = len(log_ratios)
    table = np.full((num + 1, num + 1), -math.inf)
    table[0, 0] = 0.0
    for k in range(num):
        for j in range(k + 1):
            table[k + 1, j] = table[k, j]
        times_linear(table[k + 1], k, 0.0, log_ratios[k])
    return table


@kernel
def _log_factorials(num: int) -> Floats:
    """Return the log factorials of 0 to `num` - 1."""
    logs = np.zeros(num)
    for n in range(1, num):
        logs[n] = logs[n - 1] + math.log(n)
    return logs


@kernel
def cardinality_derivatives(log_cardinality: Floats, log_missed: float, most: int) -> Floats:
    """Log of the derivatives of order 0, 1, ... of the generating function at exp(log_missed), shape (most + 1,).

    The derivative of order j is the expected number of ways to choose j detected targets in order while the others are
    missed.
    """
    num = len(log_cardinality)
    log_factorials = _log_factorials(num)
    derivatives, terms = np.full(most + 1, -math.inf), np.empty(num)
    for j in range(min(most + 1, num)):
        for n in range(j, num):
            missed = (n - j) * log_missed if n > j else 0.0
            terms[n - j] = log_cardinality[n] + log_factorials[n] - log_factorials[n - j] + missed
        derivatives[j] = log_sum(terms[: num - j])
    return derivatives


@kernel
def correct_cardinality(log_cardinality: Floats, log_missed: float, log_symmetric: Floats) -> Floats:
    """Log of the predicted probabilities of 0, 1, ... targets times the likelihood of the scan given each.

    log_symmetric: (num_measurements + 1,) elementary symmetric functions of the scan's ratios.
    """
    num = len(log_cardinality)
    log_factorials = _log_factorials(num)
    corrected, terms = np.empty(num), np.empty(len(log_symmetric))
    for n in range(num):
        most = min(n + 1, len(log_symmetric))
        for j in range(most):
            missed = (n - j) * log_missed if n > j else 0.0
            terms[j] = log_symmetric[j] + log_factorials[n] - log_factorials[n - j] + missed
        corrected[n] = log_cardinality[n] + log_sum(terms[:most])
    return corrected


@kernel
def measurement_slopes(table: Floats, log_ratios: Floats, derivatives: Floats) -> Floats:
    """Log of the derivative of sum over j of e_j(ratios) derivatives[j] with respect to each ratio.

    That is the sum over j of e_j(all other ratios) derivatives[j + 1], the weight of a detection in the corrected
    intensity. All of them are computed by one backward sweep through `table` (see `symmetric_functions`), at the cost
    of the functions themselves.
    """
    num = len(log_ratios)
    adjoint, slopes, terms = derivatives[: num + 1].copy(), np.empty(num), np.empty(num)
    for k in range(num - 1, -1, -1):
        for j in range(k + 1):
            terms[j] = adjoint[j + 1] + table[k, j]
        slopes[k] = log_sum(terms[: k + 1])
        for j in range(k + 1):
            adjoint[j] = log_add(adjoint[j], log_ratios[k] + adjoint[j + 1])
    return slopes


@borrowing
def _log_products_sum(log_symmetric: Floats, derivatives: Floats, shift: int) -> float:
    """Return the log of the sum over j of e_j derivatives[j + shift]."""
    total = -math.inf
    for j in range(len(log_symmetric)):
        total = log_add(total, log_symmetric[j] + derivatives[j + shift])
    return total


@kernel
def trim_cardinality(log_cardinality: Floats, max_log_gap: float) -> tuple[Floats, float]:
    """Return the normalised distribution without large numbers that are `max_log_gap` less probable than the mode.

    Also returns the log of the retained share.
    """
    total, peak = log_sum(log_cardinality), -math.inf
    for n in range(len(log_cardinality)):
        peak = max(peak, log_cardinality[n])
    num = len(log_cardinality)
    while num > 1 and (log_cardinality[num - 1] == -math.inf or log_cardinality[num - 1] < peak - max_log_gap):
        num -= 1
    trimmed = log_cardinality[:num].copy()
    kept = normalise_logs(trimmed)
    return trimmed, min(kept - total, 0.0)


@kernel
def _log_mean(log_cardinality: Floats) -> float:
    terms = np.empty(len(log_cardinality) - 1)
    for n in range(len(terms)):
        terms[n] = log_cardinality[n + 1] + math.log(n + 1.0)
    return log_sum(terms)


@kernel
def _predict(log_cardinality: Floats, num: int, birth: Lmb, rows_log_weights: Floats, log_died: float) -> Floats:
    """Return the predicted cardinality, and scale the row's weights, the first `num` of one target, to sum to one."""
    predicted = predict_cardinality(log_cardinality, log_sum(rows_log_weights[:num]), log_died, birth.existence_logit)
    log_prior_mean = _log_mean(log_cardinality)
    for c in range(num):
        rows_log_weights[c] += log_prior_mean
    log_mean = log_sum(rows_log_weights)
    if log_mean > -math.inf:
        for c in range(len(rows_log_weights)):
            rows_log_weights[c] -= log_mean
    return predicted


@kernel
def _normalised(mixture: Mixture) -> Mixture:
    """Return the mixture with weights that sum to one, or without components if there is no weight."""
    if normalise_logs(mixture.log_weights) == -math.inf:
        return components_between(mixture, 0, 0)
    return mixture


@kernel
def _detections(columns: Ints) -> Ints:
    """Return the options that are detections."""
    found, num = np.empty(len(columns), np.int64), 0
    for option in range(len(columns)):
        if columns[option] != MISSED:
            found[num] = option
            num += 1
    return found[:num]


@kernel
def step_cphd(
    log_cardinality: Floats,
    prior: Mixture,
    scan: ScanInput,
    motion: Motion,
    sensor: Sensor,
    truncation: Truncation,
    caps: MixtureCaps,
) -> tuple[Floats, Mixture, IntensityReport]:
    """Predict and update with one scan (Vo, Vo and Cantoni 2007). With Poisson clutter, its rate cancels in the ratios.

    prior: the density of one target, weights that sum to one. If no number of targets explains the scan, the log total
    of the report is -inf and the prior is returned.
    """
    rows, log_died, num_surviving = predict_intensity(prior, scan, motion, sensor)
    predicted = _predict(log_cardinality, num_surviving, scan.birth, rows.components.log_weights, log_died)
    options, log_clutter, num_raised = weighed_options(rows, scan, sensor, truncation)
    num_options = options.offsets[1]
    detections = _detections(options.columns[:num_options])
    log_ratios, log_missed = np.empty(len(detections)), -math.inf
    for option in range(num_options):
        if options.columns[option] == MISSED:
            log_missed = options.log_weights[option]
    for k in range(len(detections)):
        log_ratios[k] = options.log_weights[detections[k]]
    table = symmetric_functions(log_ratios)
    log_symmetric = table[len(detections)]
    derivatives = cardinality_derivatives(predicted, log_missed, len(detections) + 1)
    log_total = _log_products_sum(log_symmetric, derivatives, 0)
    if log_total == -math.inf:
        return log_cardinality, prior, IntensityReport(log_total, log_clutter, num_raised, 0.0)
    # Vo, Vo, Cantoni 2007: weight of a miss <Upsilon1, rho> / <Upsilon0, rho>, of each detection its own such ratio.
    log_factors = np.full(num_options, _log_products_sum(log_symmetric, derivatives, 1) - log_total)
    slopes = measurement_slopes(table, log_ratios, derivatives)
    for k in range(len(detections)):
        log_factors[detections[k]] = slopes[k] - log_total
    corrected = correct_cardinality(predicted, log_missed, log_symmetric)
    cardinality, log_kept = trim_cardinality(corrected, truncation.search.max_log_gap)
    posterior = _normalised(corrected_intensity(rows, options, log_factors, caps))
    return cardinality, posterior, IntensityReport(log_total, log_clutter, num_raised, log_kept)
