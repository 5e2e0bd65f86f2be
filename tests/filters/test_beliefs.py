"""Whether beliefs are true, and what is told of it (`benchmarks/beliefs.py`)."""

from __future__ import annotations

import numpy as np
import pytest

from calibration import ENOUGH, NUM_STEPS, Calibration, PriorTargets, calibration, cases
from vedette.models import BirthModel, TargetModel, constant_survival, constant_velocity

NUM_SITES = 2


def told(said, found, ranks=None) -> Calibration:
    """Of (num_runs,) existence of label (1, 0), the same at all scans, and whether it exists."""
    num = len(said)
    shape = (num, NUM_STEPS, NUM_STEPS * NUM_SITES)
    of_all, of_found = np.zeros(shape), np.zeros(shape, np.bool_)
    of_all[:, :, 0], of_found[:, :, 0] = np.array(said)[:, None], np.array(found)[:, None]
    return Calibration(of_all, of_found, np.zeros((num, NUM_STEPS)) if ranks is None else ranks, 0.0, 0.0)


def test_bins_hold_what_was_said_and_what_was_found() -> None:
    known = told([0.6] * 40 + [0.95] * 30, [True] * 10 + [False] * 30 + [True] * 30)
    rows = known.bins()
    # By hand: 0.4 too little in ten runs and 0.6 too much in thirty, 25 scans each; runs are what is independent.
    excess = 25.0 * np.array([0.4] * 10 + [-0.6] * 30 + [0.0] * 30)
    error = np.sqrt(70.0 * excess.var(ddof=1)) / 1000.0
    np.testing.assert_allclose(rows[3], [1000, 0.6, 0.25, error])
    np.testing.assert_allclose(rows[5, :3], [750, 0.95, 1.0])
    # All labels that may have been born by then: two at the first scan, fifty at the last, less those above.
    np.testing.assert_allclose(rows[0, :3], [70 * (2 * 325 - 25), 0.0, 0.0], atol=0.0)
    assert known.worst == pytest.approx((0.35, error))


def test_too_few_are_not_judged() -> None:
    num = ENOUGH // NUM_STEPS
    assert told([0.6] * num, [False] * num).worst[0] == 0.0
    assert told([0.6] * (num + 1), [False] * (num + 1)).worst[0] == pytest.approx(0.6)


def test_scores_are_sums_over_labels_a_scan() -> None:
    known = told([0.6, 0.6, 0.6, 1.0], [True, True, False, False])
    other_labels = -(2 * 325 / NUM_STEPS - 1) * np.log1p(-1e-6)
    expected = -(2.0 * np.log(0.6) + np.log(0.4) + np.log(1e-6)) / 4.0
    assert known.log_loss == pytest.approx(expected + other_labels)
    assert known.brier == pytest.approx((2.0 * 0.16 + 0.36 + 1.0) / 4.0)


def test_ranks_are_held_against_the_uniform_distribution() -> None:
    even = (np.arange(4.0 * NUM_STEPS) + 0.5) / (4.0 * NUM_STEPS)
    assert told([0.5] * 4, [True] * 4, even.reshape(4, -1)).rank_deviation == pytest.approx(0.005)
    assert told([0.5] * 4, [True] * 4, np.full((4, NUM_STEPS), 0.7)).rank_deviation == pytest.approx(0.7)


def test_the_truth_is_drawn_from_the_model() -> None:
    means, cov = np.array([[0.0, 0.0, 0.0, 0.0], [1e4, 0.0, 0.0, 0.0]]), np.diag([25.0, 25.0, 4.0, 4.0])
    birth = BirthModel(np.array([0.1, 0.4]), means, np.stack([cov, cov]))
    model = TargetModel(constant_velocity(2.0), constant_survival(0.8), birth)
    targets, rng = PriorTargets(model), np.random.default_rng(3)
    born, lived, starts, moves = [], [], [], []
    for _ in range(400):
        truth = targets.truth(np.arange(1.0, 6.0), rng=rng)
        truth.validate()
        for scan in range(5):
            ids, states = truth.at(scan)
            new = ids // NUM_SITES == scan
            born.append(np.bincount(ids[new] % NUM_SITES, minlength=NUM_SITES))
            starts.append(states[new] - birth.means[ids[new] % NUM_SITES])
            if scan:
                before, states_before = truth.at(scan - 1)
                assert np.isin(ids[~new], before).all()
                lived.append(np.isin(before, ids))
                moves.append(states[~new] - model.motion.propagate(states_before[np.isin(before, ids)], 1.0))
    np.testing.assert_allclose(np.mean(born, axis=0), birth.existence, atol=0.03)
    assert np.concatenate(lived).mean() == pytest.approx(0.8, abs=0.03)
    np.testing.assert_allclose(np.concatenate(starts).std(axis=0), [5.0, 5.0, 2.0, 2.0], rtol=0.1)
    noise = model.motion.noise_covs(np.zeros((1, 4)), 1.0)[0]
    np.testing.assert_allclose(np.cov(np.concatenate(moves).T), noise, atol=0.4)


@pytest.mark.slow
def test_every_case_can_be_asked() -> None:
    for case in cases():
        found = calibration(case, 0.9, 1)
        assert np.isfinite(found.bins()[0, :3]).all()
        assert ((found.ranks >= 0.0) & (found.ranks <= 1.0 + 1e-9)).all()
        assert bool(found.said.any()) == case.labels


@pytest.mark.parametrize("detection", [0.7, 0.95])
def test_labels_exist_as_often_as_the_default_filter_says(detection: float) -> None:
    [default] = (case for case in cases() if case.name == "default")
    number, said, found, _ = calibration(default, detection, 200).bins().T
    differences = np.abs(said - found)[number > ENOUGH]
    assert (differences < 0.05).all(), f"said and found differ by {differences.round(3)}"
