"""Biases that only the assumed motion of targets could tell: of radars at one place."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from vedette.calibration import Calibration, ParameterEstimate, calibrate
from vedette.calibration.registration import MatchedMeasurements, groups_with_common_targets, is_one_place
from vedette.kernels.base.types import Floats
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording

SHIPS = np.array([[-2500.0, 1500.0, 7.0, -2.0], [1800.0, 2600.0, -4.0, -6.0], [-800.0, -2200.0, 3.0, 8.0]])
TEXT = """recording: {bearings: east}
motion: {kind: constant_velocity, sigma_v: 0.05, noise_model: continuous_white}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: range_dependent, sigma_range: 25.0, eta_range: 0.0, sigma_bearing_deg: 0.9, eta_bearing: 0.0}
  detection: {kind: constant, probability: 0.8}
  clutter: {kind: region, rate: 2.0}
sensors:
"""
Course = Callable[[float], Floats]


def at(x: float, y: float) -> Course:
    return lambda time: np.array([x, y])


def straight(time: float) -> Floats:
    return np.array([40.0 * time - 4000.0, 500.0 - 30.0 * time])


def weaving(time: float) -> Floats:
    return np.array([6.0 * time - 600.0, 400.0 * math.sin(time / 20.0)])


def calibration_of(
    folder: Path,
    courses: Sequence[Course],
    biases: Sequence[tuple[float, float]],
    kinds: Sequence[str] = ("bias",),
    blind: Sequence[int] = (),
) -> Calibration:
    """Of radars with biases in range, m, and bearing, deg, over 200 s of straight ships, which blind ones miss."""
    rng, rows = np.random.default_rng(5), list[list[object]]()
    for s, (course, (far, turned)) in enumerate(zip(courses, biases, strict=True)):
        for time in np.arange(0.7 + s, 200.0, 4.0 + s).tolist():
            offsets = SHIPS[:, :2] + time * SHIPS[:, 2:] - course(time)
            if s in blind:
                offsets = rng.uniform(-3000.0, 3000.0, (1, 2))
            for dx, dy in offsets[rng.random(len(offsets)) < 0.9].tolist():
                bearing = math.degrees(math.atan2(dy, dx) + rng.normal(0.0, 0.012)) + turned
                reach = math.hypot(dx, dy) + rng.normal(0.0, 20.0) + far
                rows.append([time, f"r{s}", reach, bearing, *course(time).tolist()])
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "range", "bearing_deg", "own_x", "own_y"], *rows])
    sensors = "".join(f"  - {{name: r{s}, position: [0, 0], bias: {{range: 7.0}}}}\n" for s in range(len(courses)))
    (folder / "radars.yaml").write_text(TEXT + sensors, "utf-8")
    problem = build_problem(
        scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario, prior_scale=10.0
    )
    return calibrate(problem, only=[each for each in problem.parameters if each.kind in kinds])


def by_name(calibration: Calibration) -> dict[tuple[int, str], ParameterEstimate]:
    return {(each.parameter.sensor, each.parameter.name): each for each in calibration.estimates}


def test_the_range_of_one_radar_at_rest_is_not_reported(tmp_path: Path) -> None:
    calibration = calibration_of(tmp_path, [at(0.0, 0.0)], [(0.0, 0.0)], ("bias", "noise"))
    found = by_name(calibration)
    assert calibration.converged
    assert found[0, "range"].reason == (
        "not identifiable: there is no other sensor to separate it from another motion of the targets than assumed"
    )
    assert found[0, "bearing_deg"].reason == (
        "not identifiable: there is no other sensor to separate it from a rotation of all targets"
    )
    assert (found[0, "range"].value, found[0, "bearing_deg"].value) == (7.0, 0.0)  # as given
    assert math.isnan(found[0, "range"].ci_low)
    for name in ("noise.sigma_range", "noise.sigma_bearing_deg"):
        assert found[0, name].ci_low < found[0, name].ci_high


def test_a_radar_that_weaves_finds_its_range(tmp_path: Path) -> None:
    found = by_name(calibration_of(tmp_path, [weaving], [(150.0, 0.0)]))
    one = found[0, "range"]
    assert one.std < 60.0  # of eight blocks of time
    assert abs(one.value - 150.0) < 3.0 * one.std


def test_radars_on_one_mast_are_compared_with_the_first(tmp_path: Path) -> None:
    found = by_name(calibration_of(tmp_path, [at(0.0, 0.0), at(10.0, 0.0)], [(80.0, 0.5), (-60.0, -0.8)]))
    for name in ("range", "bearing_deg"):
        assert "no other sensor observes enough of the same targets from another place" in found[0, name].reason
    for name, truth in (("range", 7.0 - 140.0), ("bearing_deg", -1.3)):
        one = found[1, name]
        assert abs(one.value - truth) < 3.0 * one.std, name
    assert found[1, "range"].std < 20.0


@pytest.mark.parametrize(
    ("courses", "wanted"),
    [
        ([at(0.0, 0.0)], True),
        ([straight], True),
        ([at(0.0, 0.0), at(20.0, 0.0)], True),
        ([straight, lambda time: straight(time) + 15.0], True),
        ([weaving], False),
        ([at(0.0, 0.0), at(0.0, 900.0)], False),
        ([straight, at(0.0, 0.0)], False),
    ],
)
def test_sensors_on_one_straight_course_are_at_one_place(courses: Sequence[Course], wanted: bool) -> None:
    rows = [(time, s, *course(time)) for s, course in enumerate(courses) for time in np.arange(0.0, 200.0, 5.0)]
    table = np.array(rows)
    num, none = len(table), np.zeros(len(courses), np.int64)
    sensors, zeros = table[:, 1].astype(np.int64), np.zeros((num, 2))
    states = np.column_stack([np.full(num, 500.0), np.full(num, 3000.0), zeros, zeros])
    pairs = MatchedMeasurements(
        table[:, 0], sensors, np.zeros(num, np.int64), zeros, table[:, 2:], states, none[:, None], none, none
    )
    assert is_one_place(pairs, range(len(courses))) is wanted
    assert is_one_place(pairs, [len(courses)])  # a sensor without measurements of any target


def test_groups_share_targets_directly_or_through_others() -> None:
    """Sensors 0 and 3 through 2; 1 and 4; 5 shares too little, and 6 nothing."""
    seen = {0: [0], 2: [0, 1], 3: [1], 1: [2], 4: [2, 3], 5: [], 6: [9]}
    rows = [(s, track) for s, tracks in seen.items() for track in tracks for _ in range(3)] + [(5, 0), (5, 0)]
    sensors, tracks = np.array(rows).T
    num, none = len(rows), np.zeros(7, np.int64)
    measured, poses, states = np.zeros((num, 2)), np.zeros((num, 2)), np.zeros((num, 4))
    own = measured, poses, states, none[:, None], none, none
    pairs = MatchedMeasurements(np.arange(float(num)), sensors, tracks, *own)
    assert groups_with_common_targets(pairs, 7) == [[0, 2, 3], [1, 4], [5], [6]]


def test_radars_without_the_first_compare_their_ranges(tmp_path: Path) -> None:
    """The first is far away from the two others, which see all ships from two places."""
    far, near, other = at(2e5, 0.0), at(0.0, 0.0), at(0.0, 2500.0)
    found = by_name(calibration_of(tmp_path, [far, near, other], [(0.0, 0.0), (80.0, 0.0), (-60.0, 0.0)], blind=(0,)))
    assert found[0, "range"].reason
    for s, truth in ((1, 80.0), (2, -60.0)):
        assert abs(found[s, "range"].value - truth) < 3.0 * found[s, "range"].std
        assert found[s, "range"].std < 20.0


def test_the_noise_of_a_single_sensor_of_positions_is_estimated(tmp_path: Path) -> None:
    """Only biases of positions need other sensors."""
    rng, rows = np.random.default_rng(6), list[list[float]]()
    for time in np.arange(0.0, 160.0, 4.0).tolist():
        places = SHIPS[:, :2] + time * SHIPS[:, 2:]
        rows += [[time, *(place + rng.normal(0.0, [30.0, 18.0])).tolist()] for place in places[rng.random(3) < 0.9]]
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "x", "y"], *rows])
    (tmp_path / "sensors.yaml").write_text(
        "motion: {kind: constant_velocity, sigma_v: 0.05, noise_model: continuous_white}\n"
        "sensors:\n  - {name: r, position: [0, 0], measurement: {kind: position}, clutter: {kind: region, rate: 0.1},\n"
        "     noise: {kind: constant, std: [22.0, 22.0]}, detection: {kind: constant, probability: 0.8}}\n",
        "utf-8",
    )
    problem = build_problem(
        scenario_from_recording(tmp_path / "sensors.yaml", tmp_path / "scans.csv").scenario, prior_scale=10.0
    )
    found = calibrate(problem, only=[each for each in problem.parameters if each.kind == "noise"])
    for each, true in zip(found.estimates, (30.0, 18.0), strict=True):
        assert each.ci_low < true < each.ci_high
        assert each.ci_high < 1.5 * each.ci_low
