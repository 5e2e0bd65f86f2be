"""Motions against hand-written matrices, numerical integration and central differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from reference.differences import central_differences
from vedette import models

pytestmark = pytest.mark.lanes

STATES = np.array([[10.0, -20.0, 3.0, -7.0], [0.0, 0.0, 0.0, 0.0], [-1e3, 1e3, 250.0, 1.0]])


def jacobian(motion, state, dt):
    out = np.full((motion.state_dim, motion.state_dim), np.nan)
    motion.transition_jacobian(state, dt, motion.transition_params, out)
    return out


@pytest.mark.parametrize("dt", [0.1, 1.0, 2.0, 10.0])
def test_constant_velocity_is_the_papers(dt):
    motion = models.constant_velocity(5.0)
    identity, zero = np.eye(2), np.zeros((2, 2))
    transition = np.block([[identity, dt * identity], [zero, identity]])
    noise = 25.0 * np.block([[dt**4 / 4 * identity, dt**3 / 2 * identity], [dt**3 / 2 * identity, dt**2 * identity]])
    np.testing.assert_allclose(motion.propagate(STATES, dt), STATES @ transition.T, rtol=1e-15)
    np.testing.assert_array_equal(jacobian(motion, STATES[0], dt), transition)
    np.testing.assert_allclose(motion.noise_cov(STATES[0], dt), noise, rtol=1e-15)


@pytest.mark.parametrize("dt", [0.1, 1.0, 2.0])
def test_a_continuous_acceleration_has_the_noise_of_all_moments(dt):
    motion = models.constant_velocity(3.0, noise_model="continuous_white")
    identity = np.eye(2)
    noise = 9.0 * np.block([[dt**3 / 3 * identity, dt**2 / 2 * identity], [dt**2 / 2 * identity, dt * identity]])
    np.testing.assert_allclose(motion.noise_cov(STATES[0], dt), noise, rtol=1e-15)
    transition = jacobian(motion, STATES[0], dt)
    twice = transition @ motion.noise_cov(STATES[0], dt) @ transition.T + motion.noise_cov(STATES[0], dt)
    np.testing.assert_allclose(motion.noise_cov(STATES[0], 2.0 * dt), twice, rtol=1e-14)


@given(st.floats(0.01, 20.0), st.floats(0.01, 20.0))
def test_constant_velocity_steps_compose(first, second):
    motion = models.constant_velocity(1.0)
    apart = motion.propagate(motion.propagate(STATES, first), second)
    np.testing.assert_allclose(motion.propagate(STATES, first + second), apart, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("motion", [models.constant_velocity(5.0), models.coordinated_turn(5.0, 0.02)])
@pytest.mark.parametrize("dt", [0.1, 1.0, 5.0])
def test_process_noise_is_symmetric_and_semidefinite(motion, dt):
    cov = motion.noise_cov(np.ones(motion.state_dim), dt)
    np.testing.assert_array_equal(cov, cov.T)
    assert np.linalg.eigvalsh(cov).min() > -1e-12 * cov.max()


def test_coordinated_turn_noise_is_b_b_transposed():
    dt, sigma_v, sigma_turn_rate = 2.0, 5.0, math.radians(1.0)
    axis = np.array([dt**2 / 2, dt]) * sigma_v
    factor = np.zeros((5, 3))
    factor[[0, 2], 0] = axis
    factor[[1, 3], 1] = axis
    factor[4, 2] = dt * sigma_turn_rate
    cov = models.coordinated_turn(sigma_v, sigma_turn_rate).noise_cov(np.zeros(5), dt)
    np.testing.assert_allclose(cov, factor @ factor.T, rtol=1e-14)


def turning(_, state):
    return [state[2], state[3], -state[4] * state[3], state[4] * state[2], 0.0]


@pytest.mark.parametrize("turn_rate", [0.0, 1e-12, 1e-6, 1e-3, -0.05, 0.3, 2.0])
def test_coordinated_turn_solves_its_differential_equation(turn_rate):
    state = np.array([100.0, -50.0, 12.0, 5.0, turn_rate])
    solution = solve_ivp(turning, (0.0, 3.0), state, method="DOP853", rtol=1e-12, atol=1e-12)
    moved = models.coordinated_turn(1.0, 0.01).propagate(state, 3.0)[0]
    np.testing.assert_allclose(moved, solution.y[:, -1], rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("turn_rate", [0.0, 1e-9, -1e-4, 0.0499, 0.0501, -0.5, 3.0])
def test_coordinated_turn_jacobian_is_its_derivative(turn_rate):
    motion, dt = models.coordinated_turn(1.0, 0.01), 2.0
    state = np.array([100.0, -50.0, 12.0, 5.0, turn_rate])
    slopes = central_differences(lambda moved: motion.propagate(moved, dt)[0], state)
    np.testing.assert_allclose(jacobian(motion, state, dt), slopes, rtol=1e-7, atol=1e-6)


def test_coordinated_turn_derivatives_do_not_jump_where_the_series_ends():
    motion = models.coordinated_turn(1.0, 0.01)
    below, above = (jacobian(motion, np.array([0.0, 0.0, 50.0, 20.0, a]), 1.0) for a in (0.1, np.nextafter(0.1, 1.0)))
    np.testing.assert_allclose(below, above, rtol=1e-12, atol=1e-12)


def test_no_turn_is_constant_velocity():
    straight = models.constant_velocity(1.0).propagate(STATES, 2.0)
    turning_states = np.hstack([STATES, np.zeros((3, 1))])
    np.testing.assert_allclose(models.coordinated_turn(1.0, 1.0).propagate(turning_states, 2.0)[:, :4], straight)


@pytest.mark.parametrize("motion", [models.constant_velocity(5.0), models.coordinated_turn(5.0, 0.02)])
def test_built_in_motions_pass_their_own_check(motion):
    rng = np.random.default_rng(0)
    motion.check(rng.normal(size=(20, motion.state_dim)) * 10.0, 0.5)


def test_constant_survival():
    survival = models.constant_survival(0.98)
    survival.check(STATES)
    np.testing.assert_array_equal(survival.prob(STATES, 2.0), [0.98, 0.98, 0.98])
