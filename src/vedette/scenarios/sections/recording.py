"""The section about recorded scans, which replace simulated ones."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, QUANTITIES, in_file
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import SHA256_FIELD, NonNegative, Section, Sha256, is_complete, readable_findings
from vedette.scenarios.sections.field_of_view import max_range

if TYPE_CHECKING:
    from vedette.recorded import Origin, RecordedScans, RecordedSensor
    from vedette.recorded.returns import ReturnsModel
    from vedette.scenarios.sections.scenario import ScenarioModel
    from vedette.scenarios.sections.sensors import Sensor

_ASSUMED_DETECTION = 0.9  # where a detection model has no constant probability


class RecordingSection(Section):
    """Scans from a CSV or Parquet file with a row a measurement: time, sensor, and what it measured.

    The sensors are as `sensors` says, at their positions unless a row has `own_x` and `own_y`, or `own_lon` and
    `own_lat`, and `own_heading`. Standard deviations of a row (`range_std_m`, `bearing_std_deg`, `x_std_m`, ... and
    `xy_correlation`) replace the noise of the sensor; `snr_db` counts for a sensor with `signal`, `class` and
    `size_m` for one with `classification`; a row may lack an altitude, elevation or range rate. Of range rates `own_vx`
    and `own_vy` say how the sensor moves; else it is at rest.
    A row with empty cells says that a sensor scanned and found nothing.
    Rows beyond a sensor's reach, or far beyond all others, are left out and named.
    """

    path: str = Field(min_length=1, description="CSV or Parquet file, relative to the scenario file [-].")
    sha256: Sha256 | None = Field(default=None, description=SHA256_FIELD)
    columns: dict[str, str] = Field(
        default={},
        description="Names of the columns of time, sensor, range, bearing, range_rate, x, y, lon, lat, own_x, own_y, "
        "own_lon, own_lat, own_heading, own_vx, own_vy, where they differ from these, with or without a unit at "
        "the end (range_km) [-].",
    )
    units: dict[str, str] = Field(
        default={},
        description="Units of quantities whose columns do not name them: m, km, nmi, ft; deg, rad; mps, kmh, kn; of "
        "heights also fl [-].",
    )
    bearings: Literal["east", "north"] | None = Field(
        default=None,
        description="From where bearings and headings count: north, clockwise (a compass), or east, counter-clockwise; "
        "none: as each sensor tells them (compass), or there are none [-].",
    )
    scan_window: NonNegative = Field(
        default=0.0, description="Rows of a sensor within this time after its first are one scan [s]."
    )
    turns: Literal["found", "none"] = Field(
        default="found",
        description="Whether a sensor without `turn` is taken for a turning radar where the bearings and times of its "
        "rows show that it is one; a scan is then one turn, whatever `scan_window` says [-].",
    )
    extents: Literal["found", "none"] = Field(
        default="found",
        description="Whether sensors without `extent` get the extent that their scans show where targets give several "
        "returns; a scan then has one measurement a target, with the mean of its returns and their spread [-].",
    )
    empty_scans: Literal["found", "none"] = Field(
        default="found",
        description="Whether a scan of a sensor with a regular period is taken for empty where it has no row; not for "
        "sensors with rows of empty cells, in gaps that are outages, or where rows come by target [-].",
    )
    ignore: Literal["none", "stationary"] = Field(
        default="none",
        description="Whether measurements of places that are measured all through the recording are left out, such as "
        "those of land, buoys and anchored ships [-].",
    )
    bad_rows: Literal["refuse", "skip"] = Field(
        default="refuse", description="Whether a row that cannot be read is an error, or left out and told of [-]."
    )

    def build(self, world: ScenarioModel, folder: Path, *, as_told: bool = False) -> RecordedScans:
        """Return the scans, without the sensors' biases unless `as_told`; an unchanged file is read only once.

        Raises `InputError` for a file that cannot be read, with row and column.
        """
        file = folder / self.path
        try:
            state = os.stat(file)
        except (OSError, ValueError):
            state = None
        from vedette.models.bias import NO_BIAS

        origin = None if world.origin is None else world.origin.build()
        changed = state and (state.st_mtime_ns, state.st_size)
        sites = recorded_sensors(world)
        if as_told:
            sites = [replace(site, bias=NO_BIAS) for site in sites]
        return _read(str(file), changed, self.model_dump_json(), tuple(sites), returns_models(world), origin)


@lru_cache(maxsize=4)
def _read(
    file: str,
    changed: tuple[int, int] | None,
    section: str,
    sites: tuple[RecordedSensor, ...],
    returns: tuple[ReturnsModel, ...],
    origin: Origin | None,
) -> RecordedScans:
    """Return the scans of a file with this time of change; the section is JSON, as mappings cannot be hashed."""
    from vedette.recorded import Conventions, parse_scans
    from vedette.recorded.files import read_table
    from vedette.recorded.merging import merged
    from vedette.recorded.returns import extents_of
    from vedette.recorded.stationary import without_stationary

    own = RecordingSection.model_validate_json(section)
    conventions = Conventions(own.columns, own.units, own.bearings, own.scan_window, own.bad_rows, own.empty_scans)
    recording = parse_scans(read_table(file, sha256=own.sha256), sites, conventions, origin)
    if own.ignore == "stationary":
        recording = without_stationary(recording, sites, returns)
    return merged(recording, sites, extents_of(recording, sites, returns))


def returns_models(world: ScenarioModel) -> tuple[ReturnsModel, ...]:
    """Return for each sensor its extent, or the assumed parameters that an extent is learnt from."""
    from vedette.recorded.returns import ReturnsModel

    found = list[ReturnsModel]()
    learnt = world.recording is not None and world.recording.extents == "found"
    for sensor in world.sensors:
        extent = sensor.extent if sensor.extent is not None or learnt else 0.0
        probability = float(getattr(sensor.detection, "probability", _ASSUMED_DETECTION))
        found.append(ReturnsModel(extent, noise_stds(sensor), probability))
    return tuple(found)


def noise_stds(sensor: Sensor) -> tuple[float, ...] | None:
    """Return the lowest standard deviation of each measured component, rad and m; None for custom noise."""
    noise = sensor.noise
    if noise.kind == "range_dependent":
        names = COMPONENTS.get(sensor.measurement.kind, ())
        return tuple(QUANTITIES[name].in_si * getattr(noise, f"sigma_{in_file(name)}") for name in names)
    return tuple(noise.std) if noise.kind in ("constant", "by_axis") else None


def recorded_sensors(world: ScenarioModel) -> list[RecordedSensor]:
    """Return the sensors of a recording."""
    from vedette.recorded import RecordedSensor

    north = world.north()
    shown_by_rows = "none" if world.recording is None else world.recording.turns
    return [
        RecordedSensor(
            name,
            sensor.measurement.kind,
            sensor.pose,
            sensor.bias.build(),
            sensor.compass,
            max_range(sensor),
            north,
            shown_by_rows if sensor.turn is None else sensor.turn.build(),
            None if sensor.signal is None else sensor.signal.build(),
            None if sensor.classification is None else sensor.classification.build(world.classes),
        )
        for name, sensor in zip(world.sensor_names, world.sensors, strict=True)
    ]


def recording_findings(world: ScenarioModel, folder: Path) -> Iterator[Finding]:
    """Yield faults of recorded scans, and of sections that do not suit them."""
    section = world.recording
    if section is None:
        return
    yield from readable_findings(_content(section, world, folder))
    if world.targets.kind not in ("recorded", "unknown"):
        yield ("targets", "kind"), "recorded or unknown, as the scans are recorded", describe(world.targets.kind)
    if world.decision_steps:
        wanted = "no decisions, as it is recorded where the sensors went"
        yield ("control",), wanted, f"{len(world.decision_steps)} of them"


def _content(section: RecordingSection, world: ScenarioModel, folder: Path) -> Iterator[Finding]:
    if not is_complete(section):
        return
    try:
        section.build(world, folder)
    except InputError as error:
        yield ("recording",), "scans that can be read", str(error)
