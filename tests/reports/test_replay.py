from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.still_network import NAMES, POLYGON, STILL_NETWORK
from evaluation.synthetic import make_record
from reports.examples import MIXED_SENSORS, MODES, SUMS, campaign_of, results_of
from simulation.test_explanation_tables import explanation_of
from vedette.control import TargetGains
from vedette.errors import InputError
from vedette.reports.decision_explanations import explanation_data
from vedette.reports.groups import Strategy, comparison_groups
from vedette.reports.replay import replay_data
from vedette.scenarios.build import build_experiment
from vedette.scenarios.sections.sensors import Sensor
from vedette.simulation.replay import scans_of


def strategies_of(folder: Path, **fields: Any) -> dict[str, Strategy]:
    (group,) = comparison_groups(results_of(folder, campaign_of(runs=1, **fields)))
    return {each.label: each for each in group.strategies}


@pytest.fixture(scope="module")
def strategies(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Strategy]:
    return strategies_of(tmp_path_factory.mktemp("replay") / "results", planners=["jdm", "idm", "constant"])


def test_it_holds_the_truth_the_poses_and_the_errors(strategies: Mapping[str, Strategy]) -> None:
    record = strategies["jdm"].record(0)
    data = replay_data(strategies["jdm"], record, "group", trust=True)
    json.dumps(data, allow_nan=False)
    ids, states = record.truth.at(30)
    assert [row[0] for row in data["truth"][30]] == (ids + 1).tolist()
    np.testing.assert_allclose([row[1:3] for row in data["truth"][30]], states[:, :2], atol=0.06)
    np.testing.assert_allclose(np.array(data["poses"])[:, :, :2], record.poses[:, :, :2], atol=0.06)
    np.testing.assert_allclose(data["ospa"], record.ospa, atol=0.006)


def test_estimates_have_their_two_sigma_ellipse_and_their_error(strategies: Mapping[str, Strategy]) -> None:
    record = strategies["jdm"].record(0)
    for scan, rows in enumerate(replay_data(strategies["jdm"], record, "", trust=True)["estimates"]):
        estimate = record.estimates[scan]
        assert len(rows) == estimate.num_targets
        ids, states = record.truth.at(scan)
        for row, mean, cov in zip(rows, estimate.means, estimate.covs, strict=True):
            _, x, y, existence, long, short, angle, target, error = row
            turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            drawn = turn @ np.diag([long / 2.0, short / 2.0]) ** 2 @ turn.T
            np.testing.assert_allclose(drawn, cov[:2, :2], rtol=0.02, atol=0.02 * np.trace(cov[:2, :2]))
            assert 0.0 <= existence <= 1.0
            assert (x, y) == pytest.approx(mean[:2], abs=0.06)
            if target:
                place = states[ids.tolist().index(target - 1), :2]
                assert error == pytest.approx(math.dist(mean[:2], place), abs=0.06)


def test_bearing_and_range_become_a_point(strategies: Mapping[str, Strategy]) -> None:
    strategy = strategies["constant"]
    record = strategy.record(0)
    data = replay_data(strategy, record, "", trust=True)
    scans: Any = scans_of(record, build_experiment(strategy.cell.scenario))
    for step in (0, 39):
        for sensor in (0, 1):
            rows = data["scans"][step][sensor]
            assert [row[0] for row in rows] == (scans[step][sensor].origins + 1).tolist()
            offsets = np.array([row[1:] for row in rows]) - record.poses[step, sensor, :2]
            measured = np.c_[np.arctan2(offsets[:, 1], offsets[:, 0]), np.hypot(offsets[:, 0], offsets[:, 1])]
            np.testing.assert_allclose(measured, scans[step][sensor].measurements, atol=0.1)


def test_bearings_and_ranges_alone_stay_what_they_are(tmp_path: Path) -> None:
    strategy = strategies_of(tmp_path / "results", planners=["stationary"], set=MIXED_SENSORS)["stationary"]
    data = replay_data(strategy, strategy.record(0), "", trust=True)
    assert [sensor["kind"] for sensor in data["sensors"]] == ["ray", "circle"]
    assert data["sensors"][0]["half_width"] == pytest.approx(math.pi / 3.0, abs=1e-4)
    assert data["sensors"][1]["range"] == 1200.0
    scans: Any = scans_of(strategy.record(0), build_experiment(strategy.cell.scenario))
    bearings = [row[1] for row in data["scans"][7][0]]
    ranges = [row[1] for row in data["scans"][7][1]]
    np.testing.assert_allclose(bearings, scans[7][0].measurements[:, 0], atol=1e-4)
    np.testing.assert_allclose(ranges, scans[7][1].measurements[:, 0], atol=0.06)


def test_estimates_have_the_number_of_their_mode(tmp_path: Path) -> None:
    strategy = strategies_of(tmp_path / "results", planners=["stationary"], set=MODES)["stationary"]
    record = strategy.record(0)
    data = replay_data(strategy, record, "", trust=True)
    json.dumps(data, allow_nan=False)
    assert list(data["mode_names"]) == ["cruise", "turn"]
    for numbers, likeliest, estimate in zip(data["modes"], data["classes"], record.estimates, strict=True):
        assert len(numbers) == len(estimate.labels)
        for number, (name, _) in zip(numbers, likeliest, strict=True):
            assert name == ("cruise", "turn", "new")[number]
    assert any(0 in numbers for numbers in data["modes"])


def test_a_joint_decision_is_a_map_and_curves_with_the_choice(strategies: Mapping[str, Strategy]) -> None:
    record = strategies["jdm"].record(0)
    decision = replay_data(strategies["jdm"], record, "", trust=True)["decisions"][0]
    plan = record.decisions[0].plan
    i, j = decision["map"]["chosen"]
    assert decision["scan"] == 9
    assert f"{decision['map']['labels'][0][i]}, {decision['map']['labels'][1][j]}" == decision["actions"]
    table = np.array(decision["map"]["mean"])
    assert table[i, j] == table.max() == pytest.approx(plan.expected_rewards[0][0], rel=1e-4)
    for curve, chosen in zip(decision["curves"], (i, j), strict=True):
        assert curve["chosen"] == chosen
        assert max(curve["mean"]) == curve["mean"][chosen]


def test_a_sensor_that_stands_has_no_rewards_and_zones_are_there(tmp_path: Path) -> None:
    both = strategies_of(tmp_path / "results", planners=["jdm", "idm"], set=STILL_NETWORK)
    joint, alone = (replay_data(both[name], both[name].record(0), "", trust=True) for name in ("jdm", "idm"))
    assert [sensor["name"] for sensor in joint["sensors"]] == list(NAMES)
    assert joint["decisions"][0]["map"]["sensors"] == (1, 2)
    for data in (joint, alone):
        assert [curve["sensor"] for curve in data["decisions"][0]["curves"]] == [1, 2]
        assert data["reward"] == "minus expected loss"
        assert [kind for kind, _ in data["zones"]] == ["region", "no-go zone", "sensors stay inside"]
        assert data["zones"][1][1] == POLYGON


def test_independent_decisions_are_curves_and_fixed_ones_nothing(strategies: Mapping[str, Strategy]) -> None:
    decision = replay_data(strategies["idm"], strategies["idm"].record(0), "", trust=True)["decisions"][0]
    assert decision["map"] is None
    assert [curve["sensor"] for curve in decision["curves"]] == [0, 1]
    decision = replay_data(strategies["constant"], strategies["constant"].record(0), "", trust=True)["decisions"][0]
    assert (decision["map"], decision["curves"]) == (None, [])


def test_why_a_decision_was_taken_stands_with_it(tmp_path: Path) -> None:
    """Of sums over targets all that is told; the same numbers as in the plan's explanation, largest gains first."""
    strategy = strategies_of(tmp_path / "results", planners=["jdm"], set=SUMS)["jdm"]
    record = strategy.record(0)
    data = replay_data(strategy, record, "", trust=True)
    json.dumps(data, allow_nan=False)
    for decision, told in zip(record.decisions, data["decisions"], strict=True):
        found, why = told["why"], decision.plan.explain()
        assert why.of_targets is not None
        assert why.of_sensors is not None
        assert why.reward_without_sensor is not None
        assert found["more"] is None
        gains = [existence + localisation for _, existence, localisation in found["targets"]]
        np.testing.assert_allclose(gains, np.sort(why.of_targets.total)[::-1], rtol=2e-3, atol=1e-3)
        np.testing.assert_allclose([row[2] for row in found["sensors"]], why.of_sensors, rtol=1e-3)
        np.testing.assert_allclose([row[3] for row in found["sensors"]], why.reward_without_sensor, rtol=1e-3)
        assert ", ".join(row[1] for row in found["sensors"]) == told["actions"]
        facts = dict(found["facts"])
        assert facts["Bound"] == "the best of all joint actions"
        assert facts["Evaluated"] == "144 choices"
        assert facts["Second best"].startswith("less by ")
        assert why.runner_up is not None
        assert facts["Second best"].count(" to ") == 2 - sum(
            a == b for a, b in zip(why.runner_up.actions, decision.plan.chosen, strict=True)
        )


def test_of_many_targets_the_ten_largest_gains_are_shown() -> None:
    plan = make_record().decisions[0].plan
    total = np.arange(1.0, 21.0)
    gains = TargetGains(np.stack([np.ones(20, np.int64), np.arange(20)], axis=1), 0.25 * total, 0.75 * total)
    found = explanation_data(replace(plan, explanation=explanation_of(plan, of_targets=gains, runner_up=None)))
    assert found is not None
    assert found["targets"][0] == ("1.19", 5.0, 15.0)
    assert len(found["targets"]) == 10
    assert found["more"] == (10, 13.75, 41.25)
    assert explanation_data(plan) is None


def test_decisions_that_tell_less_say_why(strategies: Mapping[str, Strategy]) -> None:
    """Case by case there is a second best; fixed actions have nothing to explain."""
    told = {
        name: replay_data(each, each.record(0), "", trust=True)["decisions"][0] for name, each in strategies.items()
    }
    for name in ("jdm", "idm"):
        facts = dict(told[name]["why"]["facts"])
        assert "case by case" in facts["Not known"]
        assert "Second best" in facts
        assert told[name]["why"]["targets"] == told[name]["why"]["sensors"] == []
    assert told["constant"]["why"] is None


def test_without_the_models_there_are_no_measurements(
    strategies: Mapping[str, Strategy], monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: object) -> None:
        raise InputError("function: expected a file; got none")

    monkeypatch.setattr(Sensor, "build", missing)
    assert replay_data(strategies["constant"], strategies["constant"].record(0), "", trust=True)["scans"] == []
