"""Motions with other components than the built-in ones: which sensors they support, and how their states are read."""

from __future__ import annotations

import ast
import json
import re
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import vedette
from scenarios.own_models import accelerating, accelerating_at_height
from vedette import models
from vedette.cli import app
from vedette.errors import InputError, ScenarioError
from vedette.evaluation import measure_run, run_scenario
from vedette.evaluation.track_table import table_of_run
from vedette.filters import FactoredGlmbFilter, LmbFilter, MultiSensorGlmbFilter
from vedette.platforms.compass import PlaneCompass, courses_of
from vedette.scenarios import load_scenario, parse_scenario

HERE = Path(__file__).parent
FLAT = ("px", "py", "vx", "vy", "ax", "ay")
HIGH = (*FLAT, "pz")
SURVIVES = models.constant_survival(0.99)


def radar(measurement: models.MeasurementModel) -> models.SensorModel:
    stds = [0.01, 10.0, 10.0][: measurement.meas_dim]
    clutter = models.measurement_space_clutter(1.0, [-1.0] * len(stds), [1.0] * len(stds))
    return models.SensorModel(measurement, models.constant_noise(stds), models.constant_detection(0.9), clutter)


def targets(motion: models.MotionModel) -> models.TargetModel:
    return models.TargetModel(motion, SURVIVES, models.BirthModel.none(motion.state_dim))


@pytest.mark.parametrize(
    "made",
    [
        lambda model, sensor: LmbFilter(model, sensor),
        lambda model, sensor: FactoredGlmbFilter(model, sensor),
        lambda model, sensor: MultiSensorGlmbFilter(model, (sensor, sensor)),
    ],
)
def test_an_acceleration_is_not_taken_for_a_height(made) -> None:
    with pytest.raises(InputError, match=r"measurement: expected a motion with pz as component 4, .*got .*vy, ax, ay$"):
        made(targets(accelerating()), radar(models.bearing_slant_range()))
    with pytest.raises(InputError, match=r"state_components: expected names with pz, the height; got .*ax, ay"):
        models.bearing_slant_range(accelerating().components)
    made(targets(accelerating()), radar(models.bearing_range()))
    made(targets(accelerating_at_height()), radar(models.bearing_slant_range(HIGH)))


def test_a_height_behind_an_acceleration_is_measured() -> None:
    state, pose = np.array([[3000.0, 4000.0, 0.0, 0.0, 9.0, 9.0, 5000.0]]), np.zeros(3)
    for make in (models.bearing_slant_range, models.bearing_range_elevation, models.bearing_range_altitude):
        model = make(HIGH)
        assert model.measure(state, pose)[0, 1] == pytest.approx(5000.0 * np.sqrt(2.0))
        assert make().measure(state[:, [0, 1, 2, 3, 6, 5]], pose)[0, 1] == pytest.approx(5000.0 * np.sqrt(2.0))
        model.check(state, pose)
        turning = np.zeros(11)
        turning[9] = -0.5
        model.check(state + 1.0, turning)
    np.testing.assert_array_equal(models.position_altitude(HIGH).measure(state, pose), [[3000.0, 4000.0, 5000.0]])


@pytest.mark.parametrize("components", [("px", "vx", "py", "vy"), ("px", "py", "vx"), ("px", "py", "vx", "vx"), FLAT])
def test_names_that_do_not_fit_a_state_are_refused(components: tuple[str, ...]) -> None:
    still = models.constant_velocity()
    with pytest.raises(InputError, match=r"MotionModel.components: expected 4 different names, first px, py, vx, vy"):
        models.MotionModel(4, still.transition, still.process_noise_cov, np.empty(0), np.ones(1), components=components)


def test_built_in_motions_name_their_states() -> None:
    assert models.constant_velocity().components == FLAT[:4]
    assert models.coordinated_turn().components == (*FLAT[:4], "turn_rate")
    assert models.constant_velocity_height().components == (*FLAT[:4], "pz", "vz")


SCENE = """
name: air
time: {num_steps: 12, step_period: 4.0}
region: {x_min: -30000, x_max: 30000, y_min: -30000, y_max: 30000}
motion: {kind: custom, function: 'own_models.py:MOTION', components: [NAMES]}
survival: {kind: constant, probability: 0.99}
birth: {sites: [{existence: 0.1, mean: [-15000, 9000, 200, 0, 0, 0 HEIGHT], std: [500, 500, 20, 20, 0.5, 0.5 SPREAD]}]}
targets: {kind: scripted, tracks: [{state: [-15000, 9000, 200, 5, 0.2, 0.4 HEIGHT], std: [ZEROS], start_step: 1}]}
sensor_defaults:
  measurement: {kind: MEASUREMENT}
  noise: {kind: range_dependent, sigma_range: 40.0, eta_range: 0.0, sigma_bearing_deg: 0.1, sigma_altitude: 30.0}
  clutter: {kind: region, rate: 2.0}
  detection: {kind: constant, probability: 0.95}
sensors:
  - {name: ship, position: [0, -5000]}
  - {name: hill, position: [20000, 0]}
origin: {lon: 10.0, lat: 50.0}
"""


def scene(motion: str, components: tuple[str, ...], kind: str) -> str:
    """A scenario with a custom motion and one target to the east that accelerates."""
    with_height = "pz" in components
    words = {"MOTION": motion, "NAMES": ", ".join(components), "MEASUREMENT": kind}
    words |= {"HEIGHT": ", 8000" if with_height else "", "SPREAD": ", 500" if with_height else ""}
    words |= {"ZEROS": ", ".join("0" * len(components))}
    return reduce(lambda text, word: text.replace(*word), words.items(), SCENE)


def written(folder: Path, text: str) -> Path:
    """The file of a scenario, beside the models that it names."""
    (folder / "own_models.py").write_text((HERE / "own_models.py").read_text("utf-8"), "utf-8")
    (folder / "air.yaml").write_text(text, "utf-8")
    return folder / "air.yaml"


def test_a_scenario_of_heights_needs_a_motion_with_one() -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(scene("accelerating", FLAT, "bearing_range_altitude"), "air.yaml", folder=HERE)
    assert "a motion with pz" in "\n".join(error.value.faults)
    assert "px, py, vx, vy, ax, ay" in "\n".join(error.value.faults)


@pytest.mark.parametrize("motion", ["accelerating", "accelerating_at_height"])
def test_states_are_read_by_their_names(tmp_path: Path, motion: str) -> None:
    names = FLAT if motion == "accelerating" else HIGH
    kind = "bearing_range" if motion == "accelerating" else "bearing_range_altitude"
    text = scene(motion, names, kind)
    text = text.replace("origin:", "ospa: {components: position_and_height}\norigin:") if "pz" in names else text
    scenario = load_scenario(written(tmp_path, text))
    record = run_scenario(scenario, "stationary", seed=2)
    (mean,), (cov,) = record.estimates[-1].means, record.estimates[-1].covs
    ((*_,), (true,)) = record.truth.at(11)
    off = mean - true
    assert np.hypot(*off[:2]) < 150.0
    assert np.hypot(*off[2:4]) < 10.0
    assert 1.0 < off @ np.linalg.solve(cov, off) < 25.0
    table, course = table_of_run(record, scenario), courses_of(PlaneCompass(), mean[np.newaxis])[0]
    assert table["vx_mps"][-1] == mean[2]
    assert table["speed_mps"][-1] == pytest.approx(np.hypot(*mean[2:4]))
    assert table["course_deg"][-1] == pytest.approx(course[0], abs=0.5)  # of the Earth and the plane
    assert table["speed_mps"][-1] == pytest.approx(course[1])
    assert measure_run(record, scenario).nees_count[-1] == 1
    assert ("z_m" in table) == ("pz" in names)
    assert "vz_mps" not in table
    if "pz" in names:
        assert abs(off[6]) < 100.0
        assert table["z_m"][-1] == mean[6]
        assert table["std_z_m"][-1] == np.sqrt(cov[6, 6])
        assert record.ospa[-1, 0] == pytest.approx(np.linalg.norm(off[[0, 1, 6]]))


def test_the_replay_has_the_heights_of_the_motion(tmp_path: Path) -> None:
    file, out = written(tmp_path, scene("accelerating_at_height", HIGH, "bearing_range_altitude")), tmp_path / "out"
    for command in (["run", str(file), "--out", str(out)], ["report", str(out)]):
        result = CliRunner().invoke(app, command)
        assert result.exit_code == 0, result.output
    found = re.search(r'<script[^>]*id="runs"[^>]*>(.*?)</script>', (out / "report.html").read_text("utf-8"), re.DOTALL)
    assert found is not None
    run = json.loads(found.group(1))[0]
    assert run["heights"]["truth"][-1] == [8000.0]
    assert abs(run["heights"]["estimates"][-1][0][0] - 8000.0) < 100.0
    assert run["truth"][-1][0][3:] == pytest.approx([208.8, 22.6], abs=0.1)  # the velocity


# Which subscripts of these names are places of a velocity, a height, or components of a pose behind the position.
NAMES = {"state", "states", "mean", "means", "std", "stds", "cov", "covs", "moments", "pose", "poses", "pose_vector"}
# Motions, which define the states that they move.
OWN_STATES = {"models/kinematics.py", "models/manoeuvres.py", "stonesoup/motions.py"}


def bare_places(source: str) -> list[int]:
    """Lines with a number of 2 or more in a subscript of a state or a pose."""
    lines = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Subscript):
            continue
        name = node.value.attr if isinstance(node.value, ast.Attribute) else getattr(node.value, "id", "")
        constants = [leaf for leaf in ast.walk(node.slice) if isinstance(leaf, ast.Constant)]
        own = [(leaf, leaf.value) for leaf in constants if type(leaf.value) is int]
        is_range = isinstance(node.slice, ast.Slice) and [value for _, value in own] == [2, 4]
        if is_range or (name in NAMES and any(value >= 2 for leaf, value in own if leaf in flat(node.slice))):
            lines.append(node.lineno)
    return lines


def flat(index: ast.expr) -> list[ast.expr | None]:
    """The parts of an index and the lower bounds of its slices."""
    parts = index.elts if isinstance(index, ast.Tuple) else [index]
    return [part.lower if isinstance(part, ast.Slice) else part for part in parts]


def test_only_motions_know_places_as_numbers() -> None:
    root = Path(vedette.__file__).parent
    found = {file.relative_to(root).as_posix(): bare_places(file.read_text("utf-8")) for file in root.rglob("*.py")}
    assert {file for file, lines in found.items() if lines} <= OWN_STATES, {k: v for k, v in found.items() if v}


@pytest.mark.parametrize("line", ["pose[2]", "own.means[:, 2:4]", "x[2:4]", "covs[:, 4, 4]", "state[4] + at"])
def test_a_bare_place_is_found(line: str) -> None:
    assert bare_places(line) == [1]
    assert bare_places("means[:, :2] + states[i, 0] + pose[:3] + row[4]") == []
