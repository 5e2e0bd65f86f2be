"""A stretch of time says as much of who lives and who is born in however many steps it is cut."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from filters.members import LABELLED, UNLABELLED, expected_number
from vedette import models
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import (
    FactoredGlmbFilter,
    LmbFilter,
)
from vedette.tracking import Distributed

COV = np.diag([50.0, 50.0, 5.0, 5.0]) ** 2
SITES = np.array([[0.0, 400.0, 0.0, 0.0], [300.0, -200.0, 0.0, 0.0]])
SENSOR = models.SensorModel(
    models.bearing_range(),
    models.range_dependent_noise(10.0, 5e-5, np.pi / 180, 5e-6),
    models.gaussian_detection(10_000.0),
    models.region_clutter(5.0, models.Region(-1000.0, 1000.0, -1000.0, 1000.0), "bearing_range"),
)


def targets(existence: float, survival: float, period: float | None) -> models.TargetModel:
    birth = models.BirthModel(np.full(2, existence), SITES, np.array([COV, COV]), period=period)
    return models.TargetModel(models.constant_velocity(5.0), models.constant_survival(survival, period), birth)


def predicted(own: Any, belief: Any, seconds: float, steps: int) -> Any:
    for step in range(2, 2 + steps):
        belief, _ = own.predict(belief, seconds / steps, step)
    return belief


@pytest.mark.parametrize("kind", LABELLED)
@pytest.mark.parametrize("steps", [1, 10, 100])
def test_one_second_of_life_is_one_second_in_however_many_steps(kind: Any, steps: int) -> None:
    """Without a period .9 x .98 = .882 in one step is .9 x .98^10 = .735 in ten."""
    world = replace(targets(0.02, 0.98, 1.0), birth=models.BirthModel.none(4))
    own = kind(world, SENSOR)
    start = predicted(kind(targets(0.9, 0.98, 1.0), SENSOR), own.initial(), 1.0, 1)
    before = expected_number(start)
    found = predicted(own, start, 1.0, steps)
    assert expected_number(found) == pytest.approx(0.98 * before, rel=1e-5)  # light hypotheses are dropped


@pytest.mark.parametrize("kind", [LmbFilter, FactoredGlmbFilter])  # of a GLMB so many are more than it holds
def test_births_of_twenty_seconds_are_as_many_at_one_scan_a_second_and_at_twenty(kind: Any) -> None:
    """Expected targets, nobody dies: 2 sites x 20 s of a probability of .02 a second; .02 a step made 16 of it."""
    own = kind(targets(0.02, 1.0, 1.0), SENSOR)
    slow, fast = (predicted(own, own.initial(), 20.0, steps) for steps in (20, 400))
    assert expected_number(slow) == pytest.approx(2 * 20 * 0.02, rel=1e-3)
    assert expected_number(fast) == pytest.approx(2 * 400 * -np.expm1(np.log(0.98) / 20), rel=1e-3)


@pytest.mark.parametrize("kind", LABELLED | UNLABELLED)
def test_a_period_of_the_step_is_the_papers_constant(kind: Any) -> None:
    scan, pose, rng = np.array([[0.0, 380.0]]), np.array([0.0, 20.0, 0.0]), np.random.default_rng(1)
    made = []
    for period in (None, 2.0):
        own = kind(targets(0.02, 0.98, period), SENSOR)
        belief = own.initial()
        for step in (1, 2, 3):
            belief, _ = own.step(belief, scan, pose, 2.0, step, rng=rng)
        made.append(expected_number(belief))
    assert made[0] == pytest.approx(made[1], rel=1e-12)


def test_births_from_measurements_keep_to_the_period_too() -> None:
    """Two trackers see one target at the same times; one of them is also asked where nobody scans."""
    found = []
    for steps in (1, 10):
        birth = models.BirthModel.none(4)
        measured = models.MeasurementBirth(0.5, 0.03, np.sqrt(np.diag(COV)))
        world = replace(targets(0.02, 1.0, 1.0), birth=replace(birth, from_measurements=measured, period=1.0))
        tracker = Distributed((LmbFilter(world, SENSOR),))
        state, rng = tracker.initial(), np.random.default_rng(1)
        state, _ = tracker.step(state, [np.array([[0.0, 380.0]])], np.array([[0.0, 20.0, 0.0]]), 0.0, rngs=[rng])
        state, _ = tracker.step(state, [None], np.array([[0.0, 20.0, 0.0]]), 1.0 / steps, rngs=[rng])
        found.append(expected_number(state.fused))
    assert found[0] == pytest.approx(0.03, rel=1e-12)
    assert found[1] == pytest.approx(-np.expm1(np.log(0.97) / 10), rel=1e-12)


def test_certain_births_and_survival_stay_certain() -> None:
    own = LmbFilter(targets(1.0 - 2.0**-53, 1.0, 1e-3), SENSOR)
    belief, _ = own.predict(LMB.empty(4), 1e6, 1)
    assert belief.existence.tolist() == [1.0, 1.0]
    belief.validate()


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf, "1", True])
def test_a_period_is_a_time(period: Any) -> None:
    with pytest.raises(InputError, match="period: expected"):
        models.constant_survival(0.98, period)
    with pytest.raises(InputError, match=r"BirthModel\.period: expected"):
        models.BirthModel(np.full(2, 0.02), SITES, np.array([COV, COV]), period=period)
