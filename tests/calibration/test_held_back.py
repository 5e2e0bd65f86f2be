"""Fit to held-back blocks, against regressions with known answers; probabilities of detection that differ."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.calibration.held_back import blocks_of_time, held_back_gains
from vedette.calibration.initial_guess import dispersion
from vedette.calibration.maximum_likelihood import Maximum, maximise, stds_from_blocks
from vedette.calibration.registration import MatchedMeasurements
from vedette.kernels.base.types import Floats

NUM = 400
BLOCKS = blocks_of_time(np.arange(NUM, dtype=float))
SLOPES = np.array([0.5, 0.0])


def regression(seed: int) -> tuple[Floats, Floats]:
    """(NUM, 2) factors, and (NUM,) results of which the second factor explains nothing."""
    rng = np.random.default_rng(seed)
    factors = rng.normal(size=(NUM, 2))
    return factors, factors @ SLOPES + rng.normal(size=NUM)


def test_blocks_follow_each_other_and_are_as_long() -> None:
    assert BLOCKS.min() == 0
    assert BLOCKS.max() == 29
    assert (np.diff(BLOCKS) >= 0).all()
    assert np.ptp(np.bincount(BLOCKS)) <= 1
    # Terms of two sensors, one after the other: blocks count in time.
    times = np.concatenate([np.arange(40.0), np.arange(40.0)])
    np.testing.assert_array_equal(blocks_of_time(times)[:40], blocks_of_time(times)[40:])


def test_a_group_that_explains_nothing_gains_nothing() -> None:
    gained = np.zeros(2)
    for seed in range(30):
        factors, came = regression(seed)

        def terms(x: Floats, factors: Floats = factors, came: Floats = came) -> Floats:
            return -0.5 * (came - factors @ x) ** 2

        maximum = maximise(terms, np.zeros(2), np.full(2, 10.0), [[0, 1]], BLOCKS)
        cov: Floats = np.asarray(np.linalg.inv(factors.T @ factors), np.float64)
        gains = held_back_gains(terms, maximum, cov, np.zeros(2), [[0], [1]], BLOCKS)
        gained += [gain > error for gain, error in gains]
    assert gained[0] == 30
    assert gained[1] <= 8  # at most one in six by chance


def test_halves_are_scored_as_if_each_were_fitted_alone() -> None:
    """Of a regression, a Newton step from the maximum of all is the maximum of the half."""
    factors, came = regression(0)
    best: Floats = np.asarray(np.linalg.lstsq(factors, came)[0], np.float64)
    cov: Floats = np.asarray(np.linalg.inv(factors.T @ factors), np.float64)

    def terms(x: Floats) -> Floats:
        return -0.5 * (came - factors @ x) ** 2

    maximum = Maximum(best, terms(best), (came - factors @ best)[:, None] * factors, factors.T @ factors, True)
    found = held_back_gains(terms, maximum, cov, np.zeros(2), [[0, 1]], BLOCKS)[0][0]
    total = 0.0
    for half in (0, 1):
        own = half == BLOCKS % 2
        fitted = np.linalg.lstsq(factors[own], came[own])[0]
        total += float((terms(fitted) - terms(np.zeros(2)))[~own].sum())
    assert found == pytest.approx(total, rel=0.05)


def test_errors_that_last_widen_the_interval() -> None:
    """Of a mean of errors with correlation 0.8 from term to term, over 200 draws; independent rows cover 49 %."""
    rng, blocks, covered = np.random.default_rng(0), np.arange(600) // 30, np.zeros(2)
    for _ in range(200):
        errors = np.zeros(600)
        for i, step in enumerate(rng.normal(size=600)):
            errors[i] = 0.8 * errors[i - 1] + 0.6 * step
        mean, cov = errors.mean(), np.array([[1.0 / 600.0]])
        std = float(stds_from_blocks((errors - mean)[:, None], cov, blocks)[0])
        covered += [abs(mean) < 1.96 * std, abs(mean) < 1.96 * np.sqrt(cov[0, 0])]
    assert covered[0] >= 0.88 * 200
    assert covered[1] < 0.7 * 200


@pytest.mark.parametrize(("shares", "uneven"), [((0.8, 0.8, 0.8, 0.8), False), ((0.95, 0.95, 0.3, 0.4), True)])
def test_targets_that_are_not_detected_equally_often_are_found(shares: tuple[float, ...], uneven: bool) -> None:
    rng = np.random.default_rng(2)
    hits = rng.binomial(60, shares)
    tracks = np.repeat(np.arange(4), hits)
    num, none = len(tracks), np.zeros(1, np.int64)
    of_rows = np.zeros((num, 3)), np.zeros((num, 3)), np.zeros((num, 6))
    in_view = np.full((1, 4), 60)
    pairs = MatchedMeasurements(np.arange(float(num)), np.zeros(num, np.int64), tracks, *of_rows, in_view, none, none)
    share = hits.sum() / 240.0
    assert dispersion(pairs, 0) == pytest.approx(((hits - 60 * share) ** 2).sum() / (180 * share * (1 - share)))
    assert (dispersion(pairs, 0) > 4.0) is uneven
