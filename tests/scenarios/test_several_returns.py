"""Several returns a target: merged where that is asked for, warned of elsewhere; targets too fast are told of."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from vedette.errors import ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.evaluation.unexplained_courses import unexplained_course_warnings
from vedette.recorded import RecordedScans, RecordedSensor
from vedette.recorded.merging import merged
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings

SENSORS = """recording: {bearings: east%s}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: constant, std: [.004, 2.]}
  detection: {kind: constant, probability: .95}
  clutter: {kind: region, rate: 1.0}
sensors:
  - {name: R, position: [0.0, 0.0]}
"""
CARS = np.array([[-200.0, 300.0, 8.0, 0.0], [250.0, 250.0, -6.0, 2.0], [0.0, 400.0, 0.0, -7.0]])


def recorded(
    folder: Path, returns: float, more: str = "", targets: np.ndarray = CARS, seed: int = 0
) -> RecordingScenario:
    """Targets with Poisson numbers of returns a scan within a metre of each, or with one return; one false return."""
    rng, rows = np.random.default_rng(seed), ["time,sensor,range_m,bearing_rad"]
    size = np.abs(targets[:, :2]).max()
    for time in range(40):
        for target in targets:
            place = target[:2] + time * target[2:]
            number = rng.poisson(returns) if returns > 1.0 else int(rng.random() < 0.95)
            for _ in range(number):
                x, y = place + (rng.normal(0.0, 1.0, 2) if returns > 1.0 else 0.0)
                noise = rng.normal(0.0, [0.004, 2.0])
                rows.append(f"{time},R,{math.hypot(x, y) + noise[1]},{math.atan2(y, x) + noise[0]}")
        x, y = rng.uniform(-size, size, 2)
        rows.append(f"{time},R,{math.hypot(x, y)},{math.atan2(y, x)}")
    (folder / "scans.csv").write_text("\n".join([*rows, ""]), "utf-8")
    (folder / "radar.yaml").write_text(SENSORS % more, "utf-8")
    truth = [f"{t},{i},{c[0] + t * c[2]},{c[1] + t * c[3]}" for t in (0, 20, 40) for i, c in enumerate(targets)]
    (folder / "truth.csv").write_text("\n".join(["time,id,x,y", *truth, ""]), "utf-8")
    return scenario_from_recording(folder / "radar.yaml", folder / "scans.csv", folder / "truth.csv")


def test_several_returns_warn_and_are_merged(tmp_path: Path) -> None:
    plain = recorded(tmp_path, 4.0)
    (line,) = [line for line in scenario_warnings(plain.scenario) if "recording: {merge: 4.0}" in line]
    assert "R: 40 of 40 scans have measurements within 3 standard deviations of each other" in line
    apart = run_scenario(plain.scenario, "stationary", seed=0)
    found = recorded(tmp_path, 4.0, ", merge: 4.0")
    (line,) = [line for line in scenario_warnings(found.scenario) if "merged into" in line]
    assert "its noise should cover that" in line
    record = run_scenario(found.scenario, "stationary", seed=0)
    assert found.recording.num_measurements < 0.5 * plain.recording.num_measurements
    numbers = [np.mean([len(each.labels) for each in run.estimates[10:]]) for run in (apart, record)]
    assert numbers[0] > 4.0
    assert 2.5 < numbers[1] < 3.5
    assert record.ospa[10:, 0].mean() < 0.6 * apart.ospa[10:, 0].mean()


def test_one_return_per_target_does_not_warn(tmp_path: Path) -> None:
    assert not any("merge" in line for line in scenario_warnings(recorded(tmp_path, 1.0).scenario))


def test_a_cluster_is_its_mean_across_the_end_of_bearings() -> None:
    scan = np.array([[math.pi - 0.001, 100.0], [-math.pi + 0.003, 104.0], [0.5, 100.0]])
    poses = np.zeros((1, 1, 3))
    recording = RecordedScans(np.zeros(1), 0.0, False, ((scan,),), poses, (), ("east",))
    found = merged(recording, [RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0))], [(0.01, 2.0)], 4.0)
    (own,) = found.scans[0]
    assert own is not None
    np.testing.assert_allclose(own, [[-math.pi + 0.001, 102.0], [0.5, 100.0]])
    assert found.notes == (
        "R: 3 measurements merged into 2, spread bearing 0.115 deg, range 2 m; its noise should cover that",
    )


def test_a_distance_below_zero_is_refused(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    text = (SENSORS % ", merge: 4.0").replace("merge: 4.0", "merge: -1.0")
    (tmp_path / "radar.yaml").write_text(text, "utf-8")
    with pytest.raises(ScenarioError, match=r"recording\.merge"):
        scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv")


MIXED = np.array([[2000.0, 3000.0, 2.0, -1.0], [-4000.0, 1000.0, 0.0, 3.0], [9000.0, -8000.0, -200.0, 100.0]])


def test_unexplained_measurements_of_fast_targets_are_reported(tmp_path: Path) -> None:
    found = recorded(tmp_path, 1.0, targets=MIXED)
    (line,) = unexplained_course_warnings(run_scenario(found.scenario, "stationary", seed=0), found.scenario)
    speed = math.hypot(200.0, 100.0)
    low, high = (float(word) for word in line.split("courses at ")[1].split(" m/s")[0].split(" to "))
    assert low == pytest.approx(speed, rel=0.03)
    assert high == pytest.approx(speed, rel=0.03)
    where = r"\(from 1 to \d+ s, the first 118\d\d m away\)"  # at 0 s a new track is estimated where it was measured
    assert re.match(rf"R: \d+ measurements that no track explains {where}", line)
    assert "new tracks are expected at about 10 m/s: give `--max-target-speed 250`" in line
    fast = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv", speed=300.0)
    assert unexplained_course_warnings(run_scenario(fast.scenario, "stationary", seed=0), fast.scenario) == ()


def test_clutter_alone_is_not_taken_for_fast_targets(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(1), ["time,sensor,range_m,bearing_rad"]
    for time in range(40):
        for x, y in rng.uniform(-6000.0, 6000.0, (15, 2)):
            rows.append(f"{time},R,{math.hypot(x, y)},{math.atan2(y, x)}")
    (tmp_path / "scans.csv").write_text("\n".join([*rows, ""]), "utf-8")
    (tmp_path / "radar.yaml").write_text(SENSORS % "", "utf-8")
    found = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv")
    assert unexplained_course_warnings(run_scenario(found.scenario, "stationary", seed=0), found.scenario) == ()
