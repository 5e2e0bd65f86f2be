"""Recordings with values that are probably mistakes: refused with the field, or named in a warning."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from recordings import write_recording
from vedette.errors import InputError
from vedette.recorded import Conventions, RecordedSensor, as_table, parse_scans
from vedette.recorded.files import read_table
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings


def warnings_of(folder: Path, sensors: Callable[[str], str] = str) -> list[str]:
    file = folder / "radars.yaml"
    file.write_text(sensors(file.read_text("utf-8")), "utf-8")
    found = scenario_from_recording(file, folder / "scans.csv", folder / "truth.csv")
    return list(scenario_warnings(found.scenario))


def test_noise_of_ranges_beyond_the_ranges_is_named(tmp_path: Path) -> None:
    write_recording(tmp_path)
    assert not [text for text in warnings_of(tmp_path) if "noise of ranges" in text]
    texts = warnings_of(tmp_path, lambda text: text.replace("eta_range: 0.0", "eta_range: 0.01"))
    assert len([text for text in texts if "noise: expected noise of ranges below the ranges" in text]) == 2
    lines = (tmp_path / "scans.csv").read_text("utf-8").splitlines()
    rows = [lines[0] + ",range_std_m", *(f"{line},80000" for line in lines[1:])]
    (tmp_path / "scans.csv").write_text("\n".join([*rows, ""]), "utf-8")
    texts = warnings_of(tmp_path, lambda text: text.replace("eta_range: 0.01", "eta_range: 0.0"))
    assert [text for text in texts if "Calshot, column range_std: expected noise of ranges" in text]


def test_a_wild_report_of_a_target_is_named_unless_it_is_left_out(tmp_path: Path) -> None:
    write_recording(tmp_path)
    assert not [text for text in warnings_of(tmp_path) if "reached only above" in text]
    lines = (tmp_path / "truth.csv").read_text("utf-8").splitlines()
    cells = lines[5].split(",")
    lines[5] = ",".join([*cells[:2], str(float(cells[2]) + 1.0), cells[3]])
    (tmp_path / "truth.csv").write_text("\n".join([*lines, ""]), "utf-8")
    (text,) = (text for text in warnings_of(tmp_path) if "reached only above" in text)
    assert "1 report of ship 0 reached only above" in text
    limit = text[text.index("max_speed: ") + 11 : text.index("}`")]
    texts = warnings_of(tmp_path, lambda text: f"{text}targets: {{kind: recorded, max_speed: {limit}}}\n")
    assert not [text for text in texts if "reached only above" in text]


def test_ttm_sentences_are_named(tmp_path: Path) -> None:
    pytest.importorskip("pyais")
    (tmp_path / "log.nmea").write_text("$RATTM,11,11.4,13.6,T,7.0,20.0,T,0.0,0.0,N,,Q,,154125.82,A,*17\n", "utf-8")
    with pytest.raises(InputError, match="expected AIS positions; got TTM sentences, tracks of a radar: write them as"):
        read_table(tmp_path / "log.nmea")


def test_a_sensor_without_own_places_has_that_of_its_file() -> None:
    columns: dict[str, list[Any]] = {
        "time": [0.0, 0.0, 1.0],
        "sensor": ["boat", "tower", "boat"],
        "range": [100.0, 100.0, 100.0],
        "bearing_deg": [0.0, 0.0, 0.0],
        "own_x": [5.0, "", 6.0],
        "own_y": [7.0, "", 7.0],
    }
    sites = [RecordedSensor(name, "bearing_range", (50.0, 60.0, 0.0)) for name in ("boat", "tower")]
    found = parse_scans(as_table(columns), sites, Conventions({}, {}, "north"))
    assert found.poses[0, :, :2].tolist() == [[5.0, 7.0], [50.0, 60.0]]
    columns["own_x"][2] = columns["own_y"][2] = ""
    with pytest.raises(InputError, match=r"row 3, column 'own_x': expected a finite number"):
        parse_scans(as_table(columns), sites, Conventions({}, {}, "north"))
