"""Runs in which sensors are off by their actions: simulated, recorded, kept, drawn again and refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import changed
from simulation.test_storage import assert_same
from vedette.cli import app
from vedette.control import ConstantPlanner
from vedette.errors import InputError
from vedette.evaluation.actions import describe_choice
from vedette.evaluation.ensembles import rounded_choice
from vedette.evaluation.runs import run_scenario
from vedette.platforms import Actions
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.loading import parse_scenario
from vedette.simulation import RunRecord, simulate
from vedette.simulation.replay import scans_of
from vedette.simulation.storage import load_run, save_run
from vedette.simulation.tables import tables_of

NOISE = "  noise: {kind: constant, std: [0.02, 3.0]}"
COURSES = f"{NOISE}\n  platform: {{kind: heading, speed: 2.0, headings_deg: [0, 90]}}"
PLANS = ("control: {decision_steps: [4, 8]}", "control: {decision_steps: [4, 8], num_samples: 2, horizon_steps: 2}")


def scene(keys: str = "switchable: true", *more: tuple[str, str]) -> Scenario:
    """Two sensors on courses, with these keys."""
    return Scenario(parse_scenario(changed((NOISE, f"{COURSES}\n  {keys}"), PLANS, *more)))


def fixed(scenario: Scenario, *actions: Actions, **changes: Any) -> RunRecord:
    """A run in which each sensor keeps to one action from the first decision on."""

    def no_score(truth: Any, estimates: Any) -> Any:
        return np.zeros((truth.num_scans, 3))

    experiment = replace(build_experiment(scenario), **changes)
    return simulate(experiment, ConstantPlanner(actions), seed=3, run=0, score=no_score)


@pytest.fixture(scope="module")
def record() -> RunRecord:
    """The first sensor is off from the first decision on, the second never."""
    return fixed(scene(), Actions.of(heading_deg=0.0, on=0.0), Actions.of(heading_deg=90.0, on=1.0))


def test_who_is_off_is_who_has_no_scans_bit_for_bit(record: RunRecord) -> None:
    scans_at = np.ones((2, 20), bool)
    scans_at[0, 4:] = False
    headings = [Actions.of(heading_deg=angle) for angle in (0.0, 90.0)]
    other = fixed(scene("stationary_until_first_decision: true"), *headings, scans_at=scans_at)
    np.testing.assert_array_equal(record.off, ~scans_at.T)
    assert not other.off.any()
    for name in ("times", "truth", "poses", "estimates", "health"):
        assert_same(getattr(record, name), getattr(other, name))


def test_the_scans_drawn_again_lack_those_of_sensors_that_were_off(record: RunRecord) -> None:
    again = scans_of(record, build_experiment(scene()))
    always = scans_of(replace(record, off=np.zeros_like(record.off)), build_experiment(scene()))
    for step, (kept, drawn) in enumerate(zip(again, always, strict=True)):
        for mine, its, off in zip(kept, drawn, record.off[step], strict=True):
            assert (mine is None) == off
            if mine is not None:
                assert its is not None
                np.testing.assert_array_equal(mine.measurements, its.measurements)


def test_who_was_off_is_kept(record: RunRecord, tmp_path: Path) -> None:
    read = load_run(save_run(record, tmp_path / "run"))
    assert_same(read.off, record.off)
    assert np.sum(np.asarray(tables_of(read)["sensors"]["off"])) == 16
    assert "off" not in tables_of(replace(record, off=np.zeros_like(record.off)))["sensors"]
    for wrong in (record.off[1:], record.off.astype(float)):
        with pytest.raises(InputError, match=r"record.off: expected booleans of \(20, 2\)"):
            replace(record, off=wrong).check()


@pytest.mark.parametrize("planner", ["jdm", "idm", "lookahead", "true_targets"])
def test_every_planner_switches_off_what_costs_too_much(planner: str) -> None:
    found = run_scenario(scene("switchable: true\n  price: 1.0e+9"), planner, seed=1)
    assert not found.off[:4].any()
    assert found.off[4:].all()
    for decision in found.decisions:
        plan = decision.plan
        texts = [own.text(index) for own, index in zip(plan.actions, plan.chosen, strict=True)]
        assert all(text.endswith(", off") for text in texts)
        assert describe_choice(rounded_choice(plan)).count("°, off") == 2


MOST_ONE = (PLANS[0], PLANS[1][:-1] + ", constraints: [{kind: max_active, sensors: 1}]}")


@pytest.mark.parametrize(
    "planner", ["jdm", "idm", "lookahead", "true_targets", "oracle", "random", "nearest", "assigned_target", "centroid"]
)
def test_every_planner_keeps_to_the_number_of_sensors_that_may_scan(planner: str) -> None:
    scenario = Scenario(parse_scenario(changed((NOISE, f"{COURSES}\n  switchable: true"), MOST_ONE)))
    found = run_scenario(scenario, planner, seed=1)
    assert not found.off[:4].any()
    assert (found.off[4:].sum(axis=1) >= 1).all()
    if planner != "random":
        assert (found.off[4:].sum(axis=1) == 1).all()


@pytest.mark.parametrize(
    ("keys", "number", "fault"),
    [
        ("price: 1.0", 1, "constraints[0].kind: expected a sensor that is switchable, for max_active, got none"),
        ("switchable: true", 0, "constraints[0].sensors: expected a number of at least 1"),
    ],
)
def test_a_number_that_cannot_be_kept_to_is_refused(keys: str, number: int, fault: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    plans = MOST_ONE[1].replace("sensors: 1}", f"sensors: {number}}}")
    path.write_text(changed((NOISE, f"{COURSES}\n  {keys}"), (PLANS[0], plans)))
    assert fault in " ".join(CliRunner().invoke(app, ["check", str(path)]).output.split())


@pytest.mark.parametrize("compass", ["", "\n  compass: true"])
def test_a_sensor_that_moves_from_the_start_is_on_until_its_first_decision(compass: str) -> None:
    found = run_scenario(
        scene(f"switchable: true\n  stationary_until_first_decision: false\n  price: 1.0e+9{compass}"), "jdm", seed=1
    )
    assert not found.off[:4].any()
    assert found.off[4:].all()
    assert found.decisions[0].plan.actions[0].columns[-1] == "on"


@pytest.mark.parametrize("rule", ["nearest", "assigned_target", "centroid", "constant"])
def test_rules_of_thumb_leave_sensors_on(rule: str) -> None:
    assert not run_scenario(scene("switchable: true\n  price: 1.0e+9"), rule, seed=1).off.any()


def test_sensors_that_stay_may_be_off_too() -> None:
    still = Scenario(parse_scenario(changed((NOISE, f"{NOISE}\n  switchable: true\n  price: 1.0e+9"), PLANS)))
    found = run_scenario(still, "jdm", seed=1)
    assert found.off[4:].all()
    assert found.decisions[0].plan.actions[0].values.tolist() == [[1.0], [0.0]]


def test_filters_that_go_on_from_each_scan_refuse_it(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(changed((NOISE, f"{NOISE}\n  switchable: true"), ("{kind: m_delta_glmb}", "{kind: phd}")))
    shown = " ".join(CliRunner().invoke(app, ["check", str(path)]).output.split())
    assert "switchable: expected false, as phd filters go on from each scan, got true" in shown
