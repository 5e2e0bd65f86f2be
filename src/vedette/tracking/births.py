"""Births from measurements: birth candidates from the measurements of all sensors that no track explains."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB, LabelledDensity, as_lmb
from vedette.densities.containers import unchecked
from vedette.densities.labelled import LABELLED
from vedette.densities.tracks import take_tracks
from vedette.errors import InputError
from vedette.filters import Limits
from vedette.filters.inputs import births_at, births_within, model_errors, no_births_for_kernel
from vedette.fusion.matching import OWN_LABELS
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.types import Floats, Ints, Lmb, ScanInput
from vedette.kernels.labelled.births import BirthsOfMeasurements, births_of_measurements
from vedette.kernels.steps.association_probability import prob_explained
from vedette.models import BirthModel, MeasurementBirth, MotionModel, SensorModel
from vedette.models.arguments import pose_vector, reject
from vedette.models.modes import sensor_of_filter
from vedette.models.scan_rows import as_scan, to_measurements
from vedette.tracking.birth_velocities import at_scan_time, with_velocities

# A measurement unexplained with at most this probability makes no birth: each birth costs a track until the next scan.
MIN_UNEXPLAINED = 0.01
# Squared distance, in standard deviations of a birth, within which the measurements of two sensors are attributed to
# one target: the 99 % quantile of the chi-squared distribution with two degrees of freedom.
_SAME_TARGET = 9.21


class UnexplainedMeasurements(NamedTuple):
    """Measurements that no track explains with certainty."""

    states: Floats  # (num, state_dim) at rest where it was taken
    probabilities: Floats  # (num,) probability that no track explains the measurement
    sensors: Ints  # (num,) number of the sensor that measured it


def check_measured_births(birth: BirthModel, sensors: Sequence[SensorModel], *, each: bool) -> None:
    """Raise `InputError` for births from measurements if these cannot be placed (no `places`).

    each: True if every sensor starts tracks by itself, else one sensor with places is enough.
    """
    without = [s for s, sensor in enumerate(sensors) if sensor.measurement.places is None]
    if birth.from_measurements is not None and without and (each or len(without) == len(sensors)):
        expected = "a measurement with `places`, as targets are born of measurements"
        raise reject(f"sensors[{without[0]}].measurement", expected, "one without")


def tracker_births(birth: BirthModel, local: Any) -> BirthModel:
    """Return the births that the tracker must add: without those from measurements if a filter starts tracks itself.

    A filter that starts tracks has `starts_tracks`. Raises `InputError` if the tracker must start tracks and the
    expected number of births is to be learnt.
    """
    if getattr(local, "starts_tracks", False):
        return _births_at_sites(birth)
    if birth.from_measurements is not None and birth.from_measurements.is_learnt:
        wanted = f"a number, as the beliefs of {type(local).__name__} have no intensity of undetected targets"
        raise reject("MeasurementBirth.expected", wanted, birth.from_measurements.expected)
    return birth


@lru_cache(maxsize=100)
def _births_at_sites(birth: BirthModel) -> BirthModel:
    """Return the births at sites, the same object for each model, since filters cache what they derive from it."""
    return replace(birth, from_measurements=None)


def birth_candidates(birth: BirthModel, step: int, dt: float, measured: LMB | None) -> LMB | None:
    """Return the birth candidates of the `dt` seconds before a step, at sites and from measurements.

    Returns None if there are births at sites only, which filters add themselves. measured: the result of
    `births_from_scans` for this step, or None without a scan.
    """
    if birth.from_measurements is None:
        return None
    if birth.num_sites == 0 and birth.period is None and measured is not None:
        return measured
    return births_within(births_at(birth, step), birth.period, dt, measured)


def births_from_scans(
    birth: BirthModel,
    belief: LabelledDensity,
    sensors: Sequence[SensorModel],
    scans: Sequence[Any],
    poses: Any,
    step: int,
    *,
    owner: int | None = None,
    motion: MotionModel | None = None,
) -> LMB | None:
    """Return the birth candidates for `step` from the scans before it. Several sensors' measurements are pooled.

    Sensors whose measurements have no places, such as cameras, make none.

    Args:
        birth: birth model. None is returned if its `from_measurements` is None.
        belief: belief after those scans.
        sensors, scans, poses: one per sensor. A scan is None if the sensor did not scan.
        step: step in the labels of the births. Their indices follow those of the sites.
        owner: sensor that makes the births alone, with its own range of indices. None: all sensors together.
        motion: of the targets, whose modes may be detected with another probability. None: they are not.

    Raises:
        InputError: a belief without labels, or a measurement that does not determine the position of its target.
    """
    model = birth.from_measurements
    if model is None:
        return None
    first = birth.num_sites if owner is None else OWN_LABELS * (owner + 1)
    parameters = BirthsOfMeasurements(
        model.std, birth.marks, float(model.expected), float(model.max_existence), step, first
    )
    scans = [scan if sensor.measurement.places else None for sensor, scan in zip(sensors, scans, strict=True)]
    scanned = [s for s, scan in enumerate(scans) if scan is not None]
    checked = [pose_vector("pose", poses[s]) for s in scanned]
    found = unexplained_measurements(model, belief, sensors, scans, poses, motion)
    births = LMB.from_kernel(births_of_measurements(found.states, found.probabilities, parameters))
    births = with_velocities(births, model.std, sensors, scans, poses)
    return at_scan_time(births, checked)


def combine_births(birth: BirthModel, earlier: LMB | None, later: LMB | None) -> LMB | None:
    """Return the birth candidates after separate scans of one time: earlier ones, and later ones not close to them.

    earlier, later: results of `births_from_scans` for the earlier scans and for these.
    """
    model = birth.from_measurements
    if model is None or later is None or earlier is None:
        return later if earlier is None else earlier
    places, new = earlier.tracks.means[:, :2], later.tracks.means[:, :2]
    distances = ((new[:, np.newaxis] - places) / model.std[:2]) ** 2
    distant = np.flatnonzero((distances.sum(axis=-1) > _SAME_TARGET).all(axis=1))
    added = unchecked(LMB, take_tracks(later.tracks, distant), later.existence_logit[distant])
    return births_within(earlier, None, 0.0, added)


def unexplained_measurements(
    model: MeasurementBirth,
    belief: LabelledDensity,
    sensors: Sequence[SensorModel],
    scans: Sequence[Any],
    poses: Any,
    motion: MotionModel | None = None,
) -> UnexplainedMeasurements:
    """Return the measurements that no track explains with certainty, pooled over sensors. See `births_from_scans`."""
    lmb = _as_kernel(belief)
    by_sensor = [
        _unexplained_by_sensor(lmb, sensor, scans[s], pose_vector("pose", poses[s]), s, motion)
        for s, sensor in enumerate(sensors)
        if scans[s] is not None
    ]
    if not by_sensor:
        return UnexplainedMeasurements(np.empty((0, len(model.std))), np.empty(0), np.empty(0, np.int64))
    return _pool(UnexplainedMeasurements(*map(np.concatenate, zip(*by_sensor, strict=True))), model)


def births_from_received_scans(
    birth: BirthModel,
    belief: LabelledDensity,
    sensors: Sequence[SensorModel],
    scans: Sequence[Any],
    poses: Any,
    step: int,
    received: Sequence[int],
    motion: MotionModel,
) -> LMB | None:
    """Return `births_from_scans` for the scans of the sensors `received`. If some are missing, the first owns them."""
    received_scans = [scan if s in received else None for s, scan in enumerate(scans)]
    owner = None if len(received) == len(sensors) else received[0]
    return births_from_scans(birth, belief, sensors, received_scans, poses, step, owner=owner, motion=motion)


def _as_kernel(belief: LabelledDensity) -> Lmb:
    if not isinstance(belief, LabelledDensity):
        raise InputError(f"belief: expected {LABELLED} for births from measurements; got {type(belief).__name__}")
    return as_lmb(belief).to_kernel()


def _scan_input(belief: Lmb, sensor: SensorModel, scan: Any, pose: Floats) -> ScanInput:
    """Return a scan, already checked by the filters, as input of kernels."""
    measurements = to_measurements(as_scan(scan if len(scan) else np.empty((0, sensor.meas_dim))))
    return ScanInput(no_births_for_kernel(belief.tracks.components.means.shape[1]), measurements, pose, 0.0)


def _unexplained_by_sensor(
    belief: Lmb, sensor: SensorModel, scan: Any, pose: Floats, number: int, motion: MotionModel | None
) -> UnexplainedMeasurements:
    scan_input = _scan_input(belief, sensor, scan, pose)
    with model_errors():
        seen = sensor.to_kernel() if motion is None else sensor_of_filter(sensor, motion)
        explained = prob_explained(belief, scan_input, seen, _truncation(sensor.meas_dim))
    indices = np.flatnonzero(explained < 1.0 - MIN_UNEXPLAINED)
    states = sensor.measurement.states_at(
        scan_input.measurements.values[indices], scan_input.pose, belief.tracks.components.means.shape[1]
    )
    return UnexplainedMeasurements(states, 1.0 - explained[indices], np.full(len(indices), number))


@cache
def _truncation(meas_dim: int) -> Truncation:
    """Return the default gates and clutter floor of filters."""
    return Limits().truncation(meas_dim)


def _pool(measurements: UnexplainedMeasurements, model: MeasurementBirth) -> UnexplainedMeasurements:
    """Return one entry for measurements of different sensors that are close together, the least explained first.

    A group has at most one measurement per sensor. Its state is their mean, and its probability that of the least
    explained measurement.
    """
    order = np.argsort(-measurements.probabilities, kind="stable")
    if (measurements.sensors == measurements.sensors[:1]).all():  # every measurement by itself
        return UnexplainedMeasurements(
            measurements.states[order], measurements.probabilities[order], np.empty(0, np.int64)
        )
    states, totals = np.empty(measurements.states.shape), np.zeros(len(order))
    probabilities = np.empty(len(order))
    members = np.zeros((len(order), int(measurements.sensors.max(initial=0)) + 1), bool)
    cells, num = _Cells(model.std[:2] * math.sqrt(_SAME_TARGET)), 0
    for i in order.tolist():
        near = cells.near(measurements.states[i, :2])
        near = near[~members[near, measurements.sensors[i]]]
        distances = (((states[near, :2] - measurements.states[i, :2]) / model.std[:2]) ** 2).sum(axis=1)
        nearest = int(distances.argmin()) if len(near) else -1
        if len(near) and distances[nearest] <= _SAME_TARGET:
            group = int(near[nearest])
            cells.remove(group, states[group, :2])
        else:
            group = num
            states[num], probabilities[num], num = measurements.states[i], measurements.probabilities[i], num + 1
        totals[group] += 1.0
        states[group] += (measurements.states[i] - states[group]) / totals[group]
        members[group, measurements.sensors[i]] = True
        cells.add(group, states[group, :2])
    return UnexplainedMeasurements(states[:num], probabilities[:num], np.empty(0, np.int64))


class _Cells:
    """Index of groups by grid cell, so that each measurement is compared with nearby groups only."""

    def __init__(self, reach: Floats) -> None:
        """reach: (2,) in m, along each axis. Groups closer than this along both axes are found."""
        self._size = reach * (1.0 + 1e-9)  # margin for rounding
        self._groups: defaultdict[tuple[float, float], set[int]] = defaultdict(set)

    def near(self, position: Floats) -> Ints:
        """Return the groups that may lie within reach of a position, (num,), in increasing order."""
        x, y = self._cell(position)
        neighbours = [self._groups.get((x + i, y + j), ()) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)]
        return np.array(sorted({group for groups in neighbours for group in groups}), np.int64)

    def add(self, group: int, place: Floats) -> None:
        """Add a group at a position."""
        self._groups[self._cell(place)].add(group)

    def remove(self, group: int, place: Floats) -> None:
        """Remove a group that was added at this position."""
        self._groups[self._cell(place)].remove(group)

    def _cell(self, place: Floats) -> tuple[float, float]:
        x, y = np.floor(place / self._size).tolist()
        return x, y
