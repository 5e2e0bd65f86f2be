"""The scans of a run that is kept, to be shown: drawn again from its seed, or those of its recording."""

from __future__ import annotations

from functools import partial
from typing import TypeAlias

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_scan_times, build_true_sensors, drop_outs
from vedette.scenarios.sections.recording import RecordingSection
from vedette.scenarios.trust import code_of
from vedette.simulation.loop import scans_of_run
from vedette.simulation.records import RunRecord
from vedette.simulation.replay import scans_of_sensors
from vedette.simulation.scans import Scan
from vedette.simulation.true_sensors import scanning

UNKNOWN = -2  # origin of a measurement that was recorded
# How the measurements of a kind lie in the plane; of other kinds they do not.
LIE: dict[str, str] = {"bearing_range": "point", "position": "position", "bearing_only": "ray", "range_only": "circle"}
Scans: TypeAlias = tuple[tuple[Scan | None, ...], ...]


def code_of_sensors(scenario: Scenario) -> tuple[str, ...]:
    """Code that drawing the measurements of a scenario would run."""
    if scenario.model.recording is not None:
        return ()
    return tuple(
        dict.fromkeys(
            name
            for sensor in scenario.model.sensors
            for section in (sensor.measurement, sensor.noise, sensor.detection, sensor.clutter, sensor.truth)
            if section is not None
            for name in code_of(section)
        )
    )


def scans_of_record(record: RunRecord, scenario: Scenario) -> Scans:
    """For each step one scan a sensor, or None where it did not scan; of recorded scans all origins are `UNKNOWN`.

    Raises:
        VedetteError: models or a recording that cannot be had, or a recording of other scans.
    """
    model = scenario.model
    if model.recording is not None:
        return _recorded(record, model.recording, scenario)
    region, method = model.region.build(), model.filter.gaussian_method
    sensors = [section.build(region, method, scenario.folder) for section in model.sensors]
    true, times = build_true_sensors(scenario, sensors), build_scan_times(scenario)
    scans_at = scans_of_run(times, drop_outs(scenario), record.num_scans, record.seed, record.run)
    return scans_of_sensors(record, len(true), partial(scanning, true, scans_at))


def _recorded(record: RunRecord, section: RecordingSection, scenario: Scenario) -> Scans:
    recording = section.build(scenario.model, scenario.folder)
    if not np.array_equal(recording.times[: record.num_scans], record.times):
        raise InputError(f"{section.path}: expected the scans of the run; got others")
    return tuple(
        tuple(None if scan is None else Scan(scan, np.full(len(scan), UNKNOWN)) for scan in scans)
        for scans in recording.scans[: record.num_scans]
    )


def in_plane(measurements: Floats, kind: str, pose: Floats) -> Floats:
    """(n, 2) where measurements of a kind of `LIE` lie, m; of rays (n, 1) bearings in rad, of circles (n, 1) radii."""
    if kind == "bearing_range":
        bearings, ranges = measurements[:, 0], measurements[:, 1]
        return np.asarray(pose[:2] + ranges[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
    return measurements[:, : 2 if kind == "position" else 1]
