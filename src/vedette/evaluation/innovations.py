"""Innovations of a run: measurements against the tracks as predicted from the scan before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.densities import Estimate
from vedette.evaluation.scans import Rows
from vedette.kernels.base.types import Bools, Floats
from vedette.models.measurement import wrap_periodic
from vedette.models.motion import MotionModel
from vedette.models.row_noise import measured_part, noise_of_rows
from vedette.models.sensor import SensorModel
from vedette.simulation.records import RunRecord

GATE = 4.0  # standard deviations of the innovation
_MOST_SCANS = 5000  # of a sensor; of a longer run as many are looked at, evenly spread
_STEP = 1e-4  # of central differences, as a share of the standard deviation of a state component
_SINGLE = 1.5  # gates between two tracks that are not confused

Label: TypeAlias = tuple[int, ...]


class Match(NamedTuple):
    """A track at a scan of a sensor that should contain it, with no other track near.

    label: of the track. probability: of a detection. num_inside: measurements within the gate. by_chance: expected
    number of them that are clutter. innovation: (meas_dim,) of the only measurement inside, and None if there is not
    exactly one; cov: (meas_dim, meas_dim) of it.
    """

    label: Label
    probability: float
    num_inside: int
    by_chance: float
    innovation: Floats | None
    cov: Floats


@dataclass(slots=True)
class SensorFit:
    """Measurements of a sensor, compared with what its model expects.

    Attributes:
        matches: tracks at the sensor's scans, in order of time.
        variances: sums of the variances of the noise over the matches, (meas_dim,).
        num_scans: scans that were looked at.
        unexplained: measurements in the gate of no track, over these scans.
    """

    matches: list[Match] = field(default_factory=list)
    variances: Floats = field(default_factory=lambda: np.zeros(0))
    num_scans: int = 0
    unexplained: int = 0

    @property
    def noise_stds(self) -> Floats:
        """Root mean square noise of each component over the matches, (meas_dim,)."""
        return np.asarray(np.sqrt(self.variances / max(len(self.matches), 1)))


class _Predicted(NamedTuple):
    labels: list[Label]
    means: Floats
    covs: Floats


def sensor_fits(
    record: RunRecord,
    scans: Rows,
    sensors: tuple[SensorModel, ...],
    motion: MotionModel,
) -> tuple[SensorFit, ...]:
    """Return for each sensor its measurements against the tracks of a run.

    A track is predicted from its estimate at the scan before, with the motion model; its measurement and Jacobian are
    linearised there (Kalman innovations). Scans of one time are compared with one prediction.

    Args:
        record: the run.
        scans: its scans, as `vedette.evaluation.scans.rows_of_record` returns them.
        sensors: the models of the sensors that the filters assume.
        motion: of the targets.
    """
    fits = tuple(SensorFit(variances=np.zeros(each.meas_dim)) for each in sensors)
    for k in np.unique(np.linspace(1, record.num_scans - 1, min(_MOST_SCANS, record.num_scans - 1)).astype(int)):
        before, dt = record.estimates[k - 1], float(record.times[k] - record.times[k - 1])
        predicted = _predicted(before, record.estimates[k], motion, dt)
        for s, (fit, sensor, scan) in enumerate(zip(fits, sensors, scans[k], strict=True)):
            if scan is not None:
                _add_scan(fit, sensor, scan, record.poses[k, s], predicted)
    return fits


def _predicted(before: Estimate, after: Estimate, motion: MotionModel, dt: float) -> _Predicted:
    """Return the tracks of two successive estimates, predicted from the first to the time of the second."""
    present = set(map(tuple, after.labels.tolist()))
    labels = list(map(tuple, before.labels.tolist()))
    kept = [i for i, label in enumerate(labels) if label in present]
    means, covs, labels = before.means[kept], before.covs[kept], [labels[i] for i in kept]
    if not kept or dt <= 0.0:
        return _Predicted(labels, means, covs)
    jacobians = _jacobians(lambda states: motion.propagate(states, dt), means, covs, None)
    moved = jacobians @ covs @ jacobians.transpose(0, 2, 1) + motion.noise_covs(means, dt)
    return _Predicted(labels, motion.propagate(means, dt), moved)


def _jacobians(function: Callable[[Floats], Floats], means: Floats, covs: Floats, periods: Floats | None) -> Floats:
    """Return the Jacobians of a function of (n, dim) states by central differences, (n, out_dim, dim)."""
    steps = _STEP * np.sqrt(np.diagonal(covs, axis1=1, axis2=2))
    columns = []
    for i in range(means.shape[1]):
        shift = np.zeros_like(means)
        shift[:, i] = steps[:, i]
        change = function(means + shift) - function(means - shift)
        change = change if periods is None else wrap_periodic(change, periods)
        columns.append(change / (2.0 * steps[:, i, None]))
    return np.stack(columns, axis=2)


def _add_scan(fit: SensorFit, sensor: SensorModel, raw: Floats, pose: Floats, predicted: _Predicted) -> None:
    """Add a scan of a sensor, with the noise of its rows if they bring any, to the fit."""
    fit.num_scans += 1
    measured = measured_part(raw, sensor.meas_dim)
    labels, means, covs = predicted
    if not labels:
        fit.unexplained += len(measured)
        return
    periods = sensor.measurement.periods
    expected, noise = sensor.measurement.measure(means, pose), sensor.noise.covs(means, pose, sensor.meas_dim)
    jacobians = _jacobians(lambda states: sensor.measurement.measure(states, pose), means, covs, periods)
    moved = jacobians @ covs @ jacobians.transpose(0, 2, 1)
    spread = moved + noise
    of_rows = np.array([noise_of_rows(raw, np.repeat(each[None], len(raw), axis=0)) for each in noise])
    spreads = moved[:, None] + of_rows.reshape(len(noise), len(raw), *noise.shape[1:])
    inside = _inside(measured, expected, spreads, periods)
    fit.unexplained += int((~inside.any(axis=0)).sum())
    chance = _by_chance(sensor, expected, spread, pose)
    probabilities = sensor.mean_detection(means, covs, pose)
    alone = _alone(expected, spread, periods)
    for i in np.flatnonzero(alone).tolist():
        own = np.flatnonzero(inside[i])
        residual = wrap_periodic(measured[own] - expected[i], periods)[0] if len(own) == 1 else None
        cov = spreads[i, own[0]] if len(own) == 1 else spread[i]
        fit.matches.append(Match(labels[i], float(probabilities[i]), len(own), float(chance[i]), residual, cov))
        fit.variances += np.diagonal(noise[i])


def _inside(measured: Floats, expected: Floats, spread: Floats, periods: Floats, gate: float = GATE) -> Bools:
    """Return True for each track and measurement within the gate, (num_tracks, num_measurements); spread: of a pair."""
    if not len(measured):
        return np.zeros((len(expected), 0), np.bool_)
    residuals = measured[None] - expected[:, None]
    residuals = wrap_periodic(residuals.reshape(-1, measured.shape[1]), periods).reshape(residuals.shape)
    distances = np.einsum("nmi,nmij,nmj->nm", residuals, np.linalg.inv(spread), residuals)
    return np.asarray(distances <= gate**2)


def _alone(expected: Floats, spread: Floats, periods: Floats) -> Bools:
    """Return True for each track without another one that could take its measurement."""
    near = _inside(expected, expected, np.repeat(spread[:, None], len(expected), axis=1), periods, _SINGLE * GATE)
    return np.asarray((near | near.T).sum(axis=1) == 1)


def _by_chance(sensor: SensorModel, expected: Floats, spread: Floats, pose: Floats) -> Floats:
    """Return the expected number of clutter measurements in the gate of each track."""
    dim = sensor.meas_dim
    ball = math.pi ** (dim / 2.0) / math.gamma(dim / 2.0 + 1.0) * GATE**dim
    volumes = ball * np.sqrt(np.linalg.det(spread))
    return np.asarray(volumes * np.exp(sensor.clutter.log_intensity_at(expected, pose)))


def by_label(matches: list[Match]) -> Iterator[list[Match]]:
    """Yield the matches of each track, in order of time."""
    groups: dict[Label, list[Match]] = {}
    for match in matches:
        groups.setdefault(match.label, []).append(match)
    yield from groups.values()
