"""Several returns of a target are found and merged; unexplained measurements of fast targets are reported."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from vedette.errors import ScenarioError
from vedette.evaluation.fit import fit_of_run
from vedette.evaluation.runs import run_scenario
from vedette.models import ScanRows
from vedette.recorded import RecordedScans, RecordedSensor
from vedette.recorded.merging import Spread, merged
from vedette.recorded.returns import Extent, ReturnsModel, extents_of
from vedette.scenarios import Scenario
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


def test_several_returns_are_found_and_merged(tmp_path: Path) -> None:
    found = recorded(tmp_path, 4.0)
    (line,) = [line for line in scenario_warnings(found.scenario) if "are taken for one target" in line]
    assert "R: returns of a scan within" in line
    record = run_scenario(found.scenario, "stationary", seed=0)
    plain = recorded(tmp_path, 4.0, ", extents: none")
    assert not any("taken for one target" in line for line in scenario_warnings(plain.scenario))
    apart = run_scenario(plain.scenario, "stationary", seed=0)
    assert found.recording.num_measurements < 0.5 * plain.recording.num_measurements
    numbers = [np.mean([len(each.labels) for each in run.estimates[10:]]) for run in (apart, record)]
    assert numbers[0] > 4.0
    assert 2.8 < numbers[1] < 3.2
    assert record.ospa[10:, 0].mean() < 0.6 * apart.ospa[10:, 0].mean()


@pytest.mark.parametrize("seed", range(3))
def test_one_return_per_target_is_not_merged(tmp_path: Path, seed: int) -> None:
    together = np.concatenate(
        [CARS, CARS[:1] + np.array([6.0, 0.0, 0.0, 0.0])]
    )  # two cars that keep three noise deviations
    assert recorded(tmp_path, 1.0, targets=together, seed=seed).recording.notes == ()


def test_another_sensor_with_one_return_shows_the_extent() -> None:
    rng = np.random.default_rng(0)
    ends = np.array([[-9.0, 0.0], [9.0, 0.0]])  # bow and stern, both nearly always seen
    places = [np.array([300.0 + 3.0 * k, 200.0]) for k in range(60)]
    both = [place + ends[rng.random(2) < 0.9] + rng.normal(0.0, 0.5, 2) for place in places]
    one = [place + rng.normal(0.0, 3.0, (1, 2)) for place in places]
    scans = tuple(zip(both, one, strict=True))
    recording = RecordedScans(np.arange(60.0), 0.0, False, scans, np.zeros((60, 2, 3)), (), (None, None))
    sites = [RecordedSensor(name, "position", (0.0, 0.0, 0.0)) for name in ("lidar", "radar")]
    models = [ReturnsModel(None, (0.5, 0.5), 0.9), ReturnsModel(None, (3.0, 3.0), 0.9)]
    lidar, radar = extents_of(recording, sites, models)
    assert lidar is not None
    assert radar is None
    assert lidar.distance == pytest.approx(18.0, abs=1.0)
    assert lidar.evidence == "radar has one there"
    alone = RecordedScans(np.arange(60.0), 0.0, False, tuple((s,) for s in both), np.zeros((60, 1, 3)), (), (None,))
    assert extents_of(alone, sites[:1], models[:1]) == [None]  # two boats would look the same


def test_a_cluster_is_its_mean_across_the_end_of_bearings() -> None:
    scan = np.array([[math.pi - 0.001, 100.0], [-math.pi + 0.003, 104.0], [0.5, 100.0]])
    poses = np.zeros((1, 1, 3))
    recording = RecordedScans(np.zeros(1), 0.0, False, ((scan,),), poses, (), ("east",))
    found = merged(recording, [RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0))], [Extent(6.0, "as given")])
    (own,) = found.scans[0]
    assert isinstance(own, ScanRows)
    np.testing.assert_allclose(own.values, [[-math.pi + 0.001, 102.0], [0.5, 100.0]])
    ends = np.array([[math.cos(each[0]) * each[1], math.sin(each[0]) * each[1]] for each in scan[:2]])
    offsets = ends - [102.0 * math.cos(math.pi - 0.001), -102.0 * math.sin(math.pi - 0.001)]
    variance = (offsets**2).sum() / 6.0  # of three measurements in two axes
    np.testing.assert_allclose(own.added_noise[:, 0, 0], variance / own.values[:, 1] ** 2)
    np.testing.assert_allclose(own.added_noise[:, 1, 1], variance)
    assert found.notes[0].startswith(
        "R: returns of a scan within 6 m of each other are taken for one target (as given): 3 measurements became 2, "
        "their noise grew by"
    )


def test_an_extent_below_zero_is_refused(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    text = (SENSORS % "").replace("name: R,", "name: R, extent: -1.0,")
    (tmp_path / "radar.yaml").write_text(text, "utf-8")
    with pytest.raises(ScenarioError, match=r"sensors\[0\]\.extent"):
        scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv")


MIXED = np.array([[2000.0, 3000.0, 2.0, -1.0], [-4000.0, 1000.0, 0.0, 3.0], [9000.0, -8000.0, -200.0, 100.0]])


def fast_targets(scenario: Scenario) -> tuple[str, ...]:
    """Findings of fast targets."""
    fit = fit_of_run(run_scenario(scenario, "stationary", seed=0), scenario)
    return tuple(each.text for each in fit.findings if each.test == "fast targets")


def test_unexplained_measurements_of_fast_targets_are_reported(tmp_path: Path) -> None:
    found = recorded(tmp_path, 1.0, targets=MIXED)
    (line,) = fast_targets(found.scenario)
    speed = math.hypot(200.0, 100.0)
    low, high = (float(word) for word in line.split("courses at ")[1].split(" m/s")[0].split(" to "))
    assert low == pytest.approx(speed, rel=0.03)
    assert high == pytest.approx(speed, rel=0.03)
    where = r"\(from 1 to \d+ s, the first 118\d\d m away\)"  # at 0 s a new track is estimated where it was measured
    assert re.match(rf"R: \d+ measurements that no track explains {where}", line)
    assert "new tracks are expected at about 10 m/s: give `--max-target-speed 250`" in line
    fast = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv", speed=300.0)
    assert fast_targets(fast.scenario) == ()


def test_clutter_alone_is_not_taken_for_fast_targets(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(1), ["time,sensor,range_m,bearing_rad"]
    for time in range(40):
        for x, y in rng.uniform(-6000.0, 6000.0, (15, 2)):
            rows.append(f"{time},R,{math.hypot(x, y)},{math.atan2(y, x)}")
    (tmp_path / "scans.csv").write_text("\n".join([*rows, ""]), "utf-8")
    (tmp_path / "radar.yaml").write_text(SENSORS % "", "utf-8")
    found = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "scans.csv")
    assert fast_targets(found.scenario) == ()


def test_a_camera_is_read_with_a_radar_and_refused_alone(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    rows = (tmp_path / "scans.csv").read_text("utf-8")
    bearings = [f"{time}.5,C,,{math.atan2(300.0, 8.0 * time - 200.0)}" for time in range(40)]
    (tmp_path / "scans.csv").write_text(rows + "\n".join([*bearings, ""]), "utf-8")
    camera = (
        "  - {name: C, position: [0, 0], measurement: {kind: bearing_only}, noise: {kind: constant, std: [.004]}}\n"
    )
    (tmp_path / "both.yaml").write_text(SENSORS % "" + camera, "utf-8")
    both = scenario_from_recording(tmp_path / "both.yaml", tmp_path / "scans.csv")
    record = run_scenario(both.scenario, "stationary", seed=0)
    assert np.mean([len(each.labels) for each in record.estimates[10:]]) == pytest.approx(3.0, abs=0.3)
    (tmp_path / "camera.yaml").write_text((SENSORS % "").replace("  - {name: R", camera + "  # {name: R"), "utf-8")
    (tmp_path / "bearings.csv").write_text("\n".join(["time,sensor,range_m,bearing_rad", *bearings, ""]), "utf-8")
    with pytest.raises(ScenarioError, match=r"give one wide site in birth\.sites"):
        scenario_from_recording(tmp_path / "camera.yaml", tmp_path / "bearings.csv")


def test_returns_at_the_sensor_have_a_bearing_within_their_spread() -> None:
    spread = Spread(4, 800.0)
    scan = spread.added_to(np.array([[0.3, 0.0], [0.3, 100.0]]), "bearing_range")
    stds = np.sqrt([own[0, 0] for own in scan.covs(np.zeros((2, 2, 2)))])
    np.testing.assert_allclose(stds, [1.0, spread.std / 100.0])
