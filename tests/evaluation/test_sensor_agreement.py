"""Sensors of a recording that agree on no target are told of, and tracks that run side by side."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any

import pytest

from recordings import write_recording
from vedette.evaluation.fit import fit_of_run
from vedette.evaluation.runs import run_scenario
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings


def told(folder: Path) -> tuple[str, ...]:
    made = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")
    fit = fit_of_run(run_scenario(made.scenario, "stationary", seed=0), made.scenario)
    return tuple(each.text for each in fit.findings if each.test == "agreement")


def rewritten(folder: Path, radar: str, change: Any) -> None:
    """The rows of one radar otherwise."""
    with (folder / "scans.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        if row["radar"] == radar and row["brg_deg"]:
            change(row)
    with (folder / "scans.csv").open("w", newline="") as file:
        out = csv.DictWriter(file, list(rows[0]))
        out.writeheader()
        out.writerows(rows)


def from_east(row: dict[str, str]) -> None:
    row["brg_deg"] = f"{(90.0 - float(row['brg_deg'])) % 360.0:.4f}"


def in_kilometres(row: dict[str, str]) -> None:
    row["range_nmi"] = f"{1.852 * float(row['range_nmi']):.6f}"


def other_longitude(row: dict[str, str]) -> None:
    row["own_lon"] = str(-1.11 - (float(row["own_lon"]) + 1.11))


def test_sensors_that_agree_give_no_warning(tmp_path: Path) -> None:
    write_recording(tmp_path)
    assert told(tmp_path) == ()


@pytest.mark.parametrize("change", [from_east, in_kilometres, other_longitude], ids=lambda each: each.__name__)
def test_gross_errors_give_a_warning(tmp_path: Path, change: Any) -> None:
    write_recording(tmp_path)
    rewritten(tmp_path, "boat", change)
    first, *more = told(tmp_path)
    assert first.startswith("Calshot and boat agree on no target (")
    assert first.endswith(
        "pairs of a track of one and a scan of the other): check units, north (compass or east) and places"
    )
    assert int(first.split(" of ")[1].split(" ")[0]) >= 10
    assert not any("calibrate" in line for line in more)


def test_a_steady_offset_is_for_calibration(tmp_path: Path) -> None:
    write_recording(tmp_path, biases={"boat": (400.0, 0.0, 0.0)})
    lines = told(tmp_path)
    assert len(lines) == 2
    found = re.match(
        r"\d of 3 tracks of Calshot keep (\d+) m from one of boat, as two tracks of one target do", lines[1]
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(400.0, abs=60.0)
    assert lines[1].endswith("`vedette track --calibrate` finds biases of range, bearing and clock")


def test_coverage_without_overlap_gives_a_warning_before_the_run(tmp_path: Path) -> None:
    write_recording(tmp_path)
    text = (tmp_path / "radars.yaml").read_text("utf-8")
    near = text.replace(
        "{kind: constant, probability: 0.95}", "{kind: limited_range, probability: 0.95, max_range: REACH}"
    )
    apart = math.hypot(3002.0, 3002.0)
    for reach, warned in ((0.55 * apart, False), (0.45 * apart, True)):
        (tmp_path / "radars.yaml").write_text(near.replace("REACH", f"{reach:.1f}"), "utf-8")
        made = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv")
        found = [line for line in scenario_warnings(made.scenario) if "no place in common" in line]
        assert bool(found) == warned
    assert "Calshot and boat see no place in common" in found[0]
