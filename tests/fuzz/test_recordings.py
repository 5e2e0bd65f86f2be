"""Damaged recordings: each is tracked, or refused with its file and place; every row is a measurement or accounted for.

For an hour: `pytest -m fuzz tests/fuzz/test_recordings.py --fuzz-seconds 3600 --fuzz-seed 1 -s`.
"""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fuzz.damages import csv_of, damaged_blocks, damaged_lines, damaged_rows
from fuzz.mutations import pick
from fuzz.outcomes import bounded, check_message
from live.examples import answered, small, walk
from recordings import ORIGIN, SHIPS, write_recording
from simulation.test_foreign import ais, plot
from vedette.cli import app
from vedette.errors import VedetteError
from vedette.recorded import Cleaning, RecordedTargets
from vedette.recorded.files import read_table
from vedette.recorded.tables import is_empty
from vedette.scenarios.from_recording import scenario_from_recording

TryCases = Callable[[Callable[[np.random.Generator], object], int], None]
RADAR = """origin: {lon: -1.1171, lat: 50.7865}
recording: {scan_window: 3.5}
sensors:
  - {name: 1/2, position: [0, 0], detection: {kind: constant, probability: 0.95}, clutter: {kind: region, rate: 0.5}}
"""
_PLACED = re.compile(
    r"row |rows|column|line|block|record|such file|CSV|Parquet|ASTERIX|AIS|report|\.(ast|raw): expected plots|t = "
)
SECONDS = 900.0  # a first run compiles kernels

pytestmark = [pytest.mark.fuzz, pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=30.0)
    (tmp_path / "radar.yaml").write_text(RADAR)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plots() -> list[bytes]:
    """Four turns of a radar that sees all ships."""
    found = []
    for time in range(0, 16, 4):
        for state in SHIPS:
            offset = state[:2] + state[2:] * time
            azimuth = float(np.degrees(np.arctan2(offset[0], offset[1]))) % 360.0
            found.append(plot(40000.0 + time + azimuth / 90.0, float(np.hypot(*offset)) / 1852.0, azimuth))
    return found


def messages() -> list[bytes]:
    """What three ships say of themselves, every ten seconds."""
    lines = []
    for time in range(0, 60, 10):
        for ship, state in enumerate(SHIPS):
            lon, lat = ORIGIN.to_degrees([state[:2] + state[2:] * time])[0].tolist()
            lines.append(ais(1452603741.0 + time, mmsi=f"23500000{ship}", lon=lon, lat=lat).encode())
    return lines


def rows_of(path: Path) -> list[list[str]]:
    with path.open(newline="") as file:
        return list(csv.reader(file))


def tracked(words: list[str], counts: Counter[str], command: str = "track") -> dict[str, Any] | None:
    """The document of `vedette track` or `vedette calibrate`; None where it is refused, with a place.

    A calibration that did not converge ends with 3 and a document that has no intervals.
    """
    with bounded(words, SECONDS):
        result = CliRunner().invoke(app, [command, *words, "--json"], env={"COLUMNS": "200"})
    if result.exit_code in ((0, 3) if command == "calibrate" else (0,)):
        counts[f"{command}: exit {result.exit_code}"] += 1
        found: dict[str, Any] = json.loads(result.stdout)
        return found
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    text = result.stderr.partition("Error: ")[2] or result.stderr
    counts["refused"] += 1
    check_message(VedetteError(text.strip()))
    assert _PLACED.search(text), text
    return None


def check_accounted(scans: Path, sensors: Path, bad_rows: str) -> None:
    """Each row is a measurement, empty, or named as skipped."""
    recording = scenario_from_recording(sensors, scans, bad_rows=bad_rows).recording
    table = read_table(scans)
    measured = [name for name in table.columns if re.fullmatch(r"range.*|brg.*|bearing.*", name)]
    empty = sum(all(is_empty(cells[i]) for cells in map(table.columns.get, measured)) for i in range(len(table.rows)))  # type: ignore[index]
    left = len(table.rows) - recording.num_measurements - len(recording.skipped)
    assert 0 <= left <= empty, (len(table.rows), recording.num_measurements, recording.skipped, empty)


def test_damaged_tables_of_scans(try_cases: TryCases, folder: Path) -> None:
    rows, truth, counts = rows_of(folder / "scans.csv"), rows_of(folder / "truth.csv"), Counter[str]()

    def check(rng: np.random.Generator) -> None:
        of_truth = rng.random() < 0.2
        (folder / "s.csv").write_bytes(csv_of(rng, rows if of_truth else damaged_rows(rng, rows)))
        (folder / "t.csv").write_bytes(csv_of(rng, damaged_rows(rng, truth)) if of_truth else csv_of(rng, truth))
        bad_rows = pick(rng, ["refuse", "skip"])
        words = ["s.csv", "--sensors", "radars.yaml", "--bad-rows", bad_rows]
        if tracked(words + (["--truth", "t.csv"] if of_truth else []), counts) is not None:
            check_accounted(folder / "s.csv", folder / "radars.yaml", bad_rows)

    try_cases(check, 12)
    print(dict(counts))


def test_damaged_tables_are_calibrated_or_refused(try_cases: TryCases, folder: Path) -> None:
    """What is printed is finite, and the file that is written is read again."""
    rows, counts = rows_of(folder / "scans.csv"), Counter[str]()

    def check(rng: np.random.Generator) -> None:
        (folder / "s.csv").write_bytes(csv_of(rng, damaged_rows(rng, rows)))
        (folder / "found.yaml").unlink(missing_ok=True)
        bad_rows = pick(rng, ["refuse", "skip"])
        words = ["s.csv", "--sensors", "radars.yaml", "--bad-rows", bad_rows, "--out", "found.yaml"]
        found = tracked(words, counts, "calibrate")
        if found is not None:
            assert np.isfinite([value for value in numbers_of(found) if value is not None]).all()
            scenario_from_recording(folder / "found.yaml", folder / "s.csv", bad_rows=bad_rows)

    try_cases(check, 2)
    print(dict(counts))


def numbers_of(document: Any) -> list[float | None]:
    """All numbers of a JSON document."""
    if isinstance(document, dict | list):
        return [n for each in (document.values() if isinstance(document, dict) else document) for n in numbers_of(each)]
    return [document] if isinstance(document, int | float) else []


def test_damaged_plots_of_a_radar(try_cases: TryCases, folder: Path) -> None:
    blocks, counts = plots(), Counter[str]()

    def check(rng: np.random.Generator) -> None:
        name = pick(rng, ["s.ast", "s.ast", "s.ast", "s.raw", "s.pcap"])
        (folder / name).write_bytes(damaged_blocks(rng, blocks))
        tracked([name, "--sensors", "radar.yaml", "--bad-rows", pick(rng, ["refuse", "skip"])], counts)

    try_cases(check, 8)
    print(dict(counts))


def test_damaged_messages_of_ships(try_cases: TryCases, folder: Path) -> None:
    """A message that cannot be read is counted; none is read as another place."""
    lines, counts = messages(), Counter[str]()
    whole = {line.rpartition(b",0*")[0].rpartition(b",")[2] for line in lines}
    assert len(whole) == len(lines)
    (folder / "whole.nmea").write_bytes(b"\n".join(lines))
    places = set(
        zip(*(read_table(folder / "whole.nmea").columns[name] for name in ("longitude", "latitude")), strict=True)
    )

    def check(rng: np.random.Generator) -> None:
        raw = damaged_lines(rng, lines)
        (folder / "t.nmea").write_bytes(raw)
        try:
            with bounded(raw, SECONDS):
                table = read_table(folder / "t.nmea")
                RecordedTargets.from_file(folder / "t.nmea", cleaning=Cleaning())
        except VedetteError as error:
            counts["refused"] += 1
            check_message(error)
            return
        counts["read"] += 1
        found = set(zip(*(table.columns[name] for name in ("longitude", "latitude")), strict=True))
        assert found <= places, found - places
        said = [line for line in raw.split(b"\n") if line.strip() and not line.startswith(b"#")]  # comments
        unread = len(said) - len(table.rows)
        assert unread <= 0 or table.notes, raw

    try_cases(check, 20)
    print(dict(counts))


def test_damaged_lines_of_a_live_loop(try_cases: TryCases, folder: Path) -> None:
    """Each line is answered: with an error that names it, or by estimates."""
    live, lines, counts = small(folder), walk(5), Counter[str]()

    def check(rng: np.random.Generator) -> None:
        raw = damaged_lines(rng, lines).split(b"\n")
        with bounded(raw, SECONDS):
            answers = answered(live, [line for line in raw if line.strip()])
        for text in answers:
            answer = json.loads(text)
            counts["errors" if "error" in answer else "estimates"] += 1
            if "error" in answer:
                check_message(VedetteError(answer["error"]))

    try_cases(check, 12)
    print(dict(counts))
