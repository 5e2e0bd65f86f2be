"""Crowds that come and go: steady, even, and moving as the motion says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError, ModelError
from vedette.simulation import Truth, UniformTargets

MOTION = models.constant_velocity(0.5)
REGION = models.Region(-100.0, 300.0, 50.0, 250.0)
TIMES = np.arange(1.0, 41.0)


def drawn(seed: int = 0, times: np.ndarray = TIMES, motion: models.MotionModel = MOTION, **fields: Any) -> Truth:
    given: dict[str, Any] = {"number": 200, "region": REGION, "std": [3.0, 1.0], "death_probability": 0.02} | fields
    truth = UniformTargets(motion, **given).truth(times, rng=np.random.default_rng(seed))
    truth.validate()
    return truth


def steps(truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """States of all who are there at two scans in a row, before and after."""
    before, after = [], []
    for k in range(truth.num_scans - 1):
        (ids, states), (later, moved) = truth.at(k), truth.at(k + 1)
        _, old, new = np.intersect1d(ids, later, return_indices=True)
        before.append(states[old])
        after.append(moved[new])
    return np.concatenate(before), np.concatenate(after)


def test_their_number_is_exact_at_first_and_steady_later() -> None:
    numbers = np.diff(drawn(number=2000, times=np.arange(1.0, 101.0)).offsets)
    assert numbers[0] == 2000
    assert abs(numbers[50:].mean() - 2000) < 4 * np.sqrt(2000)


def test_they_are_spread_evenly_over_the_region_at_any_time() -> None:
    truth = drawn(number=4000, std=[20.0, 20.0])
    for scan in (0, 39):
        positions = truth.at(scan)[1][:, :2]
        assert REGION.contains(positions).all()
        cells = np.floor((positions - REGION.bounds[::2]) / [100.0, 50.0]).astype(np.int64)
        counts = np.bincount(4 * cells[:, 0] + cells[:, 1], minlength=16)
        assert ((counts - 250.0) ** 2 / 250.0).sum() < 45.0  # chi-squared of 16: beyond once in 10,000


def test_they_move_with_the_noise_of_the_motion_and_die_at_their_rate() -> None:
    truth = drawn(number=500)
    before, after = steps(truth)
    noise = after - MOTION.propagate(before, 1.0)
    expected = MOTION.noise_cov(before[0], 1.0)
    np.testing.assert_allclose(noise.T @ noise / len(noise), expected, atol=0.05 * expected.max())
    # Who is not there any more has died or crossed an edge; inside, none has crossed.
    inner = models.Region(-50.0, 250.0, 90.0, 210.0)
    ends = deaths = 0
    for k in range(39):
        (ids, states), (later, _) = truth.at(k), truth.at(k + 1)
        inside = inner.contains(states[:, :2])
        ends += int(inside.sum())
        deaths += int((~np.isin(ids, later) & inside).sum())
    assert abs(deaths / ends - 0.02) < 4 * np.sqrt(0.02 / ends)


def test_where_one_leaves_another_enters_opposite_as_fast() -> None:
    still = models.constant_velocity(1e-9)
    truth = drawn(motion=still, number=100, death_probability=0.0)
    assert (np.diff(truth.offsets) == 100).all()
    low, size = REGION.bounds[::2], REGION.bounds[1::2] - REGION.bounds[::2]
    for k in range(39):
        (ids, states), (later, moved) = truth.at(k), truth.at(k + 1)
        expected = still.propagate(states, 1.0)
        stays = REGION.contains(expected[:, :2])
        np.testing.assert_array_equal(later[: stays.sum()], ids[stays])
        np.testing.assert_allclose(moved[: stays.sum()], expected[stays], atol=1e-6)
        entered = expected[~stays]
        entered[:, :2] = low + (entered[:, :2] - low) % size
        np.testing.assert_allclose(moved[stays.sum() :], entered, atol=1e-6)
        assert (later[stays.sum() :] > ids.max()).all()
    assert truth.ids.max() > 100


def test_a_seed_gives_one_truth() -> None:
    first, second, other = (drawn(seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.states, second.states)
    assert not np.array_equal(first.states, other.states)


def test_noise_that_differs_from_place_to_place() -> None:
    @models.model_function("process_noise_cov")
    def noise(state: np.ndarray, dt: float, params: np.ndarray, out: np.ndarray) -> None:
        for i in range(4):
            for j in range(4):
                out[i, j] = 0.0
        out[2, 2] = state[0] > 100.0

    motion = models.MotionModel(4, MOTION.transition, noise, MOTION.transition_params)
    before, after = steps(drawn(motion=motion))
    noise_of = after[:, 2] - before[:, 2]
    assert (noise_of[before[:, 0] <= 100.0] == 0.0).all()
    assert noise_of[before[:, 0] > 100.0].std() == pytest.approx(1.0, abs=0.1)


def test_a_motion_that_leads_nowhere() -> None:
    @models.model_function("transition")
    def lost(state: np.ndarray, dt: float, params: np.ndarray, out: np.ndarray) -> None:
        for i in range(4):
            out[i] = np.nan

    with pytest.raises(ModelError, match=r"motion of a target at state .*: expected a finite state; got"):
        drawn(motion=models.MotionModel(4, lost, MOTION.process_noise_cov, noise_params=MOTION.noise_params))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"number": 0}, "UniformTargets.number: expected"),
        ({"region": None}, "UniformTargets.region: expected a Region; got"),
        ({"std": [1.0]}, "UniformTargets.std: expected"),
        ({"std": [1.0, -1.0]}, "UniformTargets.std: expected numbers of at least 0; got"),
        ({"death_probability": 2.0}, "UniformTargets.death_probability: expected"),
    ],
)
def test_bad_crowds(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        drawn(**fields)
