"""True targets that change their mode of motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from vedette import models
from vedette.errors import InputError
from vedette.simulation import PoissonTargets, ScriptedTargets, UniformTargets, simulate_scan
from vedette.simulation.true_motion import moved_target

STANDS = models.ornstein_uhlenbeck(0.0, 1e-3)
SAILS = models.constant_velocity(0.0)
FERRY = models.Modes((SAILS, STANDS), (20.0, 10.0), names=("sails", "stands"))
BEGIN = np.array([0.0, 0.0, 5.0, 0.0])


def test_modes_change_as_the_chain_says():
    rng, dt = np.random.default_rng(1), 7.0
    ended = np.array([moved_target(FERRY, BEGIN, 0, dt, rng)[1] for _ in range(4000)])
    expected = expm(FERRY.rates * dt)[0, 1]
    assert abs(ended.mean() - expected) < 4.0 * np.sqrt(expected * (1.0 - expected) / len(ended))


def test_a_target_that_stands_stays():
    rng = np.random.default_rng(2)
    stopped, mode = moved_target(FERRY, BEGIN, 1, 1e-9, rng)
    assert mode == 1
    stopped, _ = moved_target(models.Modes((STANDS, STANDS), (1.0, 1.0)), stopped, 0, 50.0, rng)
    assert np.linalg.norm(stopped[:2]) < 0.01


@pytest.mark.parametrize("num_others", [0, 3])
def test_a_scripted_target_does_not_depend_on_others(num_others):
    states = np.tile(BEGIN, (1 + num_others, 1))
    truth = ScriptedTargets(FERRY, states, process_noise=True).truth(np.arange(60.0), rng=np.random.default_rng(7))
    own = truth.states[truth.ids == 0]
    speeds = np.hypot(*own[:, 2:].T)
    assert 0.0 < np.mean(speeds < 0.1) < 1.0
    assert speeds.sum() == pytest.approx(np.hypot(*_alone()[:, 2:].T).sum())


def _alone() -> np.ndarray:
    return (
        ScriptedTargets(FERRY, BEGIN[None], process_noise=True)
        .truth(np.arange(60.0), rng=np.random.default_rng(7))
        .states
    )


def test_without_noise_a_target_keeps_the_first_mode():
    truth = ScriptedTargets(FERRY, BEGIN[None]).truth(np.arange(60.0), rng=np.random.default_rng(4))
    np.testing.assert_allclose(truth.states[-1], [5.0 * 59.0, 0.0, 5.0, 0.0])


def test_targets_that_are_drawn_change_their_modes():
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    for source in (
        UniformTargets(FERRY, 5, region, np.array([5.0, 5.0]), 0.02),
        PoissonTargets(FERRY, 0.5, BEGIN, np.diag([1.0, 1.0, 4.0, 4.0]), 0.02),
    ):
        truth = source.truth(np.arange(40.0), rng=np.random.default_rng(5))
        assert truth.states.shape[1] == 4
        assert 0.05 < np.mean(np.hypot(truth.states[:, 2], truth.states[:, 3]) < 0.1) < 0.95


HIDES = models.Modes((SAILS, SAILS), (20.0, 10.0), detection_factors=(1.0, 0.0))
DIM = models.Modes((SAILS, SAILS), (20.0, 10.0), detection_factors=(1.0, 0.4))
AREA = models.Region(-100.0, 100.0, -100.0, 100.0)
SENSOR = models.SensorModel(
    models.position(),
    models.constant_noise([1.0, 1.0]),
    models.constant_detection(0.9),
    models.region_clutter(2.0, AREA, "position"),
)
SOURCES = {
    "scripted": lambda motion: ScriptedTargets(motion, np.tile(BEGIN, (4, 1)), process_noise=True),
    "uniform": lambda motion: UniformTargets(motion, 5, AREA, np.array([5.0, 5.0]), 0.02),
    "poisson": lambda motion: PoissonTargets(motion, 0.5, BEGIN, np.diag([1.0, 1.0, 4.0, 4.0]), 0.02),
}


def scanned(truth, *, with_factors=True):
    """The scans of a truth, as in the loop."""
    rng, scans = np.random.default_rng(9), []
    for k in range(truth.num_scans):
        (ids, states), factors = truth.at(k), truth.detection_factors_at(k) if with_factors else None
        scans.append(simulate_scan(states, np.zeros(3), SENSOR, ids=ids, detection_factors=factors, rng=rng))
    return scans


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_targets_are_detected_as_their_mode_says(source):
    truth = source(HIDES).truth(np.arange(80.0), rng=np.random.default_rng(6))
    hidden = truth.detection_factors == 0.0
    assert 0.1 < hidden.mean() < 0.6
    assert set(np.unique(truth.detection_factors)) == {0.0, 1.0}
    detected = np.concatenate([np.isin(truth.at(k)[0], scan.origins) for k, scan in enumerate(scanned(truth))])
    assert not detected[hidden].any()
    num = np.count_nonzero(~hidden)
    assert abs(detected[~hidden].mean() - 0.9) < 4.0 * np.sqrt(0.09 / num)
    truth.between(10, 40).validate()
    np.testing.assert_array_equal(truth.between(10, 40).detection_factors_at(3), truth.detection_factors_at(13))


def test_a_factor_multiplies_the_probability_of_detection():
    states, rng = np.tile(BEGIN, (4000, 1)), np.random.default_rng(2)
    scan = simulate_scan(states, np.zeros(3), SENSOR, detection_factors=np.full(4000, 0.4), rng=rng)
    assert abs(np.mean(scan.origins >= 0) * len(scan.origins) / 4000 - 0.36) < 4.0 * np.sqrt(0.36 * 0.64 / 4000)


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_factors_draw_nothing(source):
    plain, dim = (
        source(motion).truth(np.arange(30.0), rng=np.random.default_rng(6))
        for motion in (models.Modes((SAILS, SAILS), (20.0, 10.0)), DIM)
    )
    assert plain.detection_factors is None
    np.testing.assert_array_equal(plain.states, dim.states)
    for seen, other in zip(scanned(dim), scanned(plain), strict=True):
        kept = np.isin(other.origins, seen.origins)
        np.testing.assert_array_equal(
            seen.measurements[np.argsort(seen.origins, kind="stable")],
            other.measurements[kept][np.argsort(other.origins[kept], kind="stable")],
        )


@pytest.mark.parametrize("factors", [[0.5], [0.5, 1.2], [-0.1, 1.0], [np.nan, 1.0]])
def test_factors_are_checked(factors):
    with pytest.raises(InputError, match="detection_factors: expected"):
        simulate_scan(
            np.tile(BEGIN, (2, 1)), np.zeros(3), SENSOR, detection_factors=factors, rng=np.random.default_rng(0)
        )
