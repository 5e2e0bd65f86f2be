"""First detections: each measurement may be the first of a target that was not detected before.

Undetected targets are a Poisson intensity D, and clutter another with intensity kappa. A measurement z is then the
first detection of a target with the odds

    rho / kappa,   rho = integral of P_D(x) g(z | x) D(x) dx,

against clutter, and its density is P_D g(z | .) D / rho (Williams 2015, eq. 36-38). In the rows of a scan it is a
candidate label with two options, absent or detected as that measurement, and no option of a miss.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options
from vedette.kernels.association.gating import near_measurements
from vedette.kernels.association.joined_rows import copy_entry
from vedette.kernels.association.options import Sight, make_room, room_for_updated, sort_row, weigh_detection
from vedette.kernels.association.predicted import Rows, make_rows, standing_rows_of_scan
from vedette.kernels.base.arrays import counted_ints, group_members
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints, Mixture, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import components_like, copy_component
from vedette.kernels.gaussian.detection import moments_if_missed
from vedette.kernels.gaussian.innovation import copy_innovation
from vedette.kernels.gaussian.linalg import log_add, log_or_minus_inf
from vedette.kernels.gaussian.marks import detection_factor, room_for_updated_marks
from vedette.kernels.gaussian.relinearisation import make_pair_work

_LEAST_SHARE = math.log(1e-5)  # least share of a component of the intensity in a candidate's density
# A measurement begins a label if that would have the least odds, or if no track takes it with at least the probability
# _LOG_FREE: then nothing else explains it but clutter, however rare births are. At a measurement that is unclaimed with
# less than _LOG_CLAIMED the label needs ten times the least odds: otherwise it would remain as an improbable second
# label of a tracked target.
_LOG_FREE, _LOG_CLAIMED, _LOG_WORTH = math.log(0.1), math.log(0.05), math.log(10.0)


class Candidates(NamedTuple):
    """The labels that a scan may begin."""

    rows: Rows
    options: Options
    log_left_out: float  # log of the factor by which measurements without a candidate would raise the total weight
    left_out: Floats  # (num_seen,) expected number of targets first detected by them, by component of the intensity


class _Pairs(NamedTuple):
    """Components of the intensity with the measurements in their gates."""

    components: Ints  # (num_pairs,)
    measurements: Ints  # (num_pairs,)
    log_odds: Floats  # (num_pairs,)
    options: Options  # with the entries of the pairs


@kernel
def seen_intensity(intensity: Mixture, scan: ScanInput, sensor: Sensor) -> Rows:
    """Return the components of an intensity as rows of one component each, with their expected measurements.

    The rows are never absent.
    """
    num = len(intensity.log_weights)
    each = Tracks(np.zeros((num, 2), np.int64), counted_ints(num + 1), intensity)
    return standing_rows_of_scan(each, scan, sensor)


@kernel
def missed_intensity(seen: Rows, scan: ScanInput, sensor: Sensor, num: int, left_out: Floats) -> tuple[Mixture, float]:
    """Return the intensity of the targets without a label, and the log probability of no first detection at all.

    num: number of components of the intensity. left_out: as in `Candidates`. The log probability is minus the integral
    of P_D D, as the number of detections is Poisson.
    """
    components = seen.components
    out, expected, state = components_like(components, num), 0.0, np.empty(components.means.shape[1])
    for c in range(num):
        detected = seen.innovation.prob_detection[c]
        expected += math.exp(components.log_weights[c]) * detected
        copy_component(components, c, out, c)
        out.log_weights[c] = log_add(
            out.log_weights[c] + log_or_minus_inf(1.0 - detected), log_or_minus_inf(left_out[c])
        )
        if seen.innovation.at_edge[c]:
            mean, cov, factor = components.means[c], components.covs[c], detection_factor(sensor, components.marks, c)
            moments_if_missed(sensor, scan.pose, mean, cov, factor, state, out.means[c], out.covs[c])
    return out, -expected


@kernel
def _gated_pairs(seen: Rows, num_local: int, sight: Sight, gate: float) -> _Pairs:
    measurements = sight.measurements
    near = near_measurements(seen, measurements, sight.sensor.periods, gate)
    num, num_rows = near.offsets[len(near.offsets) - 1], len(seen.log_absent)
    num_measurements, meas_dim = measurements.values.shape
    marks = room_for_updated_marks(measurements, num)
    options = make_room(0, num, num, num_measurements, meas_dim, room_for_updated(seen, num), marks)
    components, filled = np.empty(num, np.int64), 0
    for c in range(num_rows):
        own = c - (num_rows - num_local)
        for at in range(near.offsets[c], near.offsets[c + 1]):
            j = near.measurements[at]
            if own >= 0 and j != own:
                continue
            weight = weigh_detection(seen, c, j, sight, gate, filled, options)
            if weight > -math.inf:
                components[filled], options.columns[filled], options.log_weights[filled] = c, j, weight
                filled += 1
    return _Pairs(components[:filled], options.columns[:filled], options.log_weights[:filled], options)


class _Chosen(NamedTuple):
    """The measurements that are candidates, and the pairs grouped by measurement."""

    measurements: Ints  # (num_candidates,)
    num_pairs: int  # of all candidates
    offsets: Ints  # (num_measurements + 1,) into the next array
    pairs: Ints  # (num_pairs,) of each measurement
    log_odds: Floats  # (num_measurements,) log rho / kappa


@kernel
def _chosen(pairs: _Pairs, unclaimed: Floats, least_logit: float, left_out: Floats) -> tuple[_Chosen, float]:
    """Return the candidates, and `log_left_out` of `Candidates`.

    unclaimed: see `log_unclaimed`. left_out: as in `Candidates`, zeros, written.
    """
    num_measurements = len(unclaimed)
    offsets, members = group_members(pairs.measurements, num_measurements)
    log_odds, kept = np.full(num_measurements, -math.inf), np.empty(num_measurements, np.int64)
    num_kept, num_pairs, log_left_out = 0, 0, 0.0
    for j in range(num_measurements):
        for i in range(offsets[j], offsets[j + 1]):
            log_odds[j] = log_add(log_odds[j], pairs.log_odds[members[i]])
        left = log_odds[j] + unclaimed[j]
        if left == -math.inf:
            continue
        least = least_logit + (_LOG_WORTH if unclaimed[j] < _LOG_CLAIMED else 0.0)
        if left >= least or unclaimed[j] >= _LOG_FREE:
            kept[num_kept] = j
            num_kept += 1
            num_pairs += offsets[j + 1] - offsets[j]
        else:
            log_left_out += log_add(0.0, left)
            existence = 1.0 / (1.0 + math.exp(-left))
            for i in range(offsets[j], offsets[j + 1]):
                pair = members[i]
                left_out[pairs.components[pair]] += existence * math.exp(pairs.log_odds[pair] - log_odds[j])
    return _Chosen(kept[:num_kept], num_pairs, offsets, members, log_odds), log_left_out


@kernel
def candidates_of(
    seen: Rows,
    num_local: int,
    scan: ScanInput,
    sensor: Sensor,
    log_clutter: Floats,
    unclaimed: Floats,
    gate: float,
    least_logit: float,
    label: tuple[int, int],
) -> Candidates:
    """Return the candidate labels of a scan, in the order of its measurements.

    Args:
        seen: the intensity and the components at each measurement, as in `seen_intensity`.
        num_local: number of components, the last ones, that are each at one measurement and used for that one only.
        scan: the scan of the measurements.
        sensor: the sensor of the scan.
        log_clutter: (num_measurements,) log clutter intensity at each measurement.
        unclaimed: (num_measurements,) log probability that no track takes each, see `log_unclaimed`. The candidate's
            odds are rho / kappa times it, exact if only one track may take the measurement.
        gate: squared Mahalanobis distance beyond which a component does not explain a measurement.
        least_logit: log of the least odds of a candidate.
        label: birth step and index of the candidate of the first measurement.
    """
    work = make_pair_work(seen.components.means.shape[1], len(sensor.periods))
    sight = Sight(sensor, scan.pose, scan.measurements, log_clutter, work)
    pairs = _gated_pairs(seen, num_local, sight, gate)
    left_out = np.zeros(len(seen.log_absent))
    chosen, log_left_out = _chosen(pairs, unclaimed, least_logit, left_out)
    num, meas_dim = len(chosen.measurements), len(sensor.periods)
    rows = make_rows(num, chosen.num_pairs, seen.components, meas_dim)
    updated = room_for_updated(seen, chosen.num_pairs)
    marks = room_for_updated_marks(scan.measurements, chosen.num_pairs)
    options = make_room(num, 2 * num, chosen.num_pairs, len(unclaimed), meas_dim, updated, marks)
    for row in range(num):
        j = chosen.measurements[row]
        rows.labels[row, 0], rows.labels[row, 1] = label[0], label[1] + j
        rows.log_absent[row] = 0.0
        _write_candidate(row, j, seen, pairs, chosen, rows, options)
    return Candidates(rows, options, log_left_out, left_out)


@borrowing
def _write_candidate(
    row: int, j: int, seen: Rows, pairs: _Pairs, chosen: _Chosen, rows: Rows, options: Options
) -> None:
    """Write the components and the two options of a candidate."""
    filled = rows.offsets[row]
    options.columns[2 * row], options.log_weights[2 * row], options.entries[2 * row] = ABSENT, 0.0, -1
    options.columns[2 * row + 1], options.log_weights[2 * row + 1] = j, chosen.log_odds[j]
    options.entries[2 * row + 1] = filled
    for i in range(chosen.offsets[j], chosen.offsets[j + 1]):
        pair = chosen.pairs[i]
        c, own = pairs.components[pair], pairs.log_odds[pair]
        if own - chosen.log_odds[j] < _LEAST_SHARE:
            continue
        copy_component(seen.components, c, rows.components, filled)
        copy_innovation(seen.innovation, c, rows.innovation, filled)
        copy_entry(pairs.options, pair, options, filled)
        options.component_log_weights[filled] = own
        filled += 1
    rows.offsets[row + 1] = filled
    options.offsets[row + 1] = 2 * row + 2
    sort_row(2 * row, 2 * row + 2, options.columns, options.log_weights, options.entries)
