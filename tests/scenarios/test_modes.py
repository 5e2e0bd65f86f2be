"""Motions with modes in scenario files: read, checked, run, and named in all outputs."""

from __future__ import annotations

import csv
import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from typer.testing import CliRunner

from scenarios.minimal import changed
from vedette import models
from vedette.cli import app
from vedette.densities import Estimate
from vedette.evaluation import run_scenario
from vedette.evaluation.innovations import Instant, _predicted
from vedette.live.answers import track_answers
from vedette.reports.replay import _likeliest
from vedette.scenarios import load_scenario

MOTION = "motion: {kind: constant_velocity, sigma_v: 1.0}"
TURNS = """motion:
  kind: modes
  modes:
    cruise: {motion: {kind: constant_velocity, sigma_v: 0.1}, stay_s: 40.0, to: {turn: 0.8, hidden: 0.2}}
    turn: {motion: {kind: coordinated_turn, sigma_v: 0.5}, stay_s: 8.0, to: {cruise: 1.0}}
    hidden: {motion: {kind: constant_velocity}, detection_factor: 0.0, to: {cruise: 1.0}}"""
FIVE = [
    (
        "mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]",
        "mean: [0.0, 0.0, 0.0, 0.0, 0.0], std: [5, 5, 2, 2, 0.1]",
    ),
    ("state: [1.0, 2.0, 0.5, -0.5]", "state: [1.0, 2.0, 0.5, -0.5, 0.0]"),
]
FILTER = [("filter: {kind: m_delta_glmb}\n", ""), ("fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}\n", "")]


def text(motion: str = TURNS, *changes: tuple[str, str]) -> str:
    return changed((MOTION, motion), *FIVE, *FILTER, *changes)


def written(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_text(content, "utf-8")
    return path


def test_a_section_is_a_motion(tmp_path):
    scenario = pickle.loads(pickle.dumps(load_scenario(written(tmp_path, text()))))
    motion = scenario.model.motion.build(tmp_path)
    assert isinstance(motion, models.Modes)
    assert motion.names == scenario.model.mode_names == ("cruise", "turn", "hidden")
    assert motion.components == ("px", "py", "vx", "vy", "turn_rate")
    expected = np.array([[-0.025, 0.02, 0.005], [0.125, -0.125, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(motion.rates, expected)
    np.testing.assert_array_equal(motion.detection_factors, [1.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stay_s: 40.0", "stay_s: 0.0", "motion.modes.cruise.stay_s: expected a number above 0, got 0.0"),
        ("turn: 0.8", "turning: 0.8", "motion.modes.cruise.to.turning: expected another mode, one of turn, hidden"),
        ("turn: 0.8", "turn: 0.7", "motion.modes.cruise.to: expected probabilities that sum to 1, got 0.9"),
        ("detection_factor: 0.0", "detection_factor: 2.0", "expected a number of at most 1, got 2.0"),
        ("stay_s: 8.0", "at_birth: 0.5", "motion.modes: expected at_birth of all modes or of none, with sum 1"),
        (
            "coordinated_turn,",
            "coordinated_turn, state_order: interleaved,",
            "state_order: expected grouped, as states",
        ),
        ("motion: {kind: coordinated_turn", "motion: {kind: modes", "expected one of constant_acceleration"),
    ],
)
def test_faults_are_named(tmp_path, old, new, message):
    path = written(tmp_path, text(TURNS.replace(old, new)))
    found = CliRunner().invoke(app, ["check", str(path)])
    assert found.exit_code != 0
    assert message in " ".join(found.output.split())


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            "fusion: {kind: parallel}",
            "fusion.kind: expected sequential, central or another fusion that keeps the modes",
        ),
        (
            "filter: {kind: lmb, limits: {max_components: 1}}",
            "max_components: expected at least 2 for a motion with modes",
        ),
    ],
)
def test_what_would_forget_modes_is_refused(tmp_path, more, message):
    found = CliRunner().invoke(app, ["check", str(written(tmp_path, f"{text()}{more}\n"))])
    assert found.exit_code != 0
    assert message in " ".join(found.output.split())


def test_outputs_name_the_modes(tmp_path):
    path = written(tmp_path, text())
    scenario = load_scenario(path)
    record = run_scenario(scenario, "jdm", seed=1, num_threads=1)
    estimates = [estimate for estimate in record.estimates if len(estimate)]
    assert estimates
    assert all(np.all(estimate.mode_probs.sum(axis=1) <= 1.0 + 1e-12) for estimate in estimates)
    assert any(np.allclose(estimate.mode_probs.sum(axis=1), 1.0) for estimate in estimates)
    names = scenario.model.mode_names
    answers = track_answers(estimates[-1], (), names, None, None, scenario.model.motion.components)
    assert list(answers[0]["modes"]) == list(names)
    likeliest = [entry[0] for scan in _likeliest(record, scenario) for entry in scan]
    assert set(likeliest) <= {*names, "new"}
    assert set(likeliest) & set(names)


def test_a_run_keeps_the_probabilities(tmp_path):
    path, out = written(tmp_path, text()), tmp_path / "out"
    found = CliRunner().invoke(app, ["run", str(path), "--out", str(out), "--seed", "1", "--json"])
    assert found.exit_code == 0, found.output
    assert math.isfinite(json.loads(found.output)["ospa"]["total"])
    exported = CliRunner().invoke(app, ["results", str(out), "--export", str(tmp_path / "tables"), "--format", "csv"])
    assert exported.exit_code == 0, exported.output
    table = next((tmp_path / "tables").rglob("tracks*.csv"))
    with table.open(encoding="utf-8") as file:
        assert any(name.startswith("mode_") for name in next(csv.reader(file)))


def test_show_names_the_modes(tmp_path):
    found = CliRunner().invoke(app, ["show", str(written(tmp_path, text()))])
    assert found.exit_code == 0, found.output
    assert "modes cruise (40 s), turn (8 s), hidden (for ever)" in " ".join(found.output.split())


def test_the_fit_predicts_by_modes():
    motions = models.constant_velocity(0.1), models.constant_turn(0.4, 1.0)
    modes = models.Modes(motions, (20.0, 5.0), at_birth=(0.2, 0.8), detection_factors=(1.0, 0.5))
    mean, cov, dt, labels = np.array([1.0, 2.0, 3.0, -1.0]), np.diag([4.0, 4.0, 1.0, 1.0]), 2.0, np.array([[1, 0]])
    estimate = Estimate(labels, mean[None], cov[None], np.ones(1), mode_probs=np.array([[0.6]]))  # .4 are new
    before, now = (Instant(time, np.zeros((1, 3)), (None,), estimate) for time in (0.0, dt))
    shares = np.array([0.6 + 0.4 * 0.2, 0.4 * 0.8]) @ expm(modes.rates * dt)
    ends, spreads = [], []
    for motion in motions:
        slope = np.empty((4, 4))
        motion.transition_jacobian(mean, dt, motion.transition_params, slope)  # type: ignore[misc]
        ends.append(slope @ mean)
        spreads.append(slope @ cov @ slope.T + motion.noise_cov(mean, dt))
    wanted = shares @ np.array(ends)
    apart = [np.outer(end - wanted, end - wanted) for end in ends]
    _, found, covs, seen = _predicted(before, now, modes)
    np.testing.assert_allclose(found[0], wanted, rtol=1e-9)
    np.testing.assert_allclose(covs[0], np.einsum("m,mij->ij", shares, np.add(spreads, apart)), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(seen, shares @ [1.0, 0.5])
