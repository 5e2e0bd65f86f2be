"""Births anywhere whose rate is learnt: exposure in closed form, prior, simulated births, and what changes nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.densities import LearntRate, load_density, save_density
from vedette.errors import InputError
from vedette.filters import FactoredGlmbFilter, LmbFilter, SequentialFactoredFilter
from vedette.tracking import Central, Distributed

REGION = models.Region(-500.0, 500.0, -500.0, 500.0)
MEASURED = models.MeasurementBirth(0.5, 0.03, np.array([20.0, 20.0, 5.0, 5.0]))
POSE, NONE = np.zeros(3), np.empty((0, 2))
RNG = np.random.default_rng(0)  # nothing is drawn


def sensor(detection: float = 0.9, clutter: float = 5.0) -> models.SensorModel:
    return models.SensorModel(
        models.position(),
        models.constant_noise([10.0, 10.0]),
        models.constant_detection(detection),
        models.region_clutter(clutter, REGION, "position"),
    )


def targets(survival: float = 1.0, **more: Any) -> models.TargetModel:
    given: dict[str, Any] = {"expected": 2.0, "birth_rate": "learnt", **more}
    anywhere = models.UndetectedModel(models.CellGrid(REGION, 4, 4), given.pop("expected"), **given)
    birth = replace(models.BirthModel.none(4), from_measurements=MEASURED, anywhere=anywhere)
    return models.TargetModel(models.constant_velocity(1.0), models.constant_survival(survival, period=1.0), birth)


def learnt(belief: Any) -> LearntRate:
    assert belief.undetected is not None
    assert belief.undetected.birth_rate is not None
    found: LearntRate = belief.undetected.birth_rate
    return found


def test_the_exposure_is_in_closed_form_where_all_is_seen() -> None:
    """Undetected per unit rate U <- (1 - P_D) (U + dt); all others of the elapsed time t - U were exposed."""
    tracker, left, elapsed = FactoredGlmbFilter(targets(), sensor(0.8)), 0.0, 0.0
    belief = tracker.initial()
    for step, dt in enumerate((1.0, 2.0, 0.5, 4.0), start=1):
        belief, _ = tracker.step(belief, NONE, POSE, dt, step, rng=RNG)
        if step > 1:  # what is there at the first scan is no birth
            left, elapsed = 0.2 * (left + dt), elapsed + dt
        assert learnt(belief).unit.sum() == pytest.approx(left, rel=1e-12)
        assert learnt(belief).exposure == pytest.approx(elapsed - left, rel=1e-12, abs=1e-12)
        assert learnt(belief).rate == pytest.approx(0.5 / (5.0 + elapsed - left), rel=1e-12)
    # Those at first are thinned by each scan; those born since are as many as the rate of now says.
    assert belief.undetected is not None
    expected = 2.0 * 0.2**4 + learnt(belief).rate * left
    assert belief.undetected.expected_number == pytest.approx(expected, rel=1e-9)


def test_deaths_before_a_detection_are_no_exposure() -> None:
    tracker = FactoredGlmbFilter(targets(0.5), sensor(0.8))
    belief = tracker.initial()
    for step in (1, 2, 3):
        belief, _ = tracker.step(belief, NONE, POSE, 1.0, step, rng=RNG)
    assert learnt(belief).exposure == pytest.approx(0.8 + 0.8 * (0.2 * 0.5 + 1.0), rel=1e-12)


def test_without_scans_the_rate_is_the_prior() -> None:
    tracker = FactoredGlmbFilter(targets(prior_rate=0.3), sensor())
    belief = tracker.initial()
    for step in range(1, 5):
        belief, _ = tracker.predict(belief, 10.0, step)
    assert learnt(belief).rate == pytest.approx(0.3, rel=1e-12)
    assert belief.undetected.expected_number == pytest.approx(2.0 + 30.0 * 0.3)  # type: ignore[union-attr]


def simulated(rate: float, seed: int, num_steps: int = 40) -> float:
    """The rate learnt of Poisson births that a sensor of P_D .9 with 5 false measurements sees."""
    rng, tracker = np.random.default_rng(seed), FactoredGlmbFilter(targets(0.99, speed=5.0), sensor())
    belief, alive = tracker.initial(), [np.r_[rng.uniform(-400.0, 400.0, 2), rng.normal(0.0, 5.0, 2)] for _ in range(2)]
    for step in range(1, num_steps + 1):
        born = rng.poisson(rate) if step > 1 else 0
        alive = [np.r_[each[:2] + each[2:], each[2:]] for each in alive if rng.random() < 0.99]
        alive += [np.r_[rng.uniform(-400.0, 400.0, 2), rng.normal(0.0, 5.0, 2)] for _ in range(born)]
        seen = [each[:2] + rng.normal(0.0, 10.0, 2) for each in alive if rng.random() < 0.9]
        clutter = rng.uniform(-500.0, 500.0, (rng.poisson(5.0), 2))
        belief, _ = tracker.step(belief, np.vstack([*seen, clutter]), POSE, 1.0, step, rng=rng)
    return learnt(belief).rate


@pytest.mark.parametrize(("rate", "tolerance"), [(0.0, 0.008), (0.01, 0.01), (0.1, 0.03)])
def test_simulated_births_give_the_mean_of_the_posterior(rate: float, tolerance: float) -> None:
    """Of 20 runs. Prior and data weigh as 5 s and 39 s; two standard errors of the mean are about .025 at rate .1."""
    found = np.mean([simulated(rate, seed) for seed in range(20)])
    assert found == pytest.approx((0.5 + 39.0 * rate) / (5.0 + 39.0), abs=tolerance)


def test_it_does_not_depend_on_how_often_is_predicted() -> None:
    scans = ([[10.0, 20.0]], [[10.0, 21.0], [300.0, 300.0]], [[10.0, 20.0], [302.0, 301.0]])
    found = []
    for num in (3, 30, 300):
        tracker = FactoredGlmbFilter(targets(0.98, speed=2.0), sensor())
        belief, step = tracker.step(tracker.initial(), NONE, POSE, 1.0, 1, rng=RNG)[0], 1
        for scan in scans:
            for _ in range(num):
                step += 1
                belief, _ = tracker.predict(belief, 3.0 / num, step)
            belief, _ = tracker.update(belief, scan, POSE, rng=RNG)
        found.append((learnt(belief).rate, learnt(belief).exposure, belief.undetected.expected_number))  # type: ignore[union-attr]
    np.testing.assert_allclose(found[1:], found[:1] * 2, rtol=0.02)


def test_scans_of_elsewhere_change_nothing() -> None:
    """One sensor sees nothing of the region, twenty times a second; and a time comes in two steps (dt = 0)."""
    world, scan, found = targets(0.98), [[10.0, 20.0], [-200.0, 100.0]], []
    for rate in (1, 20):
        tracker = SequentialFactoredFilter(world, (sensor(0.0), sensor()))
        belief, _ = tracker.step(tracker.initial(), [NONE, scan], np.zeros((2, 3)), 1.0, 1, rng=RNG)
        for step in range(2, 5 * rate + 2):
            seen = scan if step % rate == 1 % rate else None
            belief, _ = tracker.step(belief, [NONE, seen], np.zeros((2, 3)), 1.0 / rate, step, rng=RNG)
            belief, _ = tracker.step(belief, [NONE, None], np.zeros((2, 3)), 0.0, step, rng=RNG)
        found.append((learnt(belief).rate, learnt(belief).exposure, belief.undetected.expected_number))  # type: ignore[union-attr]
    np.testing.assert_allclose(found[0], found[1], rtol=0.02)


def test_one_sensor_and_several_in_turn_learn_the_same() -> None:
    scans, found = ([[10.0, 20.0]], [[10.0, 21.0], [300.0, 300.0]], [[10.0, 20.0], [302.0, 301.0]]), []
    world = targets()
    for tracker in (
        Distributed((FactoredGlmbFilter(world, sensor()),)),
        Central(SequentialFactoredFilter(world, (sensor(),))),
    ):
        state = tracker.initial()
        for step, scan in enumerate(scans, start=1):
            state, _ = tracker.step(state, [scan], POSE[np.newaxis], float(step), rngs=[RNG])
        found.append(learnt(state.fused))
    assert found[0].rate == pytest.approx(found[1].rate, rel=1e-9)
    assert found[0].labels.tolist() == found[1].labels.tolist()


def test_targets_there_at_first_are_no_births() -> None:
    rates = []
    for first in (1, 4):  # step at which a target is measured for the first time
        tracker = FactoredGlmbFilter(targets(expected=1.0), sensor())
        belief = tracker.initial()
        for step in range(1, 9):
            belief, _ = tracker.step(belief, [[50.0, 60.0]] if step >= first else NONE, POSE, 1.0, step, rng=RNG)
        rates.append(learnt(belief).rate)
    assert rates == pytest.approx([0.5 / 12.0, 1.5 / 12.0], rel=0.05)


def test_a_dead_target_was_born_all_the_same() -> None:
    tracker = FactoredGlmbFilter(targets(0.9), sensor())
    belief, rates = tracker.initial(), []
    for step in range(1, 31):
        seen = [[50.0, 60.0]] if 4 <= step < 14 else NONE  # 10 s, as long as targets live on average
        belief, _ = tracker.step(belief, seen, POSE, 1.0, step, rng=RNG)
        rates.append(learnt(belief).rate * (5.0 + learnt(belief).exposure) - 0.5)
    assert rates[12] == pytest.approx(1.65, abs=0.1)  # one that lives, and the deaths that the model expects of it
    assert rates[-1] == pytest.approx(0.9, abs=0.2)


def test_it_is_saved_with_the_belief(tmp_path: Path) -> None:
    tracker = FactoredGlmbFilter(targets(), sensor())
    belief = tracker.initial()
    for step in (1, 2, 3):
        belief, _ = tracker.step(belief, [[50.0, 60.0]], POSE, 1.0, step, rng=RNG)
    save_density(tmp_path / "belief.npz", belief)
    found, own = learnt(load_density(tmp_path / "belief.npz")), learnt(belief)
    for name in LearntRate.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(own, name))
    assert repr(own) == f"LearntRate of {own.rate:.3g} births a second"


def test_births_from_measurements_are_learnt_as_well() -> None:
    measured = replace(MEASURED, expected="learnt", region=REGION)
    birth = replace(models.BirthModel.none(4), from_measurements=measured)
    world = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.99), birth)
    belief, _ = FactoredGlmbFilter(world, sensor()).step(
        FactoredGlmbFilter(world, sensor()).initial(), NONE, POSE, 1.0, 1, rng=RNG
    )
    assert learnt(belief).rate == pytest.approx(0.1)
    assert belief.undetected.expected_number == pytest.approx(0.1)  # type: ignore[union-attr] # of one at first
    with pytest.raises(InputError, match=r"MeasurementBirth\.expected: expected a number, as the beliefs of LmbFilter"):
        Distributed((LmbFilter(world, sensor()),)).step(
            Distributed((LmbFilter(world, sensor()),)).initial(), [NONE], POSE[np.newaxis], 1.0, rngs=[RNG]
        )


def test_a_belief_of_other_cells_is_refused() -> None:
    belief, _ = FactoredGlmbFilter(targets(), sensor()).step(
        FactoredGlmbFilter(targets(), sensor()).initial(), NONE, POSE, 1.0, 1, rng=RNG
    )
    world = targets()
    anywhere = replace(world.birth.anywhere, grid=models.CellGrid(REGION, 5, 5))  # type: ignore[type-var]
    other = replace(world, birth=replace(world.birth, anywhere=anywhere))
    with pytest.raises(InputError, match=r"belief\.undetected\.cells: expected those of the filter's births"):
        FactoredGlmbFilter(other, sensor()).step(belief, NONE, POSE, 1.0, 2, rng=RNG)
