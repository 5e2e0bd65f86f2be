"""Targets that are scanned again and again: the seconds since a scan, and that all strategies keep to the limit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.control.constraints.protocol import ConstraintContext
from vedette.control.constraints.revisit import Revisit
from vedette.densities import LMB, as_lmb, track_moments
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.platforms.camera import view_gap
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import simulate
from vedette.tracking.snapshots import load_snapshot, save_snapshot

EVERY, REACH, HALF_WIDTH, LIVELY = 12.0, 300.0, 30.0, 0.5


def camera_pose(x: float, pointing: float, half_width: float) -> Any:
    return np.array([x, 0.0, 0.0, pointing, half_width])


def test_the_gap_to_the_view_is_that_of_a_search() -> None:
    """The least way to the place, and the least turn, by trying many turns."""
    rng, radius, turns = np.random.default_rng(3), 50.0, np.linspace(-np.pi, np.pi, 20_001)
    for _ in range(50):
        own = camera_pose(0.0, rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 1.0))
        place = rng.uniform(-100.0, 100.0, 2)
        distance, directions = np.hypot(*place), own[3] + turns
        along = np.cos(directions) * place[0] + np.sin(directions) * place[1]
        turn = np.abs(turns[along >= np.cos(own[4]) * distance]).min()
        way = max(distance - radius, 0.0)
        assert view_gap(own, place, radius) == pytest.approx(way + turn * distance, abs=0.05)
        assert view_gap(own[:3], place, radius) == pytest.approx(way)
        assert view_gap(np.append(own[:4], 0.0), place, radius) == pytest.approx(way)  # a radar among cameras


def situation(seconds: float | None, existence: float = 0.9) -> ConstraintContext:
    """Two sensors 100 and 200 m from a still target, which go towards it, away from it, or stay near."""
    poses = np.array([[100.0, 0.0, 0.0], [-200.0, 0.0, 0.0]])
    ways, times = np.array([[-10.0, 0.0], [10.0, 0.0], [0.0, 5.0]]), np.arange(1.0, 6.0)
    courses = tuple(np.tile(pose, (3, 5, 1)) for pose in poses)
    for own in courses:
        own[..., :2] += ways[:, np.newaxis] * times[:, np.newaxis]
    belief = LMB.from_bernoullis([(1, 0)], [existence], [[0.0] * 4], [np.eye(4)])
    unseen = None if seconds is None else {(1, 0): seconds}
    return ConstraintContext(courses, times, (belief,) * 5, poses, (np.ones((3, 5), bool),) * 2, unseen)


def test_the_nearest_sensor_goes_when_it_is_time() -> None:
    """At 10 m/s the way of 90 m takes 9 s, and two horizons are 10 s."""
    constraint = Revisit((), 10.0, 60.0)
    for seconds, wanted in ((40.9, [True] * 3), (41.1, [True, False, False]), (90.0, [True, False, False])):
        assert [own.tolist() for own in constraint.courses(situation(seconds))] == [wanted, [True] * 3]
    assert constraint.courses(situation(90.0, existence=0.4))[0].all()
    assert constraint.courses(situation(90.0)._replace(unseen={}))[0].all()


def test_a_course_without_a_scan_does_not_see_the_target() -> None:
    given, constraint = situation(90.0), Revisit((), 120.0, 60.0)
    assert constraint.courses(given)[0].all()
    scans = np.array([[False] * 5, [True] * 5, [False] * 4 + [True]])
    assert constraint.courses(given._replace(scans=(scans, scans)))[0].tolist() == [False, True, True]


def test_a_camera_turns_when_it_is_time() -> None:
    """The target is 90 degrees to the left. The half width is 18 degrees, so that 12 degrees/s take 6 s."""
    own, turns, times = camera_pose(0.0, 0.0, np.radians(18.0)), np.radians([12.0, -12.0, 0.0]), np.arange(1.0, 6.0)
    courses = np.tile(own, (3, 5, 1))
    courses[:, :, 3] = turns[:, np.newaxis] * times
    belief = LMB.from_bernoullis([(1, 0)], [0.9], [[0.0, 80.0, 0.0, 0.0]], [np.eye(4)])
    scans = (np.ones((3, 5), bool),)
    for seconds, wanted in ((43.9, [True] * 3), (44.1, [True, False, False])):
        given = ConstraintContext((courses,), times, (belief,) * 5, own[np.newaxis], scans, {(1, 0): seconds})
        assert Revisit((), 100.0, 60.0).courses(given)[0].tolist() == wanted
        assert Revisit((), 70.0, 60.0).courses(given)[0].all()  # out of reach


def watched(every: float | None = EVERY, **fields: Any) -> Scenario:
    """A camera that turns 30 degrees/s and sees 60 degrees, and three still targets around it."""
    bearings = np.radians([10.0, 130.0, 250.0])
    means = [[*place, 0.0, 0.0] for place in (200.0 * np.column_stack([np.cos(bearings), np.sin(bearings)])).tolist()]
    pointings = {"half_width_deg": HALF_WIDTH, "pointings_deg": list(range(0, 360, 30)), "turn_rate_deg": 30.0}
    data: dict[str, Any] = {
        "format": 1,
        "name": "watched",
        "time": {"num_steps": 60, "step_period": 1.0, "start": 1.0},
        "region": {"x_min": -400.0, "x_max": 400.0, "y_min": -400.0, "y_max": 400.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.2},
        "survival": {"kind": "constant", "probability": 0.999},
        "birth": {
            "sites": [{"existence": 0.9, "mean": mean, "std": [10.0, 10.0, 0.5, 0.5]} for mean in means],
            "steps": [1],
        },
        "targets": {"kind": "scripted", "tracks": [{"state": mean, "start_step": 1} for mean in means]},
        "sensor_defaults": {
            "measurement": {"kind": "position"},
            "noise": {"kind": "constant", "std": [4.0, 4.0]},
            "detection": {"kind": "camera", "probability": 0.95, "max_range": 350.0},
            "clutter": {"kind": "region", "rate": 1.0},
        },
        "sensors": [{"name": "camera", "position": [0.0, 0.0], "platform": {"kind": "camera", **pointings}}],
        "control": {"decision_every": 1, "horizon_steps": 2, "horizon_period": 1.0, "explain": False},
        "ospa": {"cutoff": 50.0, "order": 1.0},
    }
    if every is not None:
        data["control"]["constraints"] = [{"kind": "revisit", "radius": REACH, "every": every}]
    data["control"].update(fields)
    return Scenario(parse_scenario(json.dumps(data)), Path("watched.yaml"))


def seconds_unseen(record: Any) -> float:
    """The longest time without a scan of a target, by angles of the camera and of the targets, which are still."""
    first, pointings = record.truth.at(0)[1][:, :2], record.poses[:, 0, 3]
    bearings = np.arctan2(first[:, 1], first[:, 0])
    off = np.degrees(np.abs(np.angle(np.exp(1j * (pointings[:, np.newaxis] - bearings)))))
    times = [np.concatenate([[0.0], record.times[seen], record.times[-1:]]) for seen in (off <= HALF_WIDTH).T]
    return max(float(np.diff(each).max()) for each in times)


@pytest.mark.parametrize("planner", ["jdm", "idm", "lookahead", "nearest", "random"])
def test_every_strategy_scans_in_time(planner: str) -> None:
    """All targets take a turn of 360 degrees, 12 s. A target at the edge of the view may be seen a scan later."""
    assert seconds_unseen(run_scenario(watched(), planner, seed=0)) <= EVERY + 2.0


def test_without_the_constraint_targets_wait_longer() -> None:
    assert seconds_unseen(run_scenario(watched(every=None), "random", seed=0)) > EVERY + 2.0


def test_the_seconds_in_states_are_those_since_a_scan_in_view(tmp_path: Path) -> None:
    scenario, states, poses_of = watched(), [], []

    class Spy:
        name = "spy"
        planner: Any = build_planner(watched(), "random", 1)

        def plan(self, state: Any, poses: Any, *, rng: np.random.Generator) -> Any:
            states.append(state)
            poses_of.append(poses)
            return self.planner.plan(state, poses, rng=rng)

    simulate(build_experiment(scenario), Spy(), seed=1, run=0, score=lambda *_: np.zeros((60, 3)))
    seen: dict[tuple[int, ...], float] = {}
    for state, poses in zip(states, poses_of, strict=True):
        tracks, pointing = as_lmb(state.fused).tracks, poses[0, 3]
        for label, mean in zip(map(tuple, tracks.labels.tolist()), track_moments(tracks)[0], strict=True):
            off = np.degrees(np.abs(np.angle((mean[0] + 1j * mean[1]) * np.exp(-1j * pointing))))
            if label not in seen or (off <= HALF_WIDTH and np.hypot(*mean[:2]) <= REACH):
                seen[label] = state.time
            assert state.unseen[label] == pytest.approx(state.time - seen[label], abs=1e-9)
    save_snapshot(tmp_path / "state.npz", {"state": states[-1]})
    assert load_snapshot(tmp_path / "state.npz")["state"].unseen == states[-1].unseen


def test_mistakes_are_named() -> None:
    with pytest.raises(InputError, match=r"revisit: expected a state with `unseen` \(see ViewTracker\)"):
        Revisit((), 10.0, 60.0).courses(situation(None))
    with pytest.raises(InputError, match="existence"):
        Revisit((), 10.0, 60.0, existence=1.5)
    twice = [{"kind": "revisit", "radius": 300.0, "every": 9.0}] * 2
    with pytest.raises(ScenarioError, match="one constraint revisit with all places or targets"):
        watched(constraints=twice)
