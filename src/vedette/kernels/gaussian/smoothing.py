"""One step of the backward pass of Rauch, Tung and Striebel (1965) over mixtures and modes of motion."""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Mixture, Motion, Tracks
from vedette.kernels.gaussian.components import components_like, copy_component
from vedette.kernels.gaussian.linalg import (
    cholesky,
    log_det_from_factor,
    log_or_minus_inf,
    log_sum,
    normalise_logs,
    sandwich,
    solve_lower,
    solve_upper,
)
from vedette.kernels.gaussian.marks import mode_of
from vedette.kernels.gaussian.mixtures import moment_match
from vedette.kernels.gaussian.modes import mode_transitions
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import Scratch, make_scratch
from vedette.kernels.gaussian.sigma_points import CUBATURE, LINEARISED, UNSCENTED_KAPPA


class SmoothedTracks(NamedTuple):
    """Tracks given the scans before and after, one Gaussian each."""

    means: Floats  # (num_tracks, state_dim)
    covs: Floats  # (num_tracks, state_dim, state_dim)
    mode_probs: Floats  # (num_tracks, num_modes), which sum to 1, or to less while modes are not drawn


class _Work(NamedTuple):
    """Working arrays of the smoothing of one component."""

    mean: Floats  # (n,) predicted
    cov: Floats  # (n, n) predicted
    gain: Floats  # (n, n)
    change: Floats  # (n,) of the predicted mean


@borrowing
def _write_cross_covariance(motion: Motion, mean: Floats, cov: Floats, scratch: Scratch, cross: Floats) -> None:
    """Write the covariance of the states before (row) and after the prediction that has just filled `scratch`."""
    n = len(mean)
    share = 0.5 / (n + (0.0 if motion.method == CUBATURE else UNSCENTED_KAPPA))
    for i in range(n):
        for j in range(n):
            total = 0.0
            if motion.method == LINEARISED:
                for k in range(n):
                    total += cov[i, k] * scratch.jacobian[j, k]
            else:
                for p in range(1, 2 * n + 1):
                    total += share * (scratch.points[p, i] - mean[i]) * scratch.images[p, j]
            cross[i, j] = total


@borrowing
def _smooth_component(
    motion: Motion, mode: int, dt: float, later: SmoothedTracks, i: int, wide: Mixture, c: int, work: _Work,
    scratch: Scratch,
) -> float:  # fmt: skip
    """Smooth component `c` of `wide` in place, if track `i` of `later` moved there in this mode.

    m <- m + G (m' - m-) and P <- P + G (P' - P-) G', with the predicted m-, P- and G = C inverse(P-), where C is the
    covariance of the states before and after. Returns the log of the predicted density at m', up to a constant.
    """
    mean, cov, n, cross, factor = wide.means[c], wide.covs[c], len(work.mean), scratch.product, scratch.factor
    predict(motion, mode, dt, mean, cov, work.mean, work.cov, scratch)
    _write_cross_covariance(motion, mean, cov, scratch, cross)
    if not cholesky(work.cov, factor):
        raise NumericalError("smoothing: the predicted covariance of a track is not positive definite")
    for k in range(n):
        solve_lower(factor, cross[k], work.gain[k])
        solve_upper(factor, work.gain[k], work.gain[k])
        work.change[k] = later.means[i, k] - work.mean[k]
    for a in range(n):
        for b in range(n):
            mean[a] += work.gain[a, b] * work.change[b]
            work.cov[a, b] = later.covs[i, a, b] - work.cov[a, b]
    sandwich(work.gain, work.cov, cov, cross, cov, n)
    solve_lower(factor, work.change, work.change)
    distance = 0.0
    for k in range(n):
        distance += work.change[k] * work.change[k]
    return -0.5 * (distance + log_det_from_factor(factor))


@borrowing
def _smooth_in_mode(
    tracks: Tracks, motion: Motion, mode: int, probs: Floats, dt: float, later: SmoothedTracks, i: int, wide: Mixture,
    width: int, work: _Work, scratch: Scratch,
) -> int:  # fmt: skip
    """Write the components of track `i`, smoothed for this mode after the step, from place `width` on of `wide`.

    Their weights sum to the probability of the mode. probs: of the mode (column) after each mode. Returns the new end.
    """
    begin, drawn = width, 0.0
    for k in range(later.mode_probs.shape[1]):
        drawn += later.mode_probs[i, k]
    after = later.mode_probs[i, mode] / drawn if drawn > 0.0 else motion.switching.at_birth[mode]
    if after == 0.0:
        return width
    for c in range(tracks.offsets[i], tracks.offsets[i + 1]):
        copy_component(tracks.components, c, wide, width)
        before = mode_of(wide.marks, width)
        share = probs[before, mode] if before >= 0 else motion.switching.at_birth[mode]
        log_density = _smooth_component(motion, mode, dt, later, i, wide, width, work, scratch)
        wide.log_weights[width] += log_or_minus_inf(share) + log_density
        width += 1
    total = log_sum(wide.log_weights[begin:width])
    if total > -math.inf:
        for c in range(begin, width):
            wide.log_weights[c] += math.log(after) - total
    return width


@kernel
def smoothed_tracks(tracks: Tracks, motion: Motion, dt: float, later: SmoothedTracks) -> SmoothedTracks:
    """Return the tracks of a scan given also the scans of `later`.

    Given the state x' and mode b after it, the density of a state is a mixture over components i of weights
    proportional to w_i P(b | mode of i) N(x'; m-, P-). They are taken at the smoothed mean, the modes have their
    smoothed probabilities (Kim 1994), and the result is reduced to one Gaussian. This is exact for a single linear
    Gaussian component.

    Args:
        tracks: densities after the scan, one track for each of `later`.
        motion: of the targets.
        dt: time until the scan of `later`, above 0 s.
        later: the same tracks at their next scan, given that and all later scans.
    """
    num, num_modes = later.mode_probs.shape
    n, widest = later.means.shape[1], 0
    for i in range(num):
        widest = max(widest, num_modes * (tracks.offsets[i + 1] - tracks.offsets[i]))
    out = SmoothedTracks(np.empty((num, n)), np.empty((num, n, n)), np.zeros((num, num_modes)))
    wide, scratch = components_like(tracks.components, widest), make_scratch(n, 1)
    work = _Work(np.empty(n), np.empty((n, n)), np.empty((n, n)), np.empty(n))
    probs = mode_transitions(motion.switching.rates, dt)
    for i in range(num):
        width = 0
        for mode in range(num_modes):
            width = _smooth_in_mode(tracks, motion, mode, probs, dt, later, i, wide, width, work, scratch)
        log_weights = wide.log_weights[:width]
        moment_match(log_weights, wide.means[:width], wide.covs[:width], out.means[i], out.covs[i])
        normalise_logs(log_weights)
        for c in range(width):
            before = mode_of(wide.marks, c)
            if before >= 0:
                out.mode_probs[i, before] += math.exp(log_weights[c])
    return out
