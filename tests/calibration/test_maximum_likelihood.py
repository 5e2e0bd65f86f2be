"""The search for a maximum, against linear regression, whose maximum and information are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.calibration.maximum_likelihood import covariance, maximise, stds_from_blocks
from vedette.kernels.base.types import Floats

TRUTH = np.array([3.0, -2.0, 0.5])
UNKNOWN = np.array([100.0, 50.0, 20.0])
BLOCKS = np.arange(400) // 20


def design(seed: int, num: int = 400) -> tuple[Floats, Floats]:
    """(num, 3) what was measured by, and (num,) what came."""
    rng = np.random.default_rng(seed)
    factors = rng.normal(size=(num, 3)) * [1.0, 0.3, 2.0]
    return factors, factors @ TRUTH + rng.normal(size=num)


@pytest.mark.parametrize("seed", range(3))
def test_a_regression_is_solved_and_its_information_found(seed: int) -> None:
    factors, came = design(seed)
    found = maximise(lambda x: -0.5 * (came - factors @ x) ** 2, np.zeros(3), UNKNOWN, [[0, 1, 2]], BLOCKS)
    best = np.linalg.lstsq(factors, came, rcond=None)[0]
    exact = factors.T @ factors
    assert found.converged
    stds = np.sqrt(np.diag(np.linalg.inv(exact)))
    assert (np.abs(found.at - best) < 0.5 * stds).all()  # a search ends within the error of its maximum
    np.testing.assert_allclose(found.terms, -0.5 * (came - factors @ found.at) ** 2)
    scores = (came - factors @ found.at)[:, None] * factors
    spread = np.std(found.scores - scores, axis=0) / np.std(scores, axis=0)
    assert (spread < 0.2).all()  # of where the last step began
    np.testing.assert_allclose(np.diag(found.information), np.diag(exact), rtol=0.15)
    cov, lost = covariance(found.information, UNKNOWN)
    np.testing.assert_allclose(np.sqrt(np.diag(cov)), stds, rtol=0.1)
    of_blocks = stds_from_blocks(found.scores, cov, BLOCKS)
    np.testing.assert_allclose(of_blocks, stds, rtol=0.5)
    np.testing.assert_array_equal(lost, np.zeros((3, 3)))


def test_an_unobservable_direction_is_reported_and_not_followed() -> None:
    factors, came = design(0)
    factors[:, 1] = factors[:, 0]  # only the sum of the first two can be found
    came = factors @ TRUTH + 0.1 * np.random.default_rng(3).normal(size=len(factors))
    found = maximise(lambda x: -0.5 * (came - factors @ x) ** 2, np.zeros(3), np.full(3, 50.0), [[0, 1, 2]], BLOCKS)
    cov, lost = covariance(found.information, np.full(3, 50.0))
    np.testing.assert_allclose(lost, [[0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 0.0]], atol=1e-4)
    assert found.at[0] + found.at[1] == pytest.approx(1.0, abs=0.03)
    assert found.at[0] == pytest.approx(found.at[1], abs=0.03)
    summed = np.array([1.0, 1.0, 0.0])
    reduced = factors[:, [0, 2]]
    assert summed @ cov @ summed == pytest.approx(np.linalg.inv(reduced.T @ reduced)[0, 0], rel=0.1)


def test_small_jumps_hide_neither_the_maximum_nor_what_few_say_in_common() -> None:
    factors, came = design(1)
    factors[:, 1] = 0.3 * factors[:, 0] + 1e-4 * factors[:, 1]

    def terms(x: Floats) -> Floats:
        jumps = 1e-5 * np.sign(np.sin(1e5 * x.sum()))
        return -0.5 * (came - factors @ x) ** 2 + jumps / len(came)

    found = maximise(terms, np.zeros(3), np.full(3, 10.0), [[0, 1, 2]], BLOCKS)
    cov, lost = covariance(found.information, np.full(3, 10.0))
    # The first two cannot be told apart; the third is as sure as if they were one.
    assert np.diag(lost)[:2].sum() == pytest.approx(1.0, abs=1e-3)
    reduced = factors[:, [0, 2]]
    assert cov[2, 2] == pytest.approx(np.linalg.inv(reduced.T @ reduced)[1, 1], rel=0.1)


def test_blocks_that_do_not_depend_on_each_other_need_no_second_differences() -> None:
    factors, came = design(2)
    calls = []

    def terms(x: Floats) -> Floats:
        calls.append(x)
        first = -0.5 * (came - factors[:, 0] * x[0] - factors[:, 1] * x[1]) ** 2
        return np.concatenate([first, -0.5 * (came - 2.0 * x[2]) ** 2])

    found = maximise(terms, np.zeros(3), UNKNOWN, [[0, 1], [2]], np.tile(BLOCKS, 2))
    np.testing.assert_allclose(found.information[2], [0.0, 0.0, 4.0 * len(came)], rtol=1e-6, atol=1e-4)
    assert found.at[2] == pytest.approx(came.mean() / 2.0, abs=1e-6)


def test_where_terms_jump_no_step_up_is_needed_near_the_maximum() -> None:
    """No share of the step goes up, as the start lies on a jump of 0.4; the maximum is 0.4 standard errors away."""
    start = np.array([0.3])

    def terms(at: Floats) -> Floats:
        return -0.5 * (at[0] - np.array([1.0, -1.0])) ** 2 + (0.2 if at[0] == start[0] else 0.0)

    found = maximise(terms, start, np.array([100.0]), [[0]], np.arange(2))
    assert (found.converged, found.at.tolist()) == (True, [0.3])


def test_far_from_the_maximum_it_did_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vedette.calibration.maximum_likelihood._MOST_STEPS", 1)
    far, unknown, blocks = np.array([60.0]), np.array([100.0]), np.arange(20)
    assert not maximise(lambda at: np.full(20, -0.5 * (at[0] - 1.0) ** 2), far, unknown, [[0]], blocks).converged


def test_a_single_block_gives_no_standard_error() -> None:
    assert (stds_from_blocks(np.ones((3, 2)), np.eye(2), np.zeros(3, np.int64)) == np.inf).all()
