"""Targets not yet found in a scenario: what is built, what is refused, and that a run is as without them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette.cli import app
from vedette.evaluation import run_scenario
from vedette.models import CellGrid, Region, UndetectedModel
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.cautions import cautions
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.sections.undetected import MAX_CELLS, UndetectedSection
from vedette.scenarios.summary import facts
from vedette.simulation.loop import run_stream
from vedette.tracking import Distributed, Searching

SHORT = (
    ("num_steps: 20", "num_steps: 6"),
    ("to_step: 20", "to_step: 6"),
    ("[4, 8]", "[2]"),
    ("end_step: 18", "end_step: 6"),
)
WHOLE = "{cell: 30.0, expected: 5.0, birth_rate: 0.02, enters: border, speed: 4.0, survival: 0.99}"


def scenario(undetected: str, *changes: tuple[str, str]) -> Scenario:
    return Scenario(parse_scenario(f"{changed(*changes)}undetected: {undetected}\n", "f.yaml"), Path("f.yaml"))


def test_the_tracker_searches() -> None:
    tracker: Any = build_experiment(scenario(WHOLE)).tracker
    assert isinstance(tracker, Searching)
    assert isinstance(tracker.tracker, Distributed)
    model = tracker.model
    assert model.grid == CellGrid(Region(-100.0, 100.0, -50.0, 50.0), 7, 4)
    told = (model.expected, model.birth_rate, model.enters, model.speed, model.survival)
    assert told == (5.0, 0.02, "border", 4.0, 0.99)
    assert isinstance(build_experiment(Scenario(parse_scenario(MINIMAL), Path("f.yaml"))).tracker, Distributed)
    worth = scenario(WHOLE, ("control: {", "control: {undetected_worth: 3.0, "))
    assert worth.model.control.undetected_worth == 3.0


def test_a_region_of_their_own() -> None:
    own = "{cell: 10.0, expected: 1.0, speed: 0.0, region: {x_min: 0.0, x_max: 40.0, y_min: 0.0, y_max: 50.0}}"
    tracker: Any = build_experiment(scenario(own)).tracker
    assert tracker.model.grid == CellGrid(Region(0.0, 40.0, 0.0, 50.0), 4, 5)
    assert (tracker.model.birth_rate, tracker.model.enters, tracker.model.survival) == (0.0, "anywhere", None)
    told = dict(facts(scenario(own).model))["not yet found"]
    assert told == (
        "cell 10 m, expected 1, birth_rate 0 1/s, enters anywhere, speed 0 m/s, prior_rate 0.1 1/s, "
        "in x 0 to 40 m, y 0 to 50 m"
    )
    assert "not yet found" not in dict(facts(parse_scenario(MINIMAL)))


def test_defaults_are_those_of_the_library() -> None:
    fields = UndetectedSection.model_fields
    for name in ("birth_rate", "enters", "survival"):
        assert fields[name].default == UndetectedModel.__dataclass_fields__[name].default


def test_it_is_written_out_and_read_back() -> None:
    model = scenario(WHOLE).model
    assert parse_scenario(dump_scenario(model), "g.yaml") == model


def test_as_many_cells_as_are_allowed() -> None:
    model = scenario("{cell: 0.285, expected: 1.0, speed: 1.0}").model
    assert model.undetected is not None
    grid = model.undetected.build(model.region).grid
    assert 0.98 * MAX_CELLS < grid.num_cells <= MAX_CELLS


def test_a_sensor_that_sees_less_than_half_a_cell_is_warned_of() -> None:
    sees = ("{name: south,", "{detection: {kind: limited_range, probability: 0.9, max_range: 12.0}, name: south,")
    found = [line for line in cautions(scenario(WHOLE, sees)) if "cells of" in line]
    assert len(found) == 1
    assert "warning: cells of 30 m, and south sees as far as 12 m" in found[0]
    assert not any("cells of" in line for line in cautions(scenario(WHOLE.replace("30.0", "24.0"), sees)))


def test_a_run_is_the_same_with_and_without() -> None:
    alone = Scenario(parse_scenario(changed(*SHORT)), Path("f.yaml"))
    for planner in ("fixed", "random"):
        mine, other = (run_scenario(one, planner, seed=3) for one in (scenario(WHOLE, *SHORT), alone))
        assert mine.poses.tobytes() == other.poses.tobytes()
        for estimate, another in zip(mine.estimates, other.estimates, strict=True):
            assert estimate.means.tobytes() == another.means.tobytes()


def test_what_is_looked_at_is_found_empty() -> None:
    experiment = build_experiment(scenario(WHOLE.replace("0.02", "0.0")))
    tracker, state = experiment.tracker, experiment.tracker.initial()
    assert state.undetected is not None
    assert state.undetected.total == pytest.approx(5.0)
    for step, time in enumerate(experiment.times.tolist()[:3], start=1):
        scans = [np.empty((0, sensor.meas_dim)) for sensor in tracker.sensors]
        state, _ = tracker.step(state, scans, experiment.poses, time, rngs=[run_stream(0, step)] * 2)
    assert state.undetected is not None
    assert state.undetected.total < 0.01  # of which each sensor sees nearly all


def test_check_show_and_run_from_the_command_line(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(f"{changed(*SHORT)}undetected: {WHOLE}\n")
    runner = CliRunner()
    checked = runner.invoke(app, ["check", str(file)])
    assert checked.exit_code == 0, checked.output
    shown = runner.invoke(app, ["show", str(file)], env={"COLUMNS": "200"})
    assert shown.exit_code == 0, shown.output
    assert "not yet found" in shown.output
    done = runner.invoke(app, ["run", str(file), "--planner", "fixed", "--out", str(tmp_path / "run.npz")])
    assert done.exit_code == 0, done.output
    file.write_text(f"{MINIMAL}undetected: {{cell: 0.01, expected: 5.0, speed: 1.0}}\n")
    refused = runner.invoke(app, ["check", str(file)])
    assert refused.exit_code == 1
    assert "undetected.cell: expected at least 0.285" in refused.output
