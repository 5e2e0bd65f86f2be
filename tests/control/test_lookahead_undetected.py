"""Sequences of decisions that look for targets not found yet, against all of them counted out cell by cell."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import KNOWN, mobile_sensor, told
from vedette import models
from vedette.control import (
    BeamSearch,
    ExpectedLossReward,
    HorizonPlanner,
    JointPlanner,
    TreeSearch,
)
from vedette.densities import LMB, UndetectedIntensity
from vedette.fusion import ParallelUpdate
from vedette.platforms import HeadingPlatform
from vedette.tracking import State

HEADINGS = (0.0, 90.0, 180.0)
SPEED, PERIOD, RANGE, WORTH, CUTOFF = 100.0, 2.0, 100.0, 300.0, 100.0
GRID = models.CellGrid.covering(models.Region(-700.0, 700.0, -700.0, 700.0), 50.0)
STARTS = np.array([[0.0, 0.0, 0.0], [200.0, -250.0, 0.0]])
ONE = replace(KNOWN, horizon_steps=1, horizon_period=PERIOD, undetected_target_value=WORTH / CUTOFF)


def sensors() -> Any:
    detection = models.limited_range(0.9, RANGE)
    return (mobile_sensor("lmb", HeadingPlatform(SPEED, HEADINGS), detection=detection),) * 2


def state(expected: Any) -> State:
    """Nobody known."""
    empty = LMB.empty(4)
    return State((empty,) * 2, empty, 1, 1.0, undetected=UndetectedIntensity(GRID, expected))


def planner(**arguments: Any) -> HorizonPlanner:
    given = {"discount": None, **arguments}
    return HorizonPlanner(sensors(), ParallelUpdate(), ONE, ExpectedLossReward(CUTOFF), **given)


def detections(headings: Any, start: Any) -> Any:
    """(num_steps, num_cells) mean probability of detection over each cell's nodes, along headings one after another."""
    steps = SPEED * PERIOD * np.stack([np.cos(np.radians(headings)), np.sin(np.radians(headings))], axis=1)
    at = start[:2] + np.cumsum(steps, axis=0)
    nodes, weights = GRID.states(4)[:, :, :2], GRID.node_weights()
    near = np.linalg.norm(nodes - at[:, np.newaxis, np.newaxis], axis=3) <= RANGE
    return 0.9 * near @ weights


def oracle(expected: Any, depth: int, discount: float | None) -> Any:
    """Value of each joint sequence, sensors' sequences as axes."""
    sequences = list(itertools.product(HEADINGS, repeat=depth))
    found = np.empty((len(sequences),) * 2)
    for place in np.ndindex(found.shape):
        miss = np.ones((depth, GRID.num_cells))
        for own, start in zip(place, STARTS, strict=True):
            miss *= np.cumprod(1.0 - detections(np.array(sequences[own]), start), axis=0)
        by_then = WORTH * (expected * (1.0 - miss)).sum(axis=1)
        found[place] = by_then[-1] if discount is None else (discount ** np.arange(depth) * by_then).sum()
    return found


@pytest.mark.parametrize(("depth", "discount"), [(1, None), (2, None), (2, 0.7), (3, None), (3, 0.9)])
def test_what_all_scans_are_expected_to_find_counts(depth: int, discount: float | None) -> None:
    expected = np.random.default_rng(2).uniform(0.0, 0.05, GRID.num_cells)
    mean = oracle(expected, depth, discount)
    plan = planner(depth=depth, discount=discount).plan(state(expected), STARTS, rng=np.random.default_rng(1))
    best = mean.reshape(3, 3 ** (depth - 1), 3, 3 ** (depth - 1)).max(axis=(1, 3))
    np.testing.assert_allclose(plan.tables[0].mean, best, rtol=1e-10)
    assert told(plan) == ()
    assert plan.bound is not None
    assert plan.bound.upper == pytest.approx(mean.max(), rel=1e-10)


@pytest.mark.parametrize("search", [BeamSearch(), TreeSearch(), TreeSearch(rollout="repeat_last")], ids=repr)
def test_what_no_single_decision_sees_is_found(search: Any) -> None:
    """They are expected where only two steps lead, one of them away from all others."""
    corner = np.linalg.norm(GRID.centres - [-400.0, 0.0], axis=1) < 80.0
    expected = np.where(corner, 0.2, 0.0)
    given = state(expected)
    single = JointPlanner(sensors(), ParallelUpdate(), ONE, ExpectedLossReward(100.0))
    assert np.ptp(single.plan(given, STARTS, rng=np.random.default_rng(1)).tables[0].mean) < 1e-9
    plan = planner(depth=2, search=search, budget=40).plan(given, STARTS, rng=np.random.default_rng(1))
    assert plan.sequence[0].ravel().tolist() == [180.0, 180.0]
    assert plan.expected_rewards[0][0] > 0.4 * WORTH * expected.sum()


def test_a_state_without_them_is_told_of() -> None:
    nowhere = replace(state(np.zeros(GRID.num_cells)), undetected=None)
    plan = planner(depth=2).plan(nowhere, STARTS, rng=np.random.default_rng(1))
    assert told(plan) == ("targets not found yet are not looked for: the state has no intensity of them",)
