"""Recorded scans: rows in anybody's units and conventions, and the scenario that a file about sensors makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recordings import ORIGIN, RADARS, SHIPS, silence, write_recording
from vedette.errors import InputError, ScenarioError
from vedette.evaluation import joining
from vedette.evaluation.joining import joins_of_run, with_joined_tracks
from vedette.evaluation.runs import measure_run, run_scenario
from vedette.evaluation.scans import scan_table, scans_of_record
from vedette.evaluation.track_table import table_of_run, write_tracks
from vedette.models import Bias
from vedette.recorded import Conventions, Origin, RecordedScans, RecordedSensor, RecordedTargets, as_table, parse_scans
from vedette.recorded.files import read_table
from vedette.recorded.reports import parse_reports
from vedette.recorded.tables import Table
from vedette.scenarios import load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.recorded_data import recorded_sensors

SITES = (
    RecordedSensor("north", "bearing_range", (0.0, 0.0, 0.0)),
    RecordedSensor("south", "bearing_range", (100.0, 0.0, 0.0)),
)
ROWS = [
    {"time": "0.0", "sensor": "north", "range": "1000", "bearing_rad": "0.5"},
    {"time": "0.0", "sensor": "2", "range": "500", "bearing_rad": "-0.5"},
    {"time": "2.5", "sensor": "north", "range": "1001", "bearing_rad": "0.6"},
    {"time": "2.5", "sensor": "north", "range": "700", "bearing_rad": "3.0"},
    {"time": "5.0", "sensor": "south", "range": "", "bearing_rad": " "},
]


def table(rows: list[dict[str, Any]]) -> Table:
    return Table({name: [row[name] for row in rows] for name in rows[0]}, range(2, len(rows) + 2), "scans.csv")


def parsed(
    rows: list[dict[str, Any]] = ROWS, sites: Any = SITES, origin: Origin | None = None, **conventions: Any
) -> RecordedScans:
    given: dict[str, Any] = {"columns": {}, "units": {}, "bearings": "east", **conventions}
    return parse_scans(table(rows), sites, Conventions(**given), origin)


def changed(row: int, **cells: Any) -> list[dict[str, Any]]:
    return [{**one, **cells} if i == row else one for i, one in enumerate(ROWS)]


def renamed(names: Mapping[str, str], rows: list[dict[str, Any]] = ROWS) -> list[dict[str, Any]]:
    return [{names.get(name, name): cell for name, cell in row.items()} for row in rows]


def test_rows_of_one_time_and_sensor_are_a_scan_and_empty_cells_a_scan_of_nothing() -> None:
    found = parsed()
    assert found.times.tolist() == [0.0, 2.5, 5.0]
    assert (found.start, found.is_utc, found.num_measurements, found.skipped) == (0.0, False, 4, ())
    first, second, third = found.scans
    assert first[0] is not None
    assert first[1] is not None
    np.testing.assert_array_equal(first[0], [[0.5, 1000.0]])
    np.testing.assert_array_equal(first[1], [[-0.5, 500.0]])
    assert second[0] is not None
    np.testing.assert_array_equal(second[0], [[0.6, 1001.0], [3.0, 700.0]])
    assert second[1] is None
    assert third[0] is None
    assert isinstance(third[1], np.ndarray)
    assert third[1].shape == (0, 2)
    np.testing.assert_array_equal(found.poses[:, 1, :2], [[100.0, 0.0]] * 3)


def test_frames_are_tables() -> None:
    class Frame:
        """As pandas and Polars have theirs."""

        columns = ("time", "sensor", "range", "bearing_rad")

        def __getitem__(self, name: str) -> Any:
            empty = {"range": [math.nan], "bearing_rad": [math.nan]}
            return [*[row[name] for row in ROWS[:4]], *empty.get(name, [ROWS[4][name]])]

    found, expected = parse_scans(as_table(Frame()), SITES, Conventions({}, {}, "east")), parsed()
    assert found.times.tolist() == expected.times.tolist()
    scans = list(found.arrivals())
    assert [(scan.sensor, scan.time, len(scan.measurements)) for scan in scans] == [
        (0, 0.0, 1), (1, 0.0, 1), (0, 2.5, 2), (1, 5.0, 0),
    ]  # fmt: skip
    with pytest.raises(InputError, match="table: expected columns by name, or a data frame; got int"):
        as_table(3)
    with pytest.raises(InputError, match="table: expected columns of one length"):
        as_table({"time": [1.0], "sensor": []})


def test_rows_may_come_in_any_order() -> None:
    shuffled = parsed([ROWS[i] for i in (4, 3, 0, 2, 1)])
    assert shuffled.times.tolist() == [0.0, 2.5, 5.0]
    assert isinstance(shuffled.scans[1][0], np.ndarray)
    assert sorted(shuffled.scans[1][0][:, 1].tolist()) == [700.0, 1001.0]


@pytest.mark.parametrize(
    ("names", "conventions", "factor"),
    [
        ({"range": "range_km"}, {}, 1000.0),
        ({"range": "range_nmi"}, {}, 1852.0),
        ({"range": "distance"}, {}, 1.0),
        ({"range": "Entfernung"}, {"columns": {"range": "Entfernung"}, "units": {"range": "km"}}, 1000.0),
        ({"range": "d_nmi"}, {"columns": {"range": "d_nmi"}}, 1852.0),
        ({}, {"units": {"range": "nmi"}}, 1852.0),
    ],
)
def test_lengths_are_in_the_unit_that_is_named(names: Any, conventions: Any, factor: float) -> None:
    scan = parsed(renamed(names), **conventions).scans[0][0]
    assert isinstance(scan, np.ndarray)
    assert scan[0, 1] == 1000.0 * factor


def test_a_compass_counts_clockwise_from_north_in_degrees() -> None:
    for compass, bearing in ((0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (270.0, 180.0), (-30.0, 120.0), (359.0, 91.0)):
        rows = renamed(
            {"bearing_rad": "bearing_deg"}, [{**ROWS[0], "bearing_rad": compass, "own_heading_deg": compass}]
        )
        found = parsed(rows, bearings="north")
        assert isinstance(found.scans[0][0], np.ndarray)
        assert math.cos(found.scans[0][0][0, 0] - math.radians(bearing)) == pytest.approx(1.0, abs=1e-12)
        assert math.cos(found.poses[0, 0, 2] - math.radians(bearing)) == pytest.approx(1.0, abs=1e-12)


def test_places_in_degrees_are_measured_and_sensors_carry_their_own() -> None:
    sites = [RecordedSensor("drone", "position", (0.0, 0.0, 0.0))]
    row = {"time": 0, "sensor": "drone", "lon": -1.12, "lat": 50.79, "own_lon": -1.13, "own_lat": 50.78}
    found = parsed([row], sites, ORIGIN)
    assert isinstance(found.scans[0][0], np.ndarray)
    np.testing.assert_array_equal(found.scans[0][0], ORIGIN.to_plane([-1.12], [50.79]))
    np.testing.assert_array_equal(found.poses[0, :, :2], ORIGIN.to_plane([-1.13], [50.78]))
    plane = parsed([{"time": 0, "sensor": "1", "x": 5, "y": "7.5", "own_x": 1, "own_y": 2}], sites)
    assert isinstance(plane.scans[0][0], np.ndarray)
    assert (plane.scans[0][0].tolist(), plane.poses[0, 0, :2].tolist()) == ([[5.0, 7.5]], [1.0, 2.0])


@pytest.mark.parametrize("swapped", [{"lon": 50.79, "lat": -1.12}, {"own_lon": 50.78, "own_lat": -1.13}])
def test_exchanged_longitude_and_latitude_are_reported(swapped: dict[str, float]) -> None:
    sites = [RecordedSensor("drone", "position", (0.0, 0.0, 0.0))]
    row = {"time": 0, "sensor": "drone", "lon": -1.12, "lat": 50.79, "own_lon": -1.13, "own_lat": 50.78}
    lon, lat = swapped
    wanted = f"expected with latitude {swapped[lat]:g} a longitude within 1000 km of the origin .are they exchanged"
    with pytest.raises(InputError, match=f"row 2, column '{lon}': {wanted}.*; got {swapped[lon]:g}"):
        parsed([{**row, **swapped}], sites, ORIGIN)
    with pytest.raises(InputError, match="column 'lon': expected with latitude -50"):  # where no plane is
        parsed([{**row, "lon": 178.0, "lat": -50.0}], sites, ORIGIN)
    found = parsed([row, {**row, **swapped}], sites, ORIGIN, bad_rows="skip")
    assert (found.num_measurements, len(found.skipped)) == (1, 1)


def test_rows_of_one_turn_of_the_antenna_are_gathered() -> None:
    rows = [{**ROWS[0], "time": time, "range": 1000 + i} for i, time in enumerate((0.0, 1.0, 2.0, 5.0, 5.5))]
    found = parsed(rows, scan_window=2.5)
    assert found.times.tolist() == [0.0, 4.25]
    assert [len(scan) for scans in found.scans for scan in scans if scan is not None] == [3, 2]
    assert found.start == 1.0


def test_dates_are_utc() -> None:
    rows = [{**ROWS[0], "time": text} for text in ("2016-01-12T13:02:21Z", "2016-01-12T14:02:23.5+01:00")]
    found = parsed(rows)
    assert (found.is_utc, found.times.tolist(), found.start) == (True, [0.0, 2.5], 1452603741.0)


@pytest.mark.parametrize(
    ("rows", "conventions", "message"),
    [
        (changed(3, range="far"), {}, "scans.csv, row 5, column 'range': expected a finite number; got 'far'"),
        (changed(3, range="nan"), {}, "scans.csv, row 5, column 'range': expected a finite number; got 'nan'"),
        (changed(3, range="-3"), {}, "row 5, column 'range': expected a number from 0 to 1e+09; got '-3'"),
        (changed(3, range=""), {}, "row 5, column 'range': expected a finite number; got ''"),
        (
            changed(3, bearing_rad="40"),
            {},
            "expected a number from -6.28319 to 6.28319; got '40'",
        ),
        (
            changed(3, sensor="east"),
            {},
            "column 'sensor': expected a sensor among 'north', 'south', or its number",
        ),
        (changed(3, sensor="3"), {}, "expected a sensor among 'north', 'south', or its number from 1; got '3'"),
        (changed(3, time="soon"), {}, "row 5, column 'time': expected a finite number of seconds; got 'soon'"),
        (changed(3, time="2016-01-12"), {}, "row 5, column 'time': expected a finite number of seconds"),
        (ROWS, {"bearings": None}, "column 'bearing_rad': expected bearings: north (clockwise, a compass) or east"),
        (renamed({"bearing_rad": "bearing"}), {}, "column 'bearing': expected a unit of bearing: a column bearing_deg"),
        (renamed({"range": "reach"}), {}, "expected a column of range, as sensor 'north' measures bearing_range; got"),
        (renamed({"time": "when"}), {}, "expected a column 'time'; got columns when, sensor, range, bearing_rad"),
        (ROWS, {"columns": {"range": "reach"}}, "expected a column 'reach'; got columns time, sensor"),
        (ROWS, {"columns": {"speed": "v"}}, "columns: expected quantities among time, sensor, bearing, range"),
        (renamed({"range": "rho_yd"}), {"columns": {"range": "rho_yd"}}, "column 'rho_yd': expected one of m, km, nmi"),
        (renamed({"range": "rho_deg"}), {"columns": {"range": "rho_deg"}}, "column 'rho_deg': expected one of m, km"),
        (ROWS, {"units": {"range": "yd"}}, "units.range: expected one of m, km, nmi, nm, ft; got yd"),
        (ROWS, {"scan_window": -1.0}, "scan_window: expected seconds, at least 0; got -1.0"),
        (
            changed(0, own_lon=1.0, own_lat=2.0)[:1],
            {},
            "expected an origin {lon: , lat: } for longitudes and latitudes",
        ),
    ],
)
def test_unreadable_values_are_reported(rows: Any, conventions: Any, message: str) -> None:
    with pytest.raises(InputError) as error:
        parsed(rows, **conventions)
    assert message in str(error.value)


def test_bad_rows_are_skipped_and_reported_on_request() -> None:
    found = parsed(changed(3, range="far"), bad_rows="skip")
    assert found.num_measurements == 3
    assert found.skipped == ("scans.csv, row 5, column 'range': expected a finite number; got 'far'",)
    with pytest.raises(InputError, match="expected at least one row that can be read; got none of 1"):
        parsed([{**ROWS[0], "range": "far"}], bad_rows="skip")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_recording(tmp_path)
    return tmp_path


def test_a_recording_is_tracked_from_its_sensor_models_alone(folder: Path) -> None:
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    assert list(made.assumed) == ["region", "motion", "survival", "birth", "clutter"]
    record = run_scenario(made.scenario, "stationary", seed=0)
    assert (record.planner, record.num_scans) == ("recorded", len(made.recording.times))
    np.testing.assert_allclose(record.poses[-1, 0, :2], RADARS["Calshot"][0], atol=5.0)
    last = made.recording.times[-1] + made.recording.start
    table = table_of_run(record, made.scenario)
    now = [i for i, time in enumerate(table["time_s"]) if time == last]
    assert sorted(table["target"][i] for i in now) == ["ship 0", "ship 1", "ship 2"]
    assert record.ospa[-10:, 0].mean() < 40.0
    assert table["utc"][now[0]].startswith("2016-01-12T13:04:")
    places = ORIGIN.to_plane([table["lon_deg"][i] for i in now], [table["lat_deg"][i] for i in now])
    np.testing.assert_allclose(places[:, 0], [table["x_m"][i] for i in now], atol=1e-6)
    truth = SHIPS[:, :2] + SHIPS[:, 2:] * (last - 1452603741.0)
    assert max(min(np.hypot(*(place - ship)) for ship in truth) for place in places) < 150.0


def test_the_example_is_tracked() -> None:
    place = Path(__file__).parents[2] / "examples/recording"
    made = scenario_from_recording(place / "radars.yaml", place / "scans.csv", place / "truth.csv")
    record = run_scenario(made.scenario, "stationary", seed=0)
    assert (record.num_scans, record.estimates[-1].num_targets) == (195, 3)
    assert record.ospa[:, 0].mean() < 40.0


def test_a_moving_sensor_is_at_its_first_position_until_then(folder: Path) -> None:
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    first = next(k for k, scans in enumerate(made.recording.scans) if scans[1] is not None)
    assert first > 0
    np.testing.assert_array_equal(made.recording.poses[0, 1], made.recording.poses[first, 1])
    assert made.recording.poses[first, 1, 0] > 3000.0


def test_zones_are_kept(folder: Path) -> None:
    zone = "control:\n  decision_steps: [3]\n  constraints: [{kind: keep_out, polygon: [[0, 0], [900, 0], [0, 900]]}]\n"
    text = (folder / "radars.yaml").read_text("utf-8")
    (folder / "radars.yaml").write_text(text + zone, "utf-8")
    model: Any = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario.model
    assert [constraint.kind for constraint in model.control.constraints] == ["keep_out"]
    assert model.decision_steps == ()


def test_without_the_targets_reports_nothing_is_scored(folder: Path) -> None:
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    record = run_scenario(made.scenario, "stationary", seed=0)
    assert np.isnan(record.ospa).all()
    assert set(table_of_run(record, made.scenario)["target"]) == {None}
    (folder / "kept.yaml").write_text(dump_scenario(made.scenario.model, folder=made.scenario.folder), "utf-8")
    again = run_scenario(load_scenario(folder / "kept.yaml"), "stationary", seed=0)
    for one, other in zip(record.estimates, again.estimates, strict=True):
        assert one.means.tobytes() == other.means.tobytes()


def test_given_sections_are_not_assumed(folder: Path) -> None:
    said = (
        "motion: {kind: constant_velocity, sigma_v: 0.2}\nregion: {x_min: -9e3, x_max: 9e3, y_min: -9e3, y_max: 9e3}\n"
    )
    text = (folder / "radars.yaml").read_text("utf-8")
    (folder / "radars.yaml").write_text(
        text.replace("detection:", "clutter: {kind: region, rate: 2.0}\n  detection:") + said
    )
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    assert list(made.assumed) == ["survival", "birth"]
    assert made.scenario.model.motion.sigma_v == 0.2
    assert made.scenario.model.sensors[0].clutter.rate == 2.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("sensors:\n", "sensors: []\nmore:\n", r"sensors: expected a list of at least 1"),
        ("name: Calshot", "name: Cowes", r"row 2, column 'radar': expected a sensor among 'Cowes', .*'Calshot'"),
        ("sigma_range: 20.0", "sigma_range: far", r"sigma_range: expected a number, got \"far\""),
        (
            "kind: bearing_range",
            "kind: bearing_only",
            "measurement.kind: expected a measurement that says where a target is",
        ),
    ],
)
def test_errors_in_the_sensor_file_are_reported(folder: Path, old: str, new: str, message: str) -> None:
    text = (folder / "radars.yaml").read_text("utf-8")
    assert old in text
    (folder / "radars.yaml").write_text(text.replace(old, new), "utf-8")
    with pytest.raises((ScenarioError, InputError), match=message):
        scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")


def test_a_recording_goes_with_no_decisions_and_no_invented_targets(folder: Path) -> None:
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    text = dump_scenario(made.scenario.model, folder=folder)
    for old, new, message in (
        ("{kind: unknown}", "{kind: scripted, tracks: []}", "targets.kind: expected recorded or unknown"),
        ("decision_steps:\n", "decision_steps: [3]\n", "control: expected no decisions"),
        (
            "planners: {}",
            "planners: {floor: {kind: true_targets}}",
            r"planners\.floor\.kind: expected one that does not know",
        ),
    ):
        assert old in text
        (folder / "kept.yaml").write_text(text.replace(old, new), "utf-8")
        with pytest.raises(ScenarioError, match=message):
            load_scenario(folder / "kept.yaml")


def test_tracks_are_written_as_others_read_them(folder: Path) -> None:
    import csv
    import json

    from pyarrow import parquet

    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    columns = table_of_run(run_scenario(made.scenario, "stationary", seed=0), made.scenario)
    for ending in ("csv", "parquet", "geojson"):
        write_tracks(folder / "deep" / f"tracks.{ending}", columns)
    with (folder / "deep/tracks.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["x_m"]) for row in rows] == columns["x_m"]
    assert parquet.read_table(folder / "deep/tracks.parquet").to_pydict() == columns
    features = json.loads((folder / "deep/tracks.geojson").read_text("utf-8"))["features"]
    assert sum(len(each["properties"]["time_s"]) for each in features) == len(columns["label"])
    long = [each for each in features if len(each["properties"]["time_s"]) > 10]
    assert sorted(each["properties"]["target"] for each in long) == ["ship 0", "ship 1", "ship 2"]
    assert all(each["geometry"]["type"] == "LineString" for each in long)
    with pytest.raises(
        InputError, match=r"expected a file that ends with .csv, .parquet, .geojson, .czml, .mcap; got .txt"
    ):
        write_tracks(folder / "tracks.txt", columns)
    for ending in ("geojson", "czml", "mcap"):
        with pytest.raises(InputError, match="expected tracks in longitude and latitude"):
            write_tracks(folder / f"t.{ending}", {name: cells for name, cells in columns.items() if name != "lon_deg"})


def test_a_ship_keeps_its_track_over_a_gap(folder: Path) -> None:
    import json

    silence(folder / "scans.csv", 45.0, 75.0)
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    record = run_scenario(made.scenario, "stationary", seed=0)
    joins = joins_of_run(record, made.scenario)
    tables = [table_of_run(record, made.scenario, own) for own in ((), joins)]
    tracks = []
    for table in tables:
        own = {name: set[str]() for name in ("ship 0", "ship 1", "ship 2")}
        for target, track in zip(table["target"], table["track"], strict=True):
            if target is not None:
                own[target].add(track)
        tracks.append([len(names) for names in own.values()])
    assert tracks == [[2, 2, 2], [1, 1, 1]]
    assert tables[0]["track"] == tables[0]["label"] == tables[1]["label"]
    joined = with_joined_tracks(record, joins)
    assert measure_run(joined, made.scenario).label_switches.sum() == 0
    assert measure_run(record, made.scenario).label_switches.sum() == 3
    for estimate in joined.estimates:
        estimate.validate()
    write_tracks(folder / "tracks.geojson", tables[1])
    features = json.loads((folder / "tracks.geojson").read_text("utf-8"))["features"]
    assert sorted(len(each["properties"]["labels"]) for each in features)[-3:] == [2, 2, 2]
    # A ship that no island can hide would not be missed for half a minute.
    assert joins_of_run(record, made.scenario, prob_hidden=0.0) == ()


def test_joins_count_the_scans_that_took_place(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Radars of periods of their own, of which one scans at most instants."""
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    given = list[Any]()
    monkeypatch.setattr(joining, "find_joins", lambda *words, **_: given.extend(words))
    joins_of_run(run_scenario(made.scenario, "stationary", seed=0), made.scenario)
    scanned = np.array([[scan is not None for scan in instant] for instant in made.recording.scans])
    assert not scanned.all()
    np.testing.assert_array_equal(given[1].scanned, scanned)


def rows_of(columns: Mapping[str, Any]) -> dict[tuple[str, float], tuple[float, float]]:
    """Longitude and latitude by label and time, to a millisecond."""
    names = ("track", "time_s", "lon_deg", "lat_deg")
    return {(label, round(t, 3)): (lon, lat) for label, t, lon, lat in zip(*map(columns.get, names), strict=True)}


def test_a_globe_has_the_tracks_at_their_times(folder: Path) -> None:
    import datetime
    import json

    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    columns = table_of_run(run_scenario(made.scenario, "stationary", seed=0), made.scenario)
    write_tracks(folder / "tracks.czml", columns)
    head, *packets = json.loads((folder / "tracks.czml").read_text("utf-8"))
    assert (head["id"], head["version"]) == ("document", "1.0")
    assert head["clock"]["interval"] == f"{min(columns['utc'])}/{max(columns['utc'])}"
    found: dict[tuple[str, float], tuple[float, float]] = {}
    for packet in packets:
        start = datetime.datetime.fromisoformat(packet["position"]["epoch"]).timestamp()
        places = np.reshape(packet["position"]["cartographicDegrees"], (-1, 4))
        assert (places[:, 3] == 0.0).all()
        assert packet["availability"].startswith(packet["position"]["epoch"])
        found |= {(packet["id"], start + time): (lon, lat) for time, lon, lat, _ in places.tolist()}
    expected = rows_of(columns)
    assert len(found) == len(expected)
    for (label, time), place in found.items():
        near = next(at for name, at in expected if name == label and abs(at - time) < 2e-3)
        np.testing.assert_allclose(place, expected[label, near], atol=1e-7)
    assert {"ship 0", "ship 1", "ship 2"} <= {packet["name"] for packet in packets}


def test_a_log_has_the_tracks_at_their_times(folder: Path) -> None:
    import json

    reader = pytest.importorskip("mcap.reader")  # which is not there for the newest Python
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")
    columns = table_of_run(run_scenario(made.scenario, "stationary", seed=0), made.scenario)
    write_tracks(folder / "tracks.mcap", columns)
    first = (folder / "tracks.mcap").read_bytes()
    write_tracks(folder / "tracks.mcap", columns)
    assert (folder / "tracks.mcap").read_bytes() == first
    found = {}
    with (folder / "tracks.mcap").open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            told = json.loads(message.data)
            assert schema.name == "foxglove.LocationFix"
            assert told["timestamp"]["sec"] * 10**9 + told["timestamp"]["nsec"] == message.log_time
            label = channel.topic.removeprefix("/tracks/")
            found[label, round(message.log_time / 1e9, 3)] = told["longitude"], told["latitude"]
            row = columns["label"].index(label)
            if columns["time_s"][row] == message.log_time / 1e9:
                assert told["position_covariance"][0] == columns["std_x_m"][row] ** 2
    assert found == rows_of(columns)


@pytest.mark.parametrize(("bearings", "turn"), [("north", -1.0), ("east", 1.0)])
def test_biases_are_taken_off_as_rows_are_read(bearings: Any, turn: float) -> None:
    values = [(1.0, "north", 900.0, 30.0, 5.0), (2.0, "south", 500.0, 10.0, 6.0), (2.5, "north", 40.0, 181.0, 7.0)]
    rows = [dict(zip(("time", "sensor", "range", "bearing_deg", "own_x"), each, strict=True)) for each in values]
    rows = [{**row, "own_y": 0.0} for row in rows]
    bias = Bias(range=100.0, bearing=math.radians(2.0), clock=1.25, x=3.0, y=-4.0)
    biased = [replace(site, bias=bias) if site.name == "north" else site for site in SITES]
    found, plain = parsed(rows, biased, bearings=bearings), parsed(rows, bearings=bearings)
    assert found.start == -0.25
    np.testing.assert_allclose(found.times, [0.0, 1.5, 2.25])
    first, second, third = found.scans
    assert (first[1], second[1], third[0]) == (None, None, None)
    for before, after, distance in ((plain.scans[0][0], first[0], 800.0), (plain.scans[2][0], second[0], 1.0)):
        assert isinstance(before, np.ndarray)
        assert isinstance(after, np.ndarray)
        assert after[0, 1] == distance  # no range falls below a metre
        turned = math.remainder(before[0, 0] - after[0, 0], 2.0 * math.pi)
        assert turned == pytest.approx(turn * math.radians(2.0), abs=1e-12)
    np.testing.assert_array_equal(np.asarray(third[1]), np.asarray(plain.scans[1][1]))
    np.testing.assert_allclose(found.poses[1], [[4.0, 4.0, 0.0], [6.0, 0.0, 0.0]])
    np.testing.assert_allclose(found.poses[2], [[4.0, 4.0, 0.0], [6.0, 0.0, 0.0]])


def test_biases_of_no_number_are_refused() -> None:
    with pytest.raises(InputError, match=r"Bias\.clock: expected a finite number"):
        Bias(clock=math.nan)


def test_a_compass_sensor_gives_degrees_from_north() -> None:
    site = RecordedSensor("radar", "bearing_range", (0.0, 0.0, 0.0), compass=True)
    told = [[0.0, 10.0], [90.0, 20.0], [225.0, 30.0], [359.0, 40.0]]
    measured = site.from_raw(told)
    np.testing.assert_allclose(measured[:, 0], np.radians([90.0, 0.0, -135.0, 91.0]), atol=1e-15)
    np.testing.assert_allclose(site.to_raw(measured), told, atol=1e-12)
    plain = RecordedSensor("radar", "bearing_range", (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(plain.to_raw(plain.from_raw(told)), told)
    with pytest.raises(InputError, match="raw: expected"):
        site.from_raw([[1.0]])


@pytest.mark.parametrize(
    ("name", "conventions", "bearing"),
    [
        ("bearing", {}, 60.0),
        ("bearing_deg", {}, 60.0),
        ("bearing", {"bearings": "east"}, 30.0),  # what a file says of itself comes first
        ("bearing", {"units": {"bearing": "rad"}}, math.degrees(math.pi / 2.0 - 0.5)),
    ],
)
def test_rows_of_a_compass_sensor_need_no_setting(name: str, conventions: Any, bearing: float) -> None:
    sites = [RecordedSensor("radar", "bearing_range", (0.0, 0.0, 0.0), compass=True)]
    value = 0.5 if "units" in conventions else 30.0
    row = {"time": 0.0, "sensor": "radar", "range": 5.0, name: value}
    found = parsed([row], sites, **{"bearings": None, **conventions})
    assert isinstance(found.scans[0][0], np.ndarray)
    assert math.degrees(found.scans[0][0][0, 0]) == pytest.approx(bearing, abs=1e-12)
    assert found.bearings == (conventions.get("bearings", "north"),)


def test_each_sensor_has_its_own_bearing_convention() -> None:
    sites = [
        RecordedSensor("a", "bearing_only", (0.0, 0.0, 0.0), compass=True),
        RecordedSensor("b", "bearing_only", (0.0, 0.0, 0.0)),
    ]
    rows = [{"time": 0.0, "sensor": name, "bearing_deg": 30.0} for name in "ab"]
    with pytest.raises(InputError, match="column 'bearing_deg': expected bearings: north"):
        parsed(rows, sites, bearings=None)
    with pytest.raises(InputError, match="expected a unit of bearing"):
        parsed([{"time": 0.0, "sensor": name, "bearing": 30.0} for name in "ab"], sites, bearings=None)
    biased = [RecordedSensor("a", "bearing_only", (0.0, 0.0, 0.0), Bias(bearing=0.1), compass=True)]
    found = parsed(rows[:1], biased, bearings=None)
    assert isinstance(found.scans[0][0], np.ndarray)  # clockwise, as it tells them
    assert found.scans[0][0][0, 0] == pytest.approx(math.radians(60.0) + 0.1, abs=1e-12)


@pytest.mark.parametrize("compass", ["all", "one", "none"])
def test_simulated_scans_are_written_as_they_are_read(tmp_path: Path, compass: str) -> None:
    """A run's scans, written and read again, are those that were drawn."""
    changes: dict[str, Any] = {
        "time.num_steps": 5,
        "control.decision_steps": [2],
        "ospa.first_scan": 1,
        "ospa.last_scan": 5,
    }
    changes |= {f"sensors.{s}.compass": True for s in {"all": (0, 1), "one": (1,), "none": ()}[compass]}
    scenario = replace_fields(load_scenario("paper-a"), changes)
    record = run_scenario(scenario, "random", seed=3)
    columns = scan_table(record, scenario)
    assert ("bearing_deg" in columns) == (compass == "all")
    write_tracks(tmp_path / "scans.csv", columns)
    write_tracks(tmp_path / "scans.parquet", columns)
    told: Any = None if compass == "all" else "east"
    for name in ("scans.csv", "scans.parquet"):
        table = read_table(tmp_path / name)
        found = parse_scans(table, recorded_sensors(scenario.model), Conventions({}, {}, told))
        np.testing.assert_allclose(found.times, record.times - record.times[0])
        np.testing.assert_allclose(found.poses[..., :2], record.poses[..., :2], atol=1e-9)
        np.testing.assert_allclose(np.cos(found.poses[..., 2] - record.poses[..., 2]), 1.0)
        for scans, expected in zip(found.scans, scans_of_record(record, scenario), strict=True):
            for scan, drawn in zip(scans, expected, strict=True):
                assert isinstance(scan, np.ndarray)
                assert drawn is not None
                np.testing.assert_allclose(scan, drawn.measurements, rtol=1e-12, atol=1e-12)


def test_a_scenario_sets_the_compass_convention(folder: Path) -> None:
    text = (folder / "radars.yaml").read_text("utf-8").replace("bearings: north", "scan_window: 0.0")
    text = text.replace("sensor_defaults:\n", "sensor_defaults:\n  compass: true\n")
    (folder / "radars.yaml").write_text(text, "utf-8")
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    (folder / "north.yaml").write_text(
        text.replace("  compass: true\n", "").replace("scan_window: 0.0", "bearings: north"), "utf-8"
    )
    said = scenario_from_recording(folder / "north.yaml", folder / "scans.csv")
    for one, other in zip(made.recording.scans, said.recording.scans, strict=True):
        for scan, expected in zip(one, other, strict=True):
            assert (scan is None) == (expected is None)
            if scan is not None:
                np.testing.assert_array_equal(scan, np.asarray(expected))
    wrong = text.replace("{kind: bearing_range}", "{kind: custom, function: 'absent.py:f'}")
    (folder / "radars.yaml").write_text(wrong, "utf-8")
    with pytest.raises(ScenarioError, match=r"compass: expected false, as nobody knows which component"):
        scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")


def test_a_bias_of_a_compass_is_the_same_simulated_and_read(tmp_path: Path) -> None:
    """What a biased sensor is simulated to say becomes, read without the bias, what an honest one says."""
    changes: dict[str, Any] = {
        "time.num_steps": 3,
        "control.decision_steps": [2],
        "ospa.first_scan": 1,
        "ospa.last_scan": 3,
    }
    changes |= {"sensors.*.compass": True, "sensors.*.noise": {"kind": "constant", "std": [1e-9, 1e-6]}}
    biased = replace_fields(
        load_scenario("paper-a"), {**changes, "sensors.*.true_parameters": {"bias": {"bearing_deg": 5.0}}}
    )
    honest = replace_fields(load_scenario("paper-a"), changes)
    write_tracks(tmp_path / "scans.csv", scan_table(run_scenario(biased, "stationary", seed=3), biased))
    known = replace_fields(honest, {"sensors.*.bias.bearing_deg": 5.0})
    found = parse_scans(read_table(tmp_path / "scans.csv"), recorded_sensors(known.model), Conventions({}, {}))
    drawn = scans_of_record(run_scenario(honest, "stationary", seed=3), honest)
    for scans, expected in zip(found.scans, drawn, strict=True):
        for scan, other in zip(scans, expected, strict=True):
            assert isinstance(scan, np.ndarray)
            assert other is not None
            of_targets = other.origins >= 0
            assert of_targets.any()
            np.testing.assert_allclose(scan[of_targets], other.measurements[of_targets], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("first", "last"), [("2016-01-12T13:02:21Z", 6.0), ("", 6.0), ("n/a", 6.0)])
def test_one_bad_time_is_located_in_any_row(first: Any, last: float) -> None:
    rows = [{**ROWS[0], "time": first}, *({**ROWS[0], "time": float(k)} for k in range(1, 7))]
    with pytest.raises(InputError, match=r"row 2, column 'time': expected a finite number of seconds; got"):
        parsed(rows)
    found = parsed(rows, bad_rows="skip")
    assert (len(found.times), len(found.skipped), found.start + found.times[-1]) == (6, 1, last)
    dates = [{**ROWS[0], "time": "5"}, *({**ROWS[0], "time": f"2016-01-12T13:02:2{k}Z"} for k in range(6))]
    with pytest.raises(InputError, match=r"row 2, column 'time': expected an ISO 8601 time; got '5'"):
        parsed(dates)
    assert (parsed(dates, bad_rows="skip").is_utc, len(parsed(dates, bad_rows="skip").times)) == (True, 6)
    reports = {"time": [first, *map(float, range(6))], "id": ["a"] * 7, "x": [0.0] * 7, "y": [0.0] * 7}
    with pytest.raises(InputError, match="row 1, column 'time': expected a finite number; got"):
        RecordedTargets.from_columns(reports)


POSITION = RecordedSensor("radar", "position", (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ({"x": 1.0, "y": 2.0, "lon": -1.1}, "column 'lon': expected a column of lat beside it, as a place has both"),
        ({"x": 1.0, "y": 2.0, "lat": 50.8}, "column 'lat': expected a column of lon beside it"),
        ({"lon": -1.1, "lat": 50.8, "x": 1.0}, "column 'x': expected a column of y beside it"),
        ({"x": 1.0, "y": 2.0, "own_x": 0.0}, "column 'own_x': expected a column of own_y beside it"),
        ({"x": 1.0, "y": 2.0, "own_lat_deg": 50.8}, "column 'own_lat_deg': expected a column of own_lon beside it"),
        (
            {"x": 7000.0, "y": 0.0, "lon": -1.1171, "lat": 50.7865},
            r"row 2, column 'x': expected x, y at the place of its longitude .* .-?0, -?0 m., not 7000 m away",
        ),
        (
            {"x": 1.0, "y": 2.0, "own_x": 0.0, "own_y": 900.0, "own_lon": -1.1171, "own_lat": 50.7865},
            r"column 'own_x': expected own_x, own_y at the place of its longitude and latitude .*, not 900 m away",
        ),
    ],
)
def test_positions_are_complete_and_unambiguous(cells: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        parsed([{"time": 0.0, "sensor": "radar", **cells}], [POSITION], ORIGIN)


def test_equal_positions_may_be_given_twice() -> None:
    lon, lat = ORIGIN.to_degrees([[2000.0, -900.0]])[0].tolist()
    row = {"time": 0.0, "sensor": "radar", "x": 2010.0, "y": -890.0, "lon": lon, "lat": lat}
    found = parsed([row, {**row, "time": 1.0, "x": "", "y": ""}], [POSITION], ORIGIN)
    for scans in found.scans:
        np.testing.assert_allclose(np.asarray(scans[0]), [[2000.0, -900.0]], atol=1e-6)
    # Of no matter to a sensor that measures no place.
    assert parsed([{**ROWS[0], "x": 5.0}]).num_measurements == 1
    reports = {"time": [0.0, 1.0], "id": ["a", "a"], "x": [2010.0, 2015.0], "y": [-890.0] * 2}
    reports |= {"longitude": [lon] * 2, "latitude": [lat] * 2}
    parse_reports(as_table(reports), usual_origin_deg=(ORIGIN.longitude_deg, ORIGIN.latitude_deg))
    reports["x"] = [9000.0, 2015.0]
    with pytest.raises(InputError, match=r"row 1, column 'x': expected x, y at the place .*, not 7000 m away"):
        parse_reports(as_table(reports), usual_origin_deg=(ORIGIN.longitude_deg, ORIGIN.latitude_deg))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("bearings: north", "bearings: North", r"recording.bearings: expected one of east, north, got \"North\""),
        (
            "bearings: north",
            "bearings: north, scan_window: -1",
            "recording.scan_window: expected a number of at least 0",
        ),
        ("bearings: north", "bearings: north, units: 3", "recording.units: expected a mapping"),
        ("bearings: north", "bearings: north, columns: {range: 3}", "recording.columns"),
        ("bearings: north", "bearings: north, units: {range: [nmi]}", "recording.units"),
    ],
)
def test_invalid_recordings_are_reported(folder: Path, old: str, new: str, words: str) -> None:
    text = (folder / "radars.yaml").read_text("utf-8").replace("columns: {sensor: radar, bearing: brg_deg}, ", "")
    (folder / "radars.yaml").write_text(text.replace(old, new), "utf-8")
    with pytest.raises(ScenarioError, match=words):
        scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    with pytest.raises(InputError, match="units: expected a mapping of quantities"):
        Conventions({}, 3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("column", "size"),
    [
        ("range_nm", 1852.0),
        ("range_NM", 1852.0),
        ("range_nmi", 1852.0),
        ("range_ft", 0.3048),
        ("rho_nm", 1852.0),
        ("NM", 1852.0),
    ],
)
def test_units_are_read_from_the_ends_of_columns_in_either_case(column: str, size: float) -> None:
    columns = {} if column.startswith("range") else {"range": column}
    first = parsed(renamed({"range": column}), columns=columns).scans[0][0]
    assert isinstance(first, np.ndarray)
    assert first[0, 1] == pytest.approx(1000.0 * size)


def test_a_sensor_of_positions_needs_no_place_of_its_own_in_the_rows() -> None:
    rows = [
        {
            "time": "0",
            "sensor": "radar",
            "range": "1000",
            "bearing_rad": "0",
            "x": "",
            "y": "",
            "own_x": "5",
            "own_y": "6",
        },
        {"time": "1", "sensor": "ais", "range": "", "bearing_rad": "", "x": "3", "y": "4", "own_x": "", "own_y": ""},
    ]
    sites = (replace(SITES[0], name="radar"), replace(SITES[0], name="ais", kind="position", pose=(1.0, 2.0, 0.0)))
    found = parsed(rows, sites)
    np.testing.assert_array_equal(np.asarray(found.scans[1][1]), [[3.0, 4.0]])
    assert found.poses[1, 1].tolist() == [1.0, 2.0, 0.0]
    assert found.poses[0, 0, :2].tolist() == [5.0, 6.0]
    with pytest.raises(InputError, match="row 2, column 'own_x': expected a finite number"):
        parsed([{**rows[0], "own_x": ""}], sites)
