"""The command that tracks recorded scans."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import write_recording
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
    assert "tracks, 3 of them of 10 estimates or more" in result.stdout
    assert "not said, so birth: of measurements" in result.stderr
    assert {path.name for path in (place / "out").iterdir()} >= {"tracks", "figures", "manifest.json", "scenario.yaml"}
    assert {path.name for path in (place / "out/tracks").iterdir()} == {"tracks.csv", "tracks.geojson"}
    assert load_run(place / "out").planner == "recorded"
    again = call("scans.csv", "--sensors", "radars.yaml", "--out", "out")
    assert (again.exit_code, "out exists" in again.stderr) == (1, True)
    told = CliRunner().invoke(app, ["results", "out"])
    assert (told.exit_code, "mean OSPA" in told.stdout) == (0, True)


def test_without_truth_no_error_is_told(place: Path) -> None:
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
def test_files_that_are_not_there_are_told(place: Path, words: tuple[str, ...], message: str) -> None:
    result = call(*words)
    assert result.exit_code == 1
    assert message in result.stderr
    assert {path.name for path in place.iterdir()} == {"scans.csv", "truth.csv", "radars.yaml"}
