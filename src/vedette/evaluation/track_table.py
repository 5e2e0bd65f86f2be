"""Estimated tracks for other programs: named columns, longitude and latitude, UTC, in files of five formats."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vedette.densities.estimates import joined_mode_probs
from vedette.densities.inspection import state_columns
from vedette.errors import InputError
from vedette.evaluation.joining import Join, track_names
from vedette.evaluation.metrics.matching import match_run
from vedette.evaluation.recording_metadata import recording_metadata
from vedette.evaluation.track_formats import czml, geojson, mcap, utc_text
from vedette.internal.extras import require_packages
from vedette.internal.files import write_file
from vedette.internal.text import spreadsheet_text
from vedette.kernels.base.types import VY
from vedette.platforms.compass import courses_of
from vedette.scenarios import Scenario
from vedette.simulation.records import RunRecord


def table_of_run(record: RunRecord, scenario: Scenario, joins: Sequence[Join] = ()) -> dict[str, list[Any]]:
    """Return the estimates of a run by columns, one row for each.

    `time_s` is in the clock of the recording, if any, and `utc` if that counts from 1970. `label` is `birth
    step.index`. `track` is the first label of its track, different from `label` after a gap that `joins` close. `x_m`,
    `y_m`, `vx_mps`, `vy_mps` are the estimate, `std_...` its standard deviations (velocities only if the state has
    them: four components or more, with heights also `z_m`, `vz_mps`), `existence` is the existence probability.
    `lon_deg`, `lat_deg` need an origin. `course_deg`, clockwise from true north, and `speed_mps` need a compass.
    `target` is the name (by default `id + 1`) of the true target that OSPA's assignment gives it, nearer than the
    cutoff of OSPA, or None. With classes of targets, `class` is the most probable one and `prob_...` the probability of
    each.

    joins: see `vedette.evaluation.joining`.
    """
    model = scenario.model
    start, is_utc, names = recording_metadata(record, scenario)
    matching = match_run(record.truth, record.estimates, cutoff=model.ospa.cutoff, order=1.0)
    matched_targets = dict(
        zip(
            zip(matching.scans.tolist(), map(tuple, matching.labels.tolist()), strict=True),
            record.truth.ids[matching.truth_rows].tolist(),
            strict=True,
        )
    )
    rows = [
        (scan, tuple(label), mean, cov, existence)
        for scan, estimate in enumerate(record.estimates)
        for label, mean, cov, existence in zip(
            estimate.labels.tolist(), estimate.means, estimate.covs, estimate.existence.tolist(), strict=True
        )
    ]
    times = [float(record.times[row[0]]) + start for row in rows]
    table: dict[str, list[Any]] = {"time_s": times}
    if is_utc:
        table["utc"] = [utc_text(time) for time in times]
    tracks = track_names(joins)
    table["label"] = [_label(label) for _, label, *_ in rows]
    table["track"] = [_label(tracks.get(label, label)) for _, label, *_ in rows]
    dim = len(rows[0][2]) if rows else 4
    means, covs = (np.array([row[part] for row in rows]) for part in (2, 3))
    table |= state_columns(means.reshape(-1, dim), covs.reshape(-1, dim, dim), model.motion.components)
    if model.origin is not None:
        positions = model.origin.build().to_degrees(np.array([row[2][:2] for row in rows]).reshape(-1, 2))
        table["lon_deg"], table["lat_deg"] = positions[:, 0].tolist(), positions[:, 1].tolist()
    if model.by_compass and dim > VY:
        courses = courses_of(model.north(), means.reshape(-1, dim))
        table["course_deg"], table["speed_mps"] = courses[:, 0].tolist(), courses[:, 1].tolist()
    table["existence"] = [row[4] for row in rows]
    if model.classes:
        classes = tuple(model.classes)
        probs = np.concatenate([estimate.class_probs for estimate in record.estimates])
        table["class"] = [classes[k] for k in probs.argmax(axis=1).tolist()]
        table |= {f"prob_{name}": probs[:, k].tolist() for k, name in enumerate(classes)}
    if modes := model.mode_names:
        probs = joined_mode_probs(record.estimates, len(modes))
        table["mode"] = [modes[k] for k in probs.argmax(axis=1).tolist()]
        table |= {f"prob_{name}": probs[:, k].tolist() for k, name in enumerate(modes)}
    table["target"] = [_name(matched_targets.get((row[0], row[1])), names) for row in rows]
    return table


def write_tracks(path: Path, table: Mapping[str, Sequence[Any]]) -> None:
    """Write a track table in the format of its file's ending: .csv, .parquet, .geojson, .czml or .mcap.

    The file appears whole or not at all. The contents of the last three are in `vedette.evaluation.track_formats`. A
    table of scans can be written, too, as .csv or .parquet.

    Raises:
        InputError: another ending, a file that cannot be written, or tracks without longitudes in the last three.
        MissingPackageError: the package that writes the format is not installed.
    """
    check_format(path)
    content = _ENCODERS[path.suffix.lower()](table)
    write_file(path, lambda file: file.write(content), make_folder=True)


def check_format(path: Path) -> None:
    """Check that `write_tracks` knows the ending of a file, and that the package that writes it is installed.

    Raises `InputError` for another ending, `MissingPackageError` for a missing package.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{path}: expected a file that ends with {', '.join(ENDINGS)}; got {ending or 'none'}")
    if package := _PACKAGES.get(ending):
        require_packages(f"writing {ending} files", package)


def _label(label: tuple[int, ...]) -> str:
    return ".".join(map(str, label))


def _name(target: int | None, names: Sequence[str]) -> str | None:
    if target is None:
        return None
    return names[target] if target < len(names) else str(target + 1)


def _csv(table: Mapping[str, Sequence[Any]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    for cells in zip(*table.values(), strict=True):
        writer.writerow([spreadsheet_text(cell) if isinstance(cell, str) else cell for cell in cells])
    return text.getvalue().encode()


def _parquet(table: Mapping[str, Sequence[Any]]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    texts = {"utc", "label", "track", "target", "sensor", "class"}
    arrays = {name: pa.array(cells, pa.string() if name in texts else pa.float64()) for name, cells in table.items()}
    content = io.BytesIO()
    parquet.write_table(pa.table(arrays), content, compression="zstd")
    return content.getvalue()


_ENCODERS = {".csv": _csv, ".parquet": _parquet, ".geojson": geojson, ".czml": czml, ".mcap": mcap}
ENDINGS = tuple(_ENCODERS)
_PACKAGES = {".parquet": "pyarrow", ".mcap": "mcap"}
