"""Scenarios whose sensors are not what the filters take them for: read, built, checked, shown and run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import changed
from vedette import models
from vedette.cli import app
from vedette.errors import ScenarioError
from vedette.models import DetectionModel
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.dumping import dump_scenario

POSITIONS = (
    ("noise: {kind: constant, std: [0.02, 3.0]}", "noise: {kind: constant, std: [2.0, 2.0]}"),
    ("sensor_defaults:\n", "sensor_defaults:\n  measurement: {kind: position}\n"),
)
TRUTH = """heading_deg: 30.0
    detection: {kind: limited_range, probability: 0.9, max_range: 60.0}
    true_parameters:
      noise: {kind: by_axis, std: [1.0, 1.0], quadratic_growth: [1e-5, 1e-5]}
      detection:
        {kind: soft_sector, probability: 0.9801, max_range: 60.0, range_slope: 1.0, angle_slope: 20.0, hard_limit: true}
      clutter: {kind: around_sensor, rate: 1.25, half_side: 2000.0, half_width_deg: 45.0}
      first_detection: {kind: limited_range, probability: 1.0, max_range: 1000.0}
      detection_of: measurement
    scans: {every: 3, first: 2}"""
FILE = changed(
    *POSITIONS,
    (
        "  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}",
        f"  - name: north\n    position: [0.0, 40.0]\n    {TRUTH}",
    ),
    ("filter: {kind: m_delta_glmb}", "filter: {kind: m_delta_glmb, detection_at: mean}"),
)


def experiment_of(text: str) -> Any:
    return build_experiment(Scenario(parse_scenario(text), Path("x.yaml")))


def test_simulated_and_assumed_sensors_differ() -> None:
    experiment = experiment_of(FILE)
    known, true = experiment.tracker.sensors[0], experiment.true_sensors[0]
    assert known.detection_at == "mean"
    assert known.noise.covs([[100.0, 0.0, 0.0, 0.0]], experiment.poses[0], 2)[0, 0, 0] == 4.0
    assert known.clutter.rate == 25.0
    assert true.model.clutter.rate == 1.25
    assert true.model.noise.covs([[100.0, 0.0, 0.0, 0.0]], experiment.poses[0], 2)[0, 0, 0] == (1.0 + 0.1) ** 2
    assert true.detection_of == "measurement"
    assert true.first_detection is not None
    np.testing.assert_array_equal(np.flatnonzero(experiment.scans_at[0]) + 1, [2, 5, 8, 11, 14, 17, 20])
    assert experiment.scans_at[1].all()
    for name in ("measurement", "noise", "detection", "clutter"):
        parts = [getattr(each, name) for each in (experiment.true_sensors[1].model, experiment.tracker.sensors[1])]
        np.testing.assert_array_equal(parts[0].params, parts[1].params)


def test_a_published_detection_model_can_be_given_exactly() -> None:
    """.99 / (1 + exp(rho - R)) times .99 / (1 + exp(20 (|dtheta| - pi))) up to R, 0 beyond."""
    experiment = experiment_of(FILE)
    detection: DetectionModel = experiment.true_sensors[0].model.detection
    pose = experiment.poses[0]
    points = np.random.default_rng(0).uniform(-80.0, 80.0, (500, 2))
    offsets = points - pose[:2]
    rho = np.hypot(*offsets.T)
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(offsets[:, 1], offsets[:, 0]) - pose[2]))))
    expected = 0.99 / (1.0 + np.exp(rho - 60.0)) * 0.99 / (1.0 + np.exp(20.0 * (off - np.pi))) * (rho <= 60.0)
    np.testing.assert_allclose(detection.prob(np.c_[points, np.zeros((500, 2))], pose), expected, rtol=1e-9)


def test_it_reads_back_as_it_is_written_and_defaults_are_shared() -> None:
    model = parse_scenario(FILE)
    assert parse_scenario(dump_scenario(model)) == model
    shared = changed(
        ("sensor_defaults:\n", "sensor_defaults:\n  true_parameters: {detection: {kind: constant, probability: 0.5}}\n")
    )
    true = experiment_of(shared).true_sensors
    assert [sensor.model.detection.params[0] for sensor in true] == [0.5, 0.5]


def test_a_custom_measurement_replaces_that_of_the_filters(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from vedette import models\n\n"
        '@models.model_function("measurement")\n'
        "def off(state, pose, params, out):\n"
        "    out[0], out[1] = state[0] + params[0], state[1]\n\n"
        "def shifted(by):\n    return models.MeasurementModel(2, off, [by])\n"
    )
    own = "true_parameters: {measurement: {kind: custom, function: 'own.py:shifted', arguments: {by: 7.0}}}"
    file = tmp_path / "scene.yaml"
    file.write_text(changed(*POSITIONS, ("heading_deg: 4.0", own)))
    model = parse_scenario(file.read_text(), folder=tmp_path)
    experiment = build_experiment(Scenario(model, file))
    np.testing.assert_array_equal(
        experiment.true_sensors[0].model.measurement.measure([[1.0, 2.0, 0.0, 0.0]], [0.0, 0.0, 0.0]), [[8.0, 2.0]]
    )
    assert isinstance(experiment.tracker.sensors[0], models.SensorModel)
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0, result.output


def test_check_and_show(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(FILE)
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0, result.output
    shown = CliRunner().invoke(app, ["show", str(file)])
    assert shown.exit_code == 0, shown.output
    for words in ("north: true detection", "north: true first detection", "north: scans", "every 3 steps from step 2"):
        assert words in shown.output
    assert "south: scans" not in shown.output


LASTS = """detection: {kind: constant, probability: 0.9}
    correlation: {noise_s: 4.0, visible_s: 6.0, hidden_s: 2.0}
    scans: {every: 3}"""


def test_filters_count_errors_that_last_for_less_and_keep_who_is_hidden():
    section = f"  - name: north\n    position: [0.0, 40.0]\n    {LASTS}"
    text = changed(("  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}", section))
    experiment = experiment_of(text)
    known, true = experiment.tracker.sensors[0], experiment.true_sensors[0]
    interval = 3.0 * Scenario(parse_scenario(text)).model.time.step_period
    wider = np.sqrt((1.0 + np.exp(-interval / 4.0)) / (1.0 - np.exp(-interval / 4.0)))
    np.testing.assert_allclose(known.noise.least_stds, wider * true.model.noise.least_stds)
    assert known.detection.params.tolist() == [0.9]
    assert known.mode_factors.tolist() == [1.0, 0.0]
    assert experiment.tracker.targets.motion.names == ("visible", "hidden from north")
    assert (true.noise_s, true.stays_s) == (4.0, (6.0, 2.0))
    assert experiment.tracker.sensors[1].mode_factors is None
    assert experiment.tracker.sensors[1].noise.params.tolist() == experiment.true_sensors[1].model.noise.params.tolist()


def test_of_the_two_stays_both_or_none_are_given():
    section = "  - name: north\n    position: [0.0, 40.0]\n    correlation: {visible_s: 6.0}"
    with pytest.raises(ScenarioError, match=r"correlation\.hidden_s: expected a time in s"):
        parse_scenario(changed(("  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}", section)))
