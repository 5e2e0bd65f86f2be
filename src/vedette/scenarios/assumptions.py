"""Sections that a sensors file does not give, assumed from its scans, with a description of each."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import TURN_RATE, Floats
from vedette.models.heights import ASSUMED_HEIGHT
from vedette.models.turns import is_turn
from vedette.recorded import RecordedScans
from vedette.recorded.extents import place_stds
from vedette.scenarios.assumed_clutter import assumed_clutter
from vedette.scenarios.region import describe_region, measured_region
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.undetected_intensity import has_intensity
from vedette.scenarios.sensors_file import EXPECTED_BIRTHS, HEIGHT_STD, measured_birth, measures_heights

_LOST_PER_SECOND = 0.001
_SLOW = 10.0  # s between scans, from which on times may be in another unit than seconds
_BIRTH_STDS = 2.0  # times the upper quartile of the noise of measured places


def assumed_sections(
    given: Mapping[str, Any],
    model: ScenarioModel,
    recording: RecordedScans,
    folder: FilePath,
    speed: float,
    descriptions: dict[str, str],
) -> dict[str, Any]:
    """Return the sections that are not given, from the scans; adds to `descriptions` a description of each."""
    times = recording.times
    period = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    assumed: dict[str, Any] = {"time": {"num_steps": len(times), "step_period": period, "start": float(times[0])}}
    if "region" not in given:
        assumed["region"] = region = measured_region(model, recording)
        descriptions["region"] = f"{describe_region(region)} (box around all measurements and sensors)"
    if "motion" not in given:
        _check_period(period, assumed.get("region") or model.region.model_dump(), speed)
    assumed |= assumed_motion(given, speed, descriptions)
    if "birth" not in given:
        measured = [[own for own in recording.measured(s) if len(own)] for s in range(len(model.sensors))]
        assumed |= assumed_birth(model, measured, folder, speed, descriptions, learnt=has_intensity(model))
    if turns := _turns(model, recording):
        descriptions["turn"] = turns
    if recording.empty:
        descriptions["scans"] = f"{'; '.join(recording.empty)} (recording: {{empty_scans: none}}: only those with rows)"
    return assumed | assumed_clutter(given, model, recording, folder, speed, descriptions)


def _check_period(period: float, region: Mapping[str, Any], speed: float) -> None:
    """Raise `InputError` if targets could cross the region between two scans, as with times in another unit."""
    diagonal = math.hypot(region["x_max"] - region["x_min"], region["y_max"] - region["y_min"])
    if period >= _SLOW and speed * period > diagonal:
        expected = f"scans less than {diagonal / speed:.3g} s apart, in which targets of {speed:g} m/s cross the region"
        cure = "give `recording: {units: {time: ms}}` for times in milliseconds (us, ns), or a lower --max-target-speed"
        raise InputError(f"recording: expected {expected}; got {period:.6g} s (median): {cure}")


def _turns(model: ScenarioModel, recording: RecordedScans) -> str:
    """Describe the turns that were found from the rows and not given; empty if there are none."""
    texts = []
    for s, (name, sensor) in enumerate(zip(model.sensor_names, model.sensors, strict=True)):
        sensor_poses = [poses[s] for k, poses in enumerate(recording.poses) if recording.scans[k][s] is not None]
        rates = [pose[TURN_RATE] for pose in sensor_poses if is_turn(pose)]
        if sensor.turn is None and rates:
            rate = float(np.median(rates))
            direction = "clockwise" if rate < 0.0 else "counter-clockwise"
            texts.append(f"{name} once in {2.0 * np.pi / abs(rate):.4g} s, {direction}")
    return f"{'; '.join(texts)} (found from bearings and times; a scan is one turn)" if texts else ""


def assumed_motion(given: Mapping[str, Any], speed: float, descriptions: dict[str, str]) -> dict[str, Any]:
    """Return the motion and survival of targets, as far as they are not given."""
    assumed: dict[str, Any] = {}
    if "motion" not in given:
        # Held over the times between scans of several sensors, it would spread targets less with more scans.
        has_height = measures_heights(given)
        kind = "constant_velocity_height" if has_height else "constant_velocity"
        assumed["motion"] = {"kind": kind, "sigma_v": speed / 20.0}
        if not has_height:
            assumed["motion"]["noise_model"] = "continuous_white"
        descriptions["motion"] = (
            f"constant velocity{', also in height' if has_height else ''}, process noise {speed / 20.0:g} m/s^1.5 "
            f"(for speeds up to {speed:g} m/s; --max-target-speed)"
        )
    if "survival" not in given:
        assumed["survival"] = {"kind": "constant", "probability": 1.0 - _LOST_PER_SECOND, "period": 1.0}
        descriptions["survival"] = f"{1.0 - _LOST_PER_SECOND:g} per second"
    return assumed


def assumed_birth(
    model: ScenarioModel,
    measured: Sequence[Sequence[Floats]],
    folder: FilePath,
    speed: float,
    descriptions: dict[str, str],
    learnt: bool = False,
) -> dict[str, Any]:
    """Return births from measurements. measured: the scans of each sensor; learnt: True to learn their rate."""
    std = _BIRTH_STDS * _place_std(model, measured, folder)
    section = measured_birth(std, speed, model.motion.components)
    rate = f"{EXPECTED_BIRTHS:g} new targets per scan"
    if learnt:
        section["from_measurements"]["expected"] = "learnt"
        rate = "new targets at a rate learnt from the scans"
    descriptions["birth"] = f"{rate}, from measurements that no track explains (std {std:.3g} m, {speed:g} m/s)"
    return {"birth": section}


def _place_std(model: ScenarioModel, measured: Sequence[Sequence[Floats]], folder: FilePath) -> float:
    """Return the standard deviation of measured places, m: the upper quartile over all measured places."""
    region, method = model.region.build(), model.filter.gaussian_method
    stds_of_sensors = list[Floats]()
    for section, scans in zip(model.sensors, measured, strict=True):
        stds = section.build(region, method, folder, model.motion.components).noise.least_stds
        if stds is None or not scans:
            continue
        kind, scan = section.measurement.kind, np.concatenate(scans)
        place_std = place_stds(kind, stds, scan)
        if kind == "bearing_slant_range":  # the ground range depends on the height
            height = np.minimum(ASSUMED_HEIGHT, scan[:, 1] * math.sqrt(0.5))
            place_std = np.hypot(place_std, 0.5 * HEIGHT_STD * height / np.sqrt(scan[:, 1] ** 2 - height**2))
        stds_of_sensors.append(place_std)
    if not sum(map(len, stds_of_sensors)):
        raise InputError("birth: expected in the sensors file, as its sensors measure no positions; got none")
    return float(np.quantile(np.concatenate(stds_of_sensors), 0.75))
