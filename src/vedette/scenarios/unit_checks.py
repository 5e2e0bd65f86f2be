"""Warnings of valid but implausible settings: wrong units, exchanged numbers, squared standard deviations."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from vedette.internal.unit_warnings import LARGE_ANGLE, look_like_degrees
from vedette.kernels.base.types import Floats
from vedette.scenarios.diagnostics import Path, format_path
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.birth import BirthSite
from vedette.scenarios.sections.sensing import Measurement, Noise, components
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.targets import ScriptedTargets
from vedette.scenarios.sections.world import RegionSection, grouped_order

# Filters never find a target that begins this number of standard deviations or more from every birth site.
_MAX_SITE_DISTANCE = 8.0
# Largest plausible biases, by field; degrees, s.
_MAX_BIAS = {"bearing_deg": 90.0, "clock": 3600.0}
# Scans in a period of the horizon; the paper's scenarios have 2.
_MAX_PERIOD_SCANS = 3.0


def implausible_settings(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield places in the scenario and texts with the expected and the given value and the probable mistake."""
    yield from _bearings(model)
    yield from _biases(model)
    yield from _areas(model)
    yield from _beyond_sites(model)
    yield from _probabilities_per_step(model)
    yield from _held_acceleration(model)


def _bearings(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of noise so large that bearings carry little information."""
    reported: list[Noise] = []  # noise that sensors share is reported once
    for path, sensor, noise in _assumed_and_true(model, "noise"):
        if noise not in reported:
            reported.append(noise)
            yield from _bearing_noise(path, sensor.measurement, noise)


def _biases(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of implausibly large biases."""
    for path, _, bias in _assumed_and_true(model, "bias"):
        for name, largest in _MAX_BIAS.items():
            if abs(value := getattr(bias, name)) > largest:
                field = format_path((*path, name))
                yield (*path, name), f"{field}: expected at most {largest:g} either way; got {value:g}"


def _assumed_and_true(model: ScenarioModel, name: str) -> Iterator[tuple[Path, Sensor, Any]]:
    """Yield a section of each sensor, and of its true parameters if they give it, with its path and the sensor."""
    for s, sensor in enumerate(model.sensors):
        yield ("sensors", s, name), sensor, getattr(sensor, name)
        if (true := getattr(sensor.true_parameters, name, None)) is not None:
            yield ("sensors", s, "true_parameters", name), sensor, true


def _bearing_noise(path: Path, measurement: Measurement, noise: Noise) -> Iterator[tuple[Path, str]]:
    for component in components(measurement)[1]:
        if noise.kind == "range_dependent":
            std, field_path = math.radians(noise.sigma_bearing_deg), (*path, "sigma_bearing_deg")
            if std > LARGE_ANGLE:
                yield field_path, f"{format_path(field_path)}: {_degrees(std)} leave little of a bearing"
        elif noise.kind == "constant" and noise.std[component] > LARGE_ANGLE:
            std, field_path = noise.std[component], (*path, "std", component)
            hint = "are the numbers exchanged" if min(noise.std) < std else "is it in degrees"
            yield (
                field_path,
                f"{format_path(field_path)}: expected radians of a bearing; got {std:g}, {_degrees(std)} ({hint}?)",
            )


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.0f} degrees"


def _areas(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of areas that are too small and too far away to be in metres."""
    for path, corners in _corners(model):
        if look_like_degrees(corners):
            width, height = np.ptp(corners, axis=0)
            got = f"an area of {width:.3g} by {height:.3g} m"
            yield path, f"{format_path(path)}: expected metres from the origin; got {got} (are these degrees?)"


def _corners(model: ScenarioModel) -> Iterator[tuple[Path, Floats]]:
    regions: list[tuple[Path, Any]] = [(("region",), model.region)]
    if model.undetected is not None:
        regions.append((("undetected", "region"), model.undetected.region))
    for i, constraint in enumerate(model.control.constraints):
        path: Path = ("control", "constraints", i)
        if constraint.kind in ("stay_inside", "keep_out"):
            regions.append(((*path, "region"), constraint.region))
        if constraint.kind == "keep_out" and constraint.polygon is not None:
            yield (*path, "polygon"), np.array(constraint.polygon)
    for path, region in regions:
        if isinstance(region, RegionSection):
            yield path, np.array([[region.x_min, region.y_min], [region.x_max, region.y_max]])


def _beyond_sites(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of targets that begin far from all birth sites."""
    targets, birth = model.targets, model.birth
    if not isinstance(targets, ScriptedTargets) or birth.from_measurements is not None or not birth.sites:
        return
    order = grouped_order(model.motion)[:2]
    for i, track in enumerate(targets.tracks):
        start = np.array(track.state)[order]
        distances = [_distance(start, site, order) for site in birth.sites]
        nearest = int(np.argmin(distances))
        if distances[nearest] > _MAX_SITE_DISTANCE:
            path: Path = ("targets", "tracks", i, "state")
            finding = f"begins {distances[nearest]:.0f} standard deviations from the nearest birth site"
            hint = f" (are standard deviations in birth.sites[{nearest}].cov?)"
            text = f"{format_path(path)}: {finding}, and is hardly found"
            yield path, text + (hint if birth.sites[nearest].cov is not None else "")


def _distance(start: Floats, site: BirthSite, order: list[int]) -> float:
    """Distance of a position from a site, in its standard deviations."""
    difference = start - np.array(site.mean)[order]
    return math.sqrt(float(difference @ np.linalg.solve(site.covariance()[np.ix_(order, order)], difference)))


def _probabilities_per_step(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of probabilities per step if a sensor does not scan at every step: they apply at every step."""
    interval, name = max(
        (sensor.scans.steps(model.time.step_period)[0], name)
        for sensor, name in zip(model.sensors, model.sensor_names, strict=True)
    )
    survival, per_scan = model.survival, []
    if model.birth.period is None and model.birth.steps == "every":
        per_scan.append("birth")
    if survival.kind == "constant" and survival.period is None and survival.probability < 1.0:
        per_scan.append("survival")
    for section in per_scan if interval > 1 else ():
        yield (
            (section,),
            f"its probabilities are those of a step of {model.time.step_period:g} s, and count {interval} times from "
            f"one scan of {name} to the next; say with {section}.period for what stretch of time they are meant",
        )


def _held_acceleration(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield warnings of accelerations that are held over steps of varying length: shorter steps spread targets less."""
    motion, scans = model.motion, model.horizon[1] / model.time.step_period
    if getattr(motion, "noise_model", "continuous_white") != "discrete_white" or not getattr(motion, "sigma_v", 0.0):
        return
    with_late_scans = [
        name for name, sensor in zip(model.sensor_names, model.sensors, strict=True) if sensor.scans.late
    ]
    if model.recording is not None or with_late_scans:
        reason = f"{with_late_scans[0]} has late scans" if with_late_scans else "scans are recorded"
        yield (
            ("motion", "noise_model"),
            f"it is held from one scan to the next of any sensor, and {reason}: targets spread the less the more scans "
            "there are in between, and clocks cannot be found; say continuous",
        )
    if model.decision_steps and scans >= _MAX_PERIOD_SCANS:
        yield (
            ("control", "horizon_period"),
            f"pseudo-updates are {scans:.3g} scans apart: motion.sigma_v is held over each such step, so that plans "
            "take targets to spread farther than tracking does; leave it and control.horizon_steps out, and plans go "
            "scan by scan to the next decision",
        )
