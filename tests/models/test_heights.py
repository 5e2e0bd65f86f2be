"""Measurements that depend on heights: values by geometry, slopes by differences, clutter by its integral."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vedette.models as models
from vedette.errors import InputError
from vedette.kernels.base.types import BEAM, OWN_HEIGHT, OWN_VELOCITY, Floats
from vedette.models import MotionModel, Region, constant_velocity_height, region_clutter
from vedette.models.functions import write_rows

KINDS = ("bearing_slant_range", "bearing_range_elevation", "bearing_range_altitude", "position_altitude")


def random_pose(rng: np.random.Generator, *, turns: bool) -> Floats:
    pose = np.zeros(OWN_HEIGHT + 1)
    pose[:2], pose[OWN_HEIGHT] = rng.normal(0.0, 1e3, 2), rng.uniform(0.0, 500.0)
    if turns:
        pose[OWN_VELOCITY:BEAM] = rng.normal(0.0, 100.0, 2)
        pose[BEAM], pose[BEAM + 1] = (
            rng.uniform(-3.0, 3.0),
            rng.choice([-1.0, 1.0]) * 2.0 * math.pi / rng.uniform(2, 10),
        )
    return pose


def random_state(rng: np.random.Generator) -> Floats:
    return np.array(
        [*rng.normal(0.0, 2e4, 2), *rng.normal(0.0, 200.0, 2), rng.uniform(100.0, 9e3), rng.normal(0.0, 15.0)]
    )


@pytest.mark.parametrize("seed", range(5))
def test_values_are_those_of_the_geometry(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose, state = random_pose(rng, turns=False), random_state(rng)
    off = np.array([state[0] - pose[0], state[1] - pose[1], state[4] - pose[OWN_HEIGHT]])
    bearing, slant = np.angle(off[0] + 1j * off[1]), np.linalg.norm(off)
    found = {kind: getattr(models, kind)().measure(state[np.newaxis], pose)[0] for kind in KINDS}
    np.testing.assert_allclose(found["bearing_slant_range"], [bearing, slant])
    np.testing.assert_allclose(found["bearing_range_elevation"], [bearing, slant, np.arcsin(off[2] / slant)])
    np.testing.assert_allclose(found["bearing_range_altitude"], [bearing, slant, state[4]])
    np.testing.assert_allclose(found["position_altitude"], state[[0, 1, 4]])


@pytest.mark.parametrize("kind", KINDS[1:])
def test_places_are_where_the_target_was(kind: str) -> None:
    rng = np.random.default_rng(1)
    model, pose, state = getattr(models, kind)(), random_pose(rng, turns=False), random_state(rng)
    found = model.states_at(model.measure(state[np.newaxis], pose), pose, 6)
    np.testing.assert_allclose(found[:, [0, 1, 4]], state[np.newaxis, [0, 1, 4]], rtol=1e-9)
    assert not found[:, [2, 3, 5]].any()


def test_a_slant_range_alone_is_placed_at_an_assumed_height() -> None:
    model, pose = models.bearing_slant_range(), np.zeros(3)
    far, near = model.states_at(np.array([[0.0, 13_000.0], [0.0, 1_000.0]]), pose, 6)[:, [0, 1, 4]]
    np.testing.assert_allclose(far, [12_000.0, 0.0, 5_000.0])
    np.testing.assert_allclose(near, [math.sqrt(0.5) * 1e3, 0.0, math.sqrt(0.5) * 1e3])


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_those_of_differences(kind: str, turns: bool) -> None:
    rng, model, steps = np.random.default_rng(2), getattr(models, kind)(), np.array([1.0, 1.0, 0.1, 0.1, 1.0, 0.1])
    for _ in range(20):
        pose, state = random_pose(rng, turns=turns), random_state(rng)
        slopes = np.empty((1, model.meas_dim, 6))
        write_rows(model.jacobian, state[np.newaxis], pose, model.params, slopes)
        ends = model.measure(np.vstack([state + np.diag(steps), state - np.diag(steps)]), pose)
        off = ends[:6] - ends[6:]
        off = np.where(model.angular, np.remainder(off + math.pi, 2.0 * math.pi) - math.pi, off)
        expected = (off / (2.0 * steps[:, np.newaxis])).T
        scale = np.abs(expected).max(axis=1, keepdims=True)
        np.testing.assert_allclose(slopes[0] / scale, expected / scale, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_clutter_has_its_rate_and_follows_its_intensity(kind: str) -> None:
    rng, region = np.random.default_rng(3), Region(-2e4, 3e4, -1e4, 2e4)
    clutter, model = region_clutter(50.0, region, kind, max_height=9e3), getattr(models, kind)()
    pose = random_pose(rng, turns=False)
    drawn = np.concatenate([clutter.sample(pose, model, state_dim=6, rng=rng) for _ in range(200)])
    assert len(drawn) == pytest.approx(200 * 50.0, rel=0.05)
    assert np.isfinite(clutter.log_intensity_at(drawn, pose)).all()
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    points = rng.uniform(low, high, (200_000, model.meas_dim))
    total = np.exp(clutter.log_intensity_at(points, pose)).mean() * np.prod(high - low)
    assert total == pytest.approx(50.0, rel=0.02)
    # In each half of the third component, or of the ranges, as many are drawn as the intensity has there.
    middle = np.median(drawn[:, -1])
    below = np.exp(clutter.log_intensity_at(points[points[:, -1] < middle], pose)).sum() / len(points)
    assert below * np.prod(high - low) == pytest.approx(25.0, rel=0.05)


def test_two_steps_have_the_noise_of_one_of_their_length() -> None:
    motion: MotionModel = constant_velocity_height(2.0, 0.5)
    one, two = np.empty((6, 6)), np.empty((6, 6))
    motion.process_noise_cov(np.zeros(6), 3.0, motion.noise_params, one)
    motion.process_noise_cov(np.zeros(6), 6.0, motion.noise_params, two)
    step = np.eye(6)
    step[0, 2] = step[1, 3] = step[4, 5] = 3.0
    np.testing.assert_allclose(step @ one @ step.T + one, two, rtol=1e-12)
    moved = np.empty(6)
    motion.transition(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), 3.0, motion.transition_params, moved)
    np.testing.assert_allclose(moved, [10.0, 14.0, 3.0, 4.0, 23.0, 6.0])


def test_noise_is_of_one_third_component() -> None:
    with pytest.raises(InputError, match="sigma_altitude: expected None beside sigma_elevation"):
        models.range_dependent_noise(10.0, 0.0, 0.01, 0.0, sigma_elevation=0.01, sigma_altitude=30.0)
