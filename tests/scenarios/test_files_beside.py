"""Scenarios that name other files: recorded targets and models, relative to the scenario file."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import Scenario, load_scenario, parse_scenario
from vedette.scenarios.build import build_targets
from vedette.scenarios.dumping import dump_scenario
from vedette.simulation import Truth

SCRIPTED = "  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}"
SHIPS = "when,ship,lon,lat\n" + "".join(
    f"2024-05-01T12:00:{second:02d}Z,{ship},{0.0001 * second},{50.0 + 0.0001 * ship}\n"
    for second in range(0, 20, 2)
    for ship in (1, 2)
)


def truth_of(scenario: Scenario) -> Truth:
    return build_targets(scenario).truth(scenario.model.time.build(), rng=np.random.default_rng(0))


def written(folder: Path, targets: str) -> Path:
    file = folder / "scenario.yaml"
    file.write_text(changed((SCRIPTED, targets)), encoding="utf-8")
    return file


@pytest.fixture
def ships(tmp_path: Path) -> Path:
    (tmp_path / "ships.csv").write_text(SHIPS, encoding="utf-8")
    return tmp_path


def test_recorded_ships_with_longitude_and_latitude(ships: Path) -> None:
    columns = "columns: {time: when, id: ship, longitude: lon, latitude: lat}"
    start = "time_origin: '2024-05-01T12:00:01Z', origin_deg: [0, 50]"
    truth = truth_of(load_scenario(written(ships, f"  {{kind: recorded, path: ships.csv, {columns}, {start}}}")))
    np.testing.assert_array_equal(np.diff(truth.offsets), [2] * 20)
    east, north = 111_413.0 * np.cos(np.radians(50.0)), 111_229.0  # m a degree at 50 N
    np.testing.assert_allclose(truth.states[0, :2], [1e-4 * east, 1e-4 * north], rtol=5e-3)
    np.testing.assert_allclose(truth.states[:, 2:], np.tile([1e-4 * east, 0.0], (40, 1)), rtol=5e-3, atol=1e-3)


def test_recorded_targets_end_at_the_region_by_default(ships: Path) -> None:
    rows = "time,id,x,y\n" + "".join(f"{time},a,{30 * time - 150},0\n" for time in range(11))
    (ships / "straight.csv").write_text(rows, encoding="utf-8")
    cropped = load_scenario(written(ships, "  {kind: recorded, path: straight.csv}"))
    whole = load_scenario(written(ships, "  {kind: recorded, path: straight.csv, crop: false}"))
    assert np.abs(truth_of(cropped).states[:, 0]).max() <= 100.0
    assert len(truth_of(cropped).ids) < len(truth_of(whole).ids)


def test_recorded_targets_of_a_parquet_file(tmp_path: Path) -> None:
    table = {"time": [0.0, 20.0, 0.0, 20.0], "id": [7, 7, 9, 9], "x": [0.0, 20.0, 0.0, 0.0], "y": [0.0, 0.0, 0.0, 10.0]}
    parquet.write_table(pyarrow.table(table), tmp_path / "ships.parquet")
    truth = truth_of(load_scenario(written(tmp_path, "  {kind: recorded, path: ships.parquet}")))
    np.testing.assert_allclose(truth.states[:2], [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.5]], atol=1e-12)


@pytest.mark.parametrize(
    ("targets", "fault"),
    [
        (
            "  {kind: recorded, path: ships.csv}",
            "10:1: targets.columns: expected the names of the columns of time, id among "
            "when, ship, lon, lat, got nothing",
        ),
        (
            "  {kind: recorded, path: ships.csv, columns: {time: When, id: ship, longitude: lon, latitude: lat}}",
            '11:53: targets.columns.time: expected a column of ships.csv: when, ship, lon, lat, got "When"',
        ),
        (
            "  {kind: recorded, path: ships.csv, columns: {x: lon, longitude: lon}}",
            "11:46: targets.columns: expected x and y together, got only x",
        ),
    ],
)
def test_missing_columns(ships: Path, targets: str, fault: str) -> None:
    file = written(ships, targets)
    with pytest.raises(ScenarioError) as error:
        load_scenario(file)
    assert error.value.faults == [f"{file}:{fault}"]


def test_models_cannot_be_imported_from_main(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "typed_at_a_prompt", ModuleType("typed_at_a_prompt"))
    custom = "{kind: custom, function: 'typed_at_a_prompt:motion', components: [px, py, vx, vy]}"
    with pytest.raises(ScenarioError, match=r"motion\.function: expected a module that Python finds"):
        parse_scenario(changed(("{kind: constant_velocity, sigma_v: 1.0}", custom)))


def test_a_recorded_file_that_is_not_a_table(ships: Path) -> None:
    (ships / "broken.csv").write_text("time,id,x,y\n0,a,1\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"broken\.csv, row 2: expected 4 cells"):
        load_scenario(written(ships, "  {kind: recorded, path: broken.csv}"))


def test_a_kept_copy_still_finds_its_files(ships: Path) -> None:
    columns = "{time: when, id: ship, longitude: lon, latitude: lat}"
    scenario = load_scenario(written(ships, f"  {{kind: recorded, path: ships.csv, columns: {columns}}}"))
    text = dump_scenario(scenario.model, folder=scenario.folder)
    elsewhere = Scenario(parse_scenario(text, folder=Path("/")), Path("/elsewhere.yaml"))
    np.testing.assert_array_equal(truth_of(elsewhere).states, truth_of(scenario).states)


def test_a_kept_copy_still_finds_its_models(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("motion = None", encoding="utf-8")
    arguments = "{kind: custom, function: 'a.py:b'}"
    custom = f"{{kind: custom, function: 'own.py:motion', arguments: {arguments}, components: [px, py, vx, vy]}}"
    text = changed(("{kind: constant_velocity, sigma_v: 1.0}", custom))
    motion = parse_scenario(dump_scenario(parse_scenario(text, folder=tmp_path), folder=tmp_path)).motion
    assert motion.model_dump()["function"] == f"{tmp_path.resolve() / 'own.py'}:motion"
    assert motion.model_dump()["arguments"] == {"kind": "custom", "function": "a.py:b"}
