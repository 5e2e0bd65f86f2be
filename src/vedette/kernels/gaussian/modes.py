"""Modes of motion: a hidden discrete state of each target, which changes as a Markov chain in continuous time.

Prediction replaces a component of weight w and mode i by one for each mode j, of weight w P(j | i), that moves as in
mode j. Components of one mode are then merged. If all of them are, this is the interacting multiple model of Blom and
Bar-Shalom (1988).
"""

import math

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import LONGEST_MODE_STEP, Floats, Mixture, Motion, Switching, Tracks
from vedette.kernels.gaussian.components import components_between, components_like, copy_component, make_components
from vedette.kernels.gaussian.linalg import log_or_minus_inf, log_sum
from vedette.kernels.gaussian.marks import NOT_DRAWN, copy_marks, mode_of, set_mode
from vedette.kernels.gaussian.prediction import predict, survival_probabilities
from vedette.kernels.gaussian.reduction import MixtureCaps, make_reduction_work, reduce_into
from vedette.kernels.gaussian.scratch import Scratch, make_scratch

# Branches into a mode are dropped below this share (log) of the heaviest one into it, so that a mode that is rarely
# entered stays possible at any rate of scans. In an intensity of many targets a light branch may be of another target.
LOG_LEAST, _LOG_LEAST_OF_INTENSITY = math.log(1e-3), math.log(1e-6)
_LOWEST = -1.7976931348623157e308  # the lowest finite number


@kernel
def mode_transitions(rates: Floats, dt: float) -> Floats:
    """Return exp(rates dt), the probability of each mode (column) `dt` seconds after each mode (row).

    By uniformisation: the modes after a Poisson number of steps of a chain, with the rate of the fastest change, whose
    steps may stay. All terms are positive. A time of several changes is halved first, and the result squared.
    """
    num, fastest, halvings = len(rates), 0.0, 0
    for i in range(num):
        fastest = max(fastest, -rates[i, i])
    while fastest * dt > 1.0:
        dt, halvings = 0.5 * dt, halvings + 1
    step, term = np.zeros((num, num)), np.zeros((num, num))
    for i in range(num):
        term[i, i] = math.exp(-fastest * dt)
        for j in range(num):
            step[i, j] = (1.0 if i == j else 0.0) + (rates[i, j] / fastest if fastest > 0.0 else 0.0)
    total, changes = term.copy(), 0
    while term.max() > 1e-17:
        changes += 1
        term = _product(term, step, fastest * dt / changes)
        total += term
    for _ in range(halvings):
        total = _product(total, total, 1.0)
        for i in range(num):
            total[i] /= total[i].sum()  # squaring doubles the rounding error of the sums
    return total


@kernel
def _product(first: Floats, second: Floats, factor: float) -> Floats:
    """Return the product of two square matrices times a number, without BLAS, whose sums depend on the threads."""
    num = len(first)
    out = np.zeros((num, num))
    for i in range(num):
        for j in range(num):
            for k in range(num):
                out[i, j] += first[i, k] * second[k, j] * factor
    return out


@kernel
def _log_shares(chain: Switching, dt: float) -> Floats:
    """Return log P(mode j after `dt` seconds | mode i), (num_modes + 1, num_modes), last the row of one not drawn."""
    changes, num = mode_transitions(chain.rates, dt), len(chain.at_birth)
    out = np.empty((num + 1, num))
    for j in range(num):
        for i in range(num):
            out[i, j] = log_or_minus_inf(changes[i, j])
        out[NOT_DRAWN, j] = log_or_minus_inf(chain.at_birth[j])
    return out


@borrowing
def _write_branches(
    tracks: Tracks,
    i: int,
    motion: Motion,
    dt: float,
    log_shares: Floats,
    log_least: float,
    wide: Mixture,
    scratch: Scratch,
) -> int:
    """Write the predicted branches of track `i`, of its total weight, and return their number."""
    given, first, last, width = tracks.components, tracks.offsets[i], tracks.offsets[i + 1], 0
    total = log_sum(given.log_weights[first:last])
    for mode in range(log_shares.shape[1]):
        heaviest = -math.inf
        for c in range(first, last):
            heaviest = max(heaviest, given.log_weights[c] + log_shares[mode_of(given.marks, c), mode])
        least = max(heaviest + log_least, _LOWEST if total > -math.inf else -math.inf)
        for c in range(first, last):
            weight = given.log_weights[c] + log_shares[mode_of(given.marks, c), mode]
            if weight < least:
                continue
            copy_marks(given.marks, c, wide.marks, width)
            set_mode(wide.marks, width, mode)
            wide.log_weights[width] = weight
            predict(motion, mode, dt, given.means[c], given.covs[c], wide.means[width], wide.covs[width], scratch)
            width += 1
    if total > -math.inf:
        shift = total - log_sum(wide.log_weights[:width])
        for k in range(width):
            wide.log_weights[k] += shift
    return width


@kernel
def _after_step(tracks: Tracks, motion: Motion, dt: float, log_least: float) -> Tracks:
    """Return the tracks after a step within which a target changes its mode at most once."""
    given, num, num_modes = tracks.components, len(tracks.labels), len(motion.transition_params)
    chain, dim, widest, room = motion.switching, given.means.shape[1], 0, num_modes * len(given.log_weights)
    for i in range(num):
        widest = max(widest, num_modes * (tracks.offsets[i + 1] - tracks.offsets[i]))
    out = make_components(room, dim, given.marks)
    wide, log_shares = components_like(out, widest), _log_shares(chain, dt)
    work, scratch = make_reduction_work(widest, wide), make_scratch(dim, 1)
    caps = MixtureCaps(-math.inf, chain.merge_distance, max(2, room))
    offsets, filled = np.zeros(num + 1, np.int64), 0
    for i in range(num):
        width = _write_branches(tracks, i, motion, dt, log_shares, log_least, wide, scratch)
        filled = reduce_into(wide, width, caps, work, out, filled)
        offsets[i + 1] = filled
    return Tracks(tracks.labels, offsets, components_between(out, 0, filled))


@kernel
def branched_tracks(tracks: Tracks, motion: Motion, dt: float, log_least: float) -> tuple[Tracks, Floats]:
    """Return the tracks `dt` seconds later, weighted by survival, and the log probability that each died, (num,).

    log_least: log of the share of the heaviest branch of a track into a mode below which others are dropped.
    """
    given, num, fastest = tracks.components, len(tracks.labels), 0.0
    survival, log_dead = survival_probabilities(motion, dt, given.means), np.empty(num)
    log_weights = given.log_weights.copy()
    for i in range(num):
        dead = 0.0
        for c in range(tracks.offsets[i], tracks.offsets[i + 1]):
            dead += math.exp(log_weights[c]) * (1.0 - survival[c])
            log_weights[c] += log_or_minus_inf(survival[c])
        log_dead[i] = log_or_minus_inf(dead)
    for i in range(len(motion.switching.rates)):
        fastest = max(fastest, -motion.switching.rates[i, i])
    num_steps = max(1, math.ceil(fastest * dt / LONGEST_MODE_STEP))
    moved = Tracks(tracks.labels, tracks.offsets, Mixture(log_weights, given.means, given.covs, given.marks))
    # Without merging, or with all of it, the result is exact.
    log_least = log_least if 0.0 < motion.switching.merge_distance < math.inf else -math.inf
    for _ in range(num_steps):
        moved = _after_step(moved, motion, dt / num_steps, log_least)
    return moved, log_dead


@kernel
def predicted_intensity(intensity: Mixture, motion: Motion, dt: float) -> Mixture:
    """Return the intensity after survival and motion over `dt` seconds."""
    num, dim = intensity.means.shape
    if len(motion.transition_params) > 1:
        one_track = Tracks(np.zeros((1, 2), np.int64), np.array([0, num]), intensity)
        return branched_tracks(one_track, motion, dt, _LOG_LEAST_OF_INTENSITY)[0].components
    out, scratch = components_like(intensity, num), make_scratch(dim, 1)
    survival = survival_probabilities(motion, dt, intensity.means)
    for c in range(num):
        copy_component(intensity, c, out, c)
        out.log_weights[c] += log_or_minus_inf(survival[c])
        predict(motion, 0, dt, intensity.means[c], intensity.covs[c], out.means[c], out.covs[c], scratch)
    return out
