"""Stays and noises of modes are parameters of the calibration: their values reach the filter and the written file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recordings import SENSORS, write_recording
from vedette.calibration import Calibration, ParameterEstimate, Problem, calibrate
from vedette.models.modes import Modes
from vedette.scenarios import Scenario
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.yaml_reader import read_yaml

MODES = """motion:
  kind: modes
  modes:
    cruise: {motion: {kind: constant_velocity, sigma_v: 0.2}, stay_s: 40.0}
    a turn.left: {motion: {kind: constant_turn, turn_rate_deg: 9.0, sigma_v: 1.0}, stay_s: 8.0}
    stands: {motion: {kind: ornstein_uhlenbeck, speed: 0.2, time_constant: 3.0}}
"""
NAMES = {
    "modes.cruise.stay_s": 40.0,
    "modes.cruise.motion.sigma_v": 0.2,
    "modes.a turn.left.stay_s": 8.0,
    "modes.a turn.left.motion.sigma_v": 1.0,
    "modes.stands.motion.speed": 0.2,
}


def problem(folder: Path, motion: str = MODES, seconds: float = 60.0) -> tuple[Problem, Scenario]:
    write_recording(folder, seconds=seconds)
    (folder / "radars.yaml").write_text(SENSORS + motion, "utf-8")
    scenario = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario
    return build_problem(scenario, biases=False), scenario


def test_each_stay_and_noise_is_a_parameter_of_the_targets(tmp_path: Path) -> None:
    found, _ = problem(tmp_path)
    own = [each for each in found.parameters if each.kind == "motion"]
    assert {each.name: each.start for each in own} == NAMES
    assert {each.sensor for each in own} == {-1}
    assert own[0].label == "cruise.stay_s"
    assert [each.unit for each in own] == ["s", "m/s^2", "s", "m/s^2", "m/s"]


def test_one_motion_has_no_parameters(tmp_path: Path) -> None:
    found, _ = problem(tmp_path, "motion: {kind: constant_velocity, sigma_v: 0.2}\n")
    assert not [each for each in found.parameters if each.kind == "motion"]


def test_values_reach_the_filter(tmp_path: Path) -> None:
    found, _ = problem(tmp_path)
    changed = {"modes.cruise.stay_s": 20.0, "modes.a turn.left.motion.sigma_v": 3.0}
    values = np.array([changed.get(each.name, each.start) for each in found.parameters])
    tracker, _ = found.tracker(values, found.births)
    motion = tracker.targets.motion
    assert isinstance(motion, Modes)
    np.testing.assert_allclose(-np.diag(motion.rates), [1.0 / 20.0, 1.0 / 8.0, 0.0])
    cov = motion.motions[1].noise_covs(np.zeros((1, 4)), 1.0)[0]
    before, _ = found.tracker(np.array([each.start for each in found.parameters]), found.births)
    assert isinstance(before.targets.motion, Modes)
    np.testing.assert_allclose(cov, 9.0 * before.targets.motion.motions[1].noise_covs(np.zeros((1, 4)), 1.0)[0])


def test_better_values_are_written(tmp_path: Path) -> None:
    found, scenario = problem(tmp_path)
    estimates = tuple(
        ParameterEstimate(
            each, 2.0 * each.start, each.start, 4.0 * each.start, "", "" if "cruise" in each.name else "no"
        )
        for each in found.parameters
        if each.kind == "motion"
    )
    calibration = Calibration(estimates, 1.0, 0.0, True, len(estimates))
    text = calibrated_text(scenario, tmp_path / "radars.yaml", calibration, None)
    modes = read_yaml(text, "calibrated.yaml").data["motion"]["modes"]
    assert modes["cruise"] == {"motion": {"kind": "constant_velocity", "sigma_v": 0.4}, "stay_s": 80.0}
    assert modes["a turn.left"]["stay_s"] == 8.0
    (tmp_path / "new.yaml").write_text(text, "utf-8")
    again = scenario_from_recording(tmp_path / "new.yaml", tmp_path / "scans.csv").scenario
    assert again.model.motion.modes["stands"].motion.speed == 0.2


@pytest.mark.slow
def test_noise_of_modes_is_found(tmp_path: Path) -> None:
    """Targets go straight on. Noise that is far too large is estimated to be smaller, at a higher likelihood."""
    motion = """motion:
  kind: modes
  modes:
    cruise: {motion: {kind: constant_velocity, sigma_v: 0.5}, stay_s: 200.0}
    changes: {motion: {kind: constant_velocity, sigma_v: 6.0}, stay_s: 8.0}
"""
    found, _ = problem(tmp_path, motion, seconds=240.0)
    noise = [each for each in found.parameters if each.name == "modes.cruise.motion.sigma_v"]
    calibration = calibrate(found, only=noise)
    [estimate] = calibration.estimates
    assert estimate.is_better
    assert estimate.value < 0.2
    assert calibration.log_likelihood > calibration.initial_log_likelihood
