"""Scans in any order give the beliefs of the same scans in order, to the last bit; and states live on in files."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tracking.scenes import filters, sensor, targets
from vedette.errors import InputError
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.overrides import replace_fields
from vedette.simulation import simulate_scan
from vedette.tracking import (
    Distributed,
    OutOfSequenceTracker,
    SensorScan,
    Timeline,
    Tracker,
    load_snapshot,
    save_snapshot,
)
from vedette.tracking.out_of_sequence import _check_equal

MEASURED = {
    "birth.sites": [],
    "birth.from_measurements": {"expected": 0.5, "max_existence": 0.03, "std": [30.0, 30.0, 9.0, 9.0]},
}
LMBS: dict[str, Any] = {"fusion": {"kind": "sequential"}, "filter": {"kind": "lmb"}}
RADIO = {"network": {"delay": 1, "link_loss_probability": 0.2}}
# Of each family of trackers, filters and fusions one, and all that draw or remember.
TRACKERS: dict[str, dict[str, Any]] = {
    "paper-e": {},
    "sequential": LMBS,
    "central": {"fusion": {"kind": "central"}, "filter": {"kind": "lmb"}},
    "clmb": {"fusion": {"kind": "clmb"}, "filter": {"kind": "lmb"}},
    "cm_delta_glmb": {"fusion": {"kind": "cm_delta_glmb"}, "filter": {"kind": "delta_glmb"}},
    "parallel": {"fusion": {"kind": "parallel"}, "filter": {"kind": "factored_glmb"}},
    "gibbs": {"filter": {"kind": "delta_glmb", "assignment": {"kind": "gibbs"}}, "fusion": {"kind": "cm_delta_glmb"}},
    "measured": {**MEASURED, **LMBS},
    "learnt": {
        **MEASURED,
        "filter": {"kind": "factored_glmb"},
        "fusion": {"kind": "sequential"},
        "undetected": {"cell_size": 100.0, "expected": 1.0, "birth_rate": "learnt", "speed": 5.0},
    },
    "matched": {**MEASURED, "fusion": {"kind": "clmb", "matching": "assignment"}, "filter": {"kind": "lmb"}},
    "radio": {**RADIO, **MEASURED, **LMBS},
    "reach": {**MEASURED, **LMBS, "network": {"max_hops": 1, "link_loss_probability": 0.3}},
    "radio beliefs": {**RADIO, "fusion": {"kind": "clmb", "feedback": True}, "filter": {"kind": "lmb"}},
    "consensus": {"fusion": {"kind": "parallel"}, "network": {"consensus_rounds": 2}, "filter": {"kind": "lmb"}},
}
DRAW = ("gibbs", "radio", "reach", "radio beliefs")
WINDOW = 6.0


def tracker_of(changes: dict[str, Any]) -> tuple[Tracker, Any]:
    experiment = build_experiment(replace_fields(load_scenario("paper-e"), changes))
    return experiment.tracker, experiment


def asynchronous(experiment: Any, num: int, seed: int = 3) -> list[SensorScan]:
    """Scans of sensors that share some of their times: every second, and every 1.5 s."""
    rng = np.random.default_rng(seed)
    times = sorted({(s, (1.0, 1.5, 2.5)[s % 3] * k) for s in range(experiment.num_sensors) for k in range(1, num)})
    scans = []
    truth = experiment.targets.truth(np.arange(1.0, 60.0), rng=np.random.default_rng(1))
    for s, time in sorted(times, key=lambda own: (own[1], own[0])):
        pose = experiment.poses[s] + np.array([5.0 * time, -3.0 * time, *np.zeros(experiment.poses.shape[1] - 2)])
        states = truth.at(round(time))[1]
        measured = simulate_scan(states, pose, experiment.tracker.sensors[s], rng=rng).measurements
        scans.append(SensorScan(s, time, measured, pose))
    return scans


def jumbled(scans: Sequence[SensorScan], delay: float, seed: int) -> list[SensorScan]:
    """As they arrive, each up to `delay` seconds after it was taken."""
    waits = delay * np.random.default_rng(seed).random(len(scans))
    arrival = np.array([scan.time for scan in scans]) + waits
    return [scans[i] for i in np.argsort(arrival, kind="stable")]


def one_by_one(late: OutOfSequenceTracker, scans: Sequence[SensorScan]) -> Timeline:
    timeline = late.initial()
    for scan in scans:
        timeline, _ = late.process(timeline, [scan])
    return timeline


def assert_equal_bits(one: Any, other: Any) -> None:
    assert pickle.dumps((one.local, one.fused, one.step, one.time, one.memory, one.undetected)) == pickle.dumps(
        (other.local, other.fused, other.step, other.time, other.memory, other.undetected)
    )
    assert one.fused.tracks.num_tracks > 0


@pytest.mark.parametrize("changes", TRACKERS.values(), ids=TRACKERS)
def test_any_order_of_arrival_gives_the_beliefs_of_scans_in_order(changes: dict[str, Any]) -> None:
    tracker, experiment = tracker_of(changes)
    scans, late = asynchronous(experiment, 9), OutOfSequenceTracker(tracker, experiment.poses, WINDOW)
    in_order = one_by_one(late, scans)
    for seed in range(2):
        shuffled = one_by_one(late, jumbled(scans, WINDOW, seed))
        assert shuffled.num_dropped == 0
        assert shuffled.num_processed == len(scans)
        assert shuffled.num_late > 5
        assert_equal_bits(shuffled.state, in_order.state)
        np.testing.assert_array_equal(shuffled.poses, in_order.poses)
    at_once, info = late.process(late.initial(), jumbled(scans, WINDOW, 5))
    assert_equal_bits(at_once.state, in_order.state)
    assert len(info.steps) == len({scan.time for scan in scans})
    assert info.num_recomputed == 0


def test_scans_in_order_give_the_same_as_a_plain_loop() -> None:
    tracker, experiment = tracker_of({})
    scans = asynchronous(experiment, 9)
    timeline = one_by_one(OutOfSequenceTracker(tracker, experiment.poses, WINDOW), scans)
    state, poses = tracker.initial(), experiment.poses.copy()
    for time in sorted({scan.time for scan in scans}):
        now = {scan.sensor: scan for scan in scans if scan.time == time}
        for s, scan in now.items():
            poses[s] = scan.pose
        measured = [now[s].measurements if s in now else None for s in range(len(poses))]
        rngs = [np.random.default_rng(0)] * len(poses)
        state, _ = tracker.step(state, measured, poses.copy(), time, rngs=rngs)
    assert_equal_bits(timeline.state, state)


def small(window: float = 5.0) -> OutOfSequenceTracker:
    world, sensors = targets(), [sensor(), sensor(2.0)]
    from vedette.fusion import Clmb

    return OutOfSequenceTracker(Distributed(filters(world, sensors), Clmb((0.5, 0.5))), np.zeros((2, 3)), window)


def scan(sensor: int = 0, time: float = 1.0, measurements: Any = ((3.0, 1.0),), pose: Any = (0.0, 0.0, 0.0)) -> Any:
    return SensorScan(sensor, time, measurements, pose)


def test_scans_older_than_the_window_are_dropped_and_counted() -> None:
    late = small()
    timeline, _ = late.process(late.initial(), [scan(time=1.0), scan(time=8.0)])
    after, info = late.process(timeline, [scan(1, 2.9), scan(1, 2.5)])
    assert [one.time for one in info.dropped] == [2.9, 2.5]
    assert (after.num_dropped, after.num_processed, info.steps) == (2, 2, ())
    assert after.state is timeline.state
    taken, info = late.process(after, [scan(1, 3.0)])  # just within
    assert (taken.num_processed, taken.num_late, info.num_recomputed) == (3, 1, 1)


def test_only_the_window_is_stored() -> None:
    late = small(window=5.0)
    timeline = one_by_one(late, [scan(k % 2, 0.5 * k) for k in range(1, 200)])
    assert len(timeline.entries) == 11
    assert timeline.state.step == 199


def test_the_oldest_entries_beyond_the_limit_become_final() -> None:
    late = replace(small(window=5.0), max_entries=4)
    timeline = one_by_one(late, [scan(0, 0.5 * k) for k in range(1, 10)])
    assert [instant.time for instant in timeline.entries] == [3.0, 3.5, 4.0, 4.5]
    for time, num_dropped in ((2.6, 0), (2.5, 1), (2.1, 1)):  # that of the last settled one is over
        after, _ = late.process(timeline, [scan(1, time)])
        assert (after.num_dropped, len(after.entries)) == (num_dropped, 4)
    with pytest.raises(InputError, match="max_entries: expected a whole number of at least 1; got 0"):
        replace(small(), max_entries=0)


def test_a_scan_that_comes_again_is_counted_and_one_that_differs_is_refused() -> None:
    late = small()
    timeline, _ = late.process(late.initial(), [scan(time=1.0), scan(time=2.0)])
    again, info = late.process(timeline, [scan(time=1.0)])
    assert (again.num_repeated, info.steps, again.state) == (1, (), timeline.state)
    with pytest.raises(InputError, match=r"scan of sensor 0 at 1 s: expected one scan of a sensor at a time"):
        late.process(timeline, [scan(time=1.0, measurements=[[9.0, 9.0]])])
    with pytest.raises(InputError, match="got a second one that differs"):
        late.process(late.initial(), [scan(), scan(pose=(1.0, 0.0, 0.0))])


def test_rows_that_come_again_in_another_order_are_the_same_scan() -> None:
    there = SensorScan(0, 1.0, np.array([[3.0, 1.0], [1.0, 2.0], [1.0, -2.0]]), np.zeros(3))
    _check_equal(there, replace(there, measurements=there.measurements[[2, 0, 1]]))
    with pytest.raises(InputError, match="got a second one that differs"):
        _check_equal(there, replace(there, measurements=there.measurements[:, ::-1]))


def test_scans_of_one_time_are_one_step_however_they_come() -> None:
    late = small()
    together, _ = late.process(late.initial(), [scan(0), scan(1)])
    apart, info = late.process(late.process(late.initial(), [scan(1)])[0], [scan(0)])
    assert together.state.step == apart.state.step == 1
    assert (apart.num_late, info.num_recomputed) == (0, 1)
    assert_equal_bits(together.state, apart.state)


def test_predicted_states_are_not_stored() -> None:
    late = small()
    timeline, _ = late.process(late.initial(), [scan(0, 1.0), scan(1, 2.0)])
    ahead = late.state_at(timeline, 4.5)
    nothing, _ = late.tracker.step(
        timeline.state, [None, None], timeline.poses, 4.5, rngs=[np.random.default_rng()] * 2
    )
    assert_equal_bits(ahead, nothing)
    assert late.state_at(timeline, 2.0) is timeline.state
    assert timeline.state.time == 2.0
    with pytest.raises(InputError, match=r"time: expected one from 2 s on, the latest of all scans that came; got 1"):
        late.state_at(timeline, 1.0)


def test_arrays_changed_by_the_caller_do_not_change_recomputed_steps() -> None:
    late, buffer, pose = small(), np.array([[3.0, 1.0]]), np.zeros(3)
    timeline, _ = late.process(late.initial(), [scan(0, 2.0, buffer, pose)])
    buffer[:], pose[:] = 700.0, 500.0
    timeline, _ = late.process(timeline, [scan(1, 1.0)])
    expected, _ = late.process(late.initial(), [scan(0, 2.0), scan(1, 1.0)])
    assert_equal_bits(timeline.state, expected.state)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (scan(sensor=2), "scan.sensor: expected a whole number from 0 to 1; got 2"),
        (scan(sensor=-1), "scan.sensor: expected a whole number of at least 0; got -1"),
        (scan(time=float("nan")), "scan.time: expected a finite number; got nan"),
        (scan(time=3.0, measurements=[[1.0, 2.0, 3.0]]), "scan of sensor 0 at 3 s: scan: expected an array of shape"),
        (scan(measurements=None), "scan of sensor 0 at 1 s: scan: expected"),
        (scan(measurements=[[1.0], [2.0, 3.0]]), "scan of sensor 0 at 1 s: scan: expected numbers in an array"),
        (scan(time=3.0, measurements=[[1.0, np.nan]]), "scan of sensor 0 at 3 s: scan: expected finite numbers"),
        (scan(pose=(0.0, 0.0)), "scan of sensor 0 at 1 s, pose: expected an array of shape"),
        (scan(pose=np.zeros(4)), "scan of sensor 0 at 1 s, pose: expected at most 3 numbers"),
        ("scan", "scan: expected a SensorScan; got str"),
    ],
)
def test_a_bad_scan_is_refused_by_name_and_leaves_all_as_it_was(bad: Any, message: str) -> None:
    late = small()
    timeline, _ = late.process(late.initial(), [scan()])
    with pytest.raises(InputError) as error:
        late.process(timeline, [scan(1, 2.0), bad])
    assert str(error.value).startswith(message)
    assert (timeline.num_processed, timeline.state.step) == (1, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tracker": 3}, "tracker: expected a Tracker"),
        ({"poses": np.zeros((3, 3))}, "poses: expected 2, one a sensor; got 3"),
        ({"window": 0.0}, "window: expected a number above 0; got 0.0"),
        ({"seed": -1}, "seed: expected a whole number of at least 0; got -1"),
    ],
)
def test_bad_parts_are_refused(changes: dict[str, Any], message: str) -> None:
    whole = small()
    given = {"tracker": whole.tracker, "poses": whole.poses, "window": 5.0, "seed": 0, **changes}
    with pytest.raises(InputError) as error:
        OutOfSequenceTracker(**given)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("changes", TRACKERS.values(), ids=TRACKERS)
def test_a_resumed_loop_gives_the_answers_of_an_uninterrupted_one(changes: dict[str, Any], tmp_path: Path) -> None:
    tracker, experiment = tracker_of(changes)
    late = OutOfSequenceTracker(tracker, experiment.poses, WINDOW)
    scans = jumbled(asynchronous(experiment, 9), WINDOW, 1)
    rng = np.random.default_rng(4)
    timeline = one_by_one(late, scans[: len(scans) // 2])
    rng.random(7)
    save_snapshot(tmp_path / "half.npz", {"timeline": timeline, "rng": rng, "count": 5, "names": ["a", None]})
    found = load_snapshot(tmp_path / "half.npz")
    assert (found["count"], found["names"], found["rng"].random()) == (5, ["a", None], rng.random())
    ends = []
    for begun in (timeline, found["timeline"]):
        for one in scans[len(scans) // 2 :]:
            begun, _ = late.process(begun, [one])
        ends.append(begun)
    assert_equal_bits(ends[0].state, ends[1].state)
    assert ends[0].num_late == ends[1].num_late


def test_other_files_are_rejected_as_snapshots(tmp_path: Path) -> None:
    path = tmp_path / "some.npz"
    with pytest.raises(InputError, match=r"some.npz: no such file; expected a snapshot"):
        load_snapshot(path)
    path.write_bytes(b"PK nonsense")
    with pytest.raises(InputError, match="expected a snapshot; it is damaged or another"):
        load_snapshot(path)
    np.savez(path, x=np.zeros(3))
    with pytest.raises(InputError, match="expected a file of format vedette-snapshot"):
        load_snapshot(path)
    with pytest.raises(InputError, match=r"parts\['own'\]: expected arrays, .*; got a builtins.object"):
        save_snapshot(path, {"own": object()})
    with pytest.raises(InputError, match=r"parts\['later'\]\[1\]"):
        save_snapshot(path, {"later": (1, lambda: None)})


def test_no_class_but_the_librarys_data_is_made_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "some.npz"
    for module, name in (("os", "system"), ("vedette.internal.files", "write_whole"), ("subprocess", "Popen")):
        text = (
            '{"format": "vedette-snapshot", "version": 1, "root": 1, "nodes": '
            f'[["plain", 1], ["object", "{module}", "{name}", {{"a": 0}}]]}}'
        )
        np.savez(path, structure=np.frombuffer(text.encode(), np.uint8))
        with pytest.raises(InputError, match=r"is no data class that a snapshot may hold"):
            load_snapshot(path)
