from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, list_builtin, load_scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import CLUTTER, Scan, load_run, loop, save_run, simulate_scans
from vedette.simulation.replay import scans_of

LASTING = "sensor_defaults:\n  true_parameters: {correlation: {noise_s: 5.0, visible_s: 6.0, hidden_s: 3.0}}\n"


@pytest.mark.parametrize("lasting", ["sensor_defaults:\n", LASTING])
def test_the_scans_drawn_again_are_those_that_the_loop_simulated(monkeypatch: pytest.MonkeyPatch, lasting: str) -> None:
    simulated: list[Scan] = []

    def recording(*args: Any, **kwargs: Any) -> tuple[Scan, ...]:
        scans: Any = simulate_scans(*args, **kwargs)
        simulated.extend(scans)
        return scans

    monkeypatch.setattr(loop, "simulate_scans", recording)
    text = list_builtin()["paper-a"].read_text("utf-8")
    scenario = Scenario(parse_scenario(text.replace("sensor_defaults:\n", lasting)))
    record = run_scenario(scenario, "random", seed=3, run=2)
    again: Any = scans_of(record, build_experiment(scenario))
    assert len(again) == record.num_scans
    assert len(simulated) == record.num_scans * record.num_sensors
    for step, scans in enumerate(again):
        ids, _ = record.truth.at(step)
        for sensor, scan in enumerate(scans):
            before = simulated[step * record.num_sensors + sensor]
            np.testing.assert_array_equal(scan.measurements, before.measurements)
            places = np.where(before.origins == CLUTTER, 0, before.origins)  # the loop names targets by their place
            np.testing.assert_array_equal(scan.origins, np.where(before.origins == CLUTTER, CLUTTER, ids[places]))


HIDING = """motion:
  kind: modes
  modes:
    seen: {motion: {kind: constant_velocity, sigma_v: 0.5}, stay_s: 10.0}
    hidden: {motion: {kind: constant_velocity, sigma_v: 0.5}, stay_s: 10.0, detection_factor: 0.0}
"""


def test_hidden_targets_are_in_no_scan_of_a_record_that_was_saved(tmp_path):
    text = list_builtin()["paper-a"].read_text("utf-8")
    text = re.sub(r"(- \{state: \[[^\]]*\])\}", r"\1, process_noise: true}", text)
    scenario = Scenario(parse_scenario(re.sub(r"motion:\n(?:  .*\n)+", HIDING, text, count=1)))
    record = run_scenario(scenario, "stationary", seed=3)
    save_run(record, tmp_path / "run")
    loaded = load_run(tmp_path / "run")
    np.testing.assert_array_equal(loaded.truth.detection_factors, record.truth.detection_factors)
    num_hidden = num_detected = 0
    again: Any = scans_of(loaded, build_experiment(scenario))
    for step, scans in enumerate(again):
        hidden = record.truth.at(step)[0][record.truth.detection_factors_at(step) == 0.0]
        num_hidden += len(hidden)
        for scan in scans:
            assert not np.isin(scan.origins, hidden).any()
            num_detected += int(np.count_nonzero(scan.origins != CLUTTER))
    assert num_hidden > 20
    assert num_detected > 50


def test_a_record_of_other_sensors_is_refused() -> None:
    scenario = load_scenario("paper-a")
    record = run_scenario(scenario, "stationary", seed=0)
    with pytest.raises(InputError, match="expected 2 sensors; got 1"):
        scans_of(replace(record, poses=record.poses[:, :1]), build_experiment(scenario))
