"""Generalised covariance intersection of track densities: weighted geometric means of Gaussian mixtures.

The fused density of one label is proportional to f = prod_i GM_i^(w_i) over the sensors i that know the label. A
power of a mixture is not a mixture. Its component-wise substitute, q = prod_i sum_c (a_ic N_ic)^(w_i) >= f, is one with
a Gaussian for every combination of components. With cubature points, each Gaussian N_c of q is given the mass and the
moments that f = q (f / q) has under it, where 0 < f / q <= 1.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints, Marks, Mixture, Tracks
from vedette.kernels.gaussian.components import components_like
from vedette.kernels.gaussian.information import log_integral, log_value, row_size, to_information, to_moments
from vedette.kernels.gaussian.linalg import cholesky, log_add, normalise_logs
from vedette.kernels.gaussian.marks import may_pool, mode_of, pool_marks
from vedette.kernels.gaussian.mixtures import require_gaussians
from vedette.kernels.gaussian.pooling import reduced_tracks
from vedette.kernels.gaussian.reduction import MixtureCaps


class Powers(NamedTuple):
    """Powers of the components of one label at all sensors, and working arrays."""

    rows: Floats  # (num_components, row_size) information rows of N^w about `reference`
    log_weights: Floats  # (num_components,) w log a of each
    sources: Ints  # (num_components,) place of each among the components of the tracks
    starts: Ints  # (num_sensors + 1,) start of the components of each sensor
    weights: Floats  # (num_sensors,) the powers w; 0 if the label is unknown
    chosen: Ints  # (num_sensors,) sources of a combination, of the sensors that know the label
    chosen_weights: Floats  # (num_sensors,) their powers
    reference: Floats  # (state_dim,) near the densities, to limit cancellation
    row: Floats  # (row_size,) of a product
    factor: Floats  # (state_dim, state_dim)
    matrix: Floats  # (state_dim, state_dim)
    offset: Floats  # (state_dim,) from the reference


@kernel
def _make_powers(num_sensors: int, most: int, like: Mixture) -> Powers:
    dim = like.means.shape[1]
    size = row_size(dim)
    return Powers(
        np.empty((most, size)),
        np.empty(most),
        np.empty(most, np.int64),
        np.zeros(num_sensors + 1, np.int64),
        np.empty(num_sensors),
        np.empty(num_sensors, np.int64),
        np.empty(num_sensors),
        np.empty(dim),
        np.empty(size),
        np.empty((dim, dim)),
        np.empty((dim, dim)),
        np.empty(dim),
    )


@kernel
def _load(chosen: Ints, item: int, fusion_weights: Floats, tracks: Tracks, powers: Powers) -> None:
    """Raise the components of the sensors' tracks (-1: unknown there) to their powers."""
    total, used, components = 0.0, 0, tracks.components
    for s in range(fusion_weights.shape[1]):
        if chosen[item, s] >= 0:
            total += fusion_weights[item, s]
    for s in range(fusion_weights.shape[1]):
        track = chosen[item, s]
        powers.starts[s + 1] = used
        powers.weights[s] = 0.0
        if track < 0:
            continue
        # Sensors that do not know the label do not affect its density: the others' weights sum to one.
        weight = fusion_weights[item, s] / total
        powers.weights[s] = weight
        for c in range(tracks.offsets[track], tracks.offsets[track + 1]):
            if used == 0:
                for i in range(components.means.shape[1]):
                    powers.reference[i] = components.means[c, i]
            row, factor, matrix = powers.rows[used], powers.factor, powers.matrix
            mean, cov = components.means[c], components.covs[c]
            if not to_information(mean, cov, powers.reference, weight, row, factor, matrix):
                raise FloatingPointError("covariance of a track is not positive definite")
            powers.log_weights[used] = weight * components.log_weights[c]
            powers.sources[used] = c
            used += 1
        powers.starts[s + 1] = used


@kernel
def _multiply(marks: Marks, powers: Powers, low: int, high: int, out: Mixture) -> None:
    """Write the product of every combination of one component per sensor: log mass, moments, marks."""
    dim, row = len(powers.reference), powers.row
    for combination in range(low, high):
        rest, total, count = combination - low, 0.0, 0
        for k in range(len(row)):
            row[k] = 0.0
        for s in range(len(powers.weights)):
            num = powers.starts[s + 1] - powers.starts[s]
            if num == 0:
                continue
            component = powers.starts[s] + rest % num
            # The digits of the combination's number, with the sensors' numbers of components as bases.
            rest //= num
            total += powers.log_weights[component]
            for k in range(len(row)):
                row[k] += powers.rows[component, k]
            powers.chosen[count], powers.chosen_weights[count] = powers.sources[component], powers.weights[s]
            count += 1
        positive = to_moments(row, powers.reference, out.means[combination], out.covs[combination], powers.factor)
        total += pool_marks(marks, powers.chosen, powers.chosen_weights, count, out.marks, combination)
        out.log_weights[combination] = total + log_integral(row, dim)
        if not positive or math.isnan(out.log_weights[combination]):
            raise FloatingPointError("the product of the track densities of a label is not integrable")


@kernel
def _log_ratio(marks: Marks, mode: int, powers: Powers) -> float:
    """Return log (f / q) of a mode at reference + `powers.offset`."""
    ratio = 0.0
    for s in range(len(powers.weights)):
        weight, log_power, log_sum_of_powers = powers.weights[s], -math.inf, -math.inf
        if weight == 0.0 or powers.starts[s + 1] - powers.starts[s] == 1:
            continue
        for component in range(powers.starts[s], powers.starts[s + 1]):
            if not may_pool(marks, powers.sources[component], mode):
                continue
            value = powers.log_weights[component] + log_value(powers.rows[component], powers.offset)
            log_power = log_add(log_power, value / weight)
            log_sum_of_powers = log_add(log_sum_of_powers, value)
        ratio += weight * log_power - log_sum_of_powers
    return ratio


@kernel
def _correct(marks: Marks, powers: Powers, points: Floats, point_weights: Floats, c: int, out: Mixture) -> float:
    """Give Gaussian `c` of q the moments of f / q times it, by cubature, and return the log of the retained mass."""
    (num, dim), mean, cov, mode = points.shape, out.means[c], out.covs[c], mode_of(out.marks, c)
    offset, images, masses, total = powers.offset, np.empty((num, dim)), np.empty(num), 0.0
    if not cholesky(cov, powers.factor):
        raise FloatingPointError("the product of the track densities of a label is not integrable")
    for p in range(num):
        for i in range(dim):
            images[p, i] = 0.0
            for j in range(i + 1):
                images[p, i] += powers.factor[i, j] * points[p, j]
            offset[i] = mean[i] - powers.reference[i] + images[p, i]
        # f / q is at most 1, so that no distant point can dominate.
        masses[p] = point_weights[p] * math.exp(_log_ratio(marks, mode, powers))
        total += masses[p]
    for i in range(dim):
        offset[i] = 0.0
        for p in range(num):
            offset[i] += masses[p] / total * images[p, i]
        mean[i] += offset[i]
    for i in range(dim):
        for j in range(i + 1):
            cov[i, j] = 0.0
            for p in range(num):
                cov[i, j] += masses[p] / total * (images[p, i] - offset[i]) * (images[p, j] - offset[j])
            cov[j, i] = cov[i, j]
    return math.log(total)


@kernel
def _count_combinations(chosen: Ints, tracks: Tracks) -> tuple[Ints, int]:
    """Return the offsets of the combinations of components of each label, and the most components of a label."""
    num, num_sensors = chosen.shape
    offsets, most = np.zeros(num + 1, np.int64), 0
    for item in range(num):
        combinations, components = 1, 0
        for s in range(num_sensors):
            if chosen[item, s] >= 0:
                size = tracks.offsets[chosen[item, s] + 1] - tracks.offsets[chosen[item, s]]
                combinations *= size
                components += size
        offsets[item + 1] = offsets[item] + combinations
        most = max(most, components)
    return offsets, most


@kernel
def fuse_tracks(
    chosen: Ints, fusion_weights: Floats, tracks: Tracks, points: Floats, point_weights: Floats
) -> tuple[Ints, Mixture, Floats]:
    """Return the fused density of each label, and the log of the integral of prod_i p_i^(w_i) (paper eqs. 11 and 12).

    chosen: (num, S) track of each sensor, -1 if it does not know the label: its factor is left out and the other
    sensors' weights are scaled to sum to one. fusion_weights: (num, S) positive if known. points: (num_points, dim),
    point_weights: (num_points,) a cubature rule for the standard normal without negative weights. With no points the
    fused mixture is the component-wise power. A fused mixture has a component for every combination of the sensors'
    components. The points take the classes of a mixture as independent of its states.

    Returns offsets (num + 1,) and components of the fused tracks, and log_overlaps (num,). Raises FloatingPointError
    if a covariance is not positive definite, NumericalError if a fused one is not.
    """
    num = len(chosen)
    offsets, most = _count_combinations(chosen, tracks)
    powers, log_overlaps = _make_powers(fusion_weights.shape[1], most, tracks.components), np.empty(num)
    out = components_like(tracks.components, offsets[num])
    for item in range(num):
        low, high = offsets[item], offsets[item + 1]
        _load(chosen, item, fusion_weights, tracks, powers)
        _multiply(tracks.components.marks, powers, low, high, out)
        for c in range(low, high):
            if high - low > 1 and len(points) > 0 and out.log_weights[c] > -math.inf:
                out.log_weights[c] += _correct(tracks.components.marks, powers, points, point_weights, c, out)
        log_overlaps[item] = normalise_logs(out.log_weights[low:high])
    require_gaussians(out.means, out.covs)
    return offsets, out, log_overlaps


class PowerRule(NamedTuple):
    """How the power of a mixture is computed."""

    caps: MixtureCaps  # of the mixtures before and after fusion
    points: Floats  # (num_points, state_dim) cubature points of a standard normal; none: the component-wise power
    point_weights: Floats  # (num_points,)


@kernel
def fused_tracks(labels: Ints, chosen: Ints, weights: Floats, tracks: Tracks, rule: PowerRule) -> tuple[Tracks, Floats]:
    """Return the tracks of `fuse_tracks` with reduced mixtures, and log_overlaps. labels: (num, 2)."""
    offsets, components, log_overlaps = fuse_tracks(chosen, weights, tracks, rule.points, rule.point_weights)
    if len(rule.points) > 0:
        for item in range(len(log_overlaps)):  # Hoelder: the integral is at most 1; cubature may exceed it
            log_overlaps[item] = min(log_overlaps[item], 0.0)
    return reduced_tracks(Tracks(labels, offsets, components), rule.caps), log_overlaps
