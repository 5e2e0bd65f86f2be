"""Targets that are drawn anew in every run."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError
from vedette.simulation import PoissonTargets, Truth

TIMES = np.arange(1.0, 2001.0)
MOTION = models.constant_velocity(0.5)
MEAN = np.array([10.0, -5.0, 1.0, 2.0])
COV = np.diag([4.0, 9.0, 0.25, 1.0])


def lives(truth: Truth) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each target the scans of its life and its states."""
    scans = np.repeat(np.arange(truth.num_scans), np.diff(truth.offsets))
    return [(scans[truth.ids == target], truth.states[truth.ids == target]) for target in np.unique(truth.ids)]


def drawn(seed: int = 0, times: np.ndarray = TIMES, **fields: object) -> Truth:
    arguments: dict[str, Any] = {"expected": 0.2, "mean": MEAN, "cov": COV, "death_probability": 0.1} | fields
    truth = PoissonTargets(MOTION, **arguments).truth(times, rng=np.random.default_rng(seed))
    truth.validate()
    return truth


def test_births_and_deaths_have_their_rates():
    all_lives = lives(drawn(death_probability=0.02))
    num, total = len(all_lives), sum(len(scans) for scans, _ in all_lives)
    assert abs(num - 400) < 4 * 20  # Poisson of mean 400
    # Deaths among the chances to die; the last scans cut lives short.
    deaths = sum(scans[-1] < len(TIMES) - 1 for scans, _ in all_lives)
    assert abs(deaths / total - 0.02) < 4 * np.sqrt(0.02 / total)
    for scans, _ in all_lives:
        assert (np.diff(scans) == 1).all()


def test_births_have_their_mean_and_covariance():
    first = np.array([states[0] for _, states in lives(drawn(expected=2.0))])
    np.testing.assert_allclose(first.mean(axis=0), MEAN, atol=4 * np.sqrt(np.diag(COV) / len(first)).max())
    np.testing.assert_allclose(np.cov(first.T), COV, atol=0.15 * COV.max())


def test_they_move_with_the_noise_of_the_motion():
    moved = [
        later - MOTION.propagate(before, 1.0)[0]
        for _, states in lives(drawn(expected=1.0))
        for before, later in pairwise(states)
    ]
    noise = MOTION.noise_cov(MEAN, 1.0)
    np.testing.assert_allclose(np.cov(np.array(moved).T), noise, atol=0.1 * noise.max())


def test_what_leaves_the_region_is_gone():
    region = models.Region(-20.0, 20.0, -20.0, 20.0)
    truth = drawn(region=region, death_probability=0.0)
    assert region.contains(truth.states[:, :2]).all()
    for scans, _ in lives(truth):
        assert (np.diff(scans) == 1).all()
        assert scans[-1] < len(TIMES) - 1 or scans[0] > len(TIMES) - 200


def test_none_die_without_a_probability():
    assert all(scans[-1] == 19 for scans, _ in lives(drawn(times=TIMES[:20], death_probability=0.0)))


def test_a_seed_gives_one_truth_and_no_birth_is_a_truth_too():
    first, second, other = (drawn(seed, TIMES[:50]) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.states, second.states)
    assert not np.array_equal(first.states, other.states)
    assert len(drawn(expected=0.0).ids) == 0


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"expected": -1.0}, "PoissonTargets.expected"),
        ({"mean": [1.0]}, "PoissonTargets.mean"),
        ({"cov": -COV}, "covariance"),
        ({"death_probability": 2.0}, "PoissonTargets.death_probability"),
    ],
)
def test_bad_targets(fields, message):
    with pytest.raises(InputError, match=message):
        drawn(**fields)
