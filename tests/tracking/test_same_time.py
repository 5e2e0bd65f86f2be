"""Scans of one time that come apart: nobody moves, dies or is born in between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracking.scenes import assert_same_lmb, filters, rngs, scans_of, sensor, targets
from vedette import models
from vedette.densities import LMB, as_lmb
from vedette.errors import InputError
from vedette.filters import (
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    SequentialLmbFilter,
)
from vedette.fusion import Clmb, LabelMatchedFusion, ParallelUpdate
from vedette.tracking import BeliefNetwork, Central, Distributed, Network, ScanNetwork, State, Tracker

TRUTH = np.array([[2.0, 1.0, 1.0, 0.0], [98.0, 3.0, 0.0, 1.0]])
POSES = np.zeros((2, 3))
OPEN = Limits(
    max_hypotheses=10_000, min_relative_weight=0.0, min_existence=0.0, merge_distance=0.0, max_components=1000
)
SENSORS = (sensor(5.0, rate=1.0), sensor(2.0, rate=0.5))


def central(kind: Any) -> Tracker:
    return Central(kind(targets(), SENSORS, OPEN))


@pytest.mark.parametrize("kind", [MultiSensorGlmbFilter, MultiSensorLmbFilter, SequentialLmbFilter])
def test_scans_that_come_apart_are_those_that_come_together(kind: Any) -> None:
    tracker, rng = central(kind), np.random.default_rng(1)
    together = apart = tracker.initial()
    for time in (1.0, 2.5, 3.0):
        scans = scans_of(TRUTH, SENSORS, POSES, rng)
        together, _ = tracker.step(together, scans, POSES, time, rngs=rngs(2))
        apart, _ = tracker.step(apart, [scans[0], None], POSES, time, rngs=rngs(2))
        apart, _ = tracker.step(apart, [None, scans[1]], POSES, time, rngs=rngs(2))
    one, other = as_lmb(together.fused), as_lmb(apart.fused)
    assert (together.step, apart.step, apart.time) == (3, 6, 3.0)
    np.testing.assert_array_equal(one.tracks.labels, other.tracks.labels)
    tolerance = 1e-9 if kind is not SequentialLmbFilter else 1e-12
    if kind is MultiSensorLmbFilter:  # an LMB in between forgets which measurements went together
        tolerance = 0.02
    np.testing.assert_allclose(one.existence, other.existence, atol=tolerance)


@pytest.mark.parametrize("kind", [DeltaGlmbFilter, LmbFilter, FactoredGlmbFilter])
def test_a_step_of_zero_time_is_an_update(kind: Any) -> None:
    filter_ = kind(targets(), SENSORS[0], Limits(max_components=1))
    rng = np.random.default_rng(2)
    scan, again = (scans_of(TRUTH, SENSORS[:1], POSES[:1], rng)[0] for _ in range(2))
    belief, _ = filter_.step(filter_.initial(), scan, POSES[0], 1.0, 1, rng=rng)
    stepped, said = filter_.step(belief, again, POSES[0], 0.0, 2, rng=rng)
    updated, told = filter_.update(belief, again, POSES[0], rng=rng)
    assert as_lmb(stepped).existence_logit.tobytes() == as_lmb(updated).existence_logit.tobytes()
    assert stepped.tracks.means.tobytes() == updated.tracks.means.tobytes()
    assert said.log_likelihood == told.log_likelihood
    waited, _ = filter_.predict(belief, 0.0, 2)
    np.testing.assert_allclose(as_lmb(waited).existence, as_lmb(belief).existence, atol=1e-12)


def test_zero_time_has_no_deaths_and_no_births() -> None:
    world = targets((0.5, 0.3))
    world = replace(world, birth=replace(world.birth, steps=None))  # at every step
    tracker = Distributed(filters(world, SENSORS), Clmb((0.5, 0.5)))
    state, _ = tracker.step(tracker.initial(), [np.zeros((0, 2))] * 2, POSES, 1.0, rngs=rngs(2))
    again, _ = tracker.step(state, [None, None], POSES, 1.0, rngs=rngs(2))
    for before, after in zip(state.local, again.local, strict=True):
        np.testing.assert_array_equal(before.tracks.labels, after.tracks.labels)
        np.testing.assert_allclose(before.existence, after.existence, rtol=1e-12)
        np.testing.assert_allclose(before.tracks.covs, after.tracks.covs, rtol=1e-12)
    later, _ = tracker.step(again, [None, None], POSES, 2.0, rngs=rngs(2))
    assert later.local[0].tracks.num_tracks == 2 * again.local[0].tracks.num_tracks


def test_separate_scans_of_one_time_give_one_birth() -> None:
    born = models.MeasurementBirth(expected=0.5, max_existence=0.1, std=np.array([20.0, 20.0, 5.0, 5.0]))
    world = targets((), born)
    tracker = Central(SequentialLmbFilter(world, SENSORS))
    here, there = np.array([[10.0, 0.0]]), np.array([[12.0, 1.0], [300.0, 0.0]])
    state, _ = tracker.step(tracker.initial(), [here, None], POSES, 1.0, rngs=rngs(2))
    state, _ = tracker.step(state, [None, there], POSES, 1.0, rngs=rngs(2))
    waiting: LMB = state.memory
    np.testing.assert_array_equal(waiting.tracks.means[:, :2], [[10.0, 0.0], [300.0, 0.0]])
    state, _ = tracker.step(state, [None, None], POSES, 2.0, rngs=rngs(2))
    assert state.fused.tracks.num_tracks == 2


NEAR = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [200.0, 0.0, 0.0]])  # within 120 m of the next: two hops
THREE = (*SENSORS, sensor(4.0, 0.7, 0.5))
BORN = models.MeasurementBirth(expected=0.5, max_existence=0.1, std=np.array([20.0, 20.0, 5.0, 5.0]))
EQUAL = (1 / 3, 1 / 3, 1 / 3)


def both_ways(tracker: Tracker, num_steps: int = 5) -> Iterator[tuple[State, State]]:
    """The state after scans of three sensors that come together, and after the same that come one by one."""
    rng = np.random.default_rng(1)
    together = apart = tracker.initial()
    for step in range(1, num_steps + 1):
        truth = TRUTH.copy()
        truth[:, :2] += step * truth[:, 2:]
        scans = scans_of(truth, THREE, NEAR, rng)
        together, _ = tracker.step(together, scans, NEAR, float(step), rngs=rngs(3))
        for s in range(3):
            alone = [scan if i == s else None for i, scan in enumerate(scans)]
            apart, _ = tracker.step(apart, alone, NEAR, float(step), rngs=rngs(3))
        yield together, apart


@pytest.mark.parametrize("network", [Network(), Network(120.0), Network(120.0, delay=1), Network(60.0)])
def test_scans_that_come_apart_over_a_network_are_those_that_come_together(network: Network) -> None:
    tracker = ScanNetwork(SequentialLmbFilter(targets(), THREE, OPEN), network, Clmb(EQUAL))
    for together, apart in both_ways(tracker):
        for one, other in zip(together.local, apart.local, strict=True):
            assert_same_lmb(one, other, 1e-9)


@pytest.mark.parametrize("network", [Network(), Network(120.0), Network(60.0)])
def test_delayed_beliefs_count_each_scan_once(network: Network) -> None:
    """Whoever divides by the common prediction adds what each scan has said, in one round or in three."""
    tracker = BeliefNetwork(filters(targets(), THREE), ParallelUpdate(), network, Clmb(EQUAL))
    for together, apart in both_ways(tracker):
        for one, other in zip(together.local, apart.local, strict=True):
            np.testing.assert_array_equal(one.tracks.labels, other.tracks.labels)
            np.testing.assert_allclose(one.existence, other.existence, atol=0.02)


@pytest.mark.parametrize("network", [Network(), Network(120.0, max_hops=1), Network(link_loss_probability=0.3)])
@pytest.mark.parametrize("beliefs", [False, True])
def test_zero_time_in_a_network_has_no_motion_deaths_or_births(network: Network, beliefs: bool) -> None:
    world = targets((0.5, 0.3))
    world = replace(world, birth=replace(world.birth, steps=None))  # at every step
    tracker: Tracker = ScanNetwork(SequentialLmbFilter(world, THREE), network, Clmb(EQUAL))
    if beliefs:
        tracker = BeliefNetwork(filters(world, THREE), Clmb(EQUAL), network, Clmb(EQUAL))
    state, nobody = tracker.initial(), [None] * 3
    for time in (1.0, 2.0, 3.0):  # nothing was measured: all believe the same, whatever they hear
        state, _ = tracker.step(state, nobody, NEAR, time, rngs=rngs(3))
    again, _ = tracker.step(state, nobody, NEAR, 3.0, rngs=rngs(3))
    for before, after in zip(state.local, again.local, strict=True):
        assert_same_lmb(after, before, 1e-12)


@pytest.mark.parametrize("delay", [0, 1])
def test_separate_scans_of_one_time_give_one_birth_in_a_network(delay: int) -> None:
    world, near = targets((), BORN), [np.array([[10.0, 0.0]]), np.array([[12.0, 1.0], [300.0, 0.0]])]
    trackers = (
        ScanNetwork(SequentialLmbFilter(world, SENSORS), Network(delay=delay), Clmb((0.5, 0.5))),
        BeliefNetwork(filters(world, SENSORS), LabelMatchedFusion(Clmb((0.5, 0.5))), Network(), Clmb((0.5, 0.5))),
    )
    for tracker in trackers:
        state, _ = tracker.step(tracker.initial(), [near[0], None], POSES, 1.0, rngs=rngs(2))
        state, _ = tracker.step(state, [None, near[1]], POSES, 1.0, rngs=rngs(2))
        state, _ = tracker.step(state, [None, None], POSES, 2.0, rngs=rngs(2))
        own = [sorted(belief.tracks.means[:, 0].round().tolist()) for belief in state.local]
        assert own[0] == own[1] == [10.0, 300.0]  # late or not, all know of all scans of 1 s at 2 s


def test_time_must_not_decrease_nor_repeat_with_delayed_beliefs() -> None:
    tracker = central(SequentialLmbFilter)
    nothing = [np.zeros((0, 2))] * 2
    state, _ = tracker.step(tracker.initial(), nothing, POSES, 1.0, rngs=rngs(2))
    with pytest.raises(InputError, match=r"time: expected one from that of the last scan on, 1 s; got 0.5"):
        tracker.step(state, nothing, POSES, 0.5, rngs=rngs(2))
    late = BeliefNetwork(filters(targets(), SENSORS), Clmb((0.5, 0.5)), Network(delay=1), Clmb((0.5, 0.5)))
    state, _ = late.step(late.initial(), nothing, POSES, 1.0, rngs=rngs(2))
    with pytest.raises(InputError, match=r"time: expected one after that of the last scan, 1 s, as beliefs that"):
        late.step(state, nothing, POSES, 1.0, rngs=rngs(2))
