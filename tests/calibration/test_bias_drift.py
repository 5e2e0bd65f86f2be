"""Biases that change: window by window of a recording, and while scans come in."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recordings import SENSORS, write_recording
from vedette.calibration import (
    BiasEstimatorState,
    OnlineBiasEstimator,
    Problem,
    calibrate,
    calibrate_windows,
    warm_started,
)
from vedette.calibration.bias_drift import WindowEstimate
from vedette.errors import InputError
from vedette.scenarios.calibration import build_problem
from vedette.scenarios.from_recording import scenario_from_recording, scenario_from_sensors
from vedette.tracking import SensorScan, load_snapshot, save_snapshot

BIASES = {"boat": (300.0, 2.0, 0.0), "Calshot": (-150.0, -1.0, 0.0)}
MOTION = "motion: {kind: constant_velocity, sigma_v: 0.05}\n"
DRIFT = 0.5  # m/s, of the boat's ranges


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    folder = tmp_path_factory.mktemp("drifting")
    write_recording(folder, seconds=240.0, biases=BIASES, drift=DRIFT)
    (folder / "radars.yaml").write_text(SENSORS + MOTION, "utf-8")
    return build_problem(
        scenario_from_recording(folder / "radars.yaml", folder / "scans.csv").scenario, prior_scale=10.0
    )


def place(problem: Problem, sensor: int, name: str) -> int:
    return [(each.sensor, each.name) for each in problem.parameters].index((sensor, name))


def test_parts_of_a_recording_are_all_of_it(problem: Problem) -> None:
    whole = problem.recording
    parts = [whole.between(low, low + 80.0) for low in (0.0, 80.0, 160.0, 240.0)]
    assert [len(part.times) for part in parts[3:]] == [0]
    np.testing.assert_allclose(
        np.concatenate([part.start + part.times for part in parts[:3]]), whole.start + whole.times
    )
    assert sum(part.num_measurements for part in parts) == whole.num_measurements
    assert all(part.times[0] == 0.0 for part in parts[:3])


def test_each_window_has_the_bias_of_its_middle(problem: Problem) -> None:
    part = replace(problem, recording=problem.recording.between(0.0, 160.0))
    windows = list(calibrate_windows(part, 70.0))
    i = place(problem, 1, "range")
    assert [round(window.begin) for window in windows] == [0, 78]
    for window in windows:
        found = window.calibration.estimates[i]
        truth = 300.0 + DRIFT * 0.5 * (window.begin + window.end)
        assert abs(found.value - truth) < 3.0 * found.std
        assert 3.92 * found.std == pytest.approx(found.ci_high - found.ci_low, rel=1e-3)
        estimates = window.calibration.estimates
        values = part.free([each.value if each.is_better else each.parameter.start for each in estimates])
        own = replace(part, recording=part.recording.between(window.begin, window.end))
        total = own.log_likelihoods(values).sum()
        assert total == pytest.approx(window.calibration.log_likelihood, abs=0.5)  # with its own rate of births


def test_one_window_is_the_whole_recording(problem: Problem) -> None:
    short = replace(problem, recording=problem.recording.between(0.0, 40.0))
    (window,) = calibrate_windows(short, math.inf)
    whole = calibrate(short)
    assert [each.value for each in window.calibration.estimates] == [each.value for each in whole.estimates]
    with pytest.raises(InputError, match="seconds: expected a number above 0; got 0"):
        next(calibrate_windows(short, 0.0))


def test_only_what_is_asked_for_changes(problem: Problem) -> None:
    short = replace(problem, recording=problem.recording.between(0.0, 60.0))
    only = [problem.parameters[place(problem, s, "range")] for s in (0, 1)]
    calibration = calibrate(short, only=only)
    assert [each.parameter for each in calibration.estimates] == only
    values = np.array([each.start for each in warm_started(problem, calibration).parameters])
    assert [values[problem.parameters.index(each)] for each in only] == [each.value for each in calibration.estimates]
    assert calibration.log_likelihood == pytest.approx(
        short.log_likelihoods(short.free(values.tolist())).sum(),
        abs=0.1,  # other births
    )


def test_biases_are_followed_and_taken_off_as_scans_come(problem: Problem, tmp_path: Path) -> None:
    """Stopped, saved and taken up again in between, which changes no bit."""
    told = {(0, "bearing_deg"): -1.0, (0, "range"): -150.0, (1, "bearing_deg"): 2.0, (1, "range"): 300.0}
    known = [replace(each, start=told.get((each.sensor, each.name), each.start)) for each in problem.parameters]
    problem = replace(problem, parameters=tuple(known))
    follower, i = OnlineBiasEstimator(problem, window=90.0, every=60.0), place(problem, 1, "range")
    state, scans = follower.initial(), list(problem.recording.arrivals())
    for scan in scans:
        state, without = follower.process(state, scan)
        if state.num_estimates == 0:
            np.testing.assert_allclose(
                without.measurements[:, 1], np.maximum(scan.measurements[:, 1] - (-150.0, 300.0)[scan.sensor], 1.0)
            )
        if state.num_estimates == 1 and len(state.scans) % 5 == 0:
            save_snapshot(tmp_path / "state.npz", {"state": state, "rest": scans.index(scan) + 1})
    assert state.num_estimates == 3
    assert state.latest is not None
    assert {each.parameter.component for each in state.latest.estimates} == {"bearing", "range"}
    now = scans[-1].time
    bias, std = follower.biases(state, now)[i], state.pieces[-1].stds[i]
    assert abs(bias - (300.0 + DRIFT * now)) < 3.0 * std + DRIFT * 45.0
    one = next(scan for scan in reversed(scans) if scan.sensor == 1 and len(scan.measurements))
    taken = follower.corrected(state, one)
    np.testing.assert_allclose(
        taken.measurements[:, 1], np.maximum(one.measurements[:, 1] - follower.biases(state, one.time)[i], 1.0)
    )
    assert taken.time == one.time - follower.biases(state, one.time)[place(problem, 1, "clock")]
    found = load_snapshot(tmp_path / "state.npz")
    again = found["state"]
    for scan in scans[found["rest"] :]:
        again, _ = follower.process(again, scan)
    assert follower.biases(again, now).tobytes() == follower.biases(state, now).tobytes()


def followed(problem: Problem, *pieces: tuple[float, float, float]) -> BiasEstimatorState:
    """Of the range of the second sensor: time, value, standard deviation."""
    made = []
    for time, value, std in pieces:
        values, stds = np.zeros(len(problem.parameters)), np.full(len(problem.parameters), math.nan)
        values[place(problem, 1, "range")], stds[place(problem, 1, "range")] = value, std
        made.append(WindowEstimate(time, values, stds))
    return BiasEstimatorState(problem.parameters, pieces=tuple(made))


def test_a_bias_goes_on_as_far_as_its_change_stands_out(problem: Problem) -> None:
    follower, i = OnlineBiasEstimator(problem, window=60.0, every=30.0), place(problem, 1, "range")

    def at(time: float, *pieces: tuple[float, float, float]) -> float:
        return float(follower.biases(followed(problem, *pieces), time)[i])

    assert at(100.0) == 0.0  # as it starts
    assert at(100.0, (30.0, 300.0, 5.0)) == 300.0
    assert at(120.0, (30.0, 300.0, 5.0), (60.0, 310.0, 5.0)) == 310.0  # windows that overlap say nothing of change
    surely = at(120.0, (30.0, 300.0, 1e-6), (90.0, 330.0, 1e-6))
    assert surely == pytest.approx(345.0)
    share = 30.0**2 / (30.0**2 + 2.0 * 15.0**2)
    assert at(120.0, (30.0, 300.0, 15.0), (90.0, 330.0, 15.0)) == pytest.approx(330.0 + 15.0 * share)
    assert at(120.0, (30.0, 300.0, 5.0), (90.0, 999.0, math.nan)) == 300.0  # not found there
    assert at(1e6, (30.0, 300.0, 1e-6), (90.0, 330.0, 1e-6)) == pytest.approx(330.0 + 45.0)  # no further


def test_sensors_of_scans_that_are_to_come_can_be_followed(tmp_path: Path) -> None:
    region = "region: {x_min: -6000, x_max: 6000, y_min: -6000, y_max: 6000}\n"
    (tmp_path / "radars.yaml").write_text(SENSORS + MOTION + region, "utf-8")
    problem = build_problem(scenario_from_sensors(tmp_path / "radars.yaml").scenario, bearings="north")
    assert {each.sensor for each in problem.parameters} == {0, 1}
    assert problem.recording.scans == ()
    follower = OnlineBiasEstimator(problem)
    state, scan = follower.process(follower.initial(), SensorScan(0, 3.0, [[0.1, 500.0]], (1.0, 2.0, 0.0)))
    assert (state.newest, state.due, state.num_estimates) == (3.0, 63.0, 0)
    np.testing.assert_array_equal(scan.measurements, [[0.1, 500.0]])


def test_bad_parts_are_refused(problem: Problem) -> None:
    with pytest.raises(InputError, match="problem: expected a Problem"):
        OnlineBiasEstimator("problem")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="window: expected a number above 0; got 0"):
        OnlineBiasEstimator(problem, window=0.0)
    follower = OnlineBiasEstimator(problem)
    with pytest.raises(InputError, match=r"scan.sensor: expected a whole number from 0 to 1; got 2"):
        follower.process(follower.initial(), SensorScan(2, 0.0, [[0.1, 500.0]], (1.0, 2.0, 0.0)))
    with pytest.raises(InputError, match=r"scan of sensor 1 at 2 s: scan: expected an array of shape \(any, 2\)"):
        follower.process(follower.initial(), SensorScan(1, 2.0, [[0.1, 500.0, 3.0]], (1.0, 2.0, 0.0)))
    with pytest.raises(InputError, match="scan of sensor 1 at 2 s: scan: expected finite numbers"):
        follower.process(follower.initial(), SensorScan(1, 2.0, [[0.1, math.nan]], (1.0, 2.0, 0.0)))
    _, empty = follower.process(follower.initial(), SensorScan(1, 2.0, [], (1.0, 2.0, 0.0)))
    assert empty.measurements.shape == (0, 2)
