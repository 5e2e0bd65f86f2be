"""State vectors of OpenSky by the names of its own tables, as CSV and Parquet files and as a frame."""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recordings import ORIGIN
from vedette.errors import InputError
from vedette.recorded import RecordedTargets, as_table
from vedette.recorded.reports import parse_reports
from vedette.scenarios import load_scenario
from vedette.scenarios.dumping import dump_stored
from vedette.scenarios.recorded_data import recorded_targets

START = 1591570800
# In the order of the tables of state vectors.
NAMES = [
    "time",
    "icao24",
    "lat",
    "lon",
    "velocity",
    "heading",
    "vertrate",
    "callsign",
    "onground",
    "alert",
    "spi",
    "squawk",
    "baroaltitude",
    "geoaltitude",
    "lastposupdate",
    "lastcontact",
]
ORIGIN_DEG = (ORIGIN.longitude_deg, ORIGIN.latitude_deg)


def vectors(**other: Any) -> list[dict[str, Any]]:
    """Two aircraft, one to the north-east and one to the south, heard every 2 s, a row a second."""
    found = []
    for icao24, place, velocity in (("a1b2c3", (0.0, 0.0), (60.0, 80.0)), ("4ca123", (5000.0, 100.0), (0.0, -150.0))):
        for k in range(6):
            heard = k - k % 2
            at = np.array(place) + heard * np.array(velocity)
            lon, lat = ORIGIN.to_degrees([at])[0].tolist()
            row = dict.fromkeys(NAMES, "")
            heading = float(np.degrees(np.arctan2(*velocity))) % 360.0
            said = {"time": START + k, "icao24": icao24, "lat": lat, "lon": lon, "heading": heading, "onground": False}
            said |= {
                "velocity": float(np.hypot(*velocity)),
                "baroaltitude": 9144.0,
                "lastposupdate": START + heard - 0.25,
            }
            found.append({**row, **said, **other})
    return found


def write(path: Path, rows: list[dict[str, Any]]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, NAMES)
        writer.writeheader()
        writer.writerows(rows)
    return path


def columns(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    return {name: [row[name] for row in rows] for name in rows[0]}


def test_aircraft_are_where_they_were_last_heard(tmp_path: Path) -> None:
    rows = vectors()
    rows.insert(3, {**rows[0], "lat": "", "lon": "NULL", "lastposupdate": ""})  # a state vector without a position
    targets = RecordedTargets.from_file(write(tmp_path / "states.csv", rows), origin_deg=ORIGIN_DEG)
    assert [(track.name, len(track.times)) for track in targets.tracks] == [("4ca123", 3), ("a1b2c3", 3)]
    assert targets.reports.notes == ("left out: 1 row without a position",)
    south, east = targets.tracks
    np.testing.assert_allclose(east.times, START - 0.25 + np.array([0.0, 2.0, 4.0]))
    np.testing.assert_allclose(east.positions, [[0.0, 0.0], [120.0, 160.0], [240.0, 320.0]], atol=1e-3)
    # Headings are from true north at the place of the aircraft.
    for track, velocity in ((east, [60.0, 80.0]), (south, [0.0, -150.0])):
        axes = ORIGIN.axes(*ORIGIN.to_degrees(track.positions).T)
        np.testing.assert_allclose(track.velocities, axes @ velocity, rtol=1e-9)


def test_files_and_frames_say_the_same(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    rows = [{**row, **{name: None for name, cell in row.items() if cell == ""}} for row in vectors()]
    parquet.write_table(pa.Table.from_pylist(rows), tmp_path / "states.parquet")
    one = RecordedTargets.from_file(tmp_path / "states.parquet", origin_deg=ORIGIN_DEG)
    other = RecordedTargets.from_columns(columns(vectors()), origin_deg=ORIGIN_DEG)
    for track, expected in zip(one.tracks, other.tracks, strict=True):
        assert track.name == expected.name
        np.testing.assert_array_equal(track.positions, expected.positions)
        np.testing.assert_array_equal(track.velocities, expected.velocities)


def test_columns_with_gaps_are_not_used() -> None:
    rows = vectors()
    rows[0]["velocity"] = None
    found = parse_reports(as_table(columns(rows)))
    assert found.velocities is None
    rows = [{**row, "lastposupdate": None if k == 2 else row["lastposupdate"]} for k, row in enumerate(vectors())]
    found = parse_reports(as_table(columns(rows)))
    assert len(found.times) == 12  # the times are those of the rows then
    named = parse_reports(as_table(columns(vectors())), columns={"id": "icao24", "longitude": "lon", "latitude": "lat"})
    assert named.velocities is None  # as was asked for


@pytest.mark.parametrize(
    ("name", "cell", "message"),
    [
        ("lat", "95", "row 3, column 'lat': expected a latitude in degrees, at most 90; got '95'"),
        ("lon", "east", "row 3, column 'lon': expected a finite number; got 'east'"),
        ("heading", "400", "row 3, column 'heading': expected a number from -360 to 360; got '400'"),
        ("velocity", "fast", "row 3, column 'velocity': expected a finite number; got 'fast'"),
        ("lastposupdate", "now", "row 3, column 'lastposupdate': expected a finite number; got 'now'"),
    ],
)
def test_bad_cells_are_named(tmp_path: Path, name: str, cell: str, message: str) -> None:
    rows = vectors()
    rows[0]["lastposupdate"] = START - 1.25
    rows[1][name] = cell
    with pytest.raises(InputError) as error:
        RecordedTargets.from_file(write(tmp_path / "states.csv", rows))
    assert message in str(error.value)


def test_a_scenario_takes_them_without_naming_columns(tmp_path: Path) -> None:
    file = write(tmp_path / "states.csv", vectors())
    targets = {"kind": "recorded", "path": str(file), "crop": False}
    text = f"""
name: air
time: {{num_steps: 5, step_period: 1.0}}
origin: {{lon: -1.1171, lat: 50.7865}}
region: {{x_min: -9e3, x_max: 9e3, y_min: -9e3, y_max: 9e3}}
birth: {{sites: [{{existence: 0.1, mean: [0, 0, 0, 0], std: [100, 100, 50, 50]}}]}}
targets: {json.dumps(targets)}
sensors: [{{position: [0, 0]}}]
"""
    (tmp_path / "air.yaml").write_text(text, "utf-8")
    scenario = load_scenario(tmp_path / "air.yaml")
    model: Any = scenario.model
    assert len(recorded_targets(model, scenario.folder).tracks) == 2
    (tmp_path / "kept.yaml").write_text(dump_stored(scenario), "utf-8")
    kept: Any = load_scenario(tmp_path / "kept.yaml").model.targets
    assert kept.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
