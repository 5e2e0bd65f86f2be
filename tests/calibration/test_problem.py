"""What calibration makes of sensors and births, so that the likelihood has no edges and favours no clock."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recordings import SENSORS, write_recording
from vedette.calibration import Problem
from vedette.scenarios.build import build_sensors
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.overrides import replace_fields
from vedette.tracking import Central

POSE = [0.0, 0.0, 0.5]


def problem(folder: Path, clutter: str, more: str = "") -> tuple[Problem, Any, Any]:
    """The problem of a recording with such clutter; the central tracker at its start, and the scenario's sensors."""
    write_recording(folder, seconds=120.0)
    text = SENSORS.replace("sensors:\n", f"  clutter: {clutter}\nsensors:\n", 1) + more
    (folder / "radars.yaml").write_text(text, "utf-8")
    scenario = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario
    found = build_problem(scenario)
    tracker, rates = found.tracker(found.values(found.free([each.start for each in found.parameters])), found.births)
    assert isinstance(tracker, Central)
    return found, (tracker, rates), build_sensors(scenario)


@pytest.mark.parametrize(
    "clutter",
    [
        "{kind: around_sensor, rate: 2.0, radius: 3000.0, half_width_deg: 60.0}",
        "{kind: around_sensor, rate: 2.0, half_side: 3000.0}",
        "{kind: region, rate: 2.0}",
    ],
)
def test_clutter_has_its_density_beyond_what_is_seen(tmp_path: Path, clutter: str) -> None:
    region = "region: {x_min: -4000.0, x_max: 4000.0, y_min: -4000.0, y_max: 4000.0}\n"
    _, (tracker, more), known = problem(tmp_path, clutter, region)
    inside, beyond = [[0.6, 2500.0]], [[0.6 + math.radians(59.0), 4500.0]]
    for own, wide, added in zip(known, tracker.sensors, more, strict=True):
        plain, wider = own.filter.sensor.clutter, wide.clutter
        np.testing.assert_allclose(wider.log_intensity_at(inside, POSE), plain.log_intensity_at(inside, POSE))
        per_area = wider.log_intensity_at(beyond, POSE)[0] - math.log(4500.0 / 2500.0)
        assert per_area == pytest.approx(wider.log_intensity_at(inside, POSE)[0])
        assert wider.rate == pytest.approx(plain.rate + added)
        rng = np.random.default_rng(1)
        drawn = [len(wider.sample(POSE, wide.measurement, state_dim=4, rng=rng)) for _ in range(300)]
        assert np.mean(drawn) == pytest.approx(wider.rate, rel=0.1)


@pytest.mark.parametrize("clutter", ["{kind: around_sensor, rate: 2.0, radius: 3000.0}", "{kind: region, rate: 2.0}"])
def test_false_measurements_do_not_pay_for_a_bias(tmp_path: Path, clutter: str) -> None:
    """Their density is that at the raw measurement; at the corrected one a longer range would be likelier."""
    region = "region: {x_min: -4000.0, x_max: 4000.0, y_min: -4000.0, y_max: 4000.0}\n"
    found, (tracker, _), _ = problem(tmp_path, clutter, region)
    values = np.array([each.start for each in found.parameters])
    for i, each in enumerate(found.parameters):
        if each.kind == "bias" and each.component in ("range", "bearing"):
            values[i] = {"range": 250.0, "bearing": 3.0}[each.component]
    biased, _ = found.tracker(values, found.births)
    assert isinstance(biased, Central)
    raw = np.array([[0.6, 2500.0], [-1.0, 800.0]])
    corrected = raw - [-math.radians(3.0), 250.0]  # clockwise
    for plain, other in zip(tracker.sensors, biased.sensors, strict=True):
        at = other.clutter.log_intensity_at(corrected, POSE)
        np.testing.assert_allclose(at, plain.clutter.log_intensity_at(raw, POSE), rtol=1e-12)


def test_births_do_not_hang_on_when_the_next_scan_comes(tmp_path: Path) -> None:
    born = (
        "birth: {sites: [], period: 2.0, from_measurements: {expected: 0.2, max_existence: 0.02, std: [9, 9, 5, 5]}}\n"
    )
    found, (tracker, _), known = problem(tmp_path, "{kind: region, rate: 2.0}", born)
    own, said = tracker.targets.birth, known[0].filter.targets.birth
    times = found.recording.times
    assert (said.period, own.period) == (2.0, None)
    assert own.from_measurements.expected == pytest.approx(0.2 * times[-1] / (len(times) - 1) / 2.0)
    assert own.from_measurements.max_existence == said.from_measurements.max_existence


def test_an_extent_is_estimated_where_the_file_has_one(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=30.0)
    (tmp_path / "radars.yaml").write_text(SENSORS, "utf-8")
    scenario = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv").scenario
    assert not [each for each in build_problem(scenario).parameters if each.component == "extent"]
    found = build_problem(replace_fields(scenario, {"sensors.1.noise.extent": 12.0}))
    (own,) = [each for each in found.parameters if each.component == "extent"]
    assert (own.sensor, own.name, own.unit, own.start) == (1, "noise.extent", "m", 12.0)
    values = np.array([7.0 if each is own else each.start for each in found.parameters])
    tracker, _ = found.tracker(values, found.births)
    assert isinstance(tracker, Central)
    first, second = (sensor.noise.params for sensor in tracker.sensors)
    assert (first[4], second[4]) == (0.0, 7.0)
