"""Targets not yet found in a scenario: what is built, what is refused, and that a run is as without them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette.cli import app
from vedette.densities import existence_probabilities
from vedette.errors import ScenarioError
from vedette.evaluation import run_scenario
from vedette.models import CellGrid, Region, UndetectedModel
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.sections.undetected import UndetectedSection
from vedette.scenarios.sections.undetected_intensity import MAX_CELLS
from vedette.scenarios.summary import summary_rows
from vedette.scenarios.warnings import scenario_warnings
from vedette.simulation.loop import run_stream
from vedette.tracking import Central, Distributed, UndetectedTargetTracker

SHORT = (
    ("num_steps: 20", "num_steps: 6"),
    ("last_scan: 20", "last_scan: 6"),
    ("[4, 8]", "[2]"),
    ("end_step: 18", "end_step: 6"),
)
WHOLE = "{cell_size: 30.0, expected: 5.0, birth_rate: 0.02, birth_density: boundary, speed: 4.0, survival: 0.99}"


def scenario(undetected: str, *changes: tuple[str, str]) -> Scenario:
    return Scenario(parse_scenario(f"{changed(*changes)}undetected: {undetected}\n", "f.yaml"), Path("f.yaml"))


def test_the_tracker_searches() -> None:
    tracker: Any = build_experiment(scenario(WHOLE)).tracker
    assert isinstance(tracker, UndetectedTargetTracker)
    assert isinstance(tracker.tracker, Distributed)
    model = tracker.model
    assert model.grid == CellGrid(Region(-100.0, 100.0, -50.0, 50.0), 7, 4)
    told = (model.expected, model.birth_rate, model.birth_density, model.speed, model.survival)
    assert told == (5.0, 0.02, "boundary", 4.0, 0.99)
    assert isinstance(build_experiment(Scenario(parse_scenario(MINIMAL), Path("f.yaml"))).tracker, Distributed)
    worth = scenario(WHOLE, ("control: {", "control: {undetected_target_value: 3.0, "))
    assert worth.model.control.undetected_target_value == 3.0


def test_a_region_of_their_own() -> None:
    own = "{cell_size: 10.0, expected: 1.0, speed: 0.0, region: {x_min: 0.0, x_max: 40.0, y_min: 0.0, y_max: 50.0}}"
    tracker: Any = build_experiment(scenario(own)).tracker
    assert tracker.model.grid == CellGrid(Region(0.0, 40.0, 0.0, 50.0), 4, 5)
    assert (tracker.model.birth_rate, tracker.model.birth_density, tracker.model.survival) == (0.0, "uniform", None)
    told = dict(summary_rows(scenario(own).model))["not yet found"]
    assert told == ("cell size 10 m, expected 1, birth density uniform, speed 0 m/s, in x 0 to 40 m, y 0 to 50 m")
    assert "not yet found" not in dict(summary_rows(parse_scenario(MINIMAL)))


def test_defaults_are_those_of_the_library() -> None:
    fields = UndetectedSection.model_fields
    for name in ("birth_density", "survival"):
        assert fields[name].default == UndetectedModel.__dataclass_fields__[name].default


def test_it_is_written_out_and_read_back() -> None:
    model = scenario(WHOLE).model
    assert parse_scenario(dump_scenario(model), "g.yaml") == model


def test_as_many_cells_as_are_allowed() -> None:
    model = scenario("{cell_size: 0.285, expected: 1.0, speed: 1.0}").model
    assert model.undetected is not None
    grid = model.undetected.build(model.region).grid
    assert 0.98 * MAX_CELLS < grid.num_cells <= MAX_CELLS


def test_a_field_of_view_below_half_a_cell_warns() -> None:
    sees = ("{name: south,", "{detection: {kind: limited_range, probability: 0.9, max_range: 12.0}, name: south,")
    found = [line for line in scenario_warnings(scenario(WHOLE, sees)) if "cells of" in line]
    assert len(found) == 1
    assert "warning: cells of 30 m, and south sees as far as 12 m" in found[0]
    assert not any("cells of" in line for line in scenario_warnings(scenario(WHOLE.replace("30.0", "24.0"), sees)))


def test_a_run_is_the_same_with_and_without() -> None:
    alone = Scenario(parse_scenario(changed(*SHORT)), Path("f.yaml"))
    for planner in ("constant", "random"):
        mine, other = (run_scenario(one, planner, seed=3) for one in (scenario(WHOLE, *SHORT), alone))
        assert mine.poses.tobytes() == other.poses.tobytes()
        for estimate, another in zip(mine.estimates, other.estimates, strict=True):
            assert estimate.means.tobytes() == another.means.tobytes()


def test_intensity_falls_where_sensors_look() -> None:
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
    done = runner.invoke(app, ["run", str(file), "--planner", "constant", "--out", str(tmp_path / "run.npz")])
    assert done.exit_code == 0, done.output
    file.write_text(f"{MINIMAL}undetected: {{cell_size: 0.01, expected: 5.0, speed: 1.0}}\n")
    refused = runner.invoke(app, ["check", str(file)])
    assert refused.exit_code == 1
    assert "undetected.cell_size: expected at least 0.285" in refused.output


ONE = (
    ("filter: {kind: m_delta_glmb}", "filter: {kind: factored_glmb}"),
    ("cm_delta_glmb, weights: [0.5, 0.5]", "sequential"),
)
BORN = ("birth:", "birth:\n  from_measurements: {expected: 0.2, std: [6.0, 6.0, 3.0, 3.0]}")


def test_beliefs_with_an_intensity_need_no_section() -> None:
    """The cells of the section, with the births from measurements where it gives no rate, and what came from sites."""
    tracker: Any = build_experiment(scenario(WHOLE, *ONE, BORN)).tracker
    assert isinstance(tracker, Central)
    found = tracker.targets.birth.anywhere
    assert found is not None
    assert (found.expected, found.birth_rate, found.birth_density, found.speed, found.survival) == (
        5.0,
        0.02,
        "boundary",
        4.0,
        0.99,
    )
    without: Any = build_experiment(scenario("{cell_size: 30.0, expected: 0.0, speed: 4.0}", *ONE, BORN)).tracker
    assert without.targets.birth.anywhere.birth_rate == "learnt"
    at_sites: Any = build_experiment(scenario("{cell_size: 30.0, expected: 0.0, speed: 4.0}", *ONE)).tracker
    assert at_sites.targets.birth.anywhere.birth_rate == 0.0
    state: Any = tracker.initial()
    assert state.undetected.total == pytest.approx(5.0)
    assert state.undetected.grid == found.grid
    rngs = [run_stream(0, 1)] * 2
    poses = np.zeros((2, 3)) + 1e6  # from where nothing is seen
    state, _ = tracker.step(state, [None, None], poses, 2.0, rngs=rngs)
    cells = state.fused.undetected.cells
    assert cells.total == pytest.approx(5.0)  # at the first scan
    at_site = state.undetected.expected - cells.expected
    assert at_site.sum() == pytest.approx(0.1, rel=1e-6)
    assert at_site.argmax() in found.grid.cells_at(np.array([[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]]))
    state, _ = tracker.step(state, [None, None], poses, 2.5, rngs=rngs)
    expected = found.predict(cells.expected, 0.5, 0.99**0.5)
    np.testing.assert_allclose(state.fused.undetected.cells.expected, expected, rtol=1e-12)


def test_planners_search_without_a_section() -> None:
    """By the belief's own intensity, at a learnt rate; not where nothing decides, starts or is worth searching for."""

    def anywhere(*changes: tuple[str, str]) -> Any:
        given = Scenario(parse_scenario(changed(*changes)), Path("f.yaml"))
        return build_experiment(given).tracker.targets.birth.anywhere, "not yet found" in dict(
            summary_rows(given.model)
        )

    found, told = anywhere(*ONE, BORN)
    assert (found.birth_rate, found.prior_rate, found.expected, found.grid.num_cells) == (
        "learnt",
        pytest.approx(0.4),
        1.0,
        16 * 16,
    )
    assert told
    sight = "  detection: {kind: limited_range, probability: 0.9, max_range: 20.0}"
    near = ("sensor_defaults:", f"sensor_defaults:\n{sight}")
    assert anywhere(*ONE, BORN, near)[0].grid.num_cells > 16 * 16
    for more in ((ONE[1], BORN), ONE, (*ONE, BORN, ("control: {", "control: {undetected_target_value: 0.0, "))):
        assert anywhere(*more) == (None, False)
    of_sites, told = anywhere(*ONE, near)  # where a view has an edge
    assert (of_sites.birth_rate, of_sites.expected, told) == (0.0, 0.0, True)
    assert of_sites.grid.num_cells > 16 * 16
    given = Scenario(parse_scenario(changed(*SHORT, *ONE, BORN)), Path("f.yaml"))
    record = run_scenario(given, "jdm", seed=1)
    assert any(decision.plan.explain().of_undetected for decision in record.decisions)
    wild = changed(*ONE, BORN, ("control: {", "control: {undetected_target_value: 10000.0, "))
    assert "a factor of that cost" in "".join(scenario_warnings(Scenario(parse_scenario(wild), Path("f.yaml"))))


def test_an_unexplained_measurement_starts_a_track_by_the_odds_of_the_intensity() -> None:
    """Five targets are expected, and the clutter is that of the scenario: rho / (rho + kappa)."""
    existence = []
    for expected in (5.0, 0.5):
        tracker: Any = build_experiment(
            scenario(f"{{cell_size: 30.0, expected: {expected}, speed: 4.0}}", *ONE, BORN)
        ).tracker
        place = np.array([60.0, 20.0])
        measured = tracker.sensors[0].measurement
        pose = np.array([[0.0, 40.0, 0.0], [0.0, -40.0, 0.0]])
        offset = place - pose[0, :2]
        scan = [[np.arctan2(offset[1], offset[0]), np.hypot(*offset)]]
        np.testing.assert_allclose(measured.positions(np.array(scan), pose[0]), [place], atol=1e-9)
        state, _ = tracker.step(tracker.initial(), [scan, None], pose, 2.0, rngs=[run_stream(0, 1)] * 2)
        labels, found = existence_probabilities(state.fused)
        assert labels.tolist() == [[1, 1]]
        existence.append(found[0] / (1.0 - found[0]))
    assert existence[0] / existence[1] == pytest.approx(10.0, rel=1e-6)


def test_detection_is_its_mean_where_undetected_targets_are_an_intensity() -> None:
    pmb = "lmb, births: poisson"
    for kind, expected in (("factored_glmb", "mean"), (pmb, "mean"), ("lmb", "centre"), ("delta_glmb", "centre")):
        fusion = ("fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}", "fusion: {kind: sequential}")
        changes = ("filter: {kind: m_delta_glmb}", f"filter: {{kind: {kind}}}"), fusion
        given = Scenario(parse_scenario(changed(*changes)), Path("f.yaml"))
        assert build_experiment(given).tracker.sensors[0].detection_at == expected


def test_where_no_track_starts_from_measurements_estimates_are_the_same() -> None:
    mine, other = (
        run_scenario(Scenario(parse_scenario(changed(*SHORT, *ONE) + more), Path("f.yaml")), "constant", seed=3)
        for more in (f"undetected: {WHOLE}\n", "")
    )
    for estimate, another in zip(mine.estimates, other.estimates, strict=True):
        assert estimate.means.tobytes() == another.means.tobytes()


def test_a_birth_rate_is_learnt() -> None:
    rate = "{cell_size: 30.0, expected: 1.0, birth_rate: learnt, speed: 4.0}"
    found: Any = build_experiment(scenario(rate, *ONE, BORN)).tracker.targets.birth.anywhere
    assert (found.birth_rate, found.prior_rate) == ("learnt", pytest.approx(0.4))  # .2 a scan of .5 s
    given = build_experiment(scenario(rate.replace("learnt", "learnt, prior_rate: 0.7"), *ONE, BORN))
    assert given.tracker.targets.birth.anywhere.prior_rate == 0.7  # type: ignore[union-attr]
    born = (BORN[0], BORN[1].replace("0.2", "learnt"))
    alone: Any = build_experiment(Scenario(parse_scenario(changed(*ONE, born)), Path("f.yaml"))).tracker
    found = alone.targets.birth.anywhere
    assert (found.birth_rate, found.prior_rate, found.expected) == (
        "learnt",
        pytest.approx(0.2),
        1.0,
    )  # a tenth of a target a scan
    told = dict(summary_rows(parse_scenario(changed(*ONE, born))))
    assert told["births"] == "1 site, steps 1, 5; at a learnt rate from measurements"
    assert dict(summary_rows(scenario(rate, *ONE, BORN).model))["not yet found"].startswith(
        "cell size 30 m, expected 1, birth rate learnt"
    )
    with pytest.raises(ScenarioError, match=r"from_measurements\.expected: expected a number, as only one belief"):
        parse_scenario(changed(ONE[1], born, ("m_delta_glmb", "lmb")))
