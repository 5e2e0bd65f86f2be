"""Warnings of sensors of a recording that agree on no target, because of wrong units, north or places."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.evaluation.scans import Scans, scans_of_record
from vedette.internal.quantities import HEIGHT_DEPENDENT, PLACED
from vedette.kernels.base.types import Bools, Floats
from vedette.scenarios import Scenario
from vedette.scenarios.sections.field_of_view import field_of_view
from vedette.scenarios.sections.sensors import Sensor
from vedette.simulation.records import RunRecord

_GATE = 4.0  # standard deviations between an estimate and a measurement of it
_LASTING = 10  # estimates of a track, at least, for it to count
_LEAST, _SHARE = 3, 0.25  # scans, and their share, at which a sensor must have measured a track
_FEWEST_PAIRS, _CHANCE = 10, 0.1  # fewest pairs for a result, and the largest share that agrees by chance
_STEADY = 0.25  # largest variation of an offset between two tracks, as a share of it
_BESIDE = 0.1  # largest offset that a bias explains, as a share of the distance from a sensor
_SEEN = 0.3  # lowest probability of detection at which a scan should contain the target

Label: TypeAlias = tuple[int, ...]


class _Life(NamedTuple):
    """A track: its mean positions by scan, and the scans at which each sensor measured it.

    looks: for each sensor, True for each of its scans in view of the track that has a measurement of it.
    """

    means: dict[int, Floats]
    looks: tuple[list[bool], ...]

    def measured_by(self, sensor: int) -> bool:
        own = self.looks[sensor]
        return sum(own) >= max(_LEAST, _SHARE * len(own))


def disagreements(record: RunRecord, scenario: Scenario) -> tuple[str, ...]:
    """Return warnings of sensors of a recording that agree on no target, and of tracks that run side by side.

    A pair is a track that one of two sensors measures and a scan of the other that should contain it. Sensors whose
    measurements give no places in the plane are left out. Raises `VedetteError` for a recording that cannot be read.
    """
    model = scenario.model
    kinds = [sensor.measurement.kind for sensor in model.sensors]
    placed = [s for s, kind in enumerate(kinds) if kind in PLACED and kind not in HEIGHT_DEPENDENT]
    if model.recording is None or len(placed) < 2:
        return ()
    lives = _lives(record, scenario, scans_of_record(record, scenario), placed)
    found = list[str]()
    for first, second in combinations(placed, 2):
        looks = [
            look
            for life in lives.values()
            for one, other in ((first, second), (second, first))
            if life.measured_by(one)
            for look in life.looks[other]
        ]
        both = any(life.measured_by(first) and life.measured_by(second) for life in lives.values())
        if both or len(looks) < _FEWEST_PAIRS or sum(looks) > _CHANCE * len(looks):
            continue
        names = model.sensor_names[first], model.sensor_names[second]
        pairs = f"{sum(looks)} of {len(looks)} pairs of a track of one and a scan of the other"
        checks = "check units, north (compass or east) and places"
        found.append(f"{names[0]} and {names[1]} agree on no target ({pairs}): {checks}")
        found += _side_by_side(lives, (first, second), names, record.poses[0, [first, second], :2])
    return tuple(found)


def _lives(record: RunRecord, scenario: Scenario, scans: Scans, placed: list[int]) -> dict[Label, _Life]:
    """Return the tracks with at least `_LASTING` estimates, by label."""
    sensors, stds = scenario.model.sensors, noise_stds(scenario, placed)
    lives: dict[Label, _Life] = {}
    for k, estimate in enumerate(record.estimates):
        for label, mean, cov in zip(map(tuple, estimate.labels.tolist()), estimate.means, estimate.covs, strict=True):
            life = lives.setdefault(label, _Life({}, tuple([] for _ in sensors)))
            life.means[k] = mean[:2]
            for s in placed:
                scan, pose = scans[k][s], record.poses[k, s]
                if scan is None or not _sees(sensors[s], pose, mean):
                    continue
                kind = sensors[s].measurement.kind
                within = measured_by(scan.measurements, kind, stds[s], pose, mean[:2], cov[:2, :2])
                life.looks[s].append(bool(within.any()))
    return {label: life for label, life in lives.items() if len(life.means) >= _LASTING}


def measured_by(scan: Floats, kind: str, stds: Floats, pose: Floats, mean: Floats, cov: Floats) -> Bools:
    """Return True for each measurement of a scan within the gate of an estimate, by its place, shape (num,)."""
    if kind == "position":
        off, turn = scan - mean, np.eye(2)
    else:
        ahead = mean - pose[:2]
        distance = max(float(np.hypot(*ahead)), 1.0)
        along = ahead / distance
        turn = np.array([[-along[1] / distance, along[0] / distance], along])
        off = scan[:, :2] - [math.atan2(ahead[1], ahead[0]), distance]
        off[:, 0] = np.remainder(off[:, 0] + math.pi, 2.0 * math.pi) - math.pi
    spread = turn @ cov @ turn.T + np.diag(stds**2)
    return np.asarray(np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off) <= _GATE**2)


def noise_stds(scenario: Scenario, placed: list[int]) -> dict[int, Floats]:
    """Return for each sensor the lowest standard deviations of its two components; 0 if a custom noise gives none."""
    model = scenario.model
    region, method, found = model.region.build(), model.filter.gaussian_method, {}
    for s in placed:
        local = model.sensors[s].build(region, method, scenario.folder, model.filter.detection_taken_at)
        found[s] = np.zeros(2) if local.noise.least_stds is None else np.asarray(local.noise.least_stds)[:2]
    return found


def _sees(sensor: Sensor, pose: Floats, mean: Floats) -> bool:
    """Return True if a sensor at a pose should see a place according to its detection model."""
    ahead = mean[:2] - pose[:2]
    distance = float(np.hypot(*ahead))
    if sensor.detection.kind == "constant":
        return float(sensor.detection.probability) >= _SEEN
    if sensor.detection.kind == "gaussian":
        return math.exp(-0.5 * (distance / sensor.detection.sigma) ** 2) >= _SEEN
    view = field_of_view(sensor, pose.tolist())
    if view is None:
        return True
    off = abs(math.remainder(math.atan2(ahead[1], ahead[0]) - view.middle, 2.0 * math.pi))
    return distance <= view.reach and off <= view.half_width and view.probability >= _SEEN


def _side_by_side(
    lives: Mapping[Label, _Life], pair: tuple[int, int], names: tuple[str, str], places: Floats
) -> Iterator[str]:
    """Yield a warning if tracks of one sensor keep a small offset from tracks of the other, as two of one target do.

    places: (2, 2) positions of the two sensors, m.
    """
    first, second = (
        [life for life in lives.values() if life.measured_by(one) and not life.measured_by(other)]
        for one, other in (pair, pair[::-1])
    )
    offsets = [found for one in first if (found := _nearest(one, second, places)) is not None]
    if offsets:
        apart = f"{np.median(offsets):.0f} m from one of {names[1]}"
        what = f"{len(offsets)} of {len(first)} tracks of {names[0]} keep {apart}, as two tracks of one target do"
        yield f"{what}: `vedette calibrate` finds biases of range, bearing, clock and place"


def _nearest(life: _Life, others: list[_Life], places: Floats) -> float | None:
    """Return the distance to the nearest other track with a constant offset, m; None if there is none near enough."""
    found: float | None = None
    mean = np.mean(list(life.means.values()), axis=0)
    most = _BESIDE * float(np.hypot(*(mean - places).T).min())
    for other in others:
        both = sorted(life.means.keys() & other.means.keys())
        if len(both) < _LASTING:
            continue
        offsets = np.array([other.means[k] - life.means[k] for k in both])
        varies, size = float(np.sqrt(offsets.var(axis=0).sum())), float(np.hypot(*offsets.mean(axis=0)))
        if varies <= _STEADY * size and size <= (most if found is None else found):
            found = size
    return found
