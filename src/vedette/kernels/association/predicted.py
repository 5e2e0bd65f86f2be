"""The rows of a scan: tracks predicted to its time, with the expected measurement of each.

Survivors precede birth sites. The weights of a row include death of the track, or absence of a birth, so that one pass
over the rows predicts and updates jointly (Vo, Vo, Hoang 2017, section III-C).
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints, Lmb, Mixture, Motion, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.components import borrowed_components, components_like, copy_component, copy_components
from vedette.kernels.gaussian.innovation import Innovation, expect, make_innovation
from vedette.kernels.gaussian.linalg import log_add, log_or_minus_inf
from vedette.kernels.gaussian.marks import detection_factor
from vedette.kernels.gaussian.modes import LOG_LEAST, branched_tracks
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.row_noise import bring_noise
from vedette.kernels.gaussian.scratch import Scratch, make_scratch


class Rows(NamedTuple):
    """Predicted tracks, ready to be updated."""

    labels: Ints  # (num_rows, 2)
    offsets: Ints  # (num_rows + 1,) into the components
    log_absent: Floats  # (num_rows,) log probability of absence
    components: Mixture  # predicted; log weights of the mixture times the probability of presence
    innovation: Innovation


@kernel
def make_rows(num_rows: int, num_components: int, like: Mixture, meas_dim: int) -> Rows:
    """Return room for rows. like: components with the same columns."""
    return Rows(
        np.empty((num_rows, 2), np.int64),
        np.zeros(num_rows + 1, np.int64),
        np.empty(num_rows),
        components_like(like, num_components),
        make_innovation(num_components, like.means.shape[1], meas_dim),
    )


@inlined
def view_rows(rows: Rows, num: int) -> Rows:
    """Return arrays for `num` rows of one component each. Their innovations are not cut."""
    components = borrowed_components(rows.components, num)
    return Rows(rows.labels[:num], rows.offsets[: num + 1], rows.log_absent[:num], components, rows.innovation)


@borrowing
def fill_survivors(tracks: Tracks, motion: Motion, dt: float, rows: Rows, scratch: Scratch) -> None:
    """Predict every track into the first rows."""
    components, out = tracks.components, rows.components
    rows.offsets[0] = 0
    for i in range(len(tracks.labels)):
        absent = 0.0
        for c in range(tracks.offsets[i], tracks.offsets[i + 1]):
            mean = components.means[c]
            survival = motion.prob_survival(mean, dt, motion.survival_params)
            if not 0.0 <= survival <= 1.0:
                raise ModelError("survival model: probability is not in [0, 1]")
            # 1 - <p, P_S>: probability of death. The surviving part keeps its weight in the mixture.
            absent += math.exp(components.log_weights[c]) * (1.0 - survival)
            copy_component(components, c, out, c)
            out.log_weights[c] += log_or_minus_inf(survival)
            predict(motion, 0, dt, mean, components.covs[c], out.means[c], out.covs[c], scratch)
        rows.log_absent[i] = log_or_minus_inf(absent)
        rows.labels[i, 0], rows.labels[i, 1] = tracks.labels[i, 0], tracks.labels[i, 1]
        rows.offsets[i + 1] = tracks.offsets[i + 1]


@borrowing
def fill_births(birth: Lmb, first_row: int, rows: Rows) -> None:
    """Append the birth sites after `first_row` survivors."""
    sites = birth.tracks
    shift = rows.offsets[first_row]
    for i in range(len(sites.labels)):
        row = first_row + i
        rows.labels[row, 0], rows.labels[row, 1] = sites.labels[i, 0], sites.labels[i, 1]
        # log (1 - r) and log r from the logit, exact near 0 and 1.
        rows.log_absent[row] = -log_add(0.0, birth.existence_logit[i])
        log_existence = -log_add(0.0, -birth.existence_logit[i])
        rows.offsets[row + 1] = shift + sites.offsets[i + 1]
        for c in range(sites.offsets[i], sites.offsets[i + 1]):
            copy_component(sites.components, c, rows.components, shift + c)
            rows.components.log_weights[shift + c] += log_existence


@borrowing
def expect_rows(sensor: Sensor, scan: ScanInput, rows: Rows, scratch: Scratch) -> None:
    """Write the expected measurement of every component of the rows for a scan. Its values are not used.

    If its rows bring noise of their own, each has an update of its own, as for a component over which the sensor bends.
    """
    components, seen, by_pair = rows.components, rows.innovation, bring_noise(scan.measurements)
    for c in range(len(components.log_weights)):
        expect(sensor, scan.pose, components.means[c], components.covs[c], c, seen, scratch)
        seen.bends[c] = seen.bends[c] or by_pair
        factor = detection_factor(sensor, components.marks, c)
        if factor < 1.0:
            seen.prob_detection[c] *= factor
            seen.at_edge[c] = seen.at_edge[c] and factor > 0.0


@inlined
def predict_rows(tracks: Tracks, scan: ScanInput, motion: Motion, sensor: Sensor, rows: Rows, scratch: Scratch) -> None:
    """Write the rows of a scan, up to the size of `rows`, without using the measurements."""
    fill_survivors(tracks, motion, scan.dt, rows, scratch)
    fill_births(scan.birth, len(tracks.labels), rows)
    expect_rows(sensor, scan, rows, scratch)


@inlined
def leave_unseen(rows: Rows) -> None:
    """Set detection of the rows to zero: without measurements, an update is then a prediction."""
    rows.innovation.prob_detection[:] = 0.0
    rows.innovation.at_edge[:] = False


@kernel
def rows_of_scan(tracks: Tracks, scan: ScanInput, motion: Motion, sensor: Sensor) -> Rows:
    """Return the result of `predict_rows` in new arrays, for a `dt` of 0 of tracks that are at the time of the scan."""
    sites, state_dim, meas_dim = scan.birth.tracks, tracks.components.means.shape[1], len(sensor.periods)
    if scan.dt == 0.0:
        return standing_rows_of_scan(tracks, scan, sensor)
    if len(motion.transition_params) > 1:
        branched = branched_rows(tracks, scan, motion, meas_dim)
        expect_rows(sensor, scan, branched, make_scratch(state_dim, meas_dim))
        return branched
    # Every component has its innovation here once, for any number of hypotheses with its track.
    num_rows = len(tracks.labels) + len(sites.labels)
    num_components = len(tracks.components.log_weights) + len(sites.components.log_weights)
    rows = make_rows(num_rows, num_components, tracks.components, meas_dim)
    predict_rows(tracks, scan, motion, sensor, rows, make_scratch(state_dim, meas_dim))
    return rows


@kernel
def standing_rows(tracks: Tracks, meas_dim: int) -> Rows:
    """Return the tracks unchanged as rows: no births, deaths or motion, each surely present, without `expect_rows`."""
    num = len(tracks.components.log_weights)
    rows = make_rows(len(tracks.labels), num, tracks.components, meas_dim)
    _copy_tracks(tracks, rows)
    rows.log_absent[:] = -math.inf
    return rows


@kernel
def standing_rows_of_scan(tracks: Tracks, scan: ScanInput, sensor: Sensor) -> Rows:
    """Return the tracks unchanged as rows, with the expected measurement of each."""
    rows = standing_rows(tracks, len(sensor.periods))
    expect_rows(sensor, scan, rows, make_scratch(tracks.components.means.shape[1], len(sensor.periods)))
    return rows


@kernel
def branched_rows(tracks: Tracks, scan: ScanInput, motion: Motion, meas_dim: int) -> Rows:
    """Return the rows of a scan, without `expect_rows`, of targets that change their mode of motion."""
    moved, log_dead = branched_tracks(tracks, motion, scan.dt, LOG_LEAST)
    sites, num = scan.birth.tracks, len(tracks.labels)
    num_components = len(moved.components.log_weights) + len(sites.components.log_weights)
    rows = make_rows(num + len(sites.labels), num_components, moved.components, meas_dim)
    _copy_tracks(moved, rows)
    rows.log_absent[:num] = log_dead
    fill_births(scan.birth, num, rows)
    return rows


@borrowing
def _copy_tracks(tracks: Tracks, rows: Rows) -> None:
    """Write the labels and components of tracks to the first rows."""
    for i in range(len(tracks.labels)):
        rows.labels[i, 0], rows.labels[i, 1] = tracks.labels[i, 0], tracks.labels[i, 1]
        rows.offsets[i + 1] = tracks.offsets[i + 1]
    copy_components(tracks.components, 0, len(tracks.components.log_weights), rows.components, 0)
