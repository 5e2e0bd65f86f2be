"""Smoothed tracks in the files and errors of `vedette track`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import write_recording
from vedette.cli import app

GIVEN = ("scans.csv", "--sensors", "radars.yaml")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=60.0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str) -> Result:
    return CliRunner().invoke(app, ["track", *words], env={"COLUMNS": "200"})


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as opened:
        return list(csv.DictReader(opened))


def test_smoothed_tracks_stand_next_to_the_filtered_ones(place: Path) -> None:
    result = call(*GIVEN, "--truth", "truth.csv", "--smooth", "--out", "out", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    filtered, smoothed = (document["trajectories"][kind] for kind in ("filtered", "smoothed"))
    assert filtered.keys() == smoothed.keys() == {"rmse_m", "ospa2_m"}
    assert 0.0 < smoothed["rmse_m"] < filtered["rmse_m"]
    names = {path.name for path in (place / "out/tracks").iterdir()}
    assert names == {"tracks.csv", "tracks.geojson", "smoothed.csv", "smoothed.geojson"}
    assert {path.stem for path in (place / "out/figures").iterdir()} >= {"tracks", "smoothed"}
    tables = [rows_of(place / f"out/tracks/{name}.csv") for name in ("tracks", "smoothed")]
    assert tables[0][0].keys() == tables[1][0].keys()
    assert {row["label"] for row in tables[1]} <= {row["label"] for row in tables[0]}
    before, after = ([float(row["std_x_m"]) for row in table] for table in tables)
    assert sum(after) / len(after) < sum(before) / len(before)


def test_filtered_tracks_do_not_depend_on_smoothing(place: Path) -> None:
    with_smoothing, plain = call(*GIVEN, "--smooth", "--out", "a"), call(*GIVEN, "--out", "b", "--json")
    assert (with_smoothing.exit_code, plain.exit_code) == (0, 0)
    assert (place / "a/tracks/tracks.csv").read_bytes() == (place / "b/tracks/tracks.csv").read_bytes()
    assert "trajectories" not in json.loads(plain.stdout)
    assert "smoothed " not in with_smoothing.stdout  # without truth there are no errors


def test_a_lag_longer_than_the_recording_is_the_whole_recording(place: Path) -> None:
    for folder, more in (("whole", ()), ("long", ("--lag", "1000")), ("short", ("--lag", "2"))):
        assert call(*GIVEN, "--smooth", *more, "--out", folder).exit_code == 0
    whole, long, short = (rows_of(place / f"{folder}/tracks/smoothed.csv") for folder in ("whole", "long", "short"))
    assert whole == long != short


def test_bad_options_are_refused_by_name(place: Path) -> None:
    for words, message in (
        (("--lag", "30"), "Invalid value for --lag: expected with --smooth"),
        (("--smooth", "--lag", "0"), "Invalid value for --lag: expected a time above 0 s; got 0"),
        (("--smooth", "--lag", "nan"), "Invalid value for --lag: expected a time above 0 s; got nan"),
    ):
        result = call(*GIVEN, *words)
        assert (result.exit_code, message in result.stderr) == (2, True), result.stderr


def test_targets_without_labels_are_refused(place: Path) -> None:
    sensors, scans = place / "radars.yaml", place / "scans.csv"
    one_radar = [line for line in sensors.read_text().splitlines() if "boat" not in line]
    births = "birth: {sites: [{existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [3000.0, 3000.0, 9.0, 9.0]}]}"
    sensors.write_text("\n".join([*one_radar, "filter: {kind: phd}", "fusion: {kind: none}", births]))
    scans.write_text("".join(line for line in scans.read_text().splitlines(True) if "boat" not in line))
    result = call(*GIVEN, "--smooth")
    expected = "Invalid value for --smooth: expected a filter whose targets have labels, such as delta_glmb; got phd"
    assert (result.exit_code, expected in result.stderr) == (2, True), result.stderr
