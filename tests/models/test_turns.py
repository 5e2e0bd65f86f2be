"""Measurements of a turning beam against the passage found by bisection, and their slopes against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models import (
    MeasurementModel,
    Region,
    bearing_only,
    bearing_range,
    bearing_range_rate,
    gaussian_detection,
    limited_sector,
    position,
    range_dependent_noise,
    range_only,
    region_clutter,
)
from vedette.models.turns import Turn, lags, longest_lag, own_places, with_beam

MODELS = (bearing_range, bearing_range_rate, bearing_only, range_only, position)


def draw(rng: np.random.Generator) -> tuple[Floats, Floats, float]:
    """States (20, 5) of targets up to 60 km away, a pose with a beam, and the period of its turn."""
    period = float(rng.uniform(1.0, 15.0))
    turn = Turn(period, clockwise=bool(rng.integers(2)))
    at = [*rng.uniform(-3000.0, 3000.0, 2), rng.uniform(-3.0, 3.0)]
    pose = with_beam(at, rng.uniform(-20.0, 20.0, 2), rng.uniform(-math.pi, math.pi), turn.rate)
    states = np.zeros((20, 5))
    far, way = 10.0 ** rng.uniform(3.7, 4.8, 20), rng.uniform(-math.pi, math.pi, 20)
    states[:, 0], states[:, 1] = pose[0] + far * np.cos(way), pose[1] + far * np.sin(way)
    states[:, 2:4], states[:, 4] = rng.uniform(-250.0, 250.0, (20, 2)), rng.uniform(-0.1, 0.1, 20)
    return states, pose, period


def passed(state: Floats, pose: Floats) -> float | None:
    """When the beam passes a target, by bisection; None of one that it passes near the ends of the turn."""
    half = longest_lag(pose)

    def off(lag: float) -> float:
        dx, dy = state[:2] + lag * state[2:4] - pose[:2] - lag * pose[6:8]
        return math.remainder(math.atan2(dy, dx) - pose[8] - pose[9] * lag, 2.0 * math.pi)

    grid = np.linspace(-0.98 * half, 0.98 * half, 400)
    values = [off(lag) for lag in grid.tolist()]
    for low, high, first, second in zip(grid, grid[1:], values, values[1:], strict=False):
        if first * second <= 0.0 and abs(first - second) < 1.0:
            for _ in range(80):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if off(middle) * first > 0.0 else (low, middle)
            return float(0.5 * (low + high))
    return None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", MODELS)
def test_a_target_is_measured_as_the_beam_passes_it(make: object, seed: int) -> None:
    model: MeasurementModel = make()  # type: ignore[operator]
    states, pose, _ = draw(np.random.default_rng(seed))
    compared = 0
    for state, measured in zip(states, model.measure(states, pose), strict=True):
        if (lag := passed(state, pose)) is None:
            continue
        then, here = state.copy(), np.zeros(8)
        then[:2] += lag * state[2:4]
        here[:2], here[6:8] = pose[:2] + lag * pose[6:8], pose[6:8]
        np.testing.assert_allclose(measured, model.measure(then[np.newaxis], here)[0], rtol=1e-9, atol=1e-9)
        compared += 1
    assert compared > 12


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", MODELS)
def test_slopes_are_those_of_the_measurement(make: object, seed: int) -> None:
    model: MeasurementModel = make()  # type: ignore[operator]
    states, pose, _ = draw(np.random.default_rng(100 + seed))
    assert model.jacobian is not None
    for state in states:
        slope = np.empty((model.meas_dim, 5))
        model.jacobian(state, pose, model.params, slope)
        steps = np.diag([1.0, 1.0, 0.01, 0.01, 0.001])
        ahead, behind = model.measure(state + steps, pose), model.measure(state - steps, pose)
        off = np.where(model.angular, np.remainder(ahead - behind + math.pi, 2.0 * math.pi) - math.pi, ahead - behind)
        numeric = (off / (2.0 * np.diag(steps)[:, np.newaxis])).T
        scale = np.abs(slope).max(axis=1, keepdims=True) + 1e-12
        np.testing.assert_allclose(slope / scale, numeric / scale, atol=2e-6)


@pytest.mark.parametrize("make", MODELS)
def test_without_a_turn_every_bit_stays(make: object) -> None:
    model: MeasurementModel = make()  # type: ignore[operator]
    states, pose, _ = draw(np.random.default_rng(3))
    still = pose.copy()
    still[9] = 0.0
    np.testing.assert_array_equal(model.measure(states, still), model.measure(states, pose[:8]))


def test_noise_detection_and_clutter_are_those_of_the_passage() -> None:
    states, pose, _ = draw(np.random.default_rng(4))
    noise, region = range_dependent_noise(10.0, 5e-5, 0.01, 5e-6), Region(-80e3, 80e3, -80e3, 80e3)
    clutter, at = region_clutter(5.0, region, "bearing_range"), bearing_range().measure(states, pose)
    for state, measured in zip(states, at, strict=True):
        if (lag := passed(state, pose)) is None:
            continue
        then, here = state.copy(), pose[:3].copy()
        then[:2] += lag * state[2:4]
        here[:2] += lag * pose[6:8]
        np.testing.assert_allclose(noise.covs([state], pose, 2), noise.covs([then], here, 2), rtol=1e-9)
        for model in (gaussian_detection(30e3), limited_sector(0.9, 4e4, 1.0)):
            found = model.function(state, pose, model.params), model.function(then, here, model.params)
            np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
        found = tuple(clutter.log_intensity(measured, own, clutter.params) for own in (pose, here))
        np.testing.assert_allclose(found[0], found[1], rtol=1e-9)


def test_places_undo_measurements_of_targets_at_rest() -> None:
    states, pose, _ = draw(np.random.default_rng(5))
    states[:, 2:] = 0.0
    model = bearing_range()
    np.testing.assert_allclose(model.positions(model.measure(states, pose), pose), states[:, :2], atol=1e-6)


def test_lags_are_within_half_a_turn() -> None:
    pose = with_beam([5.0, 6.0, 0.0], [1.0, 2.0], 1.0, Turn(8.0).rate)
    assert lags(np.array([1.0]), pose).tolist() == [0.0]
    np.testing.assert_allclose(lags(np.array([1.0 - math.pi / 2.0]), pose), [2.0])
    np.testing.assert_allclose(own_places(np.array([1.0 - math.pi / 2.0]), pose), [[7.0, 10.0]])
    assert longest_lag(pose) == pytest.approx(4.0)
    assert longest_lag(pose[:3]) == 0.0
    assert lags(np.array([2.0]), pose[:3]).tolist() == [0.0]


def test_a_turn_takes_time() -> None:
    with pytest.raises(InputError, match=r"Turn\.period: expected"):
        Turn(0.0)
