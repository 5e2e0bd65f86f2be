"""Gaussian intensities of undetected targets: prediction, and condensing to few components of the same total weight."""

from __future__ import annotations

import math

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture, Motion
from vedette.kernels.gaussian.components import (
    components_like,
    copy_component,
    merge_components,
    own_components,
    stacked_mixtures,
)
from vedette.kernels.gaussian.linalg import cholesky, inverse_from_factor, log_det_from_factor, log_sum
from vedette.kernels.gaussian.marks import may_merge
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import make_scratch

# Twice the Kullback-Leibler divergence up to which a component is merged with a heavier one, and the factor by which
# this grows until few enough are left.
_REACH, _GROWTH = 0.1, 3.0
_LIGHTEST = 1e-9  # share of the intensity below which a component is dropped, and its number shared out


@kernel
def predicted_intensity(intensity: Mixture, motion: Motion, dt: float, born: Mixture, max_components: int) -> Mixture:
    """Return the intensity `dt` seconds later, with births in between, condensed."""
    return condensed(stacked_mixtures(moved(intensity, motion, dt), born), max_components)


@kernel
def moved(intensity: Mixture, motion: Motion, dt: float) -> Mixture:
    """Survival and motion over `dt` seconds, component by component."""
    num, dim = intensity.means.shape
    out, scratch = components_like(intensity, num), make_scratch(dim, 1)
    for c in range(num):
        survival = motion.prob_survival(intensity.means[c], dt, motion.survival_params)
        if not 0.0 <= survival <= 1.0:
            raise ModelError("survival model: probability is not in [0, 1]")
        copy_component(intensity, c, out, c)
        out.log_weights[c] += math.log(survival) if survival > 0.0 else -math.inf
        predict(motion, dt, intensity.means[c], intensity.covs[c], out.means[c], out.covs[c], scratch)
    return out


@inlined
def _divergence(
    mixture: Mixture, c: int, heaviest: int, inverse: Floats, log_det: float, reach: float, factor: Floats
) -> float:
    """Twice the Kullback-Leibler divergence of component `c` from `heaviest`, or inf once it is surely above reach.

    inverse, log_det: of the covariance of `heaviest`. factor: (n, n) to work in.
    """
    n = mixture.means.shape[1]
    squared, trace = 0.0, 0.0
    for i in range(n):
        d = mixture.means[c, i] - mixture.means[heaviest, i]
        # The divergence is at least d'P^-1 d, and that at least d_i^2 / P_ii.
        if d * d > reach * mixture.covs[heaviest, i, i]:
            return math.inf
    for i in range(n):
        for j in range(n):
            off = (mixture.means[c, i] - mixture.means[heaviest, i]) * (
                mixture.means[c, j] - mixture.means[heaviest, j]
            )
            squared += inverse[i, j] * off
            trace += inverse[i, j] * mixture.covs[c, i, j]
    if squared > reach or not cholesky(mixture.covs[c], factor):
        return math.inf
    return squared + trace - n - log_det_from_factor(factor) + log_det


@borrowing
def _near(mixture: Mixture, left: Ints, heaviest: int, reach: float, inverse: Floats, factor: Floats, out: Ints) -> int:
    """Write the remaining components that `heaviest` represents to `out`, itself first. Returns their number."""
    out[0] = heaviest
    if not cholesky(mixture.covs[heaviest], factor):
        return 1
    inverse_from_factor(factor, inverse)
    log_det, count = log_det_from_factor(factor), 1
    for c in range(len(left)):
        if left[c] == 0 or c == heaviest or not may_merge(mixture.marks, heaviest, c):
            continue
        if _divergence(mixture, c, heaviest, inverse, log_det, reach, factor) < reach:
            out[count] = c
            count += 1
    return count


@kernel
def _merged(mixture: Mixture, reach: float) -> Mixture:
    """Components merged by moments, greedily from the heaviest, with those of a divergence below `reach`."""
    num, dim = mixture.means.shape
    left, near, weights = np.ones(num, np.int64), np.empty(num, np.int64), np.empty(num)
    inverse, factor = np.empty((dim, dim)), np.empty((dim, dim))
    out, filled = components_like(mixture, num), 0
    for heaviest in descending_order(mixture.log_weights):
        if left[heaviest] == 0:
            continue
        count, total = _near(mixture, left, heaviest, reach, inverse, factor, near), 0.0
        for k in range(count):
            left[near[k]] = 0
            weights[k] = math.exp(mixture.log_weights[near[k]])
            total += weights[k]
        if total == 0.0:
            continue
        merge_components(mixture, near, weights, count, out, filled)
        out.log_weights[filled] = math.log(total)
        filled += 1
    return own_components(out, filled)


@kernel
def condensed(intensity: Mixture, max_components: int) -> Mixture:
    """The intensity in at most `max_components` components.

    Similar components are merged, and where there are still too many, less and less similar ones. Components lighter
    than a billionth of the intensity are dropped, and the others raised to the same total.
    """
    found, reach = _merged(intensity, _REACH), _REACH
    total = log_sum(found.log_weights)
    while len(found.log_weights) > max_components:
        reach *= _GROWTH
        found = _merged(found, reach)
    lightest, kept = total + math.log(_LIGHTEST), 0
    for c in range(len(found.log_weights)):
        if found.log_weights[c] < lightest:
            continue
        if kept < c:
            copy_component(found, c, found, kept)
        kept += 1
    out = own_components(found, kept)
    rise = total - log_sum(out.log_weights)
    for c in range(kept):
        out.log_weights[c] += rise
    return out
