"""Tracks that a scan can affect, so that the cost of a scan depends on the tracks near it, not on their total number.

A track outside the field of view, which is certain to be missed, stays unchanged: 1 - p_D is 1 in double precision,
and p_D g(z | x) / kappa(z) is negligible next to 1 for every measurement.
"""

import math

import numpy as np

from vedette.kernels.association.options import log_clutter_of_row
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_between, components_like, copy_components
from vedette.kernels.gaussian.detection import detection_probability
from vedette.kernels.gaussian.linalg import LOG_2PI, cholesky, log_det_from_factor, normalise_logs
from vedette.kernels.gaussian.reduction import MixtureCaps, reduce_mixture
from vedette.kernels.gaussian.row_noise import bring_noise, largest_class_ratio
from vedette.kernels.gaussian.scratch import Scratch, make_scratch

_NOTHING = 2.0**-54  # negligible next to 1


@kernel
def _least_log_clutter(scan: ScanInput, sensor: Sensor, floor: float, values: Floats) -> float:
    """Return the least log clutter intensity at the measurements over the ratio of classes, or inf without any."""
    least = math.inf
    for j in range(len(scan.measurements.values)):
        level = max(log_clutter_of_row(sensor, scan.measurements, j, scan.pose, values), floor)
        least = min(least, level - largest_class_ratio(scan.measurements, j))
    return least


@inlined
def _may_change(
    tracks: Tracks, c: int, scan: ScanInput, sensor: Sensor, least_log_clutter: float, scratch: Scratch
) -> bool:
    """Return True if the scan may change a component.

    The bound on the likelihood of a measurement is the peak of the measurement noise alone. Measurements that bring
    their noise have no bound.
    """
    mean, noise = tracks.components.means[c], scratch.measurement_noise
    chance = detection_probability(sensor, scan.pose, mean, tracks.components.covs[c], scratch.points[0])
    if chance == 0.0 or chance > _NOTHING or bring_noise(scan.measurements):
        return chance > 0.0
    if least_log_clutter == math.inf:
        return False
    sensor.measurement_noise_cov(mean, scan.pose, sensor.noise_params, noise)
    if not cholesky(noise, scratch.innovation_cov):
        return True
    log_peak = -0.5 * (log_det_from_factor(scratch.innovation_cov) + noise.shape[0] * LOG_2PI)
    return math.log(chance) + log_peak - least_log_clutter > math.log(_NOTHING)


@kernel
def in_view(tracks: Tracks, scan: ScanInput, sensor: Sensor, truncation: Truncation) -> Bools:
    """Mask of the tracks that the scan may change, shape (num_tracks,)."""
    marks = np.zeros(len(tracks.labels), np.bool_)
    scratch = make_scratch(tracks.components.means.shape[1], len(sensor.periods))
    least_log_clutter = _least_log_clutter(scan, sensor, truncation.log_clutter_floor, scratch.residual)
    for i in range(len(marks)):
        for c in range(tracks.offsets[i], tracks.offsets[i + 1]):
            if _may_change(tracks, c, scan, sensor, least_log_clutter, scratch):
                marks[i] = True
                break
    return marks


@kernel
def marked(lmb: Lmb, marks: Bools) -> Lmb:
    """Return the LMB of the marked tracks."""
    num, num_components = 0, 0
    for i in range(len(marks)):
        if marks[i]:
            num += 1
            num_components += lmb.tracks.offsets[i + 1] - lmb.tracks.offsets[i]
    room, logits, filled = components_like(lmb.tracks.components, num_components), np.empty(num), 0
    out = Tracks(np.empty((num, 2), np.int64), np.zeros(num + 1, np.int64), room)
    for i in range(len(marks)):
        if marks[i]:
            _copy(lmb.tracks, i, out, filled)
            logits[filled] = lmb.existence_logit[i]
            filled += 1
    return Lmb(out, logits)


@kernel
def _copy(source: Tracks, i: int, out: Tracks, num: int) -> None:
    """Write track `i` of `source` as number `num`."""
    first, last = source.offsets[i], source.offsets[i + 1]
    out.labels[num, 0], out.labels[num, 1] = source.labels[i, 0], source.labels[i, 1]
    out.offsets[num + 1] = copy_components(source.components, first, last, out.components, out.offsets[num])


@kernel
def _copy_reduced(source: Tracks, i: int, caps: MixtureCaps, out: Tracks, num: int) -> bool:
    """Apply `_copy` with reduction. Return True if all components were kept, so that nothing remains to be reduced."""
    _copy(source, i, out, num)
    first, end = out.offsets[num], out.offsets[num + 1]
    if end - first == 1:
        return True
    reduced = reduce_mixture(components_between(out.components, first, end), caps)
    normalise_logs(reduced.log_weights)
    last = copy_components(reduced, 0, len(reduced.log_weights), out.components, first)
    out.offsets[num + 1] = last
    return bool(last == end)


@kernel
def merge_updated(prior: Lmb, marks: Bools, updated: Lmb, caps: MixtureCaps, settled: Bools) -> tuple[Lmb, Bools]:
    """Return the prior with its marked tracks as in `updated`, or dropped if they are not in it, in label order.

    Mixtures of the other tracks are reduced as by an update without effect, which may merge results of the last one.
    The `settled` tracks, whose reduction has no effect, are skipped. Also returns the tracks that are settled now.
    """
    most, own_components = len(marks), prior.tracks.components
    room = components_like(own_components, len(own_components.log_weights) + len(updated.tracks.components.log_weights))
    logits, still, num, own = np.empty(most), np.zeros(most, np.bool_), 0, 0
    out = Tracks(np.empty((most, 2), np.int64), np.zeros(most + 1, np.int64), room)
    for i in range(most):
        if not marks[i]:
            if settled[i]:
                _copy(prior.tracks, i, out, num)
            still[num] = settled[i] or _copy_reduced(prior.tracks, i, caps, out, num)
            logits[num] = prior.existence_logit[i]
            num += 1
        elif own < len(updated.existence_logit) and _same_label(prior.tracks.labels, i, updated.tracks.labels, own):
            _copy(updated.tracks, own, out, num)
            logits[num] = updated.existence_logit[own]
            num, own = num + 1, own + 1
    tracks = Tracks(out.labels[:num], out.offsets[: num + 1], components_between(room, 0, out.offsets[num]))
    return Lmb(tracks, logits[:num]), still[:num]


@inlined
def _same_label(labels: Ints, i: int, others: Ints, j: int) -> bool:
    return bool(labels[i, 0] == others[j, 0] and labels[i, 1] == others[j, 1])
