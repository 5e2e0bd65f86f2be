"""The share of the seen targets that are tracked, and the time until one is, by hand and against plain loops."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.synthetic import SENSORS, make_record
from scenarios.minimal import changed
from vedette import models
from vedette.densities.estimates import Estimate
from vedette.errors import InputError, ScenarioError
from vedette.evaluation import TimeToTrack, TrackedFraction, custom_metrics, measure_run, run_scenario, targets_in_view
from vedette.models import SensorModel
from vedette.scenarios import load_scenario
from vedette.simulation.records import RunRecord
from vedette.simulation.truth import Truth


def sensor(detection: models.DetectionModel) -> SensorModel:
    clutter = models.measurement_space_clutter(1.0, [-9.0, -9.0], [9.0, 9.0])
    return SensorModel(models.position(), models.constant_noise([1.0, 1.0]), detection, clutter)


def record_of(truth: Truth, places: list[list[list[float]]]) -> RunRecord:
    """A run with estimates at these places, and two sensors that lie still at x = -10 and 10 m."""
    estimates = tuple(
        Estimate(
            np.array([[1, number] for number in range(len(scan))], np.int64).reshape(-1, 2),
            np.array(scan, np.float64).reshape(-1, 2),
            np.tile(np.eye(2), (len(scan), 1, 1)),
            np.ones(len(scan)),
        )
        for scan in places
    )
    poses = np.tile(np.array([[-10.0, 0.0, 0.0], [10.0, 0.0, 0.0]]), (truth.num_scans, 1, 1))
    first = make_record(num_scans=truth.num_scans)
    return replace(first, times=truth.times, truth=truth, poses=poses, estimates=estimates, decisions=())


# Left: seen by the first sensor; right: by the second; middle: by neither, as it lies at 10 m of either.
TRUTH = Truth(
    np.array([1.0, 2.0, 3.0, 4.0]),
    np.array([0, 3, 6, 7, 7]),
    np.array([0, 1, 2, 0, 1, 2, 2]),
    np.array([[-10.0, 2], [10, 2], [0, 0], [-10, 3], [10, 3], [0, 0], [0, 0]]),
)
BOTH = (sensor(models.limited_range(0.9, 5.0)), sensor(models.limited_range(0.6, 5.0)))


def test_by_hand() -> None:
    run = record_of(TRUTH, [[[-10.0, 3.0], [0.0, 0.5]], [[-10.0, 3.0], [10.0, 5.5]], [[0.0, 0.0]], []])
    share = TrackedFraction(BOTH, cutoff=2.0, order=1.0)(run)
    # Scan 1: of two seen the left one is tracked; scan 2: the right estimate is 2.5 m off; then none is seen.
    np.testing.assert_array_equal(share, [0.5, 0.5, math.nan, math.nan])
    np.testing.assert_array_equal(TrackedFraction(BOTH, cutoff=3.0, order=1.0)(run)[:2], [0.5, 1.0])


def test_a_sensor_that_hardly_detects_sees_nothing() -> None:
    run = record_of(TRUTH, [[[-10.0, 3.0]]] * 4)
    np.testing.assert_array_equal(TrackedFraction(BOTH, 2.0, 1.0, min_detection_probability=0.7)(run)[:2], [1.0, 1.0])
    seen = targets_in_view(TRUTH, run.poses, BOTH, min_detection_probability=0.7)
    assert seen.tolist() == [True, False, False, True, False, False, False]


def test_an_estimate_counts_for_one_target() -> None:
    close = replace(TRUTH, states=np.tile([-10.0, 0.0], (7, 1)))
    share = TrackedFraction(BOTH, cutoff=2.0, order=1.0)(record_of(close, [[[-10.0, 0.5]]] * 3 + [[]]))
    assert share[:3] == pytest.approx([1 / 3, 1 / 3, 1.0])


def test_equals_plain_loops() -> None:
    record = make_record("random")  # of targets farther apart than twice the cutoff
    sensors = (sensor(models.limited_range(0.8, 900.0)), sensor(models.limited_range(0.8, 700.0)))
    expected = []
    for scan, estimate in enumerate(record.estimates):
        states = record.truth.at(scan)[1][:, :2]
        apart = np.linalg.norm(states[:, None] - record.poses[scan][:, :2], axis=2)
        seen = (apart <= [900.0, 700.0]).any(axis=1)
        near = [np.linalg.norm(estimate.means[:, :2] - state, axis=1).min(initial=99.0) < 30.0 for state in states]
        expected.append(np.mean(np.array(near)[seen]) if seen.any() else math.nan)
    share = TrackedFraction(sensors, cutoff=30.0, order=1.0)(record)
    np.testing.assert_allclose(share, expected)
    assert 0.0 < np.nanmean(share) < 1.0


def test_time_to_track_by_hand() -> None:
    """0 and 1 from the start on, 2 and 3 later; 1 is tracked late, 3 never."""
    truth = Truth(
        np.array([1.0, 2.0, 4.0, 7.0]),
        np.array([0, 2, 6, 10, 13]),
        np.array([0, 1, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2]),
        np.array([[0.0, 0.0], [9, 0], *[[0, 0], [9, 0], [20, 0], [50, 0]] * 2, [0, 0], [9, 0], [20, 0]]),
    )
    run = record_of(truth, [[[0.0, 0.0]], [[35.0, 0.0]], [[9.0, 0.5]], [[20.0, 1.0]]])
    late = TimeToTrack(2.0, 1.0)(run)
    np.testing.assert_array_equal(late, [math.nan, (5.0 + 2.0) / 2.0, math.nan, math.nan])
    np.testing.assert_array_equal(TimeToTrack(2.0, 1.0, first_scan=1)(run)[:2], [(0.0 + 3.0) / 2.0, 3.5])


def test_a_run_of_other_sensors_is_refused() -> None:
    run = record_of(TRUTH, [[]] * 4)
    with pytest.raises(InputError, match="sensors: expected one for each of 2 sensors; got 1"):
        TrackedFraction(BOTH[:1], cutoff=2.0, order=1.0)(run)
    assert len(SENSORS) == 2


def test_a_scenario_names_it(tmp_path: Path) -> None:
    text = changed(
        (
            "ospa: {cutoff: 50.0",
            "metrics: {share: {kind: tracked_fraction}, wait_s: {kind: time_to_track}}\nospa: {cutoff: 50.0",
        )
    )
    file = tmp_path / "f.yaml"
    file.write_text(text)
    scenario = load_scenario(file)
    record = run_scenario(scenario, "stationary", seed=1)
    columns = measure_run(record, scenario, custom_metrics(scenario)).columns()
    share = columns["share"]
    assert np.isnan(columns["wait_s"]).sum() == record.num_scans - 1  # one target, from the second scan on
    # Both sensors see everywhere, so the share is that of the targets which are not missed.
    missed = measure_run(record, scenario).num_missed
    alive = np.diff(record.truth.offsets)
    np.testing.assert_allclose(share[alive > 0], 1.0 - missed[alive > 0] / alive[alive > 0])
    assert np.isnan(share[alive == 0]).all()


def test_targets_in_view_are_those_of_the_true_sensors(tmp_path: Path) -> None:
    text = changed(
        ("ospa: {cutoff: 50.0", "metrics: {share: {kind: tracked_fraction}}\nospa: {cutoff: 50.0"),
        (
            "sensor_defaults:\n",
            "sensor_defaults:\n  true_parameters:\n"
            "    detection: {kind: limited_range, probability: 0.9, max_range: 1.0}\n",
        ),
    )
    file = tmp_path / "f.yaml"
    file.write_text(text)
    scenario = load_scenario(file)
    record = run_scenario(scenario, "stationary", seed=1)
    # The filters believe that they see everywhere; in truth no target comes within a metre.
    assert np.isnan(measure_run(record, scenario, custom_metrics(scenario)).columns()["share"]).all()


def test_a_mistake_in_it_is_placed(tmp_path: Path) -> None:
    text = changed(
        (
            "ospa: {cutoff: 50.0",
            "metrics: {share: {kind: tracked_fraction, min_detection_probability: 2}}\nospa: {cutoff: 50.0",
        )
    )
    file = tmp_path / "f.yaml"
    file.write_text(text)
    with pytest.raises(
        ScenarioError, match=r"metrics\.share\.min_detection_probability: expected a number of at most 1, got 2"
    ):
        load_scenario(file)
