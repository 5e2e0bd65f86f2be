"""Mistakes of people in a recording: each is a line that names the file, and what to change."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from recordings import write_recording
from vedette.cli import app


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=20.0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(name: str, old: str, new: str) -> str:
    """What `vedette track` says of the recording with another text in one of its files."""
    file = Path(name)
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    words = ["track", "scans.csv", "--sensors", "radars.yaml", "--truth", "truth.csv"]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "300"})
    assert (result.exit_code, result.stdout) == (1, "")
    return result.stderr.strip()


@pytest.mark.parametrize("name", ["scans.csv", "truth.csv"])
@pytest.mark.parametrize(("letter", "word"), [(";", "semicolons"), ("\t", "tabs")])
def test_columns_that_commas_do_not_separate(place: Path, name: str, letter: str, word: str) -> None:
    told = f"{place / name}, row 1: expected columns separated by commas; got them separated by {word}; "
    assert refused(name, ",", letter).startswith(told)


def test_a_time_in_milliseconds(place: Path) -> None:
    lines = (place / "scans.csv").read_text().splitlines()
    rows = [f"1452603741{i:03},{line.partition(',')[2]}" for i, line in enumerate(lines[1:])]
    (place / "scans.csv").write_text("\n".join([lines[0], *rows]))
    told = f"{place / 'scans.csv'}, row 2, column 'time': expected a number of seconds from -1e+12 to 1e+12 "
    told += "(of milliseconds: `units: {time: ms}`); got '"
    assert refused("radars.yaml", "Calshot", "Calshot").startswith(told)


def test_an_unknown_quantity_is_reported(place: Path) -> None:
    told = refused("radars.yaml", "bearing: brg_deg", "bearings: brg_deg")
    assert told.startswith("radars.yaml: recording.columns: expected quantities among time, sensor, bearing, range, ")
    assert told.endswith("; got bearings")


def test_true_targets_of_another_day_are_reported(place: Path) -> None:
    told = refused("truth.csv", "2016-01-12", "2017-01-12")
    days = "2017-01-12T13:02:21+00:00 to 2017-01-12T13:02:41+00:00"
    assert told.startswith(
        f"{place / 'truth.csv'}: times: expected scans between the first and last report, {days}; got 2016-01-"
    )


def test_true_targets_of_another_place_are_reported(place: Path) -> None:
    told = refused("truth.csv", "longitude,latitude", "latitude,longitude")
    assert told == (
        f"{place / 'truth.csv'}: recorded targets: expected at least one track after cleaning; "
        "got none of 9 reports (9 outside the region)"
    )


def test_targets_without_ids(place: Path) -> None:
    told = refused("truth.csv", "time,id,", "time,key,")
    assert told == (
        f"{place / 'truth.csv'}: targets.columns: expected the names of the columns of id among time, key, longitude, "
        "latitude, got nothing (it belongs in radars.yaml)"
    )
