"""Live loop: its answers are those of `OutOfSequenceTracker` for the same scans, whatever other lines arrive."""

from __future__ import annotations

import gc
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from live.examples import SYNCHRONOUS, answered, line, small, walk, write_live
from vedette.errors import InputError
from vedette.live import MAX_LINE_BYTES, LiveLoop, build_live_loop
from vedette.live.building import warm_up
from vedette.recorded import Conventions, Origin, RecordedSensor, parse_scans
from vedette.recorded.files import read_table
from vedette.scenarios.build import build_experiment
from vedette.scenarios.from_recording import scenario_from_sensors
from vedette.tracking import OutOfSequenceTracker, SensorScan


def test_the_estimates_are_those_of_the_same_scans_read_from_a_file(tmp_path: Path) -> None:
    lines = write_live(tmp_path, seconds=60.0)
    known = scenario_from_sensors(tmp_path / "radars.yaml")
    model = known.scenario.model
    experiment, origin = build_experiment(known.scenario), Origin(-1.1171, 50.7865)
    sites = [RecordedSensor(s.name or "", s.measurement.kind, s.pose) for s in model.sensors]
    conventions = Conventions({"sensor": "radar", "bearing": "brg_deg"}, {}, "north")
    recorded = parse_scans(read_table(tmp_path / "scans.csv"), sites, conventions, origin)
    late = OutOfSequenceTracker(experiment.tracker, experiment.poses)
    timeline, wanted = late.initial(), []
    first = float(experiment.times[0])
    for time, scans, poses in zip(recorded.times.tolist(), recorded.scans, recorded.poses, strict=True):
        for s, scan in enumerate(scans):
            if scan is not None:
                at = time + recorded.start - (recorded.start - first)
                timeline, _ = late.process(timeline, [SensorScan(s, at, scan, poses[s])])
                wanted.append(experiment.estimate(timeline.state.fused, timeline.state.step))
    answers = [json.loads(answer) for answer in answered(build_live_loop(known), lines)]
    assert len(answers) == len(wanted) == len(lines)
    for answer, estimate in zip(answers, wanted, strict=True):
        tracks = answer["tracks"]
        assert [track["label"] for track in tracks] == [f"{a}.{b}" for a, b in estimate.labels.tolist()]
        assert [[t["x"], t["y"], t["vx"], t["vy"]] for t in tracks] == estimate.means.tolist()
        stds = np.sqrt(np.diagonal(estimate.covs, axis1=1, axis2=2)).tolist()
        assert [track["std"] for track in tracks] == stds
        assert [track["existence"] for track in tracks] == estimate.existence.tolist()
        degrees = [[track["lon"], track["lat"]] for track in tracks]
        np.testing.assert_array_equal(np.reshape(degrees, (-1, 2)), origin.to_degrees(estimate.means[:, :2]))
    assert len(answers[-1]["tracks"]) == 3
    assert answers[0]["utc"] == "2016-01-12T13:02:24.184Z"
    assert answers[-1]["time"] == pytest.approx(recorded.start + recorded.times[-1], abs=1e-6)


def test_any_order_of_arrival_gives_the_same_tracks(tmp_path: Path) -> None:
    live, lines = small(tmp_path), walk(12)
    *_, last = map(json.loads, answered(live, lines))
    for seed in range(3):
        order = [0, *(1 + np.random.default_rng(seed).permutation(len(lines) - 1))]
        *_, other = map(json.loads, answered(live, [lines[i] for i in order]))
        assert other["tracks"] == last["tracks"] != []
        assert (other["late"] > 0, other["dropped"]) == (True, 0)


def test_biases_are_removed_from_the_measurements_of_lines(tmp_path: Path) -> None:
    (tmp_path / "biased").mkdir()
    biased = SYNCHRONOUS.replace("position: [0.0, 0.0]}", "position: [0.0, 0.0], bias: {x: 30.0, y: -5.0, clock: 1.0}}")
    plain, told = [], []
    for k in range(5):
        plain += [line(1, float(k), [[4.0 * k, 50.0]]), line(2, float(k), [[4.0 * k, 51.0]])]
        told += [line(1, k + 1.0, [[4.0 * k + 30.0, 45.0]]), line(2, float(k), [[4.0 * k, 51.0]])]
    wanted = [json.loads(answer) for answer in answered(small(tmp_path), plain)]
    found = [json.loads(answer) for answer in answered(small(tmp_path / "biased", biased), told)]
    assert found == wanted
    assert found[-1]["tracks"]


def test_returns_within_the_extent_of_a_sensor_are_one_measurement(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    ships = np.array([[-200.0, 100.0], [300.0, -150.0]])
    offsets = rng.uniform(-15.0, 15.0, (20, 2, 4, 2))
    scans = [(ships[:, None] + [5.0 * k, 0.0] + offsets[k]).reshape(-1, 2) for k in range(20)]
    lines = [line(1, float(k), scan.tolist()) for k, scan in enumerate(scans)]
    text = SYNCHRONOUS.replace("{position: [0.0, 0.0]}", "{position: [0.0, 0.0], extent: 40.0}")
    live = small(tmp_path, text)
    state, apart = live.initial(), small(tmp_path).initial()
    for each in lines:
        state, (answer,) = live.process(state, each)
        apart, (answer_apart,) = small(tmp_path).process(apart, each)
    assert len(answer["tracks"]) == 2 < len(answer_apart["tracks"])
    from_means = offsets - offsets.mean(axis=2, keepdims=True)
    np.testing.assert_allclose(state.spreads, [(160, (from_means**2).sum()), (0, 0.0)])
    np.testing.assert_allclose([t["std"][0] for t in answer["tracks"]], 6.0, atol=3.0)


BAD: list[tuple[bytes, str]] = [
    (b"{", "line 3: expected a JSON object; it is damaged"),
    (b"\xff{}", "line 3: expected a JSON object; it is damaged"),
    (b"[" * 100_000, "line 3: expected a JSON object; it is damaged: it is nested too deeply"),
    (b"3", "line 3: expected a JSON object; got 3"),
    (b" " * 3 + b"x" * MAX_LINE_BYTES, f"line 3: expected at most {MAX_LINE_BYTES} bytes"),
    (b'{"sensor": 1, "sensor": 2}', "'sensor' stands there twice"),
    (b'{"sensor": 1, "time": NaN, "measurements": []}', "NaN is no number"),
    (b'{"sensor": 1, "time": 1e999, "measurements": []}', "too large a number"),
    (b'{"sensor": 1, "time": 2}', "line 3, measurements: expected it in every line; got none"),
    (
        line(1, 2.0, [], speed=3),
        "times, stds, snr_db, class, size_m, pose_stds; got 'speed'",
    ),
    (line("radar", 2.0), "line 3, sensor: expected one of 'sensor 1', 'sensor 2', or its number from 1; got 'radar'"),
    (line(0, 2.0), "or its number from 1; got 0"),
    (line(True, 2.0), "or its number from 1; got True"),
    (line(1, None), "line 3, time: expected seconds, or a text in ISO 8601; got None"),
    (line(1, "noon"), "line 3, row 1, column 'time': expected an ISO 8601 time; got 'noon'"),
    (line(1, "2016-01-12T13:02:24Z"), "expected seconds, as before; got 2016-01-12T13:02:24.000Z"),
    (line(1, 1e13), "column 'time': expected a number of seconds from -1e+12 to 1e+12"),
    (line(1, 2.0, {"x": 1}), "line 3, measurements: expected a list of [x, y]"),
    (line(1, 2.0, [[1.0, 2.0], [1.0]]), "line 3, measurements[1]: expected numbers [x, y]; got [1.0]"),
    (line(1, 2.0, [[1.0, "2"]]), "line 3, measurements[0]: expected numbers [x, y]"),
    (line(1, 2.0, [[1.0, None]]), "line 3, measurements[0]: expected numbers [x, y]"),
    (line(1, 2.0, [[1.0, True]]), "line 3, measurements[0]: expected numbers [x, y]"),
    (line(1, 2.0, [[1.0, 1e12]]), "line 3, row 1, column 'y': expected a number from -1e+09 to 1e+09"),
    (line(1, 2.0, [[0.0, 0.0]] * 2001), "line 3, measurements: expected at most 2000 of a scan; got 2001"),
    (line(1, 2.0, [], pose=[1.0, 2.0]), "line 3, pose: expected numbers [x, y, heading_rad], or lon and lat"),
    (line(1, 2.0, [], pose=[0.0] * 4), "line 3, pose: expected numbers"),
    (line(1, 2.0, [], pose=[0.0, 0.0, 90.0]), "column 'pose.heading_rad': expected a number from -6.28319"),
    (
        line(1, 2.0, [], pose={"lat": 1.0}),
        "pose: expected lon, lat and, if it is known, course_deg or heading_deg; got lat",
    ),
    (line(1, 2.0, [], pose={"lon": "a", "lat": 1}), "line 3, pose.lon: expected a number; got a"),
    (line(1, 2.0, [], pose={"lon": 1, "lat": 1}), "line 3: expected an origin"),
    (line(1, 2.0, [], pose={"lon": 1, "lat": 1, "heading_deg": 0}), "expected bearings: north"),
    (line(1, 0.0, [[500.0, 500.0]]), "line 3: scan of sensor 0 at 0 s: expected one scan of a sensor at a time"),
    (
        line(1, 1e6),
        "expected at most 60 s after the latest, or 3 scans in a row that agree (10 of one sensor); got 1e+06 s",
    ),
]


@pytest.mark.parametrize(("bad", "words"), BAD, ids=range(len(BAD)))
def test_a_bad_line_is_reported_and_has_no_other_effect(tmp_path: Path, bad: bytes, words: str) -> None:
    live, lines = small(tmp_path), walk(1)
    state = live.initial()
    for one in lines:
        state, _ = live.process(state, one)
    after, (answer,) = live.process(state, bad)
    assert words in answer["error"]
    assert answer["error"].startswith("line 3")
    assert (after.num_errors, after.num_lines, after.timeline) == (1, 3, state.timeline)
    good = line(1, 1.0, [[4.0, 51.0]])
    assert live.process(after, good)[1][0]["tracks"] == live.process(state, good)[1][0]["tracks"]


def test_errors_of_custom_parts_are_reported(tmp_path: Path) -> None:
    live = small(tmp_path)

    def fails(density: Any, step: int) -> Any:
        raise RuntimeError("no estimate today")

    broken = LiveLoop(live.tracker, live.sites, fails, live.conventions)
    state, (answer,) = broken.process(broken.initial(), line())
    assert answer["error"].startswith("line 1: RuntimeError: no estimate today")
    assert state.timeline.num_processed == 0


def test_one_wrong_clock_is_rejected_but_agreeing_clocks_are_accepted(tmp_path: Path) -> None:
    live = small(tmp_path, max_lead=10.0)
    lines = [line(1, 0.0), line(1, 500.0), line(1, 501.0), line(2, 1.0), line(1, 502.0), line(1, 503.0)]
    answers = [json.loads(answer) for answer in answered(live, [*lines, line(1, 2.0), line(2, 3.0)])]
    assert ["error" in answer for answer in answers] == [False, True, True, False, True, True, False, False]
    assert [answer["time"] for answer in answers if "time" in answer] == [0.0, 1.0, 2.0, 3.0]
    # After a silence of all, what several say is believed, and what one says again and again.
    both = [line(1 + k % 2, 500.0 + k) for k in range(4)]
    told = [json.loads(answer) for answer in answered(live, [line(1, 0.0), *both])]
    assert [answer.get("time") for answer in told] == [0.0, None, None, 502.0, 503.0]
    alone = [line(1, 500.0 + k) for k in range(11)]
    told = [json.loads(answer) for answer in answered(live, [line(1, 0.0), *alone])]
    assert [answer.get("time") for answer in told] == [0.0, *[None] * 9, 509.0, 510.0]
    # Those who say another time each agree on nothing.
    apart = [line(1 + k % 2, 500.0 + 100.0 * k) for k in range(12)]
    assert sum("error" in json.loads(answer) for answer in answered(live, [line(1, 0.0), *apart])) == 12


def test_plans_follow_all_scans_of_their_time(tmp_path: Path) -> None:
    live, lines = small(tmp_path, decide_every=5.0), walk(12)
    answers = [json.loads(answer) for answer in answered(live, lines)]
    plans = {answer["line"]: answer["plan"] for answer in answers if "plan" in answer}
    assert {number: plan["time"] for number, plan in plans.items()} == {12: 5.0, 22: 10.0}
    state = live.initial()
    for one in lines[:12]:
        state, _ = live.process(state, one)
    assert live.planner is not None
    belief = state.timeline.state
    plan = live.planner.plan(belief, state.timeline.poses, rng=np.random.default_rng(0))
    told = [action["heading_deg"] for action in plans[12]["actions"]]
    assert told == [float(row[0]) for row in plan.chosen_actions]
    assert plans[12]["expected_rewards"][0]["mean"] == plan.expected_rewards[0][0]
    assert plans[12]["why"] == str(plan.explain())
    assert [action["sensor"] for action in plans[12]["actions"]] == ["sensor 1", "sensor 2"]
    # One sensor is silent: its scans are not waited for when another's are later.
    alone = [json.loads(answer) for answer in answered(live, lines[::2])]
    assert [answer["plan"]["time"] for answer in alone if "plan" in answer] == [6.0, 11.0]


def test_the_decision_times_of_a_scenario_are_kept(tmp_path: Path) -> None:
    text = SYNCHRONOUS + "time: {num_steps: 20, start: 0.0}\ncontrol: {decision_steps: [4, 8]}\n"
    answers = [json.loads(answer) for answer in answered(small(tmp_path, text), walk(12))]
    assert [answer["plan"]["time"] for answer in answers if "plan" in answer] == [3.0, 7.0]
    still = [json.loads(answer) for answer in answered(small(tmp_path, text, planner="stationary"), walk(12))]
    assert not any("plan" in answer for answer in still)


def test_a_failing_planner_loses_no_scan(tmp_path: Path) -> None:
    live = small(tmp_path, decide_every=5.0)

    class Fails:
        name = "fails"

        def plan(self, *_: Any, **__: Any) -> Any:
            raise RuntimeError("no idea")

    broken = LiveLoop(live.tracker, live.sites, live.estimate, live.conventions, planner=Fails(), decide_every=5.0)
    answers = [json.loads(answer) for answer in answered(broken, walk(8))]
    (error,) = (answer["error"] for answer in answers if "error" in answer)
    assert error.startswith("line 12, plan at 5 s: RuntimeError: no idea (test_loop.py, line ")
    assert sum("tracks" in answer for answer in answers) == 16


def test_units_and_bearings_are_those_of_the_file(tmp_path: Path) -> None:
    polar = SYNCHRONOUS.replace("kind: position", "kind: bearing_range")
    noise = polar.replace("std: [10.0, 10.0]", "std: [0.01, 10.0]")
    plain = small(tmp_path, noise)
    compass = small(tmp_path, noise + "recording: {bearings: north, units: {bearing: deg, range: km}}\n")
    own = small(tmp_path, noise.replace("sensor_defaults:", "sensor_defaults:\n  compass: true"))
    for k in range(3):
        east = line(1, float(k), [[0.25 * np.pi, 500.0]], pose=[1.0, 2.0, 0.5])
        north = line(1, float(k), [[45.0, 0.5]], pose=[1.0, 2.0, 0.5 * np.pi - 0.5])
        metres = line(1, float(k), [[45.0, 500.0]], pose=[1.0, 2.0, 0.5 * np.pi - 0.5])
        for live, sent in ((plain, east), (compass, north), (own, metres)):
            timelines = live.process(live.initial(), sent)[0].timeline
            np.testing.assert_allclose(timelines.entries[0].scans[0].measurements, [[0.25 * np.pi, 500.0]], rtol=1e-12)
            np.testing.assert_allclose(timelines.poses[0], [1.0, 2.0, 0.5], rtol=1e-12)


NO_REGION = "".join(SYNCHRONOUS.splitlines(keepends=True)[2:])
LIMITED = "{kind: limited_range, max_range: 600.0, probability: 0.9}"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{kind: constant, probability: 0.9}", LIMITED),
        ("{kind: region, rate: 1.0}", "{kind: around_sensor, radius: 600.0}"),
    ],
)
@pytest.mark.parametrize("births", [True, False])
def test_without_a_region_the_grid_covers_the_sensors_range(tmp_path: Path, old: str, new: str, births: bool) -> None:
    text = NO_REGION if births else re.sub("birth: .*\n", "", NO_REGION)
    text = text.replace(old, new)
    said = text + "region: {x_min: -600.0, x_max: 700.0, y_min: -600.0, y_max: 600.0}\n"
    found = answered(small(tmp_path, text), walk(8))
    assert found == answered(small(tmp_path, said), walk(8))
    assert len(json.loads(found[-1])["tracks"]) == 1
    words = scenario_from_sensors(tmp_path / "small.yaml").assumed
    assert "region" not in words  # it is given
    (tmp_path / "small.yaml").write_text(text, "utf-8")
    words = scenario_from_sensors(tmp_path / "small.yaml").assumed
    assert words["region"].startswith("x -600 to 700 m, y -600 to 600 m (as far as")


@pytest.mark.parametrize("num", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_memory_does_not_grow_with_the_number_of_scans(tmp_path: Path, num: int) -> None:
    live = small(tmp_path, max_delay=5.0)
    state, counts = live.initial(), []
    for k in range(num):
        state, _ = live.process(state, line(1 + k % 2, 0.5 * k, [[0.0, 50.0]] if k % 3 else []))
        if k in (999, num - 1):
            gc.collect()
            counts.append((len(gc.get_objects()), len(state.timeline.entries)))
    assert counts[1][1] == counts[0][1] == 11
    assert abs(counts[1][0] - counts[0][0]) < 200


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (NO_REGION, "expected a region, or of sensor 1 `detection: {max_range: ...}`"),
        ("- 1\n", "expected a mapping with `sensors`"),
        ("recording: {bearings: up}\nregion: 1\n", "bearings: expected east or north; got up"),
        ("recording: {units: {range: mile}}\nregion: 1\n", "units.range: expected one of m, km, nmi, nm, ft; got mile"),
    ],
)
def test_an_unsuitable_file_is_reported(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        small(tmp_path, text)


def test_planners_that_need_the_true_targets_are_rejected(tmp_path: Path) -> None:
    for name in ("oracle", "true_targets"):
        with pytest.raises(InputError, match=f"expected one that does not know the targets; got {name}"):
            small(tmp_path, decide_every=5.0, planner=name)


def test_a_planner_of_the_scenarios_own_decides(tmp_path: Path) -> None:
    """It passes the truth on to a planner that knows it, and does not know it itself."""
    text = (
        SYNCHRONOUS
        + "planners: {mine: {kind: independent}}\ncontrol: {constraints: [{kind: separation, distance: 1.0}]}\n"
    )
    live = small(tmp_path, text, decide_every=5.0, planner="mine")
    assert live.planner is not None
    assert live.planner.name == "mine"


def test_a_measurement_beyond_the_reach_of_its_sensor_is_counted_and_left_out(tmp_path: Path) -> None:
    near = SYNCHRONOUS.replace(
        "detection: {kind: constant, probability: 0.9}",
        "detection: {kind: limited_range, probability: 0.9, max_range: 300.0, outside: 0.0}",
    )
    lines = [
        line(1, 0.0, [[100.0, 0.0], [314.0, 0.0], [316.0, 0.0], [0.0, -900.0]]),
        line(2, 1.0, [[414.0, 0.0], [-216.0, 0.0]]),
        line(1, 2.0, [[50.0, 0.0]]),
    ]
    answers = [json.loads(answer) for answer in answered(small(tmp_path, near), lines)]
    assert [answer.get("beyond", 0) for answer in answers] == [2, 1, 0]
    assert all("error" not in answer for answer in answers)


def test_the_warm_up_decides_once_and_changes_no_answer(tmp_path: Path) -> None:
    class Failing:
        """A planner that counts its decisions and then fails."""

        num = 0

        def plan(self, *_: Any, **__: Any) -> Any:
            self.num += 1
            raise RuntimeError("no plan")

    live, lines = small(tmp_path), walk(6)
    expected = answered(live, lines)
    planner = Failing()
    warm_up(replace(live, planner=planner))  # type: ignore[arg-type]
    assert planner.num == 1
    assert answered(live, lines) == expected
