"""The scans of a recorded run, for display: drawn again from its seed, or read from its recording."""

from collections.abc import Sequence
from functools import partial
from math import isnan
from typing import Any, TypeAlias

import numpy as np

from vedette.errors import InputError, VedetteError
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT, PLACED, QUANTITIES, is_doppler, si_column
from vedette.kernels.base.types import BEAM, HEADING, OWN_HEIGHT, OWN_VELOCITY, Floats
from vedette.models.arguments import reject
from vedette.models.scan_rows import ScanLike, ScanRows, values_of
from vedette.models.turns import is_turn, lags
from vedette.platforms.compass import course_deg
from vedette.recorded import RecordedScans
from vedette.recorded.conventions import OWN_SPEEDS, UNITS
from vedette.recorded.extents import places_of
from vedette.recorded.turns import bearings_of
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_scan_times, build_true_sensors, scan_loss_probabilities
from vedette.scenarios.recorded_data import recorded_scans, recorded_sensors
from vedette.scenarios.sections.recording import RecordingSection
from vedette.scenarios.trust import custom_code
from vedette.simulation.loop import scan_flags_of_run
from vedette.simulation.records import RunRecord
from vedette.simulation.replay import scans_of_sensors
from vedette.simulation.scans import Scan
from vedette.simulation.true_sensors import sensors_at_step

UNKNOWN = -2  # origin of a measurement that was recorded
# Shape of the measurements of a kind in the plane; other kinds have none.
PLANE_SHAPES: dict[str, str] = {
    "bearing_range": "point",
    "bearing_range_rate": "point",
    "bearing_slant_range": "point",
    "bearing_range_elevation": "point",
    "bearing_range_altitude": "point",
    "position_altitude": "position",
    "position": "position",
    "bearing_only": "ray",
    "range_only": "circle",
}
Scans: TypeAlias = tuple[tuple[Scan | None, ...], ...]
Rows: TypeAlias = tuple[tuple[ScanLike | None, ...], ...]


def measurement_code(scenario: Scenario) -> tuple[str, ...]:
    """Return the code that drawing the measurements of a scenario would run."""
    if scenario.model.recording is not None:
        return ()
    return tuple(
        dict.fromkeys(
            name
            for sensor in scenario.model.sensors
            for section in (sensor.measurement, sensor.noise, sensor.detection, sensor.clutter, sensor.true_parameters)
            if section is not None
            for name in custom_code(section)
        )
    )


def scans_of_record(record: RunRecord, scenario: Scenario) -> Scans:
    """Return for each step one scan per sensor, or None if it did not scan. Origins of recorded scans are `UNKNOWN`.

    Raises:
        VedetteError: models or a recording that cannot be loaded, or a recording of other scans.
    """
    model = scenario.model
    if model.recording is not None:
        return _recorded(record, model.recording, scenario)
    true, times = build_true_sensors(scenario), build_scan_times(scenario)
    scans_at = scan_flags_of_run(times, scan_loss_probabilities(scenario), record.num_scans, record.seed, record.run)
    return scans_of_sensors(record, len(true), partial(sensors_at_step, true, scans_at))


def available_scans(record: RunRecord, scenario: Scenario, trust: bool) -> Scans:
    """Return the scans of a run, empty if they are not available, or need custom code that is not trusted."""
    if measurement_code(scenario) and not trust:
        return ()
    try:
        return scans_of_record(record, scenario)
    except VedetteError:
        return ()


def rows_of_record(record: RunRecord, scenario: Scenario) -> Rows:
    """Return for each step the measurements of each sensor, with the noise that rows of a recording bring, or None.

    Raises `VedetteError` like `scans_of_record`.
    """
    section = scenario.model.recording
    if section is not None:
        return _recording_of(record, section, scenario).scans[: record.num_scans]
    scans = scans_of_record(record, scenario)
    return tuple(tuple(None if scan is None else scan.measurements for scan in instant) for instant in scans)


def _recording_of(record: RunRecord, section: RecordingSection, scenario: Scenario) -> RecordedScans:
    """Return the recording of a run. Raises `InputError` for one of other scans."""
    recording = recorded_scans(scenario.model, scenario.folder)
    if not np.array_equal(recording.times[: record.num_scans], record.times):
        raise InputError(f"{section.path}: expected the scans of the run; got others")
    return recording


def _recorded(record: RunRecord, section: RecordingSection, scenario: Scenario) -> Scans:
    recording = _recording_of(record, section, scenario)
    return tuple(
        tuple(None if scan is None else Scan(values_of(scan), np.full(len(scan), UNKNOWN)) for scan in scans)
        for scans in recording.scans[: record.num_scans]
    )


def scan_table(record: RunRecord, scenario: Scenario) -> dict[str, list[Any]]:
    """Return the scans of a run by columns, one row per measurement, as `vedette.recorded.parse_scans` reads them.

    Columns are `time` (for a turning radar, the time at which its beam passed), `sensor`, the measured quantities
    (`bearing_deg`, `range_m`, `range_rate_mps`, `x_m`, `y_m`), and the sensor poses (`own_x_m`, `own_y_m`,
    `own_heading_deg`, with range rates also `own_vx_mps`, `own_vy_mps`). Rows of a recording have their columns of
    accuracy, in SI units, and empty cells for components that were not measured.
    Angles are degrees clockwise from true north if every sensor with a bearing has a compass, else they are
    `bearing_rad` and `own_heading_rad` from the east, for which a reader needs `bearings: east`. Biases in the scenario
    are removed.

    Raises:
        VedetteError: like `scans_of_record`, or measurements of a kind that rows cannot represent.
    """
    sites = recorded_sensors(scenario.model)
    for site in sites:
        if site.kind not in COMPONENTS:
            raise reject(f"sensor {site.name}", f"measurements of kind {', '.join(COMPONENTS)}", site.kind)
    bearing_sites = [site for site in sites if "bearing" in COMPONENTS[site.kind]]
    compass = bool(bearing_sites) and all(site.compass for site in bearing_sites)
    unit = "deg" if compass else "rad"
    names = {name: si_column(name) for name in QUANTITIES} | {
        name: f"{name}_{unit}" for name in ("bearing", "elevation")
    }
    quantities = dict.fromkeys(names[name] for site in sites for name in COMPONENTS[site.kind])
    pose_columns = ["own_x_m", "own_y_m", f"own_heading_{unit}"]
    if any(is_doppler(site.kind) for site in sites):
        pose_columns += [f"{name}_mps" for name in OWN_SPEEDS]
    own_heights = ["own_height_m"] if any(site.kind in HEIGHT_DEPENDENT for site in sites) else []
    recording = None
    if scenario.model.recording is not None:
        recording = recorded_scans(scenario.model, scenario.folder)
    accuracy = () if recording is None else dict.fromkeys(name for own in recording.accuracy_columns for name in own)
    header = ["time", "sensor", *quantities, *pose_columns, *own_heights, *map(_accuracy_column, accuracy)]
    table: dict[str, list[Any]] = {name: [] for name in header}
    for k, (time, scans, poses) in enumerate(
        zip(record.times.tolist(), scans_of_record(record, scenario), record.poses, strict=True)
    ):
        for s, (site, scan, pose) in enumerate(zip(sites, scans, poses, strict=True)):
            if scan is None:
                continue
            heading = float(course_deg(site.north, pose[HEADING], pose)) if compass else float(pose[HEADING])
            columns = [names[name] for name in COMPONENTS[site.kind]]
            rows = (site.to_raw(scan.measurements, pose) if compass else scan.measurements).tolist() or [()]
            bearings = bearings_of(scan.measurements, pose, site.kind)
            beam_lags = lags(bearings, pose).tolist() if is_turn(pose) and len(bearings) else [0.0] * len(rows)
            reports = () if site.features is None else site.features.reports
            more = [dict[str, Any]() for _ in rows]
            if recording is not None:
                more = _accuracy_cells(recording, k, s, columns, reports)
            for row, lag, own_accuracy in zip(rows, beam_lags, more or [{}], strict=True):
                position = pose[:2] + lag * pose[OWN_VELOCITY:BEAM] if lag else pose[:2]
                pose_cells = zip(pose_columns, (*position, heading, *pose[OWN_VELOCITY:]), strict=False)
                cells = {
                    "time": time + lag,
                    "sensor": site.name,
                    **dict(pose_cells),
                    "own_height_m": float(pose[OWN_HEIGHT]) if len(pose) > OWN_HEIGHT else 0.0,
                    **dict(zip(columns, row, strict=False)),
                    **own_accuracy,
                }
                for name, column in table.items():
                    column.append(cells.get(name))
    return table


def _accuracy_column(name: str) -> str:
    """Return the name of a column of accuracy in SI units: `range_std_m`, `xy_correlation`, `snr_db`."""
    return f"{name}_{next(iter(UNITS[name]))}".rstrip("_")


def _accuracy_cells(
    recording: RecordedScans, k: int, s: int, columns: Sequence[str], reports: Sequence[str]
) -> list[dict[str, Any]]:
    """Return for each row of a recorded scan its cells of accuracy, and None for components that were not measured.

    reports: names of the classes that the sensor reports.
    """
    scan, accuracy = recording.scans[k][s], recording.accuracy[k][s]
    assert scan is not None
    missing = scan.missing if isinstance(scan, ScanRows) else np.zeros(scan.shape, np.bool_)
    all_cells: list[dict[str, Any]] = [{columns[i]: None for i in np.flatnonzero(row).tolist()} for row in missing]
    if accuracy is not None:
        names = [_accuracy_column(name) for name in recording.accuracy_columns[s]]
        for cells, values in zip(all_cells, accuracy.tolist(), strict=True):
            cells |= {name: None if isnan(value) else value for name, value in zip(names, values, strict=True)}
            if cells.get("class") is not None:
                cells["class"] = reports[int(cells["class"])]
    return all_cells


def plane_coordinates(measurements: Floats, kind: str, pose: Floats) -> Floats:
    """Return places of measurements of a kind of `PLANE_SHAPES`, (n, 2) m.

    For rays bearings, (n, 1) rad, and for circles radii, (n, 1) m.
    """
    return places_of(measurements, pose, kind) if kind in PLACED else measurements[:, :1]
