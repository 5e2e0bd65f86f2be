"""Births of recordings without a birth section: learnt, whatever the rate of scans."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vedette.evaluation.runs import track_recording
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording

SENSORS = """sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [.5, .5]}
  detection: {kind: constant, probability: .9}
sensors: [{name: C, position: [0.0, 0.0]}]
"""


def two_targets(folder: Path, period: float) -> tuple[RecordingScenario, int]:
    """300 scans of two targets, the second from the 100th on, and a false plot in five scans; number of false plots."""
    rng, rows, num_false = np.random.default_rng(0), ["time,x,y"], 0
    for k in range(300):
        targets = np.array([[0.0, 0.3 * k * period], [30.0 - 0.5 * k * period, -20.0]])[: 1 + (k >= 100)]
        seen = targets[rng.random(len(targets)) < 0.9]
        false = rng.uniform(-100.0, 100.0, (rng.poisson(0.2), 2))
        num_false += len(false)
        plots = np.concatenate([seen + rng.normal(0.0, 0.5, seen.shape), false])
        rows += [f"{k * period:.4f},{x:.3f},{y:.3f}" for x, y in plots.tolist()] or [f"{k * period:.4f},,"]
    (folder / "scans.csv").write_text("\n".join(rows) + "\n", "utf-8")
    (folder / "sensors.yaml").write_text(SENSORS, "utf-8")
    return scenario_from_recording(folder / "sensors.yaml", folder / "scans.csv", speed=3.0), num_false


@pytest.mark.parametrize("period", [1.0 / 30.0, 1.0])
def test_false_plots_make_few_tracks_at_any_rate_of_scans(tmp_path: Path, period: float) -> None:
    found, num_false = two_targets(tmp_path, period)
    assert num_false > 50
    assert found.assumed["birth"].startswith("new targets at a rate learnt from the scans, ")
    estimates = track_recording(found.scenario, found.recording).estimates
    labels = {tuple(label) for each in estimates for label in each.labels.tolist()}
    assert len(labels) <= 2 + 3
    present = [len(each.labels) for each in estimates]
    assert np.mean(present[10:100]) == pytest.approx(1.0, abs=0.1)
    assert np.mean(present[110:]) == pytest.approx(2.0, abs=0.1)


def test_calibration_counts_a_number_of_births_in_place_of_a_learnt_rate(tmp_path: Path) -> None:
    """Because a rate that adapts to the parameters would make wrong ones likely."""
    problem = build_problem(two_targets(tmp_path, 1.0)[0].scenario)
    start = problem.free([each.start for each in problem.parameters])
    assert np.isfinite(problem.log_likelihoods(start)).all()
