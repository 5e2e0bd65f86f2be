"""Prediction and reward tables of a planning decision (paper, Algorithms 2 and 3).

A case is one action of one sensor with one sample; case `action * num_samples + sample`.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Motion
from vedette.kernels.gaussian.information import to_information
from vedette.kernels.gaussian.kalman import make_scratch, predict
from vedette.kernels.gaussian.mixtures import copy_component, match_components
from vedette.kernels.planning.fused_divergence import Cases, Prediction, fused_glmb_divergence, fused_lmb_divergence


@kernel
def predict_tracks(motion: Motion, dt: float, num_steps: int, means: Floats, covs: Floats) -> tuple[Floats, Floats]:
    """Each Gaussian after `num_steps` predictions, without birth or death."""
    new_means, new_covs = np.empty_like(means), np.empty_like(covs)
    dim = means.shape[1]
    scratch = make_scratch(dim, dim)
    old_means, old_covs = np.empty((1, dim)), np.empty((1, dim, dim))
    for c in range(len(means)):
        copy_component(means, covs, c, new_means, new_covs, c)
        for _ in range(num_steps):
            copy_component(new_means, new_covs, c, old_means, old_covs, 0)
            predict(motion, dt, old_means[0], old_covs[0], new_means[c], new_covs[c], scratch)
    return new_means, new_covs


@kernel
def write_rows(
    first: int, last: int, known: Ints, means: Floats, covs: Floats, references: Floats, power: float, rows: Floats
) -> None:
    """Information rows of cases `first:last`, scaled by the sensor's weight; zeros where `known` is 0."""
    dim = means.shape[2]
    factor, precision = np.empty((dim, dim)), np.empty((dim, dim))
    for case in range(first, last):
        for m in range(means.shape[1]):
            if known[m] == 0:
                for k in range(rows.shape[2]):
                    rows[case, m, k] = 0.0
            elif not to_information(
                means[case, m], covs[case, m], references[m], power, rows[case, m], factor, precision
            ):
                raise NumericalError("covariance of a pseudo-updated track is not positive definite")


@kernel
def fill_missing(
    log_weights: Floats,
    means: Floats,
    covs: Floats,
    source_members: Ints,
    source_sets: Ints,
    source_offsets: Ints,
    missing_sets: Ints,
    floor: float,
    first: int,
    last: int,
) -> None:
    """Stand-ins in cases `first:last` for label sets that the sensor lacks, as in `vedette.fusion.CmDeltaGlmb`.

    missing_sets: the sets lacking; their weight becomes the least of `floor` and the weights that are there. The
    Gaussian of member `m` is matched to those of members `source_members[source_offsets[m]:source_offsets[m + 1]]`
    weighted by their sets `source_sets`; a member without sources is left as it is.
    """
    most = 0
    for m in range(len(source_offsets) - 1):
        most = max(most, source_offsets[m + 1] - source_offsets[m])
    shares = np.empty(most)
    for case in range(first, last):
        peak, least = -math.inf, floor
        for weight in log_weights[case]:
            peak = max(peak, weight)
            if weight > -math.inf:
                least = min(least, weight)
        for m in range(len(source_offsets) - 1):
            low, high = source_offsets[m], source_offsets[m + 1]
            for i in range(low, high):
                shares[i - low] = math.exp(log_weights[case, source_sets[i]] - peak)
            if high > low:
                match_components(
                    source_members[low:high], shares, high - low, means[case], covs[case], means[case, m], covs[case, m]
                )
        for at in missing_sets:
            log_weights[case, at] = least


@kernel
def reward_table(
    cases: Cases,
    first_cases: Ints,
    actions: Ints,
    num_samples: int,
    prediction: Prediction,
    dim: int,
    log_unit_volume: float,
    is_lmb: bool,
    first: int,
    last: int,
    rewards: Floats,
) -> None:
    """Rewards (num_joint, num_samples) of joint actions `first:last`.

    actions: (num_joint, num_sensors) one action of each sensor. first_cases: (num_sensors,) its first case.
    """
    num_sensors = actions.shape[1]
    chosen = np.empty(num_sensors, np.int64)
    work = np.empty((2, cases.rows.shape[2]))
    for joint in range(first, last):
        for sample in range(num_samples):
            for s in range(num_sensors):
                chosen[s] = first_cases[s] + actions[joint, s] * num_samples + sample
            if is_lmb:
                rewards[joint, sample] = fused_lmb_divergence(cases, chosen, prediction, dim, log_unit_volume, work)
            else:
                rewards[joint, sample] = fused_glmb_divergence(cases, chosen, prediction, dim, log_unit_volume, work)
