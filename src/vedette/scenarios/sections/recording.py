"""The section about recorded scans, which replace simulated ones."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.internal.quantities import COMPONENTS, QUANTITIES, in_file
from vedette.scenarios.sections.base import SHA256_FIELD, NonNegative, Section, Sha256

if TYPE_CHECKING:
    from vedette.recorded import Origin, RecordedScans, RecordedSensor
    from vedette.recorded.returns import ReturnsModel
    from vedette.scenarios.sections.sensors import Sensor


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

    def build(
        self, sites: tuple[RecordedSensor, ...], returns: tuple[ReturnsModel, ...], origin: Origin | None, folder: Path
    ) -> RecordedScans:
        """Return the scans of these sensors; an unchanged file is read only once.

        Raises `InputError` for a file that cannot be read, with row and column.
        """
        file = folder / self.path
        try:
            state = os.stat(file)
        except (OSError, ValueError):
            state = None
        changed = state and (state.st_mtime_ns, state.st_size)
        return _read(str(file), changed, self.model_dump_json(), sites, returns, origin)


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


def noise_stds(sensor: Sensor) -> tuple[float, ...] | None:
    """Return the lowest standard deviation of each measured component, rad and m; None for custom noise."""
    noise = sensor.noise
    if noise.kind == "range_dependent":
        names = COMPONENTS.get(sensor.measurement.kind, ())
        return tuple(QUANTITIES[name].in_si * getattr(noise, f"sigma_{in_file(name)}") for name in names)
    return tuple(noise.std) if noise.kind in ("constant", "by_axis") else None
