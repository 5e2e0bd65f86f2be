"""Courses by compass: with an origin or a compass, directions go out as they come in, clockwise from true north."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.geodesy import inverse
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.actions import action_axis, describe_action, drawn_angle, rounded
from vedette.evaluation.rewards import mean_rewards
from vedette.evaluation.runs import run_scenario
from vedette.evaluation.track_table import table_of_run
from vedette.live import build_live_loop
from vedette.platforms import (
    Actions,
    ByCompass,
    GridPlatform,
    HeadingPlatform,
    MountedPlatform,
    PlaneCompass,
    Pointing,
    Stationary,
    Waypoints,
)
from vedette.platforms.base import options_at
from vedette.recorded import Origin
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_planner, build_sensors
from vedette.scenarios.from_recording import scenario_from_sensors
from vedette.scenarios.loading import parse_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.simulation.decision_tables import decision_tables

FAR = Origin(-1.05, 50.7)
POSE = np.array([98900.0, 30.0, 0.3])
PLATFORMS = [
    HeadingPlatform(8.0),
    HeadingPlatform((8.0, 0.0), (0.0, 90.0, 45.0)),
    HeadingPlatform(5.0, (-30.0, 0.0, 30.0), relative=True),
    GridPlatform(20.0, 50.0),
    Waypoints([[98900.0, 900.0], [97000.0, 30.0]], 4.0),
]
BOATS = """
origin: {lon: -1.05, lat: 50.7}
region: {x_min: 95000.0, x_max: 101000.0, y_min: -3000.0, y_max: 3000.0}
motion: {kind: constant_velocity, sigma_v: 0.5}
birth: {sites: [], from_measurements: {expected: 0.5, max_existence: 0.03, std: [20.0, 20.0, 5.0, 5.0]}}
sensor_defaults:
  compass: true
  noise: {kind: constant, std: [0.01, 10.0]}
  detection: {kind: constant, probability: 0.9}
  clutter: {kind: region, rate: 1.0}
  platform: {kind: heading, speed: 5.0, courses_deg: [0, 60, 135, 270]}
sensors:
  - {name: one, position: {lon: 0.35, lat: 50.7}, course_deg: 60}
  - {name: two, position: {lon: 0.36, lat: 50.7}, course_deg: 0}
filter: {kind: lmb}
"""


@pytest.mark.parametrize("platform", PLATFORMS, ids=lambda each: type(each).__name__)
@pytest.mark.parametrize("compass", [FAR, Origin(179.0, -50.7), PlaneCompass()], ids=["east", "dateline", "plane"])
def test_a_platform_follows_its_course(platform: Any, compass: Any) -> None:
    """The first second of every action is a geodesic of that azimuth and speed."""
    found = options_at("x", ByCompass(platform, compass), POSE, np.array([0.1]))
    columns = found.actions.columns
    for i, row in enumerate(found.actions.values):
        told = dict(zip(columns, row.tolist(), strict=True))
        (x, y, heading) = found.courses[found.which[i], 0]
        gone = math.hypot(x - POSE[0], y - POSE[1])
        assert gone == pytest.approx(0.1 * told["speed_mps"], abs=1e-6)
        if told["speed_mps"] == 0.0:
            continue
        assert 0.0 <= told["course_deg"] < 360.0
        if isinstance(compass, Origin):
            far = POSE[:2] + 1e3 / gone * np.array([x - POSE[0], y - POSE[1]])
            here, there = (tuple(place) for place in compass.to_degrees([POSE[:2], far]).tolist())
            _, azimuth = inverse(here, there)
        else:
            azimuth = math.pi / 2.0 - heading
        assert abs(math.remainder(math.radians(told["course_deg"]) - azimuth, 2.0 * math.pi)) < math.radians(0.001)


def test_fixed_courses_are_whole_wherever_a_boat_is() -> None:
    assert ByCompass(HeadingPlatform(8.0), FAR).actions(POSE)[:4].tolist() == [[270, 8], [240, 8], [210, 8], [180, 8]]
    assert ByCompass(GridPlatform(20.0, 50.0), FAR).actions(POSE)[[1, -1]].tolist() == [[45, 50, 20], [0, 0, 0]]
    camera = ByCompass(MountedPlatform(HeadingPlatform(8.0, (0.0,)), Pointing((0.0, 90.0))), FAR)
    assert camera.columns == ("course_deg", "speed_mps", "azimuth_deg")
    pose = np.array([*POSE, 0.1, 0.5])
    assert camera.actions(pose).tolist() == [[90, 8, 90], [90, 8, 0]]
    ((course,), (north,)) = camera.courses(pose, camera.actions(pose), np.array([1.0]))
    turned = math.degrees(float(FAR.angle(0.0, POSE)))
    assert math.degrees(north[3]) == pytest.approx(turned)
    assert turned == pytest.approx(91.085, abs=0.002)
    assert course[2] == north[2] == pytest.approx(float(FAR.angle(math.pi / 2.0, POSE)))


class Own:
    """A custom platform, which looks its row up."""

    columns = ("heading_deg", "gear")

    def actions(self, pose: Any) -> Any:
        return np.array([[10.1, 1.0], [20.2, 2.0]])

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        assert action.tolist() in self.actions(pose).tolist()
        away = np.outer(3.0 * action[1] * times, [np.cos(np.radians(action[0])), np.sin(np.radians(action[0]))])
        return np.column_stack([pose[:2] + away, np.full(len(times), np.radians(action[0]))])


def test_a_custom_platform_gets_its_own_rows_and_reports_courses() -> None:
    found = options_at("x", ByCompass(Own(), FAR), POSE, np.array([1.0]))
    assert found.actions.columns == ("course_deg", "gear", "speed_mps")
    turned = math.degrees(float(FAR.angle(0.0, POSE))) - 90.0
    np.testing.assert_allclose(found.actions.values[:, 0], [79.9 + turned, 69.8 + turned], atol=0.01)
    np.testing.assert_allclose(found.actions.values[:, 1:], [[1.0, 3.0], [2.0, 6.0]], atol=1e-6)
    with pytest.raises(InputError, match="platform: expected a platform"):
        ByCompass(3, FAR)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="compass: expected a Compass; got int"):
        ByCompass(Stationary(), 3)  # type: ignore[arg-type]


def boats(folder: Path, text: str = BOATS) -> Any:
    (folder / "boats.yaml").write_text(text, "utf-8")
    return scenario_from_sensors(folder / "boats.yaml", decide_every=5.0)


def test_the_course_of_a_plan_is_the_course_of_a_pose(tmp_path: Path) -> None:
    """What a plan tells a boat, the boat reports when it goes there; both ways it is one direction in the plane."""
    known = boats(tmp_path)
    live = build_live_loop(known, decide_every=5.0, num_threads=1)
    state, plans = live.initial(), []
    for k in range(7):
        for s, name in enumerate(("one", "two")):
            pose = {"lon": 0.35 + 0.01 * s, "lat": 50.7, "course_deg": 60.0 if s == 0 else 0.0}
            line = {"sensor": name, "time": float(k), "measurements": [[120.0, 800.0]], "pose": pose}
            state, answers = live.process(state, json.dumps(line).encode())
            assert not any("error" in answer for answer in answers)
            plans += [answer["plan"] for answer in answers if "plan" in answer]
    (plan,) = plans
    assert [sorted(action) for action in plan["actions"]] == [["course_deg", "sensor", "speed_mps"]] * 2
    assert {action["course_deg"] for action in plan["actions"]} <= {0.0, 60.0, 135.0, 270.0}
    assert {action["speed_mps"] for action in plan["actions"]} == {5.0}
    assert "course_deg" in plan["why"]
    assert "heading" not in json.dumps(plan)
    sensors, poses = build_sensors(known.scenario), state.timeline.poses
    for s, action in enumerate(plan["actions"]):
        options = options_at("x", sensors[s].platform, poses[s], np.array([10.0]))
        (row,) = np.flatnonzero(options.actions.values[:, 0] == action["course_deg"])
        there = options.courses[options.which[row], 0]
        pose = {"lon": 0.35 + 0.01 * s, "lat": 50.7, "course_deg": action["course_deg"]}
        line = {"sensor": s + 1, "time": 10.0, "measurements": [], "pose": pose}
        after, _ = live.process(state, json.dumps(line).encode())
        told = after.timeline.poses[s]
        assert math.remainder(told[2] - there[2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)
        away = there[:2] - poses[s, :2]
        assert math.atan2(away[1], away[0]) == pytest.approx(float(told[2]), abs=1e-9)
        # The compass of the boat's own bearings is the same one.
        pose["heading_deg"] = pose.pop("course_deg")
        line["pose"] = pose
        after, _ = live.process(state, json.dumps(line).encode())
        assert after.timeline.poses[s, 2] == pytest.approx(float(told[2]), abs=1e-12)


def test_lines_from_north_are_answered_from_north(tmp_path: Path) -> None:
    """Without an origin, too: bearings in rad, as the units do not say another."""
    text = BOATS.replace("origin: {lon: -1.05, lat: 50.7}", "recording: {bearings: north}").replace(
        "  compass: true\n", ""
    )
    text = text.replace("{lon: 0.35, lat: 50.7}", "[98900.0, 0.0]").replace("{lon: 0.36, lat: 50.7}", "[99600.0, 0.0]")
    live = build_live_loop(boats(tmp_path, text), decide_every=1.0, num_threads=1)
    state, plans = live.initial(), []
    for k in range(3):
        for s in (1, 2):
            pose = [98200.0 + 700.0 * s, 0.0, math.radians(60.0)]
            line = {"sensor": s, "time": float(k), "measurements": [[2.0, 800.0]], "pose": pose}
            state, answers = live.process(state, json.dumps(line).encode())
            plans += [answer["plan"] for answer in answers if "plan" in answer]
    assert state.timeline.poses[0, 2] == pytest.approx(math.radians(30.0))
    assert state.timeline.entries[0].scans[0].measurements[0, 0] == pytest.approx(math.pi / 2.0 - 2.0)
    assert {action["course_deg"] for plan in plans for action in plan["actions"]} <= {0.0, 60.0, 135.0, 270.0}


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ({"lon": 0.35, "lat": 50.7, "course_deg": -30.0}, "pose.course_deg: expected degrees from 0 to 360, clockwise"),
        (
            {"lon": 0.35, "lat": 50.7, "course_deg": 0.0, "heading_deg": 0.0},
            "known, course_deg or heading_deg; got lon",
        ),
    ],
)
def test_a_course_that_is_none_is_refused(tmp_path: Path, pose: Any, words: str) -> None:
    live = build_live_loop(boats(tmp_path), num_threads=1)
    line = json.dumps({"sensor": 1, "time": 0.0, "measurements": [], "pose": pose}).encode()
    ((answer,),) = (live.process(live.initial(), line)[1],)
    assert words in answer["error"]


def test_live_tracks_have_courses_and_speeds(tmp_path: Path) -> None:
    live = build_live_loop(boats(tmp_path), num_threads=1)
    state, origin = live.initial(), FAR
    (start,) = origin.to_plane([0.355], [50.705])
    for k in range(12):
        # A target that goes 4 m/s to true north-east.
        place = start + 4.0 * k * np.array([math.cos(a := float(origin.angle(math.pi / 4.0, start))), math.sin(a)])
        for s, lon in enumerate((0.35, 0.36)):
            ((lon_t, lat_t),) = origin.to_degrees([place]).tolist()
            distance, azimuth = inverse((lon, 50.7), (lon_t, lat_t))
            row = [math.degrees(azimuth) % 360.0, distance]
            line = {"sensor": s + 1, "time": float(k), "measurements": [row], "pose": {"lon": lon, "lat": 50.7}}
            state, answers = live.process(state, json.dumps(line).encode())
    (track,) = answers[0]["tracks"]
    assert track["course_deg"] == pytest.approx(45.0, abs=5.0)
    assert track["speed_mps"] == pytest.approx(math.hypot(track["vx"], track["vy"]))
    angle = float(origin.angle(math.radians(track["course_deg"]), [track["x"], track["y"]]))
    assert angle == pytest.approx(math.atan2(track["vy"], track["vx"]), abs=1e-9)


def on_earth(**changes: Any) -> Scenario:
    fields = {"origin": {"lon": -1.05, "lat": 50.7}, "time.num_steps": 12, "control.decision_steps": [2, 7]}
    return replace_fields(load_scenario("paper-a"), {**fields, "ospa.first_scan": 1, "ospa.last_scan": None, **changes})


def test_tables_and_texts_of_a_run_have_courses() -> None:
    scenario = on_earth()
    record = run_scenario(scenario, "idm", seed=1)
    plan = record.decisions[0].plan
    assert {"course_deg", "speed_mps"} <= set(plan.to_table())
    assert "heading" not in f"{plan} {plan.explain()}"
    tables = decision_tables(record.decisions, record.num_sensors)
    assert {"course_deg", "speed_mps"} <= set(tables["actions"])
    assert "heading_deg" not in tables["actions"]
    tracks = table_of_run(record, scenario)
    assert {"course_deg", "speed_mps", "lon_deg"} <= set(tracks)
    means = mean_rewards([record], 0)
    assert action_axis(means.actions[0]).title() == "Course (deg)"
    first = plan.actions[0]
    assert describe_action(rounded(first.columns, first.values[0])) == "course 270°, speed 50 m/s"


def test_without_origin_or_compass_nothing_changes() -> None:
    scenario = on_earth(origin=None)
    record = run_scenario(scenario, "idm", seed=1)
    plan = record.decisions[0].plan
    assert plan.actions[0].columns == ("heading_deg",)
    np.testing.assert_array_equal(plan.actions[0].values[:, 0], np.arange(-180.0, 181.0, 30.0))
    assert "course_deg" not in table_of_run(record, scenario)
    compass = run_scenario(on_earth(origin=None, **{"sensors.*.compass": True}), "idm", seed=1)
    assert compass.decisions[0].plan.actions[0].columns == ("course_deg", "speed_mps")
    # Of a plane that lies nowhere, the decisions are the same ones.
    for mine, theirs in zip(record.decisions, compass.decisions, strict=True):
        assert mine.plan.chosen == theirs.plan.chosen
    np.testing.assert_allclose(compass.poses, record.poses, atol=1e-9)


def test_a_scenario_may_give_courses(tmp_path: Path) -> None:
    known = boats(tmp_path).scenario.model
    one, two = known.sensors
    assert two.heading_deg == pytest.approx(90.0 + 1.41 * math.sin(math.radians(50.7)), abs=0.005)
    assert one.platform.headings_deg == (90.0, 30.0, -45.0, -180.0)
    steps = BOATS.replace("kind: heading, speed: 5.0", "kind: grid_moves, length: 9.0, speed: 5.0")
    assert boats(tmp_path, steps).scenario.model.sensors[0].platform.directions_deg == (90.0, 30.0, -45.0, -180.0)
    turns = BOATS.replace(
        "speed: 5.0, courses_deg: [0, 60, 135, 270]", "speed: 5.0, relative: true, courses_deg: [30, 0]"
    )
    assert boats(tmp_path, turns).scenario.model.sensors[0].platform.headings_deg == (-30.0, 0.0)
    camera = "{kind: camera, half_width_deg: 20.0, azimuth_deg: 0, azimuths_deg: [0, 90]}"
    text = BOATS.replace("{kind: heading, speed: 5.0, courses_deg: [0, 60, 135, 270]}", camera)
    platform = boats(tmp_path, text).scenario.model.sensors[0].platform
    assert platform.pointings_deg == (90.0, 0.0)
    assert platform.pointing_deg == pytest.approx(90.0 + 1.40 * math.sin(math.radians(50.7)), abs=0.005)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (
            "course_deg: 0}",
            "heading_deg: 0}",
            r"boats.yaml:14:64: sensors\[1\].heading_deg: expected course_deg, clockwise from true north, as bearings "
            "in this file, got heading_deg, which counts from east",
        ),
        ("origin: {lon: -1.05, lat: 50.7}", "", r"sensors\[0\].position: .* such an `origin`"),
        ("[0, 60, 135, 270]", "north", r"platform.courses_deg: expected a list, got \"?north"),
    ],
)
def test_a_file_has_one_direction_convention(tmp_path: Path, old: str, new: str, fault: str) -> None:
    with pytest.raises(ScenarioError, match=fault):
        boats(tmp_path, BOATS.replace(old, new))


def test_courses_need_a_north() -> None:
    text = (Path(str(resources.files("vedette.scenarios"))) / "builtin/paper-a.yaml").read_text("utf-8")
    with pytest.raises(ScenarioError, match=r"course_deg.*needs an `origin` or a sensor with `compass: true`"):
        parse_scenario(text.replace("heading_deg: 0.0", "course_deg: 90.0"))


def test_a_program_gets_the_scene_by_compass(tmp_path: Path) -> None:
    known = boats(tmp_path).scenario
    from vedette.scenarios.build import scene_for_program

    told = scene_for_program(known)["sensors"]
    assert [sensor["course_deg"] for sensor in told] == [60.0, 0.0]
    assert told[0]["platform"]["courses_deg"] == (0.0, 60.0, 135.0, 270.0)
    assert "heading_" not in json.dumps(told)
    assert build_planner(known, "constant") is not None


def test_figures_draw_courses_from_north() -> None:
    assert drawn_angle({"course_deg": 30.0}) == 60.0
    assert drawn_angle({"heading_deg": 30.0}) == 30.0
    assert drawn_angle({"azimuth_deg": 270.0}, "pointing_deg", "azimuth_deg") == -180.0
    assert drawn_angle({"dx": 1.0}) is None
    several = Actions(("course_deg", "speed_mps"), np.array([[0.0, 8.0], [90.0, 0.0]]))
    assert action_axis(several).labels == ("course 0°, speed 8 m/s", "course 90°, speed 0 m/s")
    assert rounded(("course_deg", "heading_deg"), np.array([359.7, 359.7])) == (
        ("course_deg", 0.0),
        ("heading_deg", 360.0),
    )


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
@pytest.mark.parametrize("origin", [FAR, Origin(179.9, -66.0)])
def test_the_page_turns_angles_as_the_library_does(origin: Origin) -> None:
    script = (resources.files("vedette.reports") / "page/scripts/3-earth.js").read_text("utf-8")
    at, angles = [origin.longitude_deg, origin.latitude_deg], np.linspace(-3.0, 3.0, 9)
    call = f"{angles.tolist()}.map((a) => azimuthOf({{origin: {at}}}, 98900, 30, a))"
    found = subprocess.run(
        ["node", "-e", f"{script}; console.log(JSON.stringify({call}))"], capture_output=True, text=True, check=True
    )
    apart = np.array(json.loads(found.stdout)) - origin.azimuth(angles, POSE)
    np.testing.assert_allclose(np.remainder(apart + math.pi, 2.0 * math.pi) - math.pi, 0.0, atol=1e-7)
    words = "minus = (x) => x; console.log(directionOf({compass: true}, 0, 0, -0.001), directionOf({}, 0, 0, -1))"
    told = subprocess.run(["node", "-e", f"{script}; {words}"], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["90", "-57"]
