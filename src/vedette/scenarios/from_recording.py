"""Scenarios of recorded or future scans: a sensors file, completed from the scans."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.recorded import Conventions, RecordedScans
from vedette.scenarios.assumptions import assumed_birth, assumed_motion, assumed_sections
from vedette.scenarios.loading import Scenario
from vedette.scenarios.recorded_data import recorded_scans
from vedette.scenarios.region import describe_region, reached_region
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sensors_file import MAX_STEPS, placeholder_sections, read_sensors_file, validated_model

_MAX_HORIZON_STEPS = 100  # steps of a horizon


class RecordingScenario(NamedTuple):
    """A scenario of a recording."""

    scenario: Scenario  # that a run tracks
    recording: RecordedScans  # its scans
    assumed: Mapping[str, str]  # a description of each section that the sensors file does not give, by its name


def scenario_from_recording(
    sensors: FilePath,
    scans: FilePath,
    truth: FilePath | None = None,
    *,
    speed: float = 10.0,
    bad_rows: str = "refuse",
    text: str | None = None,
    partial_truth: bool = False,
) -> RecordingScenario:
    """Return the scenario of recorded scans.

    Args:
        sensors: a YAML file with `sensors`, and any other known section of a scenario: `origin`, `recording` (columns,
            units, conventions), `motion`, `survival`, `birth`, `filter`, `fusion`, ...; of `control` the constraints.
        scans: the CSV or Parquet file of the scans.
        truth: the file of the targets' own reports; None: as in the sensors file, or unknown.
        speed: m/s that targets hardly exceed; motion and births are derived from it unless they are given.
        bad_rows: "refuse" or "skip", see `vedette.recorded.Conventions`.
        text: contents of the sensors file; None: those on disk.
        partial_truth: True if the reports cover only some targets (`ospa.truth`).

    Raises:
        InputError: a file that does not exist, or rows that cannot be read.
        ScenarioError: with every fault of the sensors file.
    """
    for file, content in ((scans, "scans"), (truth, "the targets' reports")):
        if file is not None and (file.is_dir() or not file.exists()):
            raise InputError(f"{file}: {'a folder' if file.is_dir() else 'no such file'}; expected a file of {content}")
    document = read_sensors_file(sensors, text)
    given = {key: value for key, value in document.data.items() if key not in ("control", "planners", "time")}
    control, section = document.data.get("control"), given.get("recording")
    if isinstance(control, Mapping) and "constraints" in control:  # zones are drawn
        given["control"] = {"constraints": control["constraints"]}
    given.setdefault("name", scans.stem)
    given["recording"] = {
        **(section if isinstance(section, Mapping) else {}),
        "path": str(scans.resolve()),
        "bad_rows": bad_rows,
    }
    if truth is not None:
        section = given.get("targets")
        targets = section if isinstance(section, Mapping) and section.get("kind", "recorded") == "recorded" else {}
        given["targets"] = {**targets, "kind": "recorded", "path": str(truth.resolve())}
    elif not _are_recorded(given.get("targets")):
        given["targets"] = {"kind": "unknown"}
    if partial_truth:
        score = given.get("ospa")
        given["ospa"] = {**(score if isinstance(score, Mapping) else {}), "truth": "partial"}
    provisional = {**placeholder_sections(given, speed), **given}
    provisional["targets"] = {"kind": "unknown"}
    model = validated_model(document, provisional, sensors)
    recording = recorded_scans(model, sensors.parent)
    given["sensors"] = _with_intervals(given, model, recording)
    descriptions = dict[str, str]()
    assumed = assumed_sections(given, model, recording, sensors.parent, speed, descriptions)
    section = given["targets"]
    if _are_recorded(section) and "time_origin" not in section:
        assumed["targets"] = {**section, "time_origin": recording.start}
    return RecordingScenario(
        Scenario(validated_model(document, {**given, **assumed}, sensors), sensors), recording, descriptions
    )


def _with_intervals(given: Mapping[str, Any], model: ScenarioModel, recording: RecordedScans) -> Any:
    """Return the section `sensors` with the median time between scans where errors last and none is given."""
    sections = list(given["sensors"])
    for s, (section, sensor) in enumerate(zip(sections, model.sensors, strict=True)):
        times = recording.times[[instant[s] is not None for instant in recording.scans]]
        if sensor.correlation.noise_s > 0.0 and sensor.correlation.interval_s is None and len(times) > 1:
            own = sensor.correlation.model_dump() | {"interval_s": float(np.median(np.diff(times)))}
            sections[s] = {**section, "correlation": own}
    return sections


class LiveScenario(NamedTuple):
    """A scenario of future scans."""

    scenario: Scenario  # by which a loop takes scans
    conventions: Conventions  # of the scans
    assumed: Mapping[str, str]  # see `RecordingScenario`


def scenario_from_sensors(
    sensors: FilePath, *, speed: float = 10.0, decide_every: float | None = None, plan_within: float | None = None
) -> LiveScenario:
    """Return the scenario of future scans.

    Args:
        sensors: a YAML file as in `scenario_from_recording`, or a whole scenario. Only the units and bearings of
            `recording` are used, and `targets` is ignored. Without `region`, the region covers the sensors' ranges.
        speed: m/s that targets hardly exceed.
        decide_every: s from one decision to the next, in place of the times in `control`; the horizon has the same
            length, unless `control` gives another.
        plan_within: s after which the search of a decision ends, in place of `control.max_seconds`.

    Raises:
        InputError: a file that does not exist, invalid units or bearings, or no region if a sensor gives no range.
        ScenarioError: with every fault of the file.
    """
    document = read_sensors_file(sensors)
    given = {key: value for key, value in document.data.items() if key not in ("recording", "targets")}
    recording = document.data.get("recording")
    recording = recording if isinstance(recording, Mapping) else {}
    conventions = Conventions({}, recording.get("units") or {}, recording.get("bearings"))
    if conventions.bearings == "north":  # answers count from north, too; units keep their default
        conventions = replace(conventions, units={"bearing": "rad", **conventions.units})
        given["sensors"] = _with_compass(given)
    descriptions = dict[str, str]()
    completed = {
        **placeholder_sections(given, speed),
        "name": sensors.stem,
        **given,
        "targets": {"kind": "scripted", "tracks": []},
    }
    completed |= assumed_motion(given, speed, descriptions)
    if decide_every is not None:
        completed |= _unlimited_time(completed, decide_every)
    if plan_within is not None:
        completed["control"] = {**(completed.get("control") or {}), "max_seconds": plan_within}
    model = validated_model(document, completed, sensors)
    for sensor in model.sensors:
        if sensor.correlation.noise_s > 0.0:
            sensor.correlation.interval(sensor.scans, None)
    if "region" not in given:
        completed["region"] = region = reached_region(model, sensors)
        descriptions["region"] = f"{describe_region(region)} (as far as the sensors see from their first positions)"
        model = validated_model(document, completed, sensors)
    if "birth" not in given:
        side = max(model.region.x_max - model.region.x_min, model.region.y_max - model.region.y_min)
        measured = [[np.array([[0.0, side / 4.0]])]] * len(model.sensors)
        model = validated_model(
            document, {**completed, **assumed_birth(model, measured, sensors.parent, speed, descriptions)}, sensors
        )
    return LiveScenario(Scenario(model, sensors), conventions, descriptions)


def _with_compass(given: Mapping[str, Any]) -> Any:
    """Return the sensors, with a compass for those that do not set `compass`, except for custom measurements."""
    defaults, sensors = given.get("sensor_defaults"), given.get("sensors")
    shared = defaults if isinstance(defaults, Mapping) else {}
    if "compass" in shared or not isinstance(sensors, list):
        return sensors
    result = []
    for sensor in sensors:
        measurement = sensor.get("measurement", shared.get("measurement")) if isinstance(sensor, Mapping) else None
        is_custom = isinstance(measurement, Mapping) and measurement.get("kind") == "custom"
        result.append({"compass": True, **sensor} if isinstance(sensor, Mapping) and not is_custom else sensor)
    return result


def _unlimited_time(given: Mapping[str, Any], decide_every: float) -> dict[str, Any]:
    """Return time and control of a scenario that decides as long as scans come."""
    time = given["time"] if isinstance(given["time"], Mapping) else {}
    section = given.get("control")
    control = {key: value for key, value in section.items() if not key.startswith("decision_")} if section else {}
    period = control.get("horizon_period") or time.get("step_period", 1.0)
    if "horizon_steps" not in control and isinstance(period, int | float) and period > 0.0:
        control["horizon_steps"] = round(min(max(decide_every / period, 1.0), _MAX_HORIZON_STEPS))
    return {"time": {**time, "num_steps": MAX_STEPS}, "control": control}


def _are_recorded(targets: Any) -> bool:
    return isinstance(targets, Mapping) and targets.get("kind") == "recorded"
