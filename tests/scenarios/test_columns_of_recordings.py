"""Which columns of recordings are read, under which names, and what is said of those that are not."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from recordings import write_recording
from vedette.errors import InputError, ScenarioError
from vedette.recorded import Conventions, Origin, RecordedSensor, as_table, parse_scans
from vedette.recorded.reports import parse_reports
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings

ALONE = (RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0)),)
SHIPS = {"time": [0.0, 10.0, 0.0, 10.0], "mmsi": [1, 1, 2, 2], "lon": [0.0, 0.01, 0.1, 0.1], "lat": [0.0] * 4}


def made(folder: Path, more: str = "") -> RecordingScenario:
    (folder / "radars.yaml").write_text((folder / "radars.yaml").read_text("utf-8") + more, "utf-8")
    return scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")


def told(found: RecordingScenario, words: str) -> list[str]:
    return [line.split("warning: ")[1] for line in scenario_warnings(found.scenario) if words in line]


def add_column(file: Path, name: str) -> None:
    first, *rest = file.read_text("utf-8").splitlines()
    file.write_text("\n".join([f"{first},{name}", *(f"{line},1" for line in rest), ""]), "utf-8")


def test_columns_that_are_not_used_are_named(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=40.0)
    assert told(made(tmp_path), "not used") == []
    for name in ("snr_db", "class"):
        add_column(tmp_path / "scans.csv", name)
    add_column(tmp_path / "truth.csv", "length")
    first, second = told(made(tmp_path), "not used")
    assert first.endswith("scans.csv: not used: 2 columns (snr_db, class)")
    assert second.endswith("truth.csv: not used: 1 column (length)")


def test_a_target_of_one_report_is_named(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=40.0)
    with (tmp_path / "truth.csv").open("a", encoding="utf-8") as file:
        file.write("2016-01-12T13:02:30Z,lone,-1.11,50.79\n")
    (line,) = told(made(tmp_path), "one report")
    assert line.endswith("truth.csv: 1 target with one report (lone) left out, as a course needs two")


def test_one_sensor_needs_no_column_of_sensors() -> None:
    table = as_table({"time": [0.0, 1.0], "range": [100.0, 101.0], "bearing_rad": [0.1, 0.2]})
    found = parse_scans(table, ALONE, Conventions({}, {}, "east"))
    assert [scans[0] is not None for scans in found.scans] == [True, True]
    two = (*ALONE, RecordedSensor("S", "bearing_range", (0.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="expected a column 'sensor'"):
        parse_scans(table, two, Conventions({}, {}, "east"))
    with pytest.raises(InputError, match="expected a column 'radar'"):
        parse_scans(table, ALONE, Conventions({"sensor": "radar"}, {}, "east"))


def test_bearings_may_be_a_little_more_than_a_turn() -> None:
    def bearing(value: float) -> float:
        table = as_table({"time": [0.0], "range": [100.0], "bearing_deg": [value]})
        (scan,) = parse_scans(table, ALONE, Conventions({}, {}, "east")).scans[0]
        assert isinstance(scan, np.ndarray)
        return float(scan[0, 0])

    assert bearing(360.05) == pytest.approx(math.radians(0.05))
    assert bearing(-360.05) == pytest.approx(math.radians(-0.05))
    with pytest.raises(InputError, match="a number from -360 to 360"):
        bearing(371.0)


def test_reports_have_the_names_that_are_usual() -> None:
    found = parse_reports(as_table(SHIPS), origin_deg=(0.0, 0.0))
    assert found.names == ("1", "2")
    assert found.positions[1, 0] == pytest.approx(1113.2, abs=0.1)
    with pytest.raises(InputError, match="a column 'id'"):
        parse_reports(as_table({name: cells for name, cells in SHIPS.items() if name != "mmsi"}))


def test_columns_of_the_sensor_file_are_used_with_truth(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=40.0)
    text = (tmp_path / "truth.csv").read_text("utf-8").replace("time,id,", "when,ship,")
    (tmp_path / "truth.csv").write_text(text, "utf-8")
    with pytest.raises(ScenarioError, match=r"targets.columns: expected the names of the columns of time, id among"):
        made(tmp_path)
    found = made(tmp_path, "targets: {columns: {time: when, id: ship}}\n")
    assert found.scenario.model.targets.kind == "recorded"


def test_a_region_may_lie_across_180_degrees(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=40.0)
    for file, columns in (("scans.csv", (4, 5)), ("truth.csv", (2, 3))):
        first, *rest = (tmp_path / file).read_text("utf-8").splitlines()
        rows = [line.split(",") for line in rest]
        for row in rows:
            east = float(row[columns[0]]) + 1.1171 + 180.0
            row[columns[0]] = str(east - 360.0 if east > 180.0 else east)
        (tmp_path / file).write_text("\n".join([first, *map(",".join, rows), ""]), "utf-8")
    text = (tmp_path / "radars.yaml").read_text("utf-8").replace("-1.1171", "180.0").replace("-1.1597", "179.9574")
    (tmp_path / "radars.yaml").write_text(text, "utf-8")
    found = made(tmp_path, "region: {lon_min: 179.9, lon_max: -179.9, lat_min: 50.74, lat_max: 50.84}\n")
    region = found.scenario.model.region
    assert region.x_max == pytest.approx(0.1 * 111320.0 * math.cos(math.radians(50.7865)), rel=0.01)
    assert region.x_min == pytest.approx(-region.x_max, rel=1e-6)


def test_the_middle_of_reports_across_180_degrees_is_between_them() -> None:
    ships = {**SHIPS, "lon": [179.98, 179.99, -179.98, -179.99]}
    found = parse_reports(as_table(ships))
    assert found.origin_deg is not None
    assert found.origin_deg[0] == pytest.approx(180.0, abs=0.011)
    assert np.abs(found.positions).max() < 4000.0
    assert Origin(180.0, 0.0).to_plane([-179.99], [0.0])[0, 0] > 0.0
