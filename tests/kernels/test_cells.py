"""The cells that a sensor sees on its courses, against plain NumPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.errors import ModelError
from vedette.kernels.gaussian.prediction import survival_probabilities
from vedette.kernels.planning.cells import cells_in_view
from vedette.kernels.steps.undetected import take_out_detected
from vedette.models.functions import model_function

pytestmark = pytest.mark.lanes

GRID = models.CellGrid(models.Region(-100.0, 100.0, -60.0, 60.0), 7, 5)
STATES, WEIGHTS = GRID.states(4), GRID.node_weights()


def sensor(detection: Any) -> Any:
    clutter = models.measurement_space_clutter(0.0, np.full(2, -1000.0), np.full(2, 1000.0))
    return models.SensorModel(models.position(), models.constant_noise([5.0, 5.0]), detection, clutter)


def some_courses(num_courses: int = 6, num_times: int = 4) -> Any:
    rng = np.random.default_rng(7)
    return np.concatenate(
        [rng.uniform(-130.0, 130.0, (num_courses, num_times, 2)), rng.uniform(-3, 3, (num_courses, num_times, 1))], 2
    )


def always(num_courses: int = 6, num_times: int = 4) -> Any:
    return np.ones((num_courses, num_times), np.bool_)


def plainly(detection: Any, courses: Any, scans: Any, least: float) -> tuple[Any, Any, Any]:
    """For each course the cells of which the mean of P_D over the nodes is `least` at some scan, and their misses."""
    offsets, cells, log_miss = [0], [], []
    for course, own in zip(courses, scans, strict=True):
        for cell, states in enumerate(STATES):
            chances = own * np.array([WEIGHTS @ detection.prob(states, pose) for pose in course])
            if chances.max() >= least:
                cells.append(cell)
                log_miss.append(np.log1p(-chances).sum())
        offsets.append(len(cells))
    return np.array(offsets), np.array(cells), np.array(log_miss)


@pytest.mark.parametrize(
    ("detection", "reach"),
    [
        (models.limited_range(0.9, 55.0), 55.0),
        (models.limited_range(0.9, 12.0), 12.0),  # less than a cell
        (models.limited_sector(0.8, 70.0, 0.6), 70.0),
        (models.gaussian_detection(30.0), math.inf),
    ],
)
@pytest.mark.parametrize("least", [1e-6, 0.3])
@pytest.mark.parametrize("scans", [always(), np.random.default_rng(3).random((6, 4)) < 0.5])
def test_cells_in_view_are_those_of_plain_numpy(detection: Any, reach: float, least: float, scans: Any) -> None:
    courses, own = some_courses(), sensor(detection).to_kernel()
    expected = plainly(detection, courses, scans, least)
    for known in (reach, math.inf):
        offsets, cells, log_miss = cells_in_view(own, courses, scans, STATES, WEIGHTS, least, known)
        np.testing.assert_array_equal(offsets, expected[0])
        np.testing.assert_array_equal(cells, expected[1])
        np.testing.assert_allclose(log_miss, expected[2], rtol=1e-12)
    assert 0 < len(cells) <= 6 * GRID.num_cells


@pytest.mark.parametrize("max_range", [12.0, 55.0])
def test_what_a_scan_leaves_is_that_of_plain_numpy(max_range: float) -> None:
    detection, expected = models.limited_range(0.9, max_range), np.linspace(0.0, 2.0, 70).reshape(2, 35)
    for pose in some_courses()[:, 0]:
        left = take_out_detected(sensor(detection).to_kernel(), pose, STATES, WEIGHTS, expected)
        missed = [1.0 - WEIGHTS @ detection.prob(states, pose) for states in STATES]
        np.testing.assert_allclose(left, expected * missed, rtol=1e-13)
    np.testing.assert_array_equal(expected, np.linspace(0.0, 2.0, 70).reshape(2, 35))


@model_function("prob_survival")
def _by_place(state, dt, params):
    return params[0] if state[0] < 0.0 else dt * state[1]


def test_survival_is_asked_state_by_state() -> None:
    motion = models.constant_velocity(1.0)
    bundle = models.kernel_motion(motion, models.SurvivalModel(_by_place, np.array([0.3])))
    states = np.array([[-1.0, 9.0, 0.0, 0.0], [1.0, 0.2, 0.0, 0.0]])
    np.testing.assert_allclose(survival_probabilities(bundle, 2.0, states), [0.3, 0.4])
    with pytest.raises(ModelError, match=r"survival model: probability is not in \[0, 1\]"):
        survival_probabilities(bundle, 6.0, states)


def test_nothing_in_view() -> None:
    courses = some_courses() + np.array([1e4, 0.0, 0.0])
    own = sensor(models.limited_range(0.9, 55.0)).to_kernel()
    offsets, cells, log_miss = cells_in_view(own, courses, always(), STATES, WEIGHTS, 1e-6, 55.0)
    np.testing.assert_array_equal(offsets, np.zeros(7))
    assert len(cells) == len(log_miss) == 0


@model_function("prob_detection")
def _certain(state, pose, params):
    return params[0]


def test_a_detection_that_is_certain_leaves_nothing() -> None:
    own = sensor(models.DetectionModel(_certain, np.array([1.0]))).to_kernel()
    nodes, weights = GRID.states(4, 1), GRID.node_weights(1)
    offsets, cells, log_miss = cells_in_view(own, some_courses(1), always(1), nodes, weights, 0.5, math.inf)
    np.testing.assert_array_equal(offsets, [0, 35])
    np.testing.assert_array_equal(cells, np.arange(35))
    np.testing.assert_array_equal(log_miss, np.full(35, -math.inf))


def test_what_is_no_probability_is_refused() -> None:
    own = sensor(models.DetectionModel(_certain, np.array([1.5]))).to_kernel()
    with pytest.raises(ModelError, match=r"probability is not in \[0, 1\]"):
        cells_in_view(own, some_courses(), always(), STATES, WEIGHTS, 0.5, math.inf)
