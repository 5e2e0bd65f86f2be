from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import CLUTTER, Scan, loop, simulate_scans
from vedette.simulation.replay import scans_of


def test_the_scans_drawn_again_are_those_that_the_loop_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    simulated: list[Scan] = []

    def recording(*args: Any, **kwargs: Any) -> tuple[Scan, ...]:
        scans: Any = simulate_scans(*args, **kwargs)
        simulated.extend(scans)
        return scans

    monkeypatch.setattr(loop, "simulate_scans", recording)
    scenario = load_scenario("paper-a")
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


def test_a_record_of_other_sensors_is_refused() -> None:
    scenario = load_scenario("paper-a")
    record = run_scenario(scenario, "stationary", seed=0)
    with pytest.raises(InputError, match="expected 2 sensors; got 1"):
        scans_of(replace(record, poses=record.poses[:, :1]), build_experiment(scenario))
