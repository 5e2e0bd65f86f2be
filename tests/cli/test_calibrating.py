"""vedette calibrate: what it prints and writes, what it refuses, and that Ctrl-C leaves nothing behind."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import write_recording
from vedette.calibration import Problem
from vedette.cli import app
from vedette.scenarios.yaml_reader import read_yaml


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=120.0, biases={"boat": (300.0, 2.0, 0.0)})
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str) -> Result:
    return CliRunner().invoke(app, list(words), env={"COLUMNS": "120"})


def test_estimates_are_printed_and_their_file_is_used_for_tracking(place: Path) -> None:
    result = call("calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "new/found.yaml")
    assert result.exit_code == 0, result.output
    assert "boat" in result.stdout
    assert "bearing noise std  deg" in result.stdout
    stars = [line.split()[:3] for line in result.stdout.splitlines() if line.rstrip().endswith(" *")]
    assert ["boat", "range", "bias"] in stars
    assert "Clock offsets are relative to Calshot, the first sensor." in result.stdout
    assert "Wrote new/found.yaml. Use it with: vedette track scans.csv --sensors new/found.yaml" in result.stdout
    assert "Nothing was written" not in result.stdout
    scores = []
    for sensors in ("radars.yaml", "new/found.yaml"):
        tracked = call("track", "scans.csv", "--sensors", sensors, "--truth", "truth.csv")
        assert tracked.exit_code == 0, tracked.output
        scores.append(float(tracked.stdout.split("mean OSPA")[1].split()[0]))
    assert scores[1] < scores[0]


def test_track_estimates_first_what_the_file_does_not_give(place: Path) -> None:
    """Biases and clutter; noise and detection are given, and the fit does not find them wrong."""
    words = ("track", "scans.csv", "--sensors", "radars.yaml", "--truth", "truth.csv", "--json")
    plain = json.loads(call(*words).stdout)
    result = call(*words, "--calibrate", "--out", "tracked")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert plain["calibration"] is None
    rows = {(row["sensor"], row["parameter"]): row for row in told["calibration"]["parameters"]}
    assert {name for _, name in rows} == {"bearing_deg", "range", "clock", "clutter.rate"}
    assert rows["boat", "range"]["kept"] is None
    assert abs(rows["boat", "range"]["estimate"] - 300.0) < 60.0
    assert told["ospa"]["total"] < plain["ospa"]["total"]
    written = read_yaml((place / "tracked/sensors.yaml").read_text("utf-8"), "sensors.yaml").data["sensors"][1]
    assert written["bias"]["range"] == pytest.approx(rows["boat", "range"]["estimate"], rel=1e-6)
    assert written["detection"]["probability"] == 0.95
    assert "tracked/sensors.yaml" in told["written"]


def test_windows_are_printed_side_by_side_and_the_last_is_written(place: Path) -> None:
    write_recording(place, seconds=240.0, biases={"boat": (300.0, 2.0, 0.0)})
    files = ("scans.csv", "--sensors", "radars.yaml", "--out", "found.yaml")
    words = ("calibrate", *files, "--window", "120", "--prior-scale", "3")
    result = call(*words)
    assert result.exit_code == 0, result.output
    assert "from (s)" in result.stdout
    assert result.stdout.count("\nboat ") == 2 * 7  # a row a parameter and window
    told = json.loads(call(*words, "--overwrite", "--json").stdout)
    assert [each["begin_s"] for each in told["windows"]] == [0.0, told["windows"][0]["end_s"]]
    assert told["windows"][1]["end_s"] == pytest.approx(2.0 * told["windows"][0]["end_s"])
    last = {(row["sensor"], row["parameter"]): row["estimate"] for row in told["windows"][1]["parameters"]}
    written = read_yaml((place / "found.yaml").read_text("utf-8"), "found.yaml").data
    assert written["sensors"][1]["bias"]["range"] == pytest.approx(last["boat", "range"], rel=1e-6)


def test_a_search_that_did_not_converge_has_no_intervals(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vedette.calibration.maximum_likelihood._MOST_STEPS", 1)
    for limit in ("_ENOUGH", "_JUMPS"):
        monkeypatch.setattr(f"vedette.calibration.maximum_likelihood.{limit}", 0.0)
    words = ("calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "found.yaml", "--overwrite")
    result = call(*words)
    assert result.exit_code == 3, result.output
    assert "Warning: the optimiser stopped before it converged." in result.stderr
    assert " to " not in result.stdout.split("Clock offsets")[0]
    assert (place / "found.yaml").read_text("utf-8").startswith("# The optimiser stopped before it converged")
    written = read_yaml((place / "found.yaml").read_text("utf-8"), "found.yaml").data["sensors"]
    assert [each["bias"] for each in written] == [{}, {}]
    assert [each["detection"]["probability"] for each in written] == [0.95, 0.95]
    assert "its values are those of the old file" in result.stdout
    result = call(*words, "--json")
    assert result.exit_code == 3, result.output
    told = json.loads(result.stdout)
    assert told["converged"] is False
    assert {row["ci_low"] for row in told["parameters"]} == {row["ci_high"] for row in told["parameters"]} == {None}


def test_biases_of_a_single_sensor_are_estimated_only_if_asked(place: Path) -> None:
    rows = (place / "scans.csv").read_text("utf-8").splitlines(keepends=True)
    (place / "one.csv").write_text("".join([rows[0], *(row for row in rows[1:] if "Calshot" in row)]), "utf-8")
    text = (place / "radars.yaml").read_text("utf-8").splitlines(keepends=True)
    (place / "one.yaml").write_text("".join(line for line in text if "name: boat" not in line), "utf-8")
    words = ("calibrate", "one.csv", "--sensors", "one.yaml", "--json")
    for option, told in ((), False), (("--biases",), True), (("--no-biases",), False):
        result = call(*words, *option)
        assert result.exit_code == 0, result.output
        names = {row["parameter"] for row in json.loads(result.stdout)["parameters"]}
        assert ("bearing_deg" in names) is told
        assert "detection.probability" in names
        assert ("Biases of a single sensor are not estimated" in result.stderr) is (option == ())


def test_existing_files_are_not_overwritten_without_the_option(place: Path) -> None:
    result = call("calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "radars.yaml")
    assert (result.exit_code, result.stderr) == (1, "radars.yaml: already there; --overwrite replaces it\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("absent.csv", "--sensors", "radars.yaml"), "absent.csv: no such file"),
        (("scans.csv", "--sensors", "absent.yaml"), "absent.yaml: no such file"),
        (("radars.yaml", "--sensors", "radars.yaml"), "expected a file that ends with .csv, .parquet"),
    ],
)
def test_missing_files_are_reported(place: Path, words: tuple[str, ...], message: str) -> None:
    result = call("calibrate", *words)
    assert result.exit_code == 1
    assert message in result.stderr


def test_a_bias_of_an_unmeasured_quantity_is_refused(place: Path) -> None:
    text = (place / "radars.yaml").read_text("utf-8")
    measured = "bias: {range: 1.0}, measurement: {kind: bearing_only}"
    (place / "radars.yaml").write_text(text.replace("{name: Calshot,", f"{{name: Calshot, {measured},"))
    result = call("calibrate", "scans.csv", "--sensors", "radars.yaml")
    assert result.exit_code == 1
    assert "sensors[0].bias.range: expected 0, as no range is measured (bearing_only), got 1.0" in result.stderr


def test_interrupted_it_leaves_nothing(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def interrupted(problem: Problem, free: object) -> None:
        calls.append(free)
        raise KeyboardInterrupt

    monkeypatch.setattr(Problem, "log_likelihoods", interrupted)
    before = set(place.iterdir())
    result = call("calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "found.yaml")
    assert result.exit_code == 130
    assert "interrupted: nothing was written" in result.stderr
    assert len(calls) == 1
    assert set(place.iterdir()) == before
