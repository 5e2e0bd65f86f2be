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
_MIN_ESTIMATES = 10  # estimates of a track, at least, for it to count
_MIN_SCANS, _MIN_SHARE = 3, 0.25  # scans, and their share, at which a sensor must have measured a track
_MIN_PAIRS, _MAX_CHANCE_SHARE = 10, 0.1  # fewest pairs for a result, and the largest share that agrees by chance
_MAX_OFFSET_VARIATION = 0.25  # largest variation of an offset between two tracks, as a share of it
_MAX_OFFSET_SHARE = 0.1  # largest offset that a bias explains, as a share of the distance from a sensor
_MORE = 0.3  # by which the share of one sensor is larger for a track of it alone
_MANY = 0.3  # share of the tracks of one sensor that have one of the other near them; a convoy has fewer
_MIN_DETECTION = 0.3  # lowest probability of detection at which a scan should contain the target

Label: TypeAlias = tuple[int, ...]


class _Track(NamedTuple):
    """A track: its mean positions by scan, and the scans at which each sensor measured it.

    detections: for each sensor, True for each of its scans in view of the track that has a measurement of it.
    """

    means: dict[int, Floats]
    detections: tuple[list[bool], ...]

    def is_measured_by(self, sensor: int) -> bool:
        detections = self.detections[sensor]
        return sum(detections) >= max(_MIN_SCANS, _MIN_SHARE * len(detections))

    def share(self, sensor: int) -> float:
        """Return the share of a sensor's scans in view of the track that have a measurement of it."""
        detections = self.detections[sensor]
        return sum(detections) / max(len(detections), 1)


def disagreement_warnings(record: RunRecord, scenario: Scenario) -> tuple[str, ...]:
    """Return warnings of sensors of a recording that agree on no target, and of tracks that run side by side.

    A pair is a track that one of two sensors measures and a scan of the other that should contain it. Sensors whose
    measurements give no places in the plane are left out. Raises `VedetteError` for a recording that cannot be read.
    """
    model = scenario.model
    kinds = [sensor.measurement.kind for sensor in model.sensors]
    placed = [s for s, kind in enumerate(kinds) if kind in PLACED and kind not in HEIGHT_DEPENDENT]
    if model.recording is None or len(placed) < 2:
        return ()
    tracks = _long_tracks(record, scenario, scans_of_record(record, scenario), placed)
    warnings = list[str]()
    for first, second in combinations(placed, 2):
        detections = [
            detected
            for track in tracks.values()
            for measuring, other in ((first, second), (second, first))
            if track.is_measured_by(measuring)
            for detected in track.detections[other]
        ]
        share_a_track = any(track.is_measured_by(first) and track.is_measured_by(second) for track in tracks.values())
        names = model.sensor_names[first], model.sensor_names[second]
        is_enough = len(detections) >= _MIN_PAIRS
        if is_enough and not share_a_track and sum(detections) <= _MAX_CHANCE_SHARE * len(detections):
            pairs = f"{sum(detections)} of {len(detections)} pairs of a track of one and a scan of the other"
            checks = "check units, north (compass or east) and places"
            warnings.append(f"{names[0]} and {names[1]} agree on no target ({pairs}): {checks}")
        warnings += _parallel_tracks(tracks, (first, second), names, record.poses[0, [first, second], :2])
    return tuple(warnings)


def _long_tracks(record: RunRecord, scenario: Scenario, scans: Scans, placed: list[int]) -> dict[Label, _Track]:
    """Return the tracks with at least `_MIN_ESTIMATES` estimates, by label."""
    sensors, stds = scenario.model.sensors, noise_stds(scenario, placed)
    tracks: dict[Label, _Track] = {}
    for k, estimate in enumerate(record.estimates):
        of_scan, means = [], estimate.means[:, :2]
        for (step, index), mean in zip(estimate.labels.tolist(), means, strict=True):
            of_scan.append(tracks.setdefault((step, index), _Track({}, tuple([] for _ in sensors))))
            of_scan[-1].means[k] = mean
        for s in placed:
            scan, pose, kind = scans[k][s], record.poses[k, s], sensors[s].measurement.kind
            if scan is None:
                continue
            gated = in_gate(scan.measurements, kind, stds[s], pose, means, estimate.covs[:, :2, :2])
            for track, mean, of_track in zip(of_scan, means, gated, strict=True):
                if _in_view(sensors[s], pose, mean):
                    track.detections[s].append(bool(of_track.any()))
    return {label: track for label, track in tracks.items() if len(track.means) >= _MIN_ESTIMATES}


def in_gate(scan: Floats, kind: str, stds: Floats, pose: Floats, means: Floats, covs: Floats) -> Bools:
    """Return True for each estimate and measurement of a scan within its gate, by its place, (num_estimates, num)."""
    if kind == "position":
        residuals = scan - means[:, np.newaxis]
    else:
        offsets = means - pose[:2]
        distances = np.maximum(np.hypot(offsets[:, 0], offsets[:, 1]), 1.0)[:, np.newaxis]
        directions = offsets / distances
        jacobians = np.stack([directions[:, ::-1] * [-1.0, 1.0] / distances, directions], axis=1)
        expected = np.column_stack([np.arctan2(offsets[:, 1], offsets[:, 0]), distances])
        residuals = scan[:, :2] - expected[:, np.newaxis]
        residuals[..., 0] = np.remainder(residuals[..., 0] + math.pi, 2.0 * math.pi) - math.pi
        covs = jacobians @ covs @ jacobians.transpose(0, 2, 1)
    precisions = np.linalg.inv(covs + np.diag(stds**2))
    return np.asarray(np.einsum("nmi,nij,nmj->nm", residuals, precisions, residuals) <= _GATE**2)


def noise_stds(scenario: Scenario, placed: list[int]) -> dict[int, Floats]:
    """Return for each sensor the lowest standard deviations of its two components; 0 if a custom noise gives none."""
    model = scenario.model
    region, method, stds = model.region.build(), model.filter.gaussian_method, {}
    for s in placed:
        local = model.sensors[s].build(region, method, scenario.folder)
        stds[s] = np.zeros(2) if local.noise.least_stds is None else np.asarray(local.noise.least_stds)[:2]
    return stds


def _in_view(sensor: Sensor, pose: Floats, mean: Floats) -> bool:
    """Return True if a sensor at a pose should see a place according to its detection model."""
    offset = mean[:2] - pose[:2]
    distance = float(np.hypot(*offset))
    if sensor.detection.kind == "constant":
        return float(sensor.detection.probability) >= _MIN_DETECTION
    if sensor.detection.kind == "gaussian":
        return math.exp(-0.5 * (distance / sensor.detection.sigma) ** 2) >= _MIN_DETECTION
    view = field_of_view(sensor, pose.tolist())
    if view is None:
        return True
    angle = abs(math.remainder(math.atan2(offset[1], offset[0]) - view.middle, 2.0 * math.pi))
    return distance <= view.reach and angle <= view.half_width and view.probability >= _MIN_DETECTION


def _parallel_tracks(
    tracks: Mapping[Label, _Track], pair: tuple[int, int], names: tuple[str, str], sensor_positions: Floats
) -> Iterator[str]:
    """Yield a warning if tracks of one sensor keep a small offset from tracks of the other, as two of one target do.

    sensor_positions: (2, 2), m.
    """
    first, second = (
        [each for each in tracks.values() if each.is_measured_by(one) and each.share(one) > each.share(other) + _MORE]
        for one, other in (pair, pair[::-1])
    )
    offsets = [offset for track in first if (offset := _nearest_offset(track, second, sensor_positions)) is not None]
    if len(offsets) > _MANY * len(first):
        distance = f"{np.median(offsets):.0f} m from one of {names[1]}"
        finding = f"{len(offsets)} of {len(first)} tracks of {names[0]} keep {distance}, as two tracks of one target do"
        yield f"{finding}: `vedette track --calibrate` finds biases of range, bearing and clock"


def _nearest_offset(track: _Track, others: list[_Track], sensor_positions: Floats) -> float | None:
    """Return the distance to the nearest other track with a constant offset, m; None if there is none near enough."""
    nearest: float | None = None
    mean = np.mean(list(track.means.values()), axis=0)
    largest = _MAX_OFFSET_SHARE * float(np.hypot(*(mean - sensor_positions).T).min())
    for other in others:
        common = sorted(track.means.keys() & other.means.keys())
        if len(common) < _MIN_ESTIMATES:
            continue
        offsets = np.array([other.means[k] - track.means[k] for k in common])
        variation, size = float(np.sqrt(offsets.var(axis=0).sum())), float(np.hypot(*offsets.mean(axis=0)))
        if variation <= _MAX_OFFSET_VARIATION * size and size <= (largest if nearest is None else nearest):
            nearest = size
    return nearest
