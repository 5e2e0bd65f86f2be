"""Runs of sensors on platforms of every kind: decided, recorded, kept and drawn."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenarios.minimal import changed
from vedette.evaluation import decided_actions, mean_rewards
from vedette.evaluation.actions import describe_choice
from vedette.evaluation.comparison import compare
from vedette.evaluation.figures import mean_rewards_figure, reward_figure, roses_figure, tracks_figure
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario
from vedette.scenarios.loading import parse_scenario
from vedette.simulation.records import RunRecord
from vedette.simulation.storage import load_run, save_run

CAMERA = """\
    platform:
      kind: camera
      pointing_deg: -90
      half_width_deg: 70
      pointings_deg: [-120, -60]
      turn_rate_deg: 10
      platform: {kind: heading, speeds: [1.0, 2.0], headings_deg: [180.0]}
    detection: {kind: camera, probability: 0.9, max_range: 200}
    stationary_until_first_decision: false
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    text = changed(
        ("  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}\n", f"  - position: [0.0, 40.0]\n{CAMERA}"),
        ("position: [0.0, -40.0]", "position: [0.0, -40.0], platform: {kind: grid_moves, length: 6.0, speed: 3.0}"),
        ("{decision_steps: [4, 8]}", "{decision_steps: [4, 8], num_samples: 2, horizon_steps: 2}"),
    )
    return Scenario(parse_scenario(text))


@pytest.fixture(scope="module")
def records(scenario: Scenario) -> dict[str, RunRecord]:
    return {name: run_scenario(scenario, name, seed=2, num_threads=1) for name in ("jdm", "idm", "constant")}


def test_poses_are_those_of_the_platforms(records: dict[str, RunRecord]) -> None:
    record = records["jdm"]
    assert record.poses.shape == (20, 2, 5)
    assert (record.poses[:, 1, 3:] == 0.0).all()  # steps have no pointing
    np.testing.assert_allclose(record.poses[:, 0, 4], math.radians(70.0))
    np.testing.assert_allclose(record.poses[:4, 0, 0], [0.0, 0.5, 1.0, 1.5])  # under way from the start, at 1 m/s
    np.testing.assert_array_equal(record.poses[:4, 1, :2], [[0.0, -40.0]] * 4)  # still until the first decision
    turn = np.diff(record.poses[:, 0, 3])
    assert np.abs(turn).max() <= math.radians(5.0) + 1e-9  # 10 degrees a second, scans twice a second
    decision = record.decisions[0]
    assert [own.columns for own in decision.plan.actions] == [("heading_deg", "speed", "pointing_deg"), ("dx", "dy")]
    assert decision.plan.tables[0].mean.shape == (4, 9)
    step = decision.plan.chosen_actions[1]
    np.testing.assert_allclose(record.poses[7, 1, :2] - record.poses[3, 1, :2], step, atol=1e-9)


def test_without_a_decision_a_platform_keeps_to_its_course(records: dict[str, RunRecord]) -> None:
    (row, *_) = decided_actions(records["constant"])
    assert describe_choice(row) == "heading 0°, speed 1, pointing -90°; dx 0, dy 0"


def test_runs_are_kept_and_drawn(records: dict[str, RunRecord], tmp_path: Path) -> None:
    for name, record in records.items():
        kept = load_run(save_run(record, tmp_path / name))
        np.testing.assert_array_equal(kept.poses, record.poses)
        assert [own.columns for own in kept.decisions[0].plan.actions] == [
            own.columns for own in record.decisions[0].plan.actions
        ]
        tracks_figure(record)
    joint, alone = (reward_figure(records[name].decisions[0].plan) for name in ("jdm", "idm"))
    titles = ["Heading (deg), speed, pointing (deg)", "Dx, dy"]
    assert [axes.get_xlabel() for axes in joint.axes][1:3] == titles
    assert [axes.get_xlabel() for axes in alone.axes] == titles
    assert mean_rewards_figure([mean_rewards([records["idm"]], 0)]).axes[0].get_xlabel() == "Number of the action"
    mean_rewards_figure([mean_rewards([records["jdm"]], 0)])
    bars = roses_figure(compare({name: [record] for name, record in records.items()}))
    assert not any(axes.name == "polar" for axes in bars.axes)
