"""Recorded trajectories: reading, cleaning, projecting, interpolating."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from vedette.errors import InputError
from vedette.models import Region
from vedette.recorded import Cleaning, RecordedTargets
from vedette.recorded.cleaning import longest_reachable
from vedette.recorded.geography import Origin

SEMI_MAJOR_AXIS = 6378137.0  # m, of WGS 84
RNG = np.random.default_rng(0)


def circling(times, radius=500.0, rate=0.02):
    angle = rate * np.asarray(times)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), radius * rate * np.stack(
        [-np.sin(angle), np.cos(angle)], axis=1
    )


def table(**columns):
    return {"time": [0.0, 10.0, 20.0], "id": ["a", "a", "a"], "x": [0.0, 50.0, 100.0], "y": [0.0, 0.0, 0.0], **columns}


def test_a_straight_track_is_exact():
    truth = RecordedTargets.from_columns(table()).truth([1.0, 4.0, 16.0, 30.0], rng=RNG)
    truth.validate()
    np.testing.assert_array_equal(truth.offsets, [0, 1, 2, 3, 3])
    np.testing.assert_allclose(truth.states, [[0, 0, 5, 0], [15, 0, 5, 0], [75, 0, 5, 0]], atol=1e-12)


@pytest.mark.parametrize("with_velocity", [False, True])
def test_a_circle_is_followed(with_velocity):
    times = np.arange(0.0, 101.0, 5.0)
    places, speeds = circling(times)
    columns: dict[str, Any] = {"time": times, "id": [4] * 21, "x": places[:, 0], "y": places[:, 1]}
    if with_velocity:
        columns |= {"vx": speeds[:, 0], "vy": speeds[:, 1]}
    scans = np.arange(10.0, 90.0, 1.7)
    truth = RecordedTargets.from_columns(columns, time_origin=10.0).truth(scans, rng=RNG)
    places, speeds = circling(scans)
    np.testing.assert_allclose(truth.states[:, :2], places, atol=0.002 if with_velocity else 0.05)
    np.testing.assert_allclose(truth.states[:, 2:], speeds, atol=0.002 if with_velocity else 0.05)


def test_csv_parquet_and_memory_agree(tmp_path):
    columns: dict[str, Any] = {
        "time": [0.0, 4.0, 2.0, 8.0, 6.0],
        "id": ["b", "a", "a", "b", "b"],
        "x": [1.0, 2.0, 3.0, 4.0, 5.0],
        "y": [5.0, 4.0, 3.0, 2.0, 1.0],
        "note": ["", "ä", "x", "y", "z"],
    }
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "tracks.csv").write_text("\ufeff" + "\n".join(lines) + "\n\n", encoding="utf-8")
    parquet.write_table(pyarrow.table(columns), tmp_path / "tracks.parquet")
    sources = [
        RecordedTargets.from_columns(columns),
        RecordedTargets.from_file(tmp_path / "tracks.csv"),
        RecordedTargets.from_file(str(tmp_path / "tracks.parquet")),
    ]
    truths = [source.truth([0.0, 2.0, 4.0, 7.0], rng=RNG) for source in sources]
    assert [track.name for track in sources[0].tracks] == ["b", "a"]
    for truth in truths[1:]:
        np.testing.assert_array_equal(truth.states, truths[0].states)
        np.testing.assert_array_equal(truth.ids, truths[0].ids)


def test_columns_of_other_names_and_iso_times():
    columns: dict[str, Any] = {
        "When": ["2016-01-12T13:02:11", "2016-01-12 13:02:21+00:00", "2016-01-12T14:02:31+01:00"],
        "MMSI": [235, 235, 235],
        "lon": [-1.1, -1.099, -1.098],
        "lat": [50.75, 50.75, 50.75],
    }
    names = {"time": "When", "id": "MMSI", "longitude": "lon", "latitude": "lat"}
    targets = RecordedTargets.from_columns(columns, columns=names, origin_deg=(-1.1, 50.75))
    assert targets.reports.origin_deg == (-1.1, 50.75)
    truth = targets.truth([100.0, 110.0], rng=RNG)
    np.testing.assert_allclose(truth.states[0, :2], 0.0, atol=1e-9)
    width = math.radians(0.001) * math.cos(math.radians(50.75)) * SEMI_MAJOR_AXIS * 1.002
    np.testing.assert_allclose(truth.states[1, :2], [width, 0.0], atol=0.05)
    late = RecordedTargets.from_columns(columns, columns=names, time_origin="2016-01-12T13:02:21")
    np.testing.assert_allclose(late.truth([0.0], rng=RNG).states[0, :2], 0.0, atol=1e-9)


def test_tangent_plane_against_radii_of_curvature():
    """Near the origin: meridional and prime-vertical radii of WGS 84 in closed form."""
    latitude, eccentricity_squared = math.radians(50.0), 0.00669437999014
    curvature = 1.0 - eccentricity_squared * math.sin(latitude) ** 2
    north = SEMI_MAJOR_AXIS * (1 - eccentricity_squared) / curvature**1.5
    east = SEMI_MAJOR_AXIS / math.sqrt(curvature) * math.cos(latitude)
    plane = Origin(8.0, 50.0).to_plane([8.0, 8.001, 8.0], [50.0, 50.0, 50.001])
    expected = np.array([[0, 0], [east * math.radians(0.001), 0], [0, north * math.radians(0.001)]])
    np.testing.assert_allclose(plane, expected, atol=2e-3)
    np.testing.assert_allclose(np.hypot(*Origin(8.0, 50.0).to_plane([9.4], [50.0])[0]), 100e3, rtol=5e-3)


def test_jumps_are_removed_wherever_they_are():
    times, x = np.arange(10.0), 5.0 * np.arange(10.0)
    for bad in range(10):
        jumped = x.copy()
        jumped[bad] = 3.9e6
        columns: dict[str, Any] = {"time": times, "id": [1] * 10, "x": jumped, "y": np.zeros(10)}
        targets = RecordedTargets.from_columns(columns, cleaning=Cleaning(max_speed=20.0))
        assert targets.counts.jumps == 1
        np.testing.assert_array_equal(targets.tracks[0].positions[:, 0], np.delete(x, bad))


def test_as_few_reports_as_possible_are_removed():
    """Against the enumeration of all subsets."""
    rng = np.random.default_rng(8)
    for _ in range(40):
        times, places = np.cumsum(rng.uniform(0.5, 2.0, 8)), rng.normal(0.0, 6.0, (8, 2))
        chains = (
            kept
            for size in range(8, 0, -1)
            for kept in itertools.combinations(range(8), size)
            if all(math.dist(places[a], places[b]) <= 5.0 * (times[b] - times[a]) for a, b in itertools.pairwise(kept))
        )
        found = longest_reachable(times, places, 5.0)
        assert len(found) == len(next(chains))
        assert all(math.dist(places[a], places[b]) <= 5.0 * (times[b] - times[a]) for a, b in itertools.pairwise(found))


def test_a_silence_splits_a_track():
    columns: dict[str, Any] = {
        "time": [0.0, 10.0, 100.0, 110.0, 400.0],
        "id": [1] * 5,
        "x": np.arange(5.0),
        "y": np.zeros(5),
    }
    targets = RecordedTargets.from_columns(columns, cleaning=Cleaning(max_gap=60.0))
    assert [(track.times[0], track.times[-1]) for track in targets.tracks] == [(0.0, 10.0), (100.0, 110.0)]
    assert (targets.counts.tracks, targets.counts.short_tracks) == (2, 1)
    truth = targets.truth([0.0, 50.0, 105.0], rng=RNG)
    np.testing.assert_array_equal(truth.ids, [0, 1])


def test_leaving_the_region_ends_a_track():
    x = [0.0, 50.0, 150.0, 160.0, 60.0, 10.0]
    columns: dict[str, Any] = {"time": np.arange(6.0), "id": [1] * 6, "x": x, "y": np.zeros(6)}
    targets = RecordedTargets.from_columns(columns, cleaning=Cleaning(region=Region(-100.0, 100.0, -100.0, 100.0)))
    assert targets.counts.outside == 2
    assert [track.positions[:, 0].tolist() for track in targets.tracks] == [[0.0, 50.0], [60.0, 10.0]]


def test_moored_targets_are_dropped():
    columns = table(time=[0.0, 10.0, 0.0, 10.0], id=["ship", "ship", "buoy", "buoy"], x=[0, 80, 5, 6], y=[0, 0, 0, 0])
    targets = RecordedTargets.from_columns(columns, cleaning=Cleaning(min_speed=0.5))
    assert [track.name for track in targets.tracks] == ["ship"]
    assert targets.counts.slow_tracks == 1


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time": [], "id": [], "x": [], "y": []}, "table: expected at least one report; got none"),
        ({"time": [1.0], "id": [1], "x": [1.0]}, "table: expected a column 'y'; got columns time, id, x"),
        (table(x=[0.0, "far", 1.0]), "table, row 2, column 'x': expected a finite number; got 'far'"),
        (table(y=[0.0, 1.0, None]), "table, row 3, column 'y': expected a finite number; got None"),
        (table(y=[0.0, math.inf, 1.0]), "table, row 2, column 'y': expected a finite number; got inf"),
        (
            table(time=["2016-01-12", "1e308", "x"]),
            "table, row 2, column 'time': expected an ISO 8601 time; got '1e308'",
        ),
        (table(time=["2016-01-12", "inf", "x"]), "table, row 2, column 'time': expected an ISO 8601 time; got 'inf'"),
        (table(x=[0.0, 1e10, 1.0]), "table, row 2, column 'x': expected a number from -1e"),
        (table(x=[0.0, True, 1.0]), "table, row 2, column 'x': expected a finite number; got True"),
        (table(x=[0.0, "1_0", 1.0]), "table, row 2, column 'x': expected a finite number; got '1_0'"),
        (table(id=["a", " ", "a"]), "table, row 2, column 'id': expected a name or number; got ' '"),
        (table(time=["2016-01-12", "noon", "x"]), "table, row 2, column 'time': expected an ISO 8601 time; got 'noon'"),
        (table(vx=[1.0, "a", 1.0], vy=[0.0] * 3), "table, row 2, column 'vx'"),
        (table(time=[0.0]), "table: expected columns of one length"),
        (table(time=[0.0, 100.0, 200.0]), "recorded targets: expected at least one track after cleaning"),
        (
            {"time": [0.0], "id": [1], "longitude": [8.0], "latitude": [91.0]},
            "row 1, column 'latitude': expected a latitude in degrees, at most 90; got 91.0",
        ),
        (
            {"time": [0.0, 1.0, 2.0], "id": [1] * 3, "longitude": [8.0, 8.0, -170.0], "latitude": [50, 50, -50]},
            "row 3, column 'latitude': expected a place on the same side of the globe as the origin.*got -50",
        ),
    ],
)
def test_bad_tables_are_named(columns, message):
    with pytest.raises(InputError, match=message):
        RecordedTargets.from_columns(columns)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"columns": {"speed": "v"}}, "columns: expected time, id, x, y.*got speed"),
        ({"columns": {"x": "x", "longitude": "x"}}, "columns: expected either x and y, or longitude and latitude"),
        ({"columns": {"longitude": "lon", "latitude": "lat"}}, "expected a column 'lon'"),
        ({"columns": {"vx": "speed"}}, "expected a column 'speed'"),
        ({"origin_deg": (0.0, 0.0)}, "origin_deg: expected only for longitudes"),
        ({"time_origin": "yesterday"}, "time_origin: expected a number of seconds or an ISO 8601 time"),
        ({"time_origin": math.nan}, "time_origin"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        RecordedTargets.from_columns(table(), **options)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a column 'time'; got columns none"),
        ("time,id,x,y\n", "expected at least one report; got none"),
        ("time,id,x,y\n0,1,0,0\n1,1,0\n", "row 3: expected 4 cells, as in the header; got 3"),
        ("time,id,x,x\n", "row 1: expected each column name once"),
        ("time,id,x,y\n0,1,0,0\n\n1,1,zero,0\n", "row 4, column 'x': expected a finite number; got 'zero'"),
        ('time,id,x,y\n0,"1,0,0\n', "cannot be read as CSV"),
    ],
)
def test_bad_csv_is_named(tmp_path, text, message):
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=f"tracks.csv.*{message}"):
        RecordedTargets.from_file(path)


def test_files_that_are_not_tables(tmp_path):
    with pytest.raises(InputError, match="no such file; expected a table of records"):
        RecordedTargets.from_file(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"expected a file that ends with \.csv, \.parquet"):
        RecordedTargets.from_file(tmp_path / "tracks.xlsx")
    (tmp_path / "bytes.csv").write_bytes(b"time,id\n\xff\xfe,1\n")
    with pytest.raises(InputError, match="cannot be read as CSV in UTF-8"):
        RecordedTargets.from_file(tmp_path / "bytes.csv")
    (tmp_path / "text.parquet").write_text("time,id,x,y\n")
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        RecordedTargets.from_file(tmp_path / "text.parquet")


def test_scans_at_a_time_without_targets():
    with pytest.raises(InputError, match="times: expected scans between the first and last report, 0 to 20 s"):
        RecordedTargets.from_columns(table(), time_origin=500.0).truth([0.0, 1.0], rng=RNG)


def test_of_two_reports_at_one_time_the_first_is_kept_and_the_other_named():
    columns = table(time=[0.0, 5.0, 5.0 + 1e-9, 10.0], id=["a"] * 4, x=[0.0, 50.0, 99.0, 100.0], y=[0.0] * 4)
    targets = RecordedTargets.from_columns(columns)
    assert targets.reports.repeats == ((2, 3),)
    np.testing.assert_array_equal(targets.tracks[0].positions[:, 0], [0.0, 50.0, 100.0])
