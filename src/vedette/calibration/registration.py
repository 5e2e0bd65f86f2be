"""Initial guess for calibration: tracks, the measurements matched with them, and the biases that fit best.

Biases and straight pieces of the tracks are fitted jointly to the matched measurements by least squares with Huber
weights. Noise, detection and clutter then follow from the residuals and the unmatched measurements.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from vedette.densities import as_lmb, track_moments
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT, is_position
from vedette.kernels.base.types import CLIMB, HEIGHT, OWN_HEIGHT, STATE_COMPONENTS, VX, VY, Bools, Floats, Ints
from vedette.models.scan_rows import ScanLike, ScanRows
from vedette.recorded import RecordedScans, RecordedSensor
from vedette.recorded.scan_times import with_wrapped_angles
from vedette.tracking import Tracker

# Biases of a sensor, in this order, in SI units, bearings counter-clockwise. Range rates are left to the likelihood.
BIASES = ("range", "bearing", "clock", "x", "y", "elevation", "altitude")
MOST_FITTED = 3  # largest number of components of a measurement that are fitted
_SURE = 0.5  # existence probability above which a track is matched with measurements
_GATE = 4.0  # standard deviations
_HUBER = 1.5
_ROUNDS = 10
SCANS_A_PIECE = 5  # scans of the slowest sensor per piece
_LEAST_PAIRS = 4  # least number of pairs in a piece
_LEAST_SEEN = 3  # least number of measurements of a target for a sensor to share it with others
_MAD = 1.4826  # standard deviation of Gaussian numbers over their median absolute value
_STATE = STATE_COMPONENTS["constant_velocity_height"]  # components of the states here
_PLACE, _VELOCITY = [0, 1, _STATE.index(HEIGHT)], [VX, VY, _STATE.index(CLIMB)]
_BASELINE = 0.03  # distance between sensors, as a share of that of the targets, below which they are at one place
_POSITION, _SPEED = 1e4, 30.0  # m, m/s: prior that regularises poorly determined pieces


class MatchedMeasurements(NamedTuple):
    """Measurements matched with tracks.

    times: (n,) s. sensors, tracks: (n,) numbers. measured: (n, MOST_FITTED) the `fitted` components, then NaN, with NaN
    also where a row lacks one. poses: (n, 3) positions and heights of the sensors. states: (n, 6) predicted states of
    the tracks, [px, py, vx, vy, pz, vz], with zeros where no height is estimated. in_view: (num_sensors, num_tracks)
    numbers of scans that may detect a track. false, scans: (num_sensors,) numbers of measurements without a track, and
    of scans.
    """

    times: Floats
    sensors: Ints
    tracks: Ints
    measured: Floats
    poses: Floats
    states: Floats
    in_view: Ints
    false: Ints
    scans: Ints


def fitted(kind: str) -> tuple[str, ...]:
    """Return the components of a kind of measurement that are fitted, the first ones: all but range rates."""
    return tuple(name for name in COMPONENTS[kind] if name in BIASES)


def match_measurements(
    tracker: Tracker, recording: RecordedScans, sites: Sequence[RecordedSensor], stds: Floats
) -> MatchedMeasurements:
    """Match measurements with the tracks of a tracker.

    Args:
        tracker: tracker for the sensors, which draws no random numbers.
        recording: recording without the known biases.
        sites: the sensors.
        stds: (num_sensors, MOST_FITTED) standard deviations for gating measurements around tracks.
    """
    components = tracker.targets.motion.components
    rngs = (np.random.default_rng(0),) * len(sites)
    state, rows, numbers = tracker.initial(), list[tuple[float | int, ...]](), dict[tuple[int, ...], int]()
    counts, seen = np.zeros((2, len(sites)), np.int64), list[tuple[int, int]]()
    for time, scans, poses in zip(recording.times.tolist(), recording.scans, recording.poses, strict=True):
        lmb = as_lmb(state.fused)
        sure = lmb.existence > _SURE
        moments, means = track_moments(lmb.tracks)[0][sure], np.zeros((int(sure.sum()), len(_STATE)))
        for name in set(_STATE).intersection(components):
            means[:, _STATE.index(name)] = moments[:, components.index(name)]
        if state.time is not None:
            means = _moved(means, np.full(len(means), time - state.time))
        labels = [numbers.setdefault(tuple(label), len(numbers)) for label in lmb.tracks.labels[sure].tolist()]
        for s, scan in enumerate(scans):
            if scan is None:
                continue
            place = np.append(poses[s, :2], poses[s, OWN_HEIGHT] if poses.shape[1] > OWN_HEIGHT else 0.0)
            own = _fitted_part(scan, sites[s].kind)
            pairs = _assigned(own, means[:, _PLACE] - place, place, sites[s].kind, stds[s])
            counts[:, s] += len(scan) - len(pairs), 1
            chances = tracker.sensors[s].detection.prob(moments, poses[s]) if labels else np.empty(0)
            seen += ((s, label) for label, chance in zip(labels, chances.tolist(), strict=True) if chance > 0.0)
            for i, j in pairs:
                measured = (*own[i].tolist(), *(math.nan,) * MOST_FITTED)[:MOST_FITTED]
                rows.append((time, s, labels[j], *measured, *place.tolist(), *means[j].tolist()))
        state = tracker.step(state, list(scans), poses, time, rngs=rngs)[0]
    table = np.array(rows, np.float64).reshape(len(rows), 15)
    whole, in_view = table[:, 1:3].astype(np.int64), np.zeros((len(sites), len(numbers)), np.int64)
    np.add.at(in_view, tuple(np.array(seen, np.int64).reshape(-1, 2).T), 1)
    return MatchedMeasurements(
        table[:, 0], whole[:, 0], whole[:, 1], table[:, 3:6], table[:, 6:9], table[:, 9:], in_view, *counts
    )


def _fitted_part(scan: ScanLike, kind: str) -> Floats:
    """(num, num_fitted) components of measurements that are fitted, NaN where a row lacks one."""
    values = np.where(scan.missing, math.nan, scan.values) if isinstance(scan, ScanRows) else scan
    return values[:, : len(fitted(kind))]


def _moved(states: Floats, seconds: Floats) -> Floats:
    """(n, 6) states after (n,) s at constant velocity."""
    moved = states.copy()
    moved[:, _PLACE] += seconds[:, None] * states[:, _VELOCITY]
    return moved


def _assigned(measured: Floats, offsets: Floats, place: Floats, kind: str, stds: Floats) -> list[tuple[int, int]]:
    """Return pairs of measurement and track, each at most once and within the gate."""
    if not len(measured) or not len(offsets):
        return []
    predicted = _measured_of(offsets, place, kind)
    gaps = _residuals(measured[:, None] - predicted[None], kind) / stds[: predicted.shape[1]]
    costs = np.minimum((gaps**2).sum(axis=2), _GATE**2)
    found = linear_sum_assignment(costs)
    return [(i, j) for i, j in zip(*(each.tolist() for each in found), strict=True) if costs[i, j] < _GATE**2]


def _residuals(gaps: Floats, kind: str) -> Floats:
    """Return differences of the fitted components of measurements, with angles in [-pi, pi), and 0 where one lacks."""
    return np.nan_to_num(with_wrapped_angles(gaps, kind))


def _measured_of(offsets: Floats, places: Floats, kind: str) -> Floats:
    """(n, num_fitted) measurements of targets at offsets (n, 3) from sensors at places."""
    x, y, z = offsets.T
    up = z if kind in HEIGHT_DEPENDENT else 0.0
    values = {
        "bearing": np.arctan2(y, x),
        "range": np.sqrt(x * x + y * y + up * up),
        "elevation": np.arctan2(z, np.hypot(x, y)),
        "x": (offsets + places)[:, 0],
        "y": (offsets + places)[:, 1],
        "altitude": (offsets + places)[:, 2],
    }
    return np.stack([values[component] for component in fitted(kind)], axis=1)


def _slopes(offsets: Floats, kind: str) -> Floats:
    """(n, num_fitted, 3) derivatives of `_measured_of`."""
    x, y, z = offsets.T
    up = z if kind in HEIGHT_DEPENDENT else 0.0 * z
    square, one, none = np.maximum(x * x + y * y, 1.0), np.ones(len(x)), np.zeros(len(x))
    ground, distance = np.sqrt(square), np.sqrt(square + up * up)
    lift = ground * (square + z * z)
    values = {"bearing": (-y / square, x / square, none), "range": (x / distance, y / distance, up / distance)}
    values |= {"elevation": (-z * x / lift, -z * y / lift, square / lift)}
    values |= {"x": (one, none, none), "y": (none, one, none), "altitude": (none, none, one)}
    return np.stack([np.stack(values[component], axis=1) for component in fitted(kind)], axis=1)


def groups_with_common_targets(pairs: MatchedMeasurements, num_sensors: int) -> list[list[int]]:
    """Return the sensors in groups that share targets, directly or through others, in order of their first sensors."""
    counts = np.zeros((num_sensors, pairs.tracks.max(initial=-1) + 1), np.int64)
    np.add.at(counts, (pairs.sensors, pairs.tracks), 1)
    seen: Bools = counts >= _LEAST_SEEN
    groups, left = list[list[int]](), list(range(num_sensors))
    while left:
        reached: Bools = np.arange(num_sensors) == left[0]
        for _ in range(num_sensors):
            reached = np.logical_or(reached, seen[:, seen[reached].any(axis=0)].any(axis=1))
        groups.append(np.flatnonzero(reached).tolist())
        left = [s for s in left if not reached[s]]
    return groups


def is_one_place(pairs: MatchedMeasurements, sensors: Sequence[int]) -> bool:
    """Return True if these sensors measured from one place, or from places on one straight course at constant velocity.

    Only the assumed motion of the targets then tells a constant error of their ranges from none: seen from another
    frame of reference, a sensor on such a course is at rest.
    """
    own = np.isin(pairs.sensors, sensors)
    if not own.any():
        return True
    times, places = pairs.times[own], pairs.poses[own, :2]
    course = np.column_stack([np.ones(len(times)), times - times.mean()])
    away = places - course @ np.linalg.lstsq(course, places)[0]
    distances = np.hypot(*(pairs.states[own, :2] - places).T)
    return bool(2.0 * np.sqrt((away**2).sum(axis=1).mean()) < _BASELINE * np.median(distances))


class Registration(NamedTuple):
    """Fitted biases.

    biases, bias_stds: (num_sensors, num_biases), ordered as `BIASES`. stds: (num_sensors, MOST_FITTED) standard
    deviations of the residuals.
    """

    biases: Floats
    bias_stds: Floats
    stds: Floats


def register(
    pairs: MatchedMeasurements,
    sites: Sequence[RecordedSensor],
    asked: Bools,
    unknown: Floats,
    stds: Floats,
    period: float,
) -> Registration:
    """Return the biases that fit best, jointly with straight pieces of the tracks.

    Args:
        pairs: the matched measurements.
        sites: the sensors.
        asked: (num_sensors, num_biases) which biases to estimate, ordered as `BIASES`. The others are 0.
        unknown: (num_sensors, num_biases) prior scales of the biases. Undetermined ones stay near 0.
        stds: (num_sensors, MOST_FITTED) initial standard deviations of the measurements.
        period: of the slowest sensor, s.
    """
    biases = np.zeros(asked.shape)
    pieces, middles, states = _pieces(pairs, SCANS_A_PIECE * period)
    for _ in range(_ROUNDS):
        residuals, own, of_bias = _linearised(pairs, sites, biases, pieces, middles, states)
        spreads = _spreads(residuals, pairs.sensors, pieces, stds)[pairs.sensors]
        rows = _Rows(residuals, own, of_bias * asked[pairs.sensors][:, None], spreads, pairs.sensors, pieces)
        change, changes, bias_stds = _solved(rows, biases, unknown, len(middles))
        biases, states = biases + change, states + changes
    residuals, _, _ = _linearised(pairs, sites, biases, pieces, middles, states)
    return Registration(biases, bias_stds, _spreads(residuals, pairs.sensors, pieces, stds))


class _Rows(NamedTuple):
    """Linearised equations.

    residuals: (n, MOST_FITTED). own, of_bias: derivatives of the predictions by the states of the pieces and by the
    biases. stds: (n, MOST_FITTED) standard deviations. sensors, pieces: (n,) numbers.
    """

    residuals: Floats
    own: Floats
    of_bias: Floats
    stds: Floats
    sensors: Ints
    pieces: Ints


def _pieces(pairs: MatchedMeasurements, length: float) -> tuple[Ints, Floats, Floats]:
    """Return (n,) the track piece of each pair, -1 for none; the times of the piece middles, s; and the states
    there.
    """
    keys = np.stack([pairs.tracks, np.floor(pairs.times / length).astype(np.int64)], axis=1)
    _, pieces, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    numbers = np.where(counts >= _LEAST_PAIRS, np.cumsum(counts >= _LEAST_PAIRS) - 1, -1)
    pieces = numbers[pieces.ravel()]
    middles, states = np.zeros(numbers.max(initial=-1) + 1), np.zeros((numbers.max(initial=-1) + 1, 6))
    for w in range(len(middles)):
        own = pieces == w
        middles[w] = pairs.times[own].mean()
        states[w] = _moved(pairs.states[own], middles[w] - pairs.times[own]).mean(axis=0)
    return pieces, middles, states


def _linearised(
    pairs: MatchedMeasurements,
    sites: Sequence[RecordedSensor],
    biases: Floats,
    pieces: Ints,
    middles: Floats,
    states: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Return (n, MOST_FITTED) residuals, and their predictions' derivatives by piece states and biases.

    Components that are not fitted, or lack in a row, have zeros.
    """
    shape = len(pairs.times), MOST_FITTED
    residuals, own, of_bias = np.zeros(shape), np.zeros((*shape, 6)), np.zeros((*shape, len(BIASES)))
    for s, site in enumerate(sites):
        rows = np.flatnonzero((pairs.sensors == s) & (pieces >= 0))
        if not len(rows):
            continue
        names, bias = fitted(site.kind), dict(zip(BIASES, biases[s].tolist(), strict=True))
        piece = states[pieces[rows]]
        after = pairs.times[rows] - bias["clock"] - middles[pieces[rows]]
        places = pairs.poses[rows] - (np.zeros(3) if is_position(site.kind) else [bias["x"], bias["y"], 0.0])
        offsets = _moved(piece, after)[:, _PLACE] - places
        slopes, dim = _slopes(offsets, site.kind), len(names)
        predicted = _measured_of(offsets, places, site.kind) + [bias[name] for name in names]
        measured = pairs.measured[rows, :dim]
        residuals[rows, :dim] = _residuals(measured - predicted, site.kind)
        of_state, by_bias = np.zeros((len(rows), dim, 6)), np.zeros((len(rows), dim, len(BIASES)))
        of_state[..., _PLACE], of_state[..., _VELOCITY] = slopes, after[:, None, None] * slopes
        by_bias[..., BIASES.index("clock")] = -(slopes @ piece[:, _VELOCITY, None])[..., 0]
        if not is_position(site.kind):
            by_bias[..., BIASES.index("x") : BIASES.index("y") + 1] = slopes[..., :2]
        for i, name in enumerate(names):
            by_bias[:, i, BIASES.index(name)] = 1.0
        there = ~np.isnan(measured)[..., None]
        own[rows, :dim], of_bias[rows, :dim] = of_state * there, by_bias * there
    return residuals, own, of_bias


def _spreads(residuals: Floats, sensors: Ints, pieces: Ints, stds: Floats) -> Floats:
    """(num_sensors, MOST_FITTED) robust residual standard deviations, at most `stds`, or `stds` if there are few."""
    found = stds.copy()
    for s in range(len(stds)):
        own = residuals[(sensors == s) & (pieces >= 0)]
        if len(own) >= _LEAST_PAIRS:
            found[s] = np.clip(_MAD * np.median(np.abs(own), axis=0), 0.01 * stds[s], stds[s])
    return found


def _solved(rows: _Rows, biases: Floats, unknown: Floats, num_pieces: int) -> tuple[Floats, Floats, Floats]:
    """Return changes of the biases and of the piece states, and conditional standard deviations of the biases.

    The states are eliminated first, piece by piece.
    """
    num, size = biases.shape
    hold = unknown.ravel() ** -2.0
    left, right = np.diag(hold), -hold * biases.ravel()
    prior, parts = np.diag([_POSITION**-2.0] * 2 + [_SPEED**-2.0] * 2 + [_POSITION**-2.0, _SPEED**-2.0]), []
    sizes = np.abs(rows.residuals) / rows.stds
    weights = np.minimum(1.0, _HUBER / np.maximum(sizes, _HUBER)) / rows.stds**2
    for w in range(num_pieces):
        of = np.flatnonzero(rows.pieces == w)
        all_biases = np.zeros((len(of), MOST_FITTED, num, size))
        all_biases[np.arange(len(of)), :, rows.sensors[of]] = rows.of_bias[of]
        biased, own = all_biases.reshape(-1, num * size), rows.own[of].reshape(-1, 6)
        weight, residual = weights[of].reshape(-1, 1), rows.residuals[of].reshape(-1)
        inner, cross = own.T @ (weight * own) + prior, own.T @ (weight * biased)
        slope = (weight * own).T @ residual
        gain = np.linalg.solve(inner, np.column_stack([cross, slope]))
        left += biased.T @ (weight * biased) - cross.T @ gain[:, :-1]
        right += (weight * biased).T @ residual - cross.T @ gain[:, -1]
        parts.append(gain)
    change = np.asarray(np.linalg.solve(left, right), np.float64)
    changes = np.array([gain[:, -1] - gain[:, :-1] @ change for gain in parts], np.float64)
    conditional = np.diag(left) ** -0.5
    return change.reshape(num, size), changes.reshape(num_pieces, 6), conditional.reshape(num, size)
