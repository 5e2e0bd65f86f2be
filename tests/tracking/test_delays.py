"""Delayed scans: the density is that of `OutOfSequenceTracker` for the scans that have arrived."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracking.scenes import rngs
from tracking.test_out_of_sequence import DRAW, TRACKERS, assert_equal_bits, tracker_of
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.kernels.base.types import Floats
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_experiment
from vedette.simulation import simulate_scans
from vedette.tracking import (
    Delay,
    DelayedScanTracker,
    OutOfSequenceTracker,
    SensorScan,
    State,
    Tracker,
    load_snapshot,
    save_snapshot,
)

LATE = {"probability": 0.6, "max_delay": 3.0, "start": 4.0, "end": 8.0, "window": None}
STEPS = 12


class Loop:
    """Scans of every second, the same whatever takes them; those of the second sensor come of every other."""

    def __init__(self, experiment: Any) -> None:
        truth = experiment.targets.truth(np.arange(1.0, STEPS + 1.0), rng=np.random.default_rng(1))
        own = [np.random.default_rng((2, s)) for s in range(experiment.num_sensors)]
        self.times = truth.times.tolist()
        self.poses: list[Floats] = [experiment.poses + np.array([3.0 * k, 0.0, 0.0]) for k in range(STEPS)]
        self.scans: list[list[Any]] = []
        for k, poses in enumerate(self.poses):
            scans = simulate_scans(truth.at(k)[1], poses, experiment.sensors_at(k + 1), rngs=own)
            self.scans.append([None if s == 1 and k % 2 else scan.measurements for s, scan in enumerate(scans)])

    def states(self, tracker: Tracker) -> list[State]:
        """After each step."""
        luck = [np.random.default_rng((7, s)) for s in range(len(tracker.sensors))]
        state, found = tracker.initial(), []
        for time, poses, scans in zip(self.times, self.poses, self.scans, strict=True):
            state, info = tracker.step(state, scans, poses, time, rngs=luck)
            assert len(info.filters) in (1, len(scans))
            found.append(state)
        return found


@pytest.mark.parametrize("name", [name for name in TRACKERS if name not in DRAW])
def test_without_delay_it_is_the_tracker(name: str) -> None:
    tracker, experiment = tracker_of(TRACKERS[name])
    loop = Loop(experiment)
    states = zip(loop.states(tracker), loop.states(DelayedScanTracker(tracker, {1: Delay(0.0, 9.0)})), strict=True)
    for k, (plain, own) in enumerate(states, start=1):
        if k > 3:  # of targets that were born of measurements
            assert_equal_bits(own.memory.timeline.state, plain)
        assert (own.step, own.time) == (plain.step, plain.time)


@pytest.mark.parametrize("window", [math.inf, 1.0])
@pytest.mark.parametrize("name", ["paper-e", "measured"])
def test_the_density_is_that_of_the_scans_that_have_arrived(name: str, window: float) -> None:
    tracker, experiment = tracker_of(TRACKERS[name])
    loop, delay = Loop(experiment), Delay(0.6, 3.0, 4.0, 8.0, window)
    states = loop.states(DelayedScanTracker(tracker, {0: delay}))
    luck, late = np.random.default_rng((7, 0)), OutOfSequenceTracker(tracker, experiment.poses)
    luck.integers(2**32)  # the seed of filters that draw
    coming, waited, lost = list[tuple[float, SensorScan]](), 0, 0
    for k, (state, time) in enumerate(zip(states, loop.times, strict=True)):
        for s, scan in enumerate(loop.scans[k]):
            by = delay.sample(time, luck) if s == 0 and scan is not None else 0.0
            lost, waited = lost + (by > window), waited + (0.0 < by <= window)
            assert by == 0.0 or (4.0 <= time <= 8.0 and by < 3.0)
            if scan is not None and by <= window:
                coming.append((time + by, SensorScan(s, time, scan, loop.poses[k][s])))
        timeline, _ = late.process(late.initial(), [scan for arrives, scan in coming if arrives <= time])
        believed = late.state_at(timeline, time)
        for mine, wanted in ((state.fused, believed.fused), *zip(state.local, believed.local, strict=True)):
            np.testing.assert_array_equal(mine.tracks.labels, wanted.tracks.labels)
            np.testing.assert_array_equal(mine.tracks.means, wanted.tracks.means)
    assert waited >= 1
    assert (lost > 0) == (window < math.inf)


def scene(**late: Any) -> Any:
    changes = {"sensors.1.scans.late": {**LATE, **late}, "control.decision_steps": [6]}
    return replace_fields(load_scenario("paper-e"), changes)


def test_a_scenario_has_it_and_a_run_is_the_same_again() -> None:
    scenario = scene()
    experiment = build_experiment(scenario)
    assert isinstance(experiment.tracker, DelayedScanTracker)
    assert experiment.tracker.delays == {1: Delay(0.6, 3.0, 4.0, 8.0)}
    first, again = (run_scenario(scenario, "jdm", seed=3, num_threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(first.ospa, again.ospa)
    assert first.decisions[0].plan.chosen == again.decisions[0].plan.chosen
    assert not np.array_equal(first.ospa, run_scenario(scene(probability=0.0), "jdm", seed=3).ospa)


def test_a_loop_with_pending_scans_can_be_saved(tmp_path: Path) -> None:
    tracker, experiment = tracker_of({})
    [*_, state] = Loop(experiment).states(DelayedScanTracker(tracker, {0: Delay(1.0, 30.0)}))
    assert len(state.memory.pending) > 5
    save_snapshot(tmp_path / "loop.npz", {"state": state})
    given: Any = ([None, None], experiment.poses, 30.0)
    states = (state, load_snapshot(tmp_path / "loop.npz")["state"])
    one, other = (
        DelayedScanTracker(tracker, {0: Delay(1.0, 30.0)}).step(own, *given, rngs=rngs(2))[0] for own in states
    )
    assert_equal_bits(one.memory.timeline.state, other.memory.timeline.state)
    assert 0 < len(one.memory.pending) == len(other.memory.pending) < len(state.memory.pending)


@pytest.mark.parametrize(
    ("late", "message"),
    [
        ({"probability": 1.5}, r"sensors\[1\].scans.late.probability: expected a number of at most 1, got 1.5"),
        ({"max_delay": 0.0}, r"sensors\[1\].scans.late.max_delay: expected a number above 0, got 0.0"),
        ({"end": 3.0}, r"sensors\[1\].scans.late.end: expected a time from start on, 4 s, got 3.0"),
        ({"window": -1.0}, r"sensors\[1\].scans.late.window: expected a number of at least 0, got -1.0"),
    ],
)
def test_bad_delays_of_a_scenario_are_named(late: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        scene(**late)


def test_bad_parts_are_refused() -> None:
    tracker, _ = tracker_of({})
    with pytest.raises(InputError, match=r"delays: expected sensors from 0 to 1; got 2"):
        DelayedScanTracker(tracker, {2: Delay(0.5, 3.0)})
    with pytest.raises(InputError, match=r"delays\[0\]: expected a Delay"):
        DelayedScanTracker(tracker, {0: 3.0})  # type: ignore[dict-item]
    with pytest.raises(InputError, match=r"Delay.window: expected seconds, at least 0; got nan"):
        Delay(0.5, 3.0, window=math.nan)
    with pytest.raises(InputError, match=r"Delay.end: expected a time from start on, 4 s; got 3"):
        Delay(0.5, 3.0, 4.0, 3.0)
