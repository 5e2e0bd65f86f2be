"""Warnings of oddities in the recorded targets and scans of a scenario that a run accepts."""

from collections.abc import Iterator

import numpy as np

from vedette.internal.quantities import COMPONENTS, PLACED
from vedette.internal.text import pluralise
from vedette.kernels.base.types import VELOCITY, VY
from vedette.recorded import RecordedScans
from vedette.recorded import RecordedTargets as RecordedSource
from vedette.recorded.cleaning import longest_reachable
from vedette.recorded.tables import column_names
from vedette.scenarios.diagnostics import Path, format_path
from vedette.scenarios.loading import Scenario
from vedette.scenarios.recorded_data import recorded_scans, recorded_targets
from vedette.scenarios.region import beyond_region_warnings
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.recording import noise_stds
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.sections.world import Time

_JUMP = 5.0  # times the speed of nine in ten steps between reports, above which a report is a jump
_MIN_DISTANCE = 1000.0  # m; sensors nearer than this to the targets are not called far


def recording_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield the places in the scenario and texts of warnings of recorded data that are probably mistakes."""
    model, folder = scenario.model, scenario.folder
    if model.recording is not None:
        recording = recorded_scans(model, folder)
        yield from _unused_columns(("recording", "path"), model.recording.path, recording.unused)
        yield from ((("recording", "path"), note) for note in recording.notes)
        yield from beyond_region_warnings(model, recording)
        yield from _large_scan_window(model, recording)
        yield from _noise_beyond_ranges(model, recording)
    if not isinstance(model.targets, RecordedTargets):
        return
    source = recorded_targets(model, folder)
    yield from _repeated_reports(model.targets, source)
    yield from _single_reports(model.targets, source)
    if source.cleaning.max_speed is None:
        yield from _jumps(model.targets, source)
    yield from _unused_columns(("targets", "path"), model.targets.path, source.reports.unused)
    yield from ((("targets", "path"), f"targets.path: {model.targets.path}: {note}") for note in source.reports.notes)
    for index, sensor in enumerate(model.sensors):
        path: Path = ("sensors", index, "position")
        place = f"{format_path(path)}: expected metres from the origin"
        at = f"({sensor.position[0]:g}, {sensor.position[1]:g})"
        if _is_geographic(sensor, source):
            yield path, f"{place}, got {at}, which is a longitude and latitude among those of {model.targets.path}"
        elif (distance := _distance(sensor, source, model.time)) is not None:
            yield path, f"{place}, got {at}, {distance / 1000.0:.3g} km from the nearest recorded position"


def _unused_columns(path: Path, file: str, columns: tuple[str, ...]) -> Iterator[tuple[Path, str]]:
    """Yield a warning of columns that are not read."""
    if columns:
        names = column_names(columns)
        yield path, f"{'.'.join(map(str, path))}: {file}: not used: {pluralise(len(columns), 'column')} ({names})"


def _single_reports(section: RecordedTargets, source: RecordedSource) -> Iterator[tuple[Path, str]]:
    """Yield a warning of targets with one report, which have no course."""
    numbers = np.bincount(source.reports.tracks, minlength=len(source.reports.names))
    single = [name for name, number in zip(source.reports.names, numbers.tolist(), strict=True) if number == 1]
    if single:
        which = f"{pluralise(len(single), 'target')} with one report ({column_names(single)})"
        yield ("targets", "path"), f"targets.path: {section.path}: {which} left out, as a course needs two"


def _large_scan_window(model: ScenarioModel, recording: RecordedScans) -> Iterator[tuple[Path, str]]:
    """Yield warnings of rows gathered into one scan although targets move by more than the noise between them."""
    births = model.birth.from_measurements
    if births is None or len(births.std) <= VY:
        return
    speed = max(births.std[VELOCITY])
    for s, (sensor, window) in enumerate(zip(model.sensors, recording.gathered, strict=False)):
        stds = noise_stds(sensor)
        if stds is None or sensor.measurement.kind not in PLACED or speed * window <= stds[1]:
            continue
        yield (
            ("recording", "scan_window"),
            f"{model.sensor_names[s]}: rows of one scan are {window:.3g} s apart (median), in which a target of "
            f"{speed:g} m/s moves {speed * window:.3g} m, more than the noise ({stds[1]:.3g} m): if it is a turning "
            "radar, give the sensor `turn: {period: ...}`; else use a smaller `scan_window`",
        )


def _noise_beyond_ranges(model: ScenarioModel, recording: RecordedScans) -> Iterator[tuple[Path, str]]:
    """Yield warnings of noise of a range that is larger than the range itself, at the median of its measurements."""
    for s, sensor in enumerate(model.sensors):
        scans = [measured for measured in recording.measured(s) if len(measured)]
        names, stds = COMPONENTS.get(sensor.measurement.kind, ()), noise_stds(sensor)
        if "range" not in names or stds is None or not scans:
            continue
        away, what = float(np.median(np.concatenate(scans)[:, (axis := names.index("range"))])), "noise"
        std = stds[axis] + getattr(sensor.noise, "eta_range", 0.0) * away**2
        if "range_std" in (columns := recording.accuracy_columns[s] if recording.accuracy_columns else ()):
            cells = [own[:, columns.index("range_std")] for each in recording.accuracy if (own := each[s]) is not None]
            std, what = float(np.nanmedian([std, *np.concatenate(cells)])), "column range_std"
        if std > away:
            text = f"expected noise of ranges below the ranges, {away:.0f} m (median); got {std:.3g} m"
            yield ("sensors", s, "noise"), f"{model.sensor_names[s]}, {what}: {text} (is its unit right?)"


def _jumps(section: RecordedTargets, source: RecordedSource) -> Iterator[tuple[Path, str]]:
    """Yield a warning of reports that no speed of the others reaches."""
    reports = source.reports
    rows = [np.flatnonzero(reports.tracks == i) for i in range(len(reports.names))]
    paths = [(reports.times[own], reports.positions[own]) for own in rows]
    speeds = [np.hypot(*np.diff(places, axis=0).T) / np.diff(times) for times, places in paths]
    limit = max(_JUMP * float(np.quantile(np.concatenate(speeds), 0.9)), 1.0)
    jumping = [i for i, own in enumerate(speeds) if (own > limit).any()]
    lost = {reports.names[i]: len(rows[i]) - len(longest_reachable(*paths[i], limit)) for i in jumping}
    if num := sum(lost.values()):
        finding = f"{pluralise(num, 'report')} of {column_names(lost)} reached only above {limit:.3g} m/s"
        cure = f"the error counts {'it' if num == 1 else 'them'}; `targets: {{max_speed: {limit:.3g}}}` leaves such out"
        yield ("targets", "path"), f"targets.path: {section.path}: {finding}, {_JUMP:g} times most speeds: {cure}"


def _repeated_reports(section: RecordedTargets, source: RecordedSource) -> Iterator[tuple[Path, str]]:
    repeats = source.reports.repeats
    if repeats:
        first, second = repeats[0]
        others = f", as are {len(repeats) - 1} more" if len(repeats) > 1 else ""
        yield (
            ("targets", "path"),
            f"targets.path: {section.path}, row {second}: a second report of one target at the time of row {first}; "
            f"left out{others}",
        )


def _is_geographic(sensor: Sensor, source: RecordedSource) -> bool:
    """Return True if the position of a sensor, taken as degrees, would lie among the reports."""
    bounds = source.reports.bounds_deg
    if bounds is None:
        return False
    low, high = np.array(bounds[0]), np.array(bounds[1])
    margin = np.maximum(high - low, 0.01)
    return bool((low - margin <= sensor.position).all() and (sensor.position <= high + margin).all())


def _distance(sensor: Sensor, source: RecordedSource, time: Time) -> float | None:
    """Return the distance to the nearest track position, m; None if it is within a limit.

    The limit is the extent of all tracks, at least 1 km, plus the distance that the sensor can travel.
    """
    positions = np.concatenate([track.positions for track in source.tracks])
    extent = float(np.hypot(*np.ptp(positions, axis=0)))
    limit = max(extent, _MIN_DISTANCE) + sensor.platform.top_speed * time.step_period * time.num_steps
    nearest = float(np.hypot(*(positions - sensor.position).T).min())
    return nearest if nearest > limit else None
