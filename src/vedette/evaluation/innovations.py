"""Innovations: measurements against the tracks as predicted from the scan before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from vedette.densities import Estimate
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.modes import mode_transitions
from vedette.models.measurement import wrap_periodic
from vedette.models.modes import Modes
from vedette.models.motion import MotionModel
from vedette.models.scan_rows import ScanLike, noise_of_rows, values_of
from vedette.models.sensor import SensorModel
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_motion, build_sensor_models

GATE = 4.0  # standard deviations of the innovation
_STEP = 1e-4  # of central differences, as a share of the standard deviation of a state component
_SINGLE = 1.5  # gates between two tracks that are not confused
_MIN_DETECTION = 0.3  # lowest probability of detection at which a scan should contain the target


class Assumed(NamedTuple):
    """A scenario with the models of its sensors and of the targets' motion, which tests compare with the scans."""

    scenario: Scenario
    sensors: tuple[SensorModel, ...]
    motion: MotionModel

    @classmethod
    def of(cls, scenario: Scenario) -> Assumed:
        """Build the models. Raises `InputError` for custom models that cannot be loaded."""
        return cls(scenario, build_sensor_models(scenario), build_motion(scenario)[0])


class Instant(NamedTuple):
    """A time of a run at which sensors scanned."""

    time: float  # s
    poses: Floats  # (num_sensors, 3 or more)
    rows: Sequence[ScanLike | None]  # measurements of each sensor, with the noise that rows bring. None without a scan
    estimate: Estimate  # of the targets after these scans


class Matches(NamedTuple):
    """Tracks at scans of a sensor that should contain them, with no other track near, in order of time."""

    labels: Ints  # (num, 2)
    offsets: Floats  # (num, 2) predicted position relative to the sensor, m
    probabilities: Floats  # (num,) of a detection
    numbers: Ints  # (num,) measurements within the gate
    by_chance: Floats  # (num,) expected number of them that are clutter
    innovations: Floats  # (num, meas_dim) of the only measurement inside, NaN if there is not exactly one
    variances: Floats  # of them
    whitened: Floats  # innovations in units of their standard deviations, without correlations (by Cholesky factors)
    noise: Floats  # (num, meas_dim) variances of the noise alone

    @classmethod
    def none(cls, dim: int) -> Matches:
        """Return no matches of a sensor of `dim` components."""
        flat, wide = np.empty(0), np.empty((0, dim))
        return cls(np.empty((0, 2), np.int64), np.empty((0, 2)), flat, flat.astype(np.int64), flat, *[wide] * 4)

    def by_label(self) -> list[Ints]:
        """Return the indices of the matches of each track, in order of time."""
        _, track = np.unique(self.labels, axis=0, return_inverse=True)
        order = np.argsort(track, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(track[order])) + 1) if len(order) else []


class SensorFit(NamedTuple):
    """Measurements of a sensor, compared with what its model expects."""

    counts: Ints  # (num_scans,) measurements in the gate of no track, in the scans that were looked at
    pose: Floats  # at the last of these
    further: Floats  # (num_scans, 2) measurements in gates above one for each group of near tracks, and these groups
    matches: Matches  # tracks at these scans
    # (num, 2) positions relative to the sensor, m, of measurements in the gate of no track, with NaN for sensors that
    # measure no positions
    unexplained: Floats

    @property
    def noise_stds(self) -> Floats:
        """Root mean square noise of each component over the matches, (meas_dim,)."""
        return np.asarray(np.sqrt(self.matches.noise.sum(axis=0) / max(len(self.matches.noise), 1)))


class Compared(NamedTuple):
    """An instant, compared with the tracks as predicted from the instant before."""

    time: float  # s
    own: Floats  # (num_sensors, 2) positions of the sensors, m
    labels: Ints  # (n, 2) of the tracks
    means: Floats  # (n, 2) their positions, m
    # (n, num_sensors) 1 if a measurement lies in the gate, 0 if none does although one should, -1 for no scan, or a
    # track out of view
    detected: Ints
    fits: tuple[SensorFit | None, ...]  # of the sensors. None without a scan


def joined(fits: Iterable[SensorFit]) -> SensorFit:
    """Return the fit of all scans of one or more fits of a sensor."""
    counts, poses, further, matches, unexplained = zip(*fits, strict=True)
    columns = Matches(*(np.concatenate(each) for each in zip(*matches, strict=True)))
    return SensorFit(np.concatenate(counts), poses[-1], np.concatenate(further), columns, np.concatenate(unexplained))


def compared(before: Instant, now: Instant, assumed: Assumed) -> Compared:
    """Return an instant compared with the one before it.

    A track is predicted from its estimate at the instant before, with the motion model. Its measurement and Jacobian
    are linearised there (Kalman innovations). Scans of one time are compared with one prediction.
    """
    labels, means, covs, seen = _predicted(before, now, assumed.motion)
    detected, fits = np.full((len(labels), len(now.rows)), -1), list[SensorFit | None]()
    for s, (sensor, rows, pose) in enumerate(zip(assumed.sensors, now.rows, now.poses, strict=True)):
        if rows is None:
            fits.append(None)
            continue
        fit, probabilities, is_measured = _of_scan(sensor, rows, pose, labels, means, covs, seen)
        fits.append(fit)
        detected[:, s] = np.where(probabilities >= _MIN_DETECTION, is_measured, -1)
    return Compared(now.time, now.poses[:, :2], labels, means[:, :2], detected, tuple(fits))


def _predicted(before: Instant, now: Instant, motion: MotionModel) -> tuple[Ints, Floats, Floats, Floats]:
    """Return labels, means and covariances of the tracks of both estimates, predicted to the time of the second.

    Also return the factors of their modes on the probability of detection.
    """
    estimate, dt = before.estimate, now.time - before.time
    present = set(map(tuple, now.estimate.labels.tolist()))
    kept = [i for i, label in enumerate(estimate.labels.tolist()) if tuple(label) in present]
    labels, means, covs = estimate.labels[kept], estimate.means[kept], estimate.covs[kept]
    if not kept or dt <= 0.0:
        return labels, means, covs, np.ones(len(kept))
    if not isinstance(motion, Modes):
        return labels, *_moved(motion, means, covs, dt), np.ones(len(kept))
    probs = estimate.mode_probs[kept]
    known = np.pad(probs, ((0, 0), (0, len(motion.names) - probs.shape[1])))
    known = known + (1.0 - known.sum(axis=1, keepdims=True)) * motion.at_birth  # new targets have no mode yet
    shares = known @ mode_transitions(motion.rates, dt)
    ends, spreads = map(np.array, zip(*(_moved(own, means, covs, dt) for own in motion.in_common), strict=True))
    moved = np.einsum("im,mid->id", shares, ends)
    apart = ends - moved
    spreads = spreads + apart[..., :, np.newaxis] * apart[..., np.newaxis, :]
    return labels, moved, np.einsum("im,mide->ide", shares, spreads), shares @ motion.detection_factors


def _moved(motion: MotionModel, means: Floats, covs: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return means and covariances `dt` seconds later."""
    moved, jacobians = _linearised(lambda states: motion.propagate(states, dt), means, covs, None)
    return moved, jacobians @ covs @ jacobians.transpose(0, 2, 1) + motion.noise_covs(means, dt)


def _linearised(
    function: Callable[[Floats], Floats], means: Floats, covs: Floats, periods: Floats | None
) -> tuple[Floats, Floats]:
    """Return a function of (n, dim) states there, (n, out_dim), and its Jacobians by central differences."""
    steps = _STEP * np.sqrt(np.diagonal(covs, axis1=1, axis2=2))
    num, dim = means.shape
    shifts = steps[:, np.newaxis] * np.eye(dim)
    states = np.concatenate([means[:, np.newaxis], means[:, np.newaxis] + shifts, means[:, np.newaxis] - shifts], 1)
    values = function(states.reshape(-1, dim)).reshape(num, 1 + 2 * dim, -1)
    change = values[:, 1 : 1 + dim] - values[:, 1 + dim :]
    if periods is not None:
        change = wrap_periodic(change.reshape(num * dim, -1), periods).reshape(change.shape)
    return values[:, 0], (change / (2.0 * steps[..., np.newaxis])).transpose(0, 2, 1)


def _of_scan(
    sensor: SensorModel, raw: ScanLike, pose: Floats, labels: Ints, means: Floats, covs: Floats, seen: Floats
) -> tuple[SensorFit, Floats, Bools]:
    """Return the fit of a scan, the probabilities of detection of the tracks, and whether they have measurements.

    raw: measurements, with the noise of each if they bring any. seen: factors on the probability of detection.
    """
    measured, periods = values_of(raw), sensor.measurement.periods
    matches, explained = Matches.none(sensor.meas_dim), np.asarray(np.zeros(len(measured), np.bool_))
    probabilities, numbers, further = np.empty(0), np.empty(0, np.int64), np.zeros((1, 2))
    if len(labels):
        expected, jacobians = _linearised(lambda states: sensor.measurement.measure(states, pose), means, covs, periods)
        noise = sensor.noise.covs(means, pose, sensor.meas_dim)
        moved = jacobians @ covs @ jacobians.transpose(0, 2, 1)
        of_rows = np.array([noise_of_rows(raw, np.repeat(each[None], len(raw), axis=0)) for each in noise])
        spread, spreads = moved + noise, moved[:, None] + of_rows.reshape(len(noise), len(raw), *noise.shape[1:])
        inside = _inside(measured, expected, spreads, periods)
        explained, numbers = np.asarray(inside.any(axis=0)), inside.sum(axis=1)
        residuals, variances = np.full(expected.shape, np.nan), np.diagonal(spread, axis1=1, axis2=2).copy()
        single = np.flatnonzero(numbers == 1)
        own = inside[single].argmax(axis=1) if len(single) else single
        residuals[single] = wrap_periodic(measured[own] - expected[single], periods)
        variances[single] = np.diagonal(spreads[single, own], axis1=1, axis2=2)
        whitened = residuals.copy()
        roots = np.linalg.cholesky(spreads[single, own])
        whitened[single] = np.linalg.solve(roots, residuals[single, :, np.newaxis])[..., 0]
        probabilities, chance = (
            seen * sensor.mean_detection(means, covs, pose),
            _by_chance(sensor, expected, spread, pose),
        )
        innovations = residuals, variances, whitened, np.diagonal(noise, axis1=1, axis2=2)
        columns = labels, means[:, :2] - pose[:2], probabilities, numbers, chance, *innovations
        num, group = connected_components(_near(expected, spread, periods))
        matches = Matches(*(np.asarray(each)[np.bincount(group)[group] == 1] for each in columns))
        likely = np.zeros(num)
        np.maximum.at(likely, group, probabilities)
        further = np.array([[explained.sum() - likely.sum() - chance.sum(), num]])
    beside = np.full((int((~explained).sum()), 2), np.nan)
    if sensor.measurement.places is not None:
        beside = sensor.measurement.positions(measured[~explained], pose) - pose[:2]
    return SensorFit(np.array([len(beside)]), pose, further, matches, beside), probabilities, numbers > 0


def _inside(measured: Floats, expected: Floats, spread: Floats, periods: Floats, gate: float = GATE) -> Bools:
    """Return True for each track and measurement within the gate, (num_tracks, num_measurements). spread: of a pair."""
    if not len(measured):
        return np.zeros((len(expected), 0), np.bool_)
    residuals = measured[None] - expected[:, None]
    residuals = wrap_periodic(residuals.reshape(-1, measured.shape[1]), periods).reshape(residuals.shape)
    distances = np.einsum("nmi,nmij,nmj->nm", residuals, np.linalg.inv(spread), residuals)
    return np.asarray(distances <= gate**2)


def _near(expected: Floats, spread: Floats, periods: Floats) -> Bools:
    """Return True for each pair of tracks that could take the same measurement, (n, n)."""
    near = _inside(expected, expected, np.repeat(spread[:, None], len(expected), axis=1), periods, _SINGLE * GATE)
    return np.asarray(near | near.T)


def _by_chance(sensor: SensorModel, expected: Floats, spread: Floats, pose: Floats) -> Floats:
    """Return the expected number of clutter measurements in the gate of each track."""
    dim = sensor.meas_dim
    ball = math.pi ** (dim / 2.0) / math.gamma(dim / 2.0 + 1.0) * GATE**dim
    volumes = ball * np.sqrt(np.linalg.det(spread))
    return np.asarray(volumes * np.exp(sensor.clutter.log_intensity_at(expected, pose)))
