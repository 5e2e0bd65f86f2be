"""Sensors found from recordings: against the filter's own sums, brute-force grids, the truth; and what cannot be."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recordings import SENSORS, write_recording
from vedette.calibration import Calibration, Problem, calibrate
from vedette.calibration.held_back import blocks_of_time
from vedette.calibration.maximum_likelihood import _Search, covariance, maximise
from vedette.filters import Limits, SequentialLmbFilter, common_target_model
from vedette.kernels.base.types import Floats
from vedette.scenarios.build import build_sensors
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.tracking import Central

BIASES = {"boat": (300.0, 2.0, 0.0), "Calshot": (-150.0, -1.0, 0.0)}
TRUTH = {
    (0, "range"): -150.0,
    (0, "bearing_deg"): -1.0,
    (1, "range"): 300.0,
    (1, "bearing_deg"): 2.0,
    (1, "clock"): 0.0,
}
MOTION = "motion: {kind: constant_velocity, sigma_v: 0.05}\n"


def recorded(folder: Path, seconds: float = 150.0, text: str = SENSORS + MOTION) -> RecordingScenario:
    write_recording(folder, seconds=seconds, biases=BIASES)
    (folder / "radars.yaml").write_text(text, "utf-8")
    return scenario_from_recording(folder / "radars.yaml", folder / "scans.csv")


def at_start(problem: Problem) -> Floats:
    return problem.free([each.start for each in problem.parameters])


def at_truth(problem: Problem) -> Floats:
    values = [TRUTH.get((each.sensor, each.name), each.start) for each in problem.parameters]
    return problem.free(values)


def test_the_likelihood_is_the_sum_of_what_the_filter_reports(tmp_path: Path) -> None:
    """Of clutter around the sensor, which ends nowhere that matters, number for number.

    With sigma points and wide gates, as switches of the method and edges of gates would make it jump.
    """
    clutter = "  clutter: {kind: around_sensor, rate: 2.0, radius: 40000.0}\nsensors:"
    text = (SENSORS + MOTION + "filter: {kind: lmb, gaussian_method: ukf}\n").replace("sensors:\n", clutter + "\n", 1)
    scenario, scans, _ = recorded(tmp_path, text=text)
    filters = [sensor.filter for sensor in build_sensors(scenario)]
    sensors = tuple(each.sensor for each in filters)
    limits = Limits(min_existence=1e-3, gate_probability=1.0 - 1e-12, merge_distance=0.5, max_components=20)
    tracker = Central(SequentialLmbFilter(common_target_model(filters), sensors, limits))
    state, total, rngs = tracker.initial(), [], (np.random.default_rng(0),) * 2
    for time, measured, poses in zip(scans.times.tolist(), scans.scans, scans.poses, strict=True):
        state, info = tracker.step(state, list(measured), poses, time, rngs=rngs)
        total.append(info.filters[0].log_likelihood)
        state, _ = tracker.step(state, [None, None], poses, time + 1e-9, rngs=rngs)  # who is born is there at once
    problem = build_problem(recorded(tmp_path, text=text.replace("ukf", "auto")).scenario)
    found = problem.log_likelihoods(at_start(problem))
    assert found.sum() == pytest.approx(sum(total), rel=1e-9)
    assert sorted(found[found != 0.0].tolist()) == pytest.approx(sorted(total), rel=1e-6)


def test_clutter_of_the_region_weighs_as_much_wherever_a_bias_takes_it(tmp_path: Path) -> None:
    """A single radar that is turned sees all the same: by 20 degrees, where corners of the region are left.

    But for the sigma points, which follow the axes of the plane: 0.1 of 60 s.
    """
    text = SENSORS.replace("  - {name: boat, position: [0.0, 0.0]}\n", "") + MOTION
    write_recording(tmp_path, seconds=60.0)
    lines = (tmp_path / "scans.csv").read_text("utf-8").splitlines()
    (tmp_path / "scans.csv").write_text("\n".join(line for line in lines if "boat" not in line), "utf-8")
    (tmp_path / "radars.yaml").write_text(text, "utf-8")
    problem = build_problem(scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv").scenario)
    before, turned = at_start(problem), at_start(problem)
    turned[[each.component for each in problem.parameters].index("bearing")] = 20.0
    total = problem.log_likelihoods(before).sum()
    assert problem.log_likelihoods(turned).sum() == pytest.approx(total, abs=0.2)
    calibration = calibrate(problem)
    found = {each.parameter.name: each for each in calibration.estimates}
    assert "no other sensor" in found["bearing_deg"].reason
    assert math.isnan(found["bearing_deg"].ci_low)
    assert found["bearing_deg"].value == 0.0
    assert found["noise.sigma_range"].ci_low < 20.0 < found["noise.sigma_range"].ci_high
    told = problem.free([each.value if each.is_better else each.parameter.start for each in calibration.estimates])
    assert problem.log_likelihoods(told).sum() == pytest.approx(calibration.log_likelihood, abs=1e-9)


def test_scores_are_those_of_finer_differences(tmp_path: Path) -> None:
    problem = build_problem(recorded(tmp_path).scenario)
    at = at_truth(problem)
    steps = np.array([0.01 if each.scale == "plain" else 0.001 for each in problem.parameters])
    search = _Search(problem.log_likelihoods, at, problem.log_likelihoods(at), 8.0 * steps, np.zeros(0))
    coarse, one_sided = search.central().sum(axis=0), search.one_sided().sum(axis=0)
    search.steps = steps
    np.testing.assert_allclose(coarse, search.central().sum(axis=0), rtol=0.02, atol=0.05)
    np.testing.assert_allclose(coarse, one_sided, rtol=1e-9, atol=1e-6)


def test_the_search_finds_the_top_of_a_grid(tmp_path: Path) -> None:
    """Over the bias and the noise of a radar's range; the others are as they are in truth."""
    problem = build_problem(recorded(tmp_path).scenario)
    names = [(each.sensor, each.name) for each in problem.parameters]
    own = [names.index((1, "range")), names.index((1, "noise.sigma_range"))]
    whole = at_truth(problem)

    def terms(two: Floats) -> Floats:
        free = whole.copy()
        free[own] = two
        return problem.log_likelihoods(free)

    unknown = np.array([problem.parameters[i].unknown for i in own])
    found = maximise(terms, whole[own] + [30.0, 0.4], unknown, [[0], [1]], blocks_of_time(problem.term_times()))
    stds = np.sqrt(np.diag(covariance(found.information, unknown)[0]))
    grid = [(x, y) for x in np.linspace(-2.0, 2.0, 9) for y in np.linspace(-2.0, 2.0, 9)]
    heights = [terms(found.at + stds * pair).sum() for pair in grid]
    assert max(heights) <= found.log_likelihood + 0.05
    # As high as a normal density would be, from top to the edges of the grid.
    expected = [-0.5 * (x * x + y * y) for x, y in grid]
    assert np.corrcoef(heights, expected)[0, 1] > 0.97


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RecordingScenario, Calibration]:
    folder = tmp_path_factory.mktemp("calibrated")
    found = recorded(folder, 240.0)
    return folder, found, calibrate(build_problem(found.scenario))


def test_biases_of_two_radars_are_estimated(calibrated: tuple[Path, RecordingScenario, Calibration]) -> None:
    _, _, calibration = calibrated
    assert calibration.log_likelihood > calibration.initial_log_likelihood + 300.0
    assert calibration.converged
    assert not any(each.reason for each in calibration.estimates)
    ours = [each for each in calibration.estimates if each.parameter.name in ("range", "bearing_deg")]
    assert all(each.is_better for each in ours)
    for each in calibration.estimates:
        name = each.parameter.sensor, each.parameter.name
        wide = 1.6 * (each.ci_high - each.ci_low) / 2.0  # three standard deviations
        if name in TRUTH and not each.kept:
            assert abs(each.value - TRUTH[name]) < wide, name
        elif name[1] in ("noise.sigma_range", "noise.sigma_bearing_deg"):
            told = 20.0 if name[1] == "noise.sigma_range" else 0.7
            assert abs(each.value - told) < wide, name


def test_the_file_that_comes_out_reads_back_with_all_that_was_in_it(
    calibrated: tuple[Path, RecordingScenario, Calibration],
) -> None:
    folder, (scenario, _, _), calibration = calibrated
    text = calibrated_text(scenario, folder / "radars.yaml", calibration, folder)
    (folder / "found.yaml").write_text(text, "utf-8")
    again = scenario_from_recording(folder / "found.yaml", folder / "scans.csv").scenario.model
    assert again.motion == scenario.model.motion
    assert again.origin == scenario.model.origin
    assert again.recording is not None
    assert again.recording.columns == {"sensor": "radar", "bearing": "brg_deg"}
    found = {each.parameter: each.value if each.is_better else each.parameter.start for each in calibration.estimates}
    for each, value in found.items():
        sensor, (kind, *rest) = again.sensors[each.sensor], each.name.split(".")
        holder = getattr(sensor, kind if rest else "bias")
        assert getattr(holder, rest[0] if rest else kind) == pytest.approx(value, rel=1e-6)
    # The written values are those that the next calibration starts from.
    problem = build_problem(scenario_from_recording(folder / "found.yaml", folder / "scans.csv").scenario)
    assert [each.start for each in problem.parameters] == pytest.approx(list(found.values()), 1e-6)


def test_files_that_are_named_are_found_from_another_folder(
    calibrated: tuple[Path, RecordingScenario, Calibration], tmp_path: Path
) -> None:
    folder, (scenario, _, _), calibration = calibrated
    (folder / "with.yaml").write_text(SENSORS + MOTION + "targets: {kind: recorded, path: truth.csv}\n", "utf-8")
    text = calibrated_text(scenario, folder / "with.yaml", calibration, tmp_path)
    assert str((folder / "truth.csv").resolve()) in text


def test_radars_without_common_targets_are_named(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(3), list[list[object]]()
    targets = {"a": [(2000.0, 500.0, -5.0, 3.0), (-1500.0, 1000.0, 4.0, 4.0)]}
    targets["b"] = [(1500.0, -800.0, -4.0, 5.0), (-2000.0, -600.0, 6.0, -2.0)]
    for name, states in targets.items():
        for time in np.arange(0.3, 100.0, 4.0).tolist():
            for x, y, vx, vy in states:
                dx, dy = x + vx * time, y + vy * time
                bearing = math.degrees(math.atan2(dy, dx) + rng.normal(0.0, 0.012))
                rows.append([time, name, math.hypot(dx, dy) + rng.normal(0.0, 20.0), bearing])
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "range", "bearing_deg"], *rows])
    (tmp_path / "radars.yaml").write_text(
        "recording: {bearings: east}\n"
        "sensor_defaults:\n"
        "  noise: {kind: constant, std: [0.012, 20.0]}\n"
        "  detection: {kind: limited_range, probability: 0.9, max_range: 8000.0}\n"
        "  clutter: {kind: region, rate: 1.0}\n"
        "sensors:\n  - {name: a, position: [0, 0]}\n  - {name: b, position: [30000, 0]}\n" + MOTION,
        "utf-8",
    )
    problem = build_problem(scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv").scenario)
    why = {(each.parameter.sensor, each.parameter.name): each.reason for each in calibrate(problem).estimates}
    for one in ((0, "bearing_deg"), (1, "bearing_deg"), (1, "clock")):
        assert "no other sensor observes enough of the same targets" in why[one]
    assert "rotation" in why[0, "bearing_deg"]
    assert "shift in time" in why[1, "clock"]
    assert why[0, "noise.std.1"] == ""


def test_positions_are_compared_with_those_of_the_first_sensor(tmp_path: Path) -> None:
    rng, rows, bias = np.random.default_rng(0), list[list[object]](), np.array([200.0, -100.0])
    states = rng.uniform(-2000.0, 2000.0, (4, 4)) * [1.0, 1.0, 0.002, 0.002]
    for name, period in (("a", 4.0), ("b", 5.0)):
        for time in np.arange(1.0, 80.0, period).tolist():
            for state in states:
                place = state[:2] + time * state[2:] + (name == "b") * bias + rng.normal(0.0, 15.0, 2)
                rows.append([time, name, *place.tolist()])
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "x", "y"], *rows])
    (tmp_path / "sensors.yaml").write_text(
        "sensor_defaults:\n  measurement: {kind: position}\n  noise: {kind: constant, std: [20.0, 20.0]}\n"
        "  detection: {kind: constant, probability: 0.9}\n"
        "sensors:\n  - {name: a, position: [0, 0]}\n  - {name: b, position: [3000, 0]}\n" + MOTION,
        "utf-8",
    )
    scenario = scenario_from_recording(tmp_path / "sensors.yaml", tmp_path / "scans.csv").scenario
    problem = build_problem(scenario, prior_scale=10.0)
    found = {(each.parameter.sensor, each.parameter.name): each for each in calibrate(problem).estimates}
    assert (0, "x") not in found
    for name, truth in (("x", 200.0), ("y", -100.0)):
        one = found[1, name]
        assert abs(one.value - truth) < 0.8 * (one.ci_high - one.ci_low)
        assert one.ci_high - one.ci_low < 40.0
    # Biases of 200 m at 3 km are implausible with the prior of 1 % of the range.
    found = {
        (each.parameter.sensor, each.parameter.name): each for each in calibrate(build_problem(scenario)).estimates
    }
    assert found[1, "x"].reason.startswith("implausible: ")
    assert found[1, "y"].reason.startswith("implausible: fitted together with the x bias of b")
    assert (found[1, "x"].value, found[1, "y"].value) == (0.0, 0.0)


def test_places_are_asked_of_the_others_alone(tmp_path: Path) -> None:
    scenario = recorded(tmp_path, 30.0).scenario
    plain, asked = (
        [
            (each.sensor, each.name)
            for each in build_problem(scenario, position=position).parameters
            if each.kind == "bias"
        ]
        for position in (False, True)
    )
    assert plain == [(0, "bearing_deg"), (0, "range"), (1, "bearing_deg"), (1, "range"), (1, "clock")]
    assert asked == [(0, "range"), (1, "bearing_deg"), (1, "range"), (1, "clock"), (1, "x"), (1, "y")]


def two_radars(folder: Path, targets: Sequence[tuple[float, ...]], names: str = "ab") -> Problem:
    """Of targets (x, y, vx, vy); b is at (3000, 0), and said to be at (3080, -60); places are asked for."""
    rng, rows = np.random.default_rng(3), list[list[object]]()
    for name, at, period in (("a", 0.0, 4.0), ("b", 3000.0, 5.0))[: len(names)]:
        for time in np.arange(0.3, 120.0, period).tolist():
            for x, y, vx, vy in targets:
                dx, dy = x + vx * time - at, y + vy * time
                bearing = math.degrees(math.atan2(dy, dx) + rng.normal(0.0, 0.012))
                rows.append([time, name, math.hypot(dx, dy) + rng.normal(0.0, 20.0), bearing])
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "range", "bearing_deg"], *rows])
    sensors = ["  - {name: a, position: [0, 0]}\n", "  - {name: b, position: [3080, -60]}\n"][: len(names)]
    (folder / "radars.yaml").write_text(
        "recording: {bearings: east}\n"
        "sensor_defaults:\n"
        "  noise: {kind: constant, std: [0.012, 20.0]}\n"
        "  detection: {kind: constant, probability: 0.9}\n"
        "  clutter: {kind: region, rate: 1.0}\n"
        f"sensors:\n{''.join(sensors)}" + MOTION,
        "utf-8",
    )
    scenario = scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario
    return build_problem(scenario, position=True, prior_scale=10.0)


def biases_of(problem: Problem) -> Calibration:
    return calibrate(problem, only=[each for each in problem.parameters if each.kind == "bias"])


def test_radar_position_is_estimated_from_surrounding_targets(tmp_path: Path) -> None:
    targets = [(2000.0, 3000.0, 5.0, 3.0), (-3000.0, 1000.0, -4.0, 4.0), (1000.0, -3000.0, 3.0, -6.0)]
    calibration = biases_of(two_radars(tmp_path, targets))
    found = {(each.parameter.sensor, each.parameter.name): each for each in calibration.estimates}
    assert len(found) == 6
    assert found[1, "clock"].kept.startswith("held-back scans fit no better")  # the targets hardly move
    assert found[1, "clock"].std > 2.0
    for name, truth in (("x", 80.0), ("y", -60.0), ("range", 0.0), ("bearing_deg", 0.0)):
        one = found[1, name]
        assert abs(one.value - truth) < 3.0 * one.std, name
    assert found[1, "x"].std < 20.0


def test_of_far_targets_in_one_direction_a_place_is_like_a_range(tmp_path: Path) -> None:
    """Ranges that are too long, or a place too far north."""
    targets = [(1600.0, 9000.0, 5.0, 3.0), (1400.0, 9600.0, -4.0, 4.0), (1500.0, 8400.0, 3.0, -6.0)]
    calibration = biases_of(two_radars(tmp_path, targets))
    why = {(each.parameter.sensor, each.parameter.name): each.reason for each in calibration.estimates}
    assert why[1, "range"].startswith("not identifiable separately from y bias of b")
    assert why[1, "y"].startswith("not identifiable separately from range bias of b")
    assert (why[1, "bearing_deg"], why[1, "x"]) == ("", "")
    assert calibration.rank == 5


def test_position_of_a_single_radar_is_not_estimated(tmp_path: Path) -> None:
    calibration = biases_of(two_radars(tmp_path, [(2000.0, 3000.0, 5.0, 3.0), (-3000.0, 1000.0, -4.0, 4.0)], "a"))
    assert [each.parameter.name for each in calibration.estimates] == ["range"]
    assert "there is no other sensor" in calibration.estimates[0].reason
    assert calibration.rank == 0


def test_values_and_scales_are_each_others_inverse(tmp_path: Path) -> None:
    problem = build_problem(recorded(tmp_path, 30.0).scenario)
    values = np.array([each.start + 0.01 for each in problem.parameters])
    np.testing.assert_allclose(problem.values(problem.free(values.tolist())), values, rtol=1e-12)
    bearing = next(each for each in problem.parameters if each.component == "bearing")
    assert bearing.per_si == pytest.approx(-180.0 / math.pi)  # a compass counts clockwise
    assert replace(bearing, scale="log").from_free(1e9) < math.inf
