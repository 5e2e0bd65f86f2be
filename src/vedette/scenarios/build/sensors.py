"""The sensors of a scenario: their filters and platforms, where they start and when they scan."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vedette.control import MobileSensor
from vedette.filters import Filter, PredictUpdateFilter
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import OWN_VELOCITY, VISITS, Bools, Floats
from vedette.models import MotionModel, SensorModel, TargetModel
from vedette.models.correlation import discounted
from vedette.models.modes import hiding_modes
from vedette.platforms import Actions, ByCompass, Operated, Patrolling, Platform
from vedette.platforms.base import SWITCH, actions_at
from vedette.platforms.wrapper import PlatformWrapper, WithVelocity
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.custom import Custom, MissingMember
from vedette.scenarios.sections.deciding import Lookahead
from vedette.scenarios.sections.platforms import CustomPlatform
from vedette.scenarios.sections.scenario import ScenarioModel
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.tracking import CustomFilter
from vedette.scenarios.sections.undetected_intensity import undetected_anywhere
from vedette.simulation.true_sensors import TrueSensor


def build_sensors(scenario: Scenario) -> tuple[MobileSensor, ...]:
    """Return the sensors as planners control them, each with its filter; the filters share the models of the targets.

    Raises:
        InputError: a custom model that cannot be loaded, or parts that do not fit together.
    """
    model, folder = scenario.model, scenario.folder
    birth = model.birth.build(model.motion, model.region)
    targets = TargetModel(
        build_motion(scenario)[0],
        model.survival.build(folder),
        replace(birth, anywhere=undetected_anywhere(model, birth), class_probs=model.class_probs),
    )
    sensors = []
    for sensor, built in zip(model.sensors, build_sensor_models(scenario), strict=True):
        assumed, lasts = built, sensor.correlation
        if lasts.noise_s > 0.0:
            interval = lasts.interval(sensor.scans, None if model.recording else model.time.step_period)
            assumed = discounted(built, interval, lasts.noise_s)
        local = model.filter.build(targets, assumed, folder)
        _check_custom_parts(scenario, sensor, assumed, local)
        sensors.append(MobileSensor(local, _platform(model, sensor, folder), _scan_times(model, sensor)))
    return tuple(sensors)


def _platform(model: ScenarioModel, sensor: Sensor, folder: Path) -> Platform:
    """Return the platform of a sensor with prices and switch; its actions are courses with an origin or a compass."""
    section, price = sensor.platform, sensor.price
    platform: Platform = section.build(folder)
    if model.by_compass and platform.columns:
        platform = ByCompass(platform, model.north())
    if sensor.needs_velocity and platform.columns and len(section.components()) + 3 <= OWN_VELOCITY:
        platform = WithVelocity(platform)
    if isinstance(section, CustomPlatform) and isinstance(price, str) and price not in platform.columns:
        wanted = f"{section.function} to have a column {price}, as its price"
        raise MissingMember(section, "function", wanted, ", ".join(platform.columns) or "no columns")
    if isinstance(section, CustomPlatform) and sensor.switchable and SWITCH in platform.columns:
        wanted = f"{section.function} to have no column {SWITCH}, as the sensor is switchable"
        raise MissingMember(section, "function", wanted, ", ".join(platform.columns))
    visits = model.control.revisit()
    if visits is not None and section.top_speed > 0.0:
        platform = Patrolling(platform, visits.places, visits.radius)
    if price is None and sensor.budget is None and not sensor.switchable:
        return platform
    if sensor.budget is None:
        return Operated(platform, price, sensor.switchable)
    return Operated(platform, price, sensor.switchable, sensor.budget.seconds, sensor.budget.refill)


def _scan_times(model: ScenarioModel, sensor: Sensor) -> Floats | None:
    """Return the times of a sensor's scans, s, to the end of the last horizon; None if it scans at every step."""
    if sensor.scans.steps(model.time.step_period)[0] == 1:
        return None
    lookahead, horizon = model.control.lookahead or Lookahead(), math.prod(model.horizon)
    seconds_ahead = horizon + (lookahead.depth - 1) * (lookahead.period or horizon)
    num = model.time.num_steps + math.ceil(seconds_ahead / model.time.step_period)
    time = model.time.model_copy(update={"num_steps": num})
    times: Floats = time.build()[sensor.scans.build(time)]
    return times


def _check_custom_parts(scenario: Scenario, section: Sensor, sensor: SensorModel, local: Filter) -> None:
    """Raise `MissingMember` if a custom measurement or filter lacks a method or attribute that the scenario needs."""
    model, measured = scenario.model, section.measurement
    has_measured_births = model.birth.from_measurements is not None
    if has_measured_births and sensor.measurement.places is None and isinstance(measured, Custom):
        expected = f"{measured.function} to give a measurement with `places`, as targets are born of measurements"
        raise MissingMember(measured, "function", expected, "one without")
    may_skip_scans = (
        section.scans.scan_loss_probability or section.scans.late or not section.scans.build(model.time).all()
    )
    may_skip_scans = may_skip_scans or section.switchable or (model.network is not None and model.network.delay)
    if (
        isinstance(model.filter, CustomFilter)
        and (has_measured_births or may_skip_scans)
        and not isinstance(local, PredictUpdateFilter)
    ):
        reason = "targets are born of measurements" if has_measured_births else "it must predict without a scan"
        expected = f"{model.filter.function} to give a PredictUpdateFilter, with predict() and update(), as {reason}"
        raise MissingMember(model.filter, "function", expected, f"a {type(local).__name__}")


def build_motion(scenario: Scenario) -> tuple[MotionModel, dict[str, Floats]]:
    """Return the motion for filters, with modes if targets hide from sensors, and these sensors' factors by name."""
    model = scenario.model
    motion = model.motion.build(scenario.folder, method=model.filter.gaussian_method)
    pairs = zip(model.sensor_names, model.sensors, strict=True)
    stays = {name: own for name, sensor in pairs if (own := sensor.correlation.stays_s) is not None}
    return hiding_modes(motion, stays) if stays else (motion, {})


def build_sensor_models(scenario: Scenario) -> tuple[SensorModel, ...]:
    """Return the models of the sensors as the scenario gives them, whose errors may last.

    Raises `InputError` for a custom model that cannot be loaded, or parts that do not fit together.
    """
    model, factors = scenario.model, dict[str, Floats]()
    if any(section.correlation.stays_s for section in model.sensors):
        factors = build_motion(scenario)[1]
    given = model.region.build(), model.filter.gaussian_method, scenario.folder, model.motion.components
    built = [section.build(*given, model.filter.detection_at) for section in model.sensors]
    with suppress_unit_warnings():
        return tuple(
            replace(each, mode_factors=factors[name]) if name in factors else each
            for name, each in zip(model.sensor_names, built, strict=True)
        )


def build_true_sensors(scenario: Scenario) -> tuple[TrueSensor, ...]:
    """Return the true sensors; raises like `build_sensor_models`."""
    model = scenario.model
    given = model.region.build(), scenario.folder, model.motion.components
    pairs = zip(model.sensors, build_sensor_models(scenario), strict=True)
    return tuple(section.build_true(known, *given) for section, known in pairs)


def scan_loss_probabilities(scenario: Scenario) -> tuple[float, ...]:
    """Return the probability of each sensor that a scan does not take place; () if all are 0."""
    probabilities = tuple(sensor.scans.scan_loss_probability or 0.0 for sensor in scenario.model.sensors)
    return probabilities if any(probabilities) else ()


def build_scan_times(scenario: Scenario) -> Bools:
    """Return True for each sensor and step with a scan, shape (num_sensors, num_steps)."""
    model = scenario.model
    return np.array([sensor.scans.build(model.time) for sensor in model.sensors])


def build_poses(scenario: Scenario) -> Floats:
    """Return the poses at the start, (num_sensors, pose_dim), padded with zeros to the longest."""
    sensors, visits = scenario.model.sensors, scenario.model.control.revisit()
    poses = [sensor.pose if scenario.model.recording else sensor.turning_pose for sensor in sensors]
    longest = max(map(len, poses)) if visits is None else VISITS
    padded = np.array([(*pose, *(0.0,) * (longest - len(pose))) for pose in poses])
    if visits is None:
        return padded
    patrols = [[0.0 if sensor.platform.top_speed > 0.0 else -1.0] * len(visits.places) for sensor in sensors]
    return np.hstack([padded, patrols])


def first_actions(scenario: Scenario, sensors: tuple[MobileSensor, ...]) -> tuple[Actions, ...]:
    """Return the action of each sensor before any decision: its course at the start, or the first of its actions."""
    result = []
    places = zip(scenario.model.sensors, sensors, build_poses(scenario), strict=True)
    for s, (section, sensor, pose) in enumerate(places):
        row = section.platform.first_action(section.heading_deg)
        actions = actions_at(f"sensors[{s}].platform", sensor.platform, pose)
        rows = actions.values[:1] if row is None else np.array([row])
        platform: Any = sensor.platform
        while isinstance(platform, PlatformWrapper):
            platform = platform.platform
        if row is not None and isinstance(platform, ByCompass):
            rows = platform.converted(rows, pose, fixed=False)
        if row is not None and isinstance(sensor.platform, Operated):
            rows = sensor.platform.switched_on_and_off(rows)[:1]
        result.append(Actions(actions.columns, rows))
    return tuple(result)
