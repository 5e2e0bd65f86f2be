"""What can hardly be meant is said: in the check of a scenario with its place, and of objects made in Python."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette import models
from vedette.cli import app
from vedette.control import JointPlanner, KeepOut, MobileSensor, StayInside
from vedette.errors import ImplausibleWarning, InputError, ScenarioError
from vedette.filters import LmbFilter, PhdFilter, SequentialLmbFilter
from vedette.fusion import Clmb
from vedette.platforms import HeadingPlatform, Pointing
from vedette.scenarios import Scenario, list_builtin, load_scenario, parse_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.unit_checks import implausible_settings
from vedette.tracking import State

BEARING, NOISE = "std: [0.02, 3.0]", "noise: {kind: constant, std: [0.02, 3.0]}"
SPREAD = "std: [5.0, 5.0, 2.0, 2.0]"
CONTROL = "{decision_steps: [4, 8]}"


def zone(area: str) -> tuple[str, str]:
    return CONTROL, f"{{decision_steps: [4, 8], constraints: [{{kind: keep_out, {area}}}]}}"


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        (
            BEARING,
            "std: [5.0, 0.02]",
            ".std[0]: expected a bearing's standard deviation in radians, up to pi (exchanged?)",
        ),
        (
            BEARING,
            "std: [5.0, 9.0]",
            ".std[0]: expected a bearing's standard deviation in radians, up to pi (in degrees?)",
        ),
        (NOISE, "noise: {kind: range_dependent, sigma_bearing_deg: 200}", "in degrees, up to 180, got 200"),
    ],
)
def test_impossible_bearing_noise_is_an_error(old: str, new: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed((old, new)), "f.yaml")
    (fault,) = error.value.faults
    assert fault.startswith("f.yaml:15:"), fault
    assert wanted in fault


@pytest.mark.parametrize(
    ("changes", "place", "wanted"),
    [
        (
            ((BEARING, "std: [2.0, 0.02]"),),
            "15:33",
            "sensors[0].noise.std[0]: expected radians of a bearing; got 2, 115 degrees (are the numbers exchanged?)",
        ),
        (
            ((BEARING, "std: [1.0, 5.0]"),),
            "15:33",
            "sensors[0].noise.std[0]: expected radians of a bearing; got 1, 57 degrees (is it in degrees?)",
        ),
        (
            ((NOISE, "noise: {kind: range_dependent, sigma_bearing_deg: 57.3}"),),
            "15:53",
            "sensors[0].noise.sigma_bearing_deg: 57 degrees leave little of a bearing",
        ),
        (
            ((NOISE, f"{NOISE}\n  bias: {{clock: 5000.0}}"),),
            "16:17",
            "sensors[0].bias.clock: expected at most 3600 either way; got 5000",
        ),
        (
            (zone("polygon: [[-1.10, 50.78], [-1.08, 50.78], [-1.08, 50.80]]"),),
            "22:75",
            "control.constraints[0].polygon: expected metres from the origin; got an area of 0.02 by 0.02 m (are these "
            "degrees?)",
        ),
        (
            (zone("region: {x_min: -1.10, x_max: -1.08, y_min: 50.78, y_max: 50.80}"),),
            "22:74",
            "control.constraints[0].region: expected metres from the origin",
        ),
        (
            ((SPREAD, "cov: [[9, 0, 0, 0], [0, 9, 0, 0], [0, 0, 4, 0], [0, 0, 0, 4]]"), ("[1.0, 2.0,", "[40.0, 2.0,")),
            "13:15",
            "targets.tracks[0].state: begins 13 standard deviations from the nearest birth site, and is hardly found "
            "(are standard deviations in birth.sites[0].cov?)",
        ),
        (
            (("[1.0, 2.0,", "[90.0, 2.0,"),),
            "13:15",
            "begins 18 standard deviations from the nearest birth site, and is hardly found",
        ),
    ],
)
def test_implausible_values_are_reported_by_check(
    changes: tuple[tuple[str, str], ...], place: str, wanted: str, tmp_path: Path
) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text(changed(*changes))
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0
    (line,) = {line.split("scenario.yaml:")[1] for line in result.stderr.splitlines() if wanted in line}
    assert line.startswith(f"{place}: warning: "), line


def test_a_scenario_with_warnings_is_built_and_run() -> None:
    text = changed((BEARING, "std: [2.0, 0.02]"), zone("polygon: [[-1.1, 50.78], [-1.08, 50.78], [-1.08, 50.8]]"))
    scenario = Scenario(parse_scenario(text))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build_experiment(scenario)
        build_planner(scenario, "random")
    assert len(list(implausible_settings(scenario.model))) == 2


@pytest.mark.parametrize("name", list_builtin())
def test_built_in_scenarios_have_no_implausible_values(name: str) -> None:
    scenario = load_scenario(name)
    assert list(implausible_settings(scenario.model)) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build_experiment(scenario)
        models.Region(*scenario.model.region.build().bounds)


def sensor(noise: models.NoiseModel, measurement: models.MeasurementModel | None = None) -> models.SensorModel:
    measured = models.bearing_range() if measurement is None else measurement
    kind = "bearing_range" if measured.meas_dim == 2 else "range_only"
    clutter = models.region_clutter(2.0, models.Region(-100.0, 100.0, -100.0, 100.0), kind)
    return models.SensorModel(measured, noise, models.constant_detection(0.9), clutter)


def targets() -> models.TargetModel:
    birth = models.BirthModel([0.1], [[10.0, 20.0, 0.0, 0.0]], [np.eye(4)])  # type: ignore[arg-type]
    return models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.98), birth)


GOOD = models.constant_noise([0.02, 3.0])


@pytest.mark.parametrize(
    "noise",
    [models.constant_noise([5.0, 0.02]), models.range_dependent_noise(10.0, 0.0, 5.0)],
    ids=["constant", "grows"],
)
def test_a_bearing_with_noise_beyond_pi_is_refused(noise: models.NoiseModel) -> None:
    wanted = (
        r"SensorModel.noise: expected .* an angle, in radians, up to pi; got 5 \(is it in degrees, or are components"
    )
    with pytest.raises(InputError, match=wanted):
        sensor(noise)


def test_a_bearing_with_much_noise_warns() -> None:
    with pytest.warns(
        ImplausibleWarning, match=r"SensorModel.noise: expected .* component 0, an angle, in radians; got 2 \("
    ):
        sensor(models.constant_noise([2.0, 0.02]))


@pytest.mark.parametrize("heading", [90.0, -135.0, 45.0])
def test_a_heading_in_degrees_warns(heading: float) -> None:
    pose = np.array([0.0, 0.0, heading])
    lmb, phd = LmbFilter(targets(), sensor(GOOD)), PhdFilter(targets(), sensor(GOOD))
    central = SequentialLmbFilter(targets(), (sensor(GOOD),))
    mobile = MobileSensor(lmb, HeadingPlatform(5.0, [0.0, 90.0]))
    state, rng = State((lmb.initial(),), lmb.initial(), 1, 1.0), np.random.default_rng(1)
    calls: list[Callable[[], Any]] = [
        lambda: lmb.step(lmb.initial(), np.empty((0, 2)), pose, 1.0, 1, rng=rng),
        lambda: phd.step(phd.initial(), np.empty((0, 2)), pose, 1.0, 1, rng=rng),
        lambda: central.step(central.initial(), [np.empty((0, 2))], pose[np.newaxis], 1.0, 1, rng=rng),
        lambda: JointPlanner((mobile,), Clmb((1.0,))).plan(state, pose[np.newaxis], rng=rng),
        lambda: models.bearing_range().measure(np.zeros(4), pose),
    ]
    for call in calls:
        with pytest.warns(ImplausibleWarning, match=rf"expected a heading in radians; got {heading:g}, .* degrees are"):
            call()


@pytest.mark.parametrize("heading", [0.0, 3.0, -6.0, 20.0 * math.pi, 1e3 * 0.371 + 0.2, 90.5, 9.0, 1e4])
def test_accumulated_headings_do_not_warn(heading: float) -> None:
    models.bearing_range().measure(np.zeros(4), np.array([0.0, 0.0, heading]))


@pytest.mark.parametrize("half_width", [45.0, 3.2])
def test_a_camera_in_degrees_is_refused(half_width: float) -> None:
    with pytest.raises(
        InputError, match=r"reference_half_width_rad: expected an angle in radians, .*\(is it in degrees"
    ):
        models.camera(0.9, 100.0, half_width)
    pose = np.array([0.0, 0.0, 0.0, 0.5, half_width])
    with pytest.raises(InputError, match=r"pose: expected half_width_rad in \(0, pi\]; got .* \(is it in degrees"):
        Pointing([0.0]).actions(pose)


@pytest.mark.parametrize("kind", [LmbFilter, PhdFilter])
def test_a_negative_range_warns_unless_noise_explains_it(kind: Any) -> None:
    for made, scan in (
        (kind(targets(), sensor(GOOD)), [[0.1, -300.0]]),
        (kind(targets(), sensor(models.constant_noise([3.0]), models.range_only())), [[-300.0]]),
    ):
        arguments: dict[str, Any] = {"pose": np.zeros(3), "dt": 1.0, "step": 1, "rng": np.random.default_rng(1)}
        with pytest.warns(ImplausibleWarning, match="scan: expected at least 0, but for noise; got -300 in row 0"):
            made.step(made.initial(), scan, **arguments)
        made.step(made.initial(), np.array(scan) / 30.0, **arguments)


def test_areas_in_degrees_warn() -> None:
    corners = np.array([[-1.10, 50.78], [-1.08, 50.78], [-1.08, 50.80]])
    wanted = r"expected metres from the origin; got an area of 0.02 by 0.02 m at \(-1.1, 50.78\) \(are these longitudes"
    with pytest.warns(ImplausibleWarning, match=f"area: {wanted}"):
        KeepOut(corners)
    with pytest.warns(ImplausibleWarning, match=f"Region: {wanted}"):
        StayInside(models.Region(-1.10, -1.08, 50.78, 50.80))


@pytest.mark.parametrize("scale", [1.0, 100.0, 1e6])
def test_areas_in_metres_do_not_warn(scale: float) -> None:
    KeepOut(scale * np.array([[4.0, 3.0], [5.0, 3.0], [5.0, 4.0]]))
    KeepOut(scale * np.array([[0.0, 0.0], [0.02, 0.0], [0.02, 0.02]]))


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"control.horizon_period": 3.0}, True),
        ({"control.horizon_period": 2.0}, False),
        ({"control.horizon_period": 3.0, "control.decision_steps": []}, False),
        (
            {"control.horizon_period": 3.0, "motion": {"kind": "constant_velocity", "noise_model": "continuous_white"}},
            False,
        ),
        ({"control.horizon_period": 3.0, "motion": {"kind": "constant_velocity", "sigma_v": 0.0}}, False),
        ({"time.step_period": 0.1}, False),  # the horizon goes scan by scan
    ],
)
def test_pseudo_updates_far_apart_warn(fields: dict[str, Any], told: bool) -> None:
    scenario = replace_fields(Scenario(parse_scenario(MINIMAL)), {"time.step_period": 1.0} | fields)
    assert [path for path, _ in implausible_settings(scenario.model)] == [("control", "horizon_period")] * told
