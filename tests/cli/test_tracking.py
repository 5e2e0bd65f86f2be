"""The command that tracks recorded scans."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import silence, write_recording
from vedette.cli import app
from vedette.simulation.storage import load_run


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=60.0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str) -> Result:
    return CliRunner().invoke(app, ["track", *words], env={"COLUMNS": "200"})


def test_scans_become_tracks_results_and_a_picture(place: Path) -> None:
    result = call("scans.csv", "--sensors", "radars.yaml", "--truth", "truth.csv", "--out", "out")
    assert result.exit_code == 0, result.output
    assert "mean OSPA" in result.stdout
    assert " (3 with at least 10 estimates), " in result.stdout
    assert "Wrote out: tracks/tracks.csv, tracks/tracks.geojson, figures/, 5 tables" in result.stdout
    assert "\nAssumed, because radars.yaml does not give it:\n  region      x -" in result.stderr
    assert "\n  birth       new targets at a rate learnt from the scans, from measurements" in result.stderr
    assert {path.name for path in (place / "out").iterdir()} >= {"tracks", "figures", "manifest.json", "scenario.yaml"}
    assert {path.name for path in (place / "out/tracks").iterdir()} == {"tracks.csv", "tracks.geojson"}
    assert load_run(place / "out").planner == "recorded"
    again = call("scans.csv", "--sensors", "radars.yaml", "--out", "out")
    assert (again.exit_code, "out exists" in again.stderr) == (1, True)
    told = CliRunner().invoke(app, ["results", "out"])
    assert (told.exit_code, "mean OSPA" in told.stdout) == (0, True)


def test_tracks_are_joined_across_gaps_unless_that_is_switched_off(place: Path) -> None:
    write_recording(place)
    silence(place / "scans.csv", 45.0, 75.0)
    given = ("scans.csv", "--sensors", "radars.yaml", "--truth", "truth.csv")
    result = call(*given, "--out", "joined")
    assert "  joined      3 gaps between labels of one track (--no-join: none)\n" in result.stdout
    assert "joined" not in call(*given, "--no-join", "--out", "apart").stdout
    tables = []
    for folder in ("joined", "apart"):
        with (place / folder / "tracks/tracks.csv").open(newline="") as file:
            tables.append(list(csv.DictReader(file)))
    joined, apart = tables
    assert [row["label"] for row in joined] == [row["label"] for row in apart] == [row["track"] for row in apart]
    assert len({row["track"] for row in joined}) == len({row["label"] for row in joined}) - 3


def test_tables_are_written_before_the_joins(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    words = ("scans.csv", "--sensors", "radars.yaml", "--out", "out")
    with monkeypatch.context() as patch:
        patch.setattr("vedette.evaluation.joining.joins_of_run", interrupted)
        result = call(*words)
    assert (result.exit_code, load_run(place / "out").num_scans > 0) == (130, True)
    assert "wrote out, but not all of its tracks and figures; the same command starts anew" in result.stderr
    assert call(*words).exit_code == 0
    assert (place / "out/tracks/tracks.csv").exists()
    assert call(*words).exit_code == 1


def test_a_mistyped_file_name_is_in_the_message(place: Path) -> None:
    assert call("scnas.csv", "--sensors", "radars.yaml").stderr == (
        "scnas.csv: no such file; expected a file of scans\n"
    )
    told = call("scans.csv", "--sensors", "radars.yaml", "--truth", "turth.csv").stderr
    assert told == "turth.csv: no such file; expected a file of the targets' reports\n"
    (place / "bad.csv").write_text("time,sensor,bearing\n0,a,0.5\n")
    told = call("bad.csv", "--sensors", "radars.yaml").stderr
    assert "radars.yaml" not in told
    assert "bad.csv" in told


def test_bearing_only_sensors_get_advice(place: Path) -> None:
    sensor = "measurement: {kind: bearing_only}, noise: {kind: constant, std: [0.02]}, clutter: {kind: region, rate: 1}"
    head = "region: {x_min: -5000, x_max: 5000, y_min: -5000, y_max: 5000}\nsensors:\n"
    (place / "ears.yaml").write_text(f"{head}  - {{name: a, position: [0, 0], {sensor}, {SEES}}}\n")
    (place / "ears.csv").write_text("time,sensor,bearing_rad\n0,a,0.5\n10,a,0.51\n")
    told = call("ears.csv", "--sensors", "ears.yaml").output
    assert "births at sites: give one wide site in birth.sites" in told
    assert "from_measurements" not in told


SEES = "detection: {kind: constant, probability: 0.9}"


def test_the_folder_is_checked_before_the_run(place: Path) -> None:
    (place / "file").write_text("")
    result = call("scans.csv", "--sensors", "radars.yaml", "--out", "file/out")
    assert result.exit_code != 0
    assert "expected a folder that may be written to; got file/out" in result.stderr
    assert "mean" not in result.stdout


@pytest.mark.parametrize(
    "words",
    ["results run", "report run", "video run --out a.gif", "check run/scenario.yaml", "show run/scenario.yaml",
     "run run/scenario.yaml"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["scans.csv", "truth.csv"])
def test_a_missing_or_changed_recording_is_reported_by_every_command(tracked: Path, words: str, name: str) -> None:
    file = tracked / name
    content = file.read_bytes()
    is_enough = words == "results run"  # what was found is in the folder
    for changed, message in (
        (content.replace(b"1", b"2", 1), "got another ("),
        (None, "no such file"),
    ):
        if changed is None:
            file.unlink()
        else:
            file.write_bytes(changed)
        told = CliRunner().invoke(app, words.split(), env={"COLUMNS": "400"})
        assert told.exit_code == (0 if is_enough else 1), told.output
        for part in (name, message, "scenario.yaml:"):
            assert part in (told.stdout if words.startswith("check") else told.stderr)
    file.write_bytes(content)
    assert CliRunner().invoke(app, ["check", "run/scenario.yaml"]).exit_code == 0


@pytest.fixture
def tracked(place: Path) -> Path:
    assert call("scans.csv", "--sensors", "radars.yaml", "--truth", "truth.csv", "--out", "run").exit_code == 0
    return place


def test_tracks_are_written_in_the_formats_that_are_asked_for(place: Path) -> None:
    words = ("scans.csv", "--sensors", "radars.yaml", "--out", "out")
    result = call(*words, *(word for name in ("czml", "mcap", "parquet") for word in ("--format", name)))
    assert result.exit_code == 0, result.output
    assert {path.name for path in (place / "out/tracks").iterdir()} == {
        f"tracks.{name}" for name in ("czml", "mcap", "parquet")
    }
    other = call(*words, "--overwrite", "--format", "kml")
    message = "expected one of 'csv', 'geojson', 'parquet', 'czml', 'mcap'; got 'kml'"
    assert (other.exit_code, message in " ".join(other.stderr.split())) == (2, True)
    assert call(*words[:3], "--format", "csv").exit_code == 2


def test_a_format_of_places_on_the_earth_without_an_origin_leaves_no_folder(place: Path) -> None:
    (place / "plane.csv").write_text("time,sensor,x,y\n0,pier,100,200\n1,pier,105,200\n2,pier,110,201\n", "utf-8")
    (place / "plane.yaml").write_text(
        "sensor_defaults: {measurement: {kind: position}, noise: {kind: constant, std: [9.0, 9.0]}}\n"
        "sensors: [{name: pier, position: [0.0, 0.0]}]\n",
        "utf-8",
    )
    result = call("plane.csv", "--sensors", "plane.yaml", "--out", "out", "--format", "csv", "--format", "czml")
    assert result.exit_code == 2, result.output
    assert "expected an origin in plane.yaml, as czml has degrees; got none" in " ".join(result.stderr.split())
    assert not (place / "out").exists()


def test_invalid_numbers_of_options_are_reported_as_given(place: Path) -> None:
    words = ("scans.csv", "--sensors", "radars.yaml", "--max-target-speed")
    low, none = call(*words, "-3"), call(*words, "fast")
    assert (low.exit_code, none.exit_code) == (2, 2)
    assert "'--max-target-speed': expected greater than or equal to 0.001; got '-3'" in " ".join(low.stderr.split())
    assert "'--max-target-speed': expected a valid number" in " ".join(none.stderr.split())
    assert "got 'fast'" in none.stderr


def test_a_sensor_without_scans_is_reported(place: Path) -> None:
    rows = (place / "scans.csv").read_text("utf-8").splitlines()
    (place / "scans.csv").write_text("\n".join(row for row in rows if ",boat," not in row), "utf-8")
    result = call("scans.csv", "--sensors", "radars.yaml")
    assert result.exit_code == 0, result.output
    assert "boat 1 per scan (no scan in the recording)" in result.stderr


def test_without_truth_no_error_is_printed(place: Path) -> None:
    result = call("scans.csv", "--sensors", "radars.yaml")
    assert result.exit_code == 0, result.output
    assert "OSPA" not in result.stdout


def test_bad_rows_are_refused_or_skipped_by_name(place: Path) -> None:
    lines = (place / "scans.csv").read_text("utf-8").splitlines()
    lines[4] = lines[4].replace("Calshot", "Cowes").replace("boat", "Cowes")
    (place / "scans.csv").write_text("\n".join(lines), "utf-8")
    refused = call("scans.csv", "--sensors", "radars.yaml")
    assert refused.exit_code == 1
    assert "row 5, column 'radar': expected a sensor among 'Calshot', 'boat'" in refused.stderr
    skipped = call("scans.csv", "--sensors", "radars.yaml", "--bad-rows", "skip")
    assert skipped.exit_code == 0, skipped.output
    assert "skipped: " in skipped.stderr
    assert "row 5, column 'radar'" in skipped.stderr
    assert call("scans.csv", "--sensors", "radars.yaml", "--bad-rows", "some").exit_code == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("absent.csv", "--sensors", "radars.yaml"), "absent.csv: no such file"),
        (("scans.csv", "--sensors", "absent.yaml"), "absent.yaml: no such file"),
        (("scans.csv", "--sensors", "radars.yaml", "--truth", "absent.csv"), "no such file"),
        (("radars.yaml", "--sensors", "radars.yaml"), "expected a file that ends with .csv, .parquet"),
        (("scans.csv", "--sensors", "scans.csv"), "expected a mapping with `sensors`"),
    ],
)
def test_missing_files_are_reported(place: Path, words: tuple[str, ...], message: str) -> None:
    result = call(*words)
    assert result.exit_code == 1
    assert message in result.stderr
    assert {path.name for path in place.iterdir()} == {"scans.csv", "truth.csv", "radars.yaml"}


def test_times_without_dates_are_reported_for_formats_with_dates(place: Path) -> None:
    rows = "".join(f"{600_000_000_000 + k},pier,{100 + k},200\n" for k in range(4))
    (place / "far.csv").write_text("time,sensor,x,y\n" + rows, "utf-8")
    (place / "plane.yaml").write_text(
        "origin: {lon: 1.0, lat: 50.0}\n"
        "sensor_defaults: {measurement: {kind: position}, noise: {kind: constant, std: [9.0, 9.0]}}\n"
        "sensors: [{name: pier, position: [0.0, 0.0]}]\n",
        "utf-8",
    )
    result = call("far.csv", "--sensors", "plane.yaml", "--out", "out", "--format", "czml")
    assert result.exit_code == 1, result.output
    assert "time: expected seconds since 1970 of a date before the year 10000; got 6e+11" in result.stderr
