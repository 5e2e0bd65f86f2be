"""Scenarios of recorded or future scans: a sensors file, completed from the scans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.recorded import Conventions, RecordedScans
from vedette.scenarios.assumptions import assumed_birth, assumed_motion, assumed_sections
from vedette.scenarios.extents import reached_region, region_in_words
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sensors_file import (
    ENDLESS,
    model_of_sensors,
    read_sensors_file,
    stand_ins,
)

_MOST_STEPS = 100  # steps of a horizon


class OfRecording(NamedTuple):
    """A scenario of a recording.

    scenario: that a run tracks. recording: its scans. assumed: a description of each section that the sensors file does
    not give, by its name.
    """

    scenario: Scenario
    recording: RecordedScans
    assumed: Mapping[str, str]


def scenario_of_recording(
    sensors: FilePath, scans: FilePath, truth: FilePath | None = None, *, speed: float = 10.0, bad_rows: str = "refuse"
) -> OfRecording:
    """Return the scenario of recorded scans.

    Args:
        sensors: a YAML file with `sensors`, and any other known section of a scenario: `origin`, `recording` (columns,
            units, conventions), `motion`, `survival`, `birth`, `filter`, `fusion`, ...; of `control` the constraints.
        scans: the CSV or Parquet file of the scans.
        truth: the file of the targets' own reports; None: as in the sensors file, or unknown.
        speed: m/s that targets hardly exceed; motion and births are derived from it unless they are given.
        bad_rows: "refuse" or "skip", see `vedette.recorded.Conventions`.

    Raises:
        InputError: a file that does not exist, or rows that cannot be read.
        ScenarioError: with every fault of the sensors file.
    """
    for file, what in ((scans, "scans"), (truth, "the targets' reports")):
        if file is not None and (file.is_dir() or not file.exists()):
            raise InputError(f"{file}: {'a folder' if file.is_dir() else 'no such file'}; expected a file of {what}")
    document = read_sensors_file(sensors)
    said = {key: value for key, value in document.data.items() if key not in ("control", "planners", "time")}
    control, own = document.data.get("control"), said.get("recording")
    if isinstance(control, Mapping) and "constraints" in control:  # zones are drawn
        said["control"] = {"constraints": control["constraints"]}
    said.setdefault("name", scans.stem)
    said["recording"] = {
        **(own if isinstance(own, Mapping) else {}),
        "path": str(scans.resolve()),
        "bad_rows": bad_rows,
    }
    if truth is not None:
        own = said.get("targets")
        known = own if isinstance(own, Mapping) and own.get("kind", "recorded") == "recorded" else {}
        said["targets"] = {**known, "kind": "recorded", "path": str(truth.resolve())}
    elif not _are_recorded(said.get("targets")):
        said["targets"] = {"kind": "unknown"}
    first = {**stand_ins(said, speed), **said}
    first["targets"] = {"kind": "unknown"}
    model = model_of_sensors(document, first, sensors)
    assert model.recording is not None
    recording = model.recording.build(model, sensors.parent)
    words = dict[str, str]()
    more = assumed_sections(said, model, recording, sensors.parent, speed, words)
    own = said["targets"]
    if _are_recorded(own) and "time_origin" not in own:
        more["targets"] = {**own, "time_origin": recording.start}
    return OfRecording(Scenario(model_of_sensors(document, {**said, **more}, sensors), sensors), recording, words)


class OfSensors(NamedTuple):
    """A scenario of future scans.

    scenario: by which a loop takes scans. conventions: of the scans. assumed: see `OfRecording`.
    """

    scenario: Scenario
    conventions: Conventions
    assumed: Mapping[str, str]


def scenario_of_sensors(
    sensors: FilePath, *, speed: float = 10.0, decide_every: float | None = None, plan_within: float | None = None
) -> OfSensors:
    """Return the scenario of future scans.

    Args:
        sensors: a YAML file as in `scenario_of_recording`, or a whole scenario. Only the units and bearings of
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
    said = {key: value for key, value in document.data.items() if key not in ("recording", "targets")}
    own = document.data.get("recording")
    own = own if isinstance(own, Mapping) else {}
    conventions = Conventions({}, own.get("units") or {}, own.get("bearings"))
    if conventions.bearings == "north":  # answers count from north, too; units keep their default
        conventions = replace(conventions, units={"bearing": "rad", **conventions.units})
        said["sensors"] = _with_compass(said)
    words = dict[str, str]()
    told = {**stand_ins(said, speed), "name": sensors.stem, **said, "targets": {"kind": "scripted", "tracks": []}}
    told |= assumed_motion(said, speed, words)
    if decide_every is not None:
        told |= _endless(told, decide_every)
    if plan_within is not None:
        told["control"] = {**(told.get("control") or {}), "max_seconds": plan_within}
    model = model_of_sensors(document, told, sensors)
    if "region" not in said:
        told["region"] = region = reached_region(model, sensors)
        words["region"] = f"{region_in_words(region)} (as far as the sensors see from their first positions)"
        model = model_of_sensors(document, told, sensors)
    if "birth" not in said:
        side = max(model.region.x_max - model.region.x_min, model.region.y_max - model.region.y_min)
        measured = [[np.array([[0.0, side / 4.0]])]] * len(model.sensors)
        model = model_of_sensors(
            document, {**told, **assumed_birth(model, measured, sensors.parent, speed, words)}, sensors
        )
    return OfSensors(Scenario(model, sensors), conventions, words)


def _with_compass(said: Mapping[str, Any]) -> Any:
    """Return the sensors, with a compass for those that do not set `compass`, except for custom measurements."""
    defaults, sensors = said.get("sensor_defaults"), said.get("sensors")
    shared = defaults if isinstance(defaults, Mapping) else {}
    if "compass" in shared or not isinstance(sensors, list):
        return sensors
    found = []
    for sensor in sensors:
        own = sensor.get("measurement", shared.get("measurement")) if isinstance(sensor, Mapping) else None
        is_custom = isinstance(own, Mapping) and own.get("kind") == "custom"
        found.append({"compass": True, **sensor} if isinstance(sensor, Mapping) and not is_custom else sensor)
    return found


def _endless(said: Mapping[str, Any], decide_every: float) -> dict[str, Any]:
    """Return time and control of a scenario that decides as long as scans come."""
    time = said["time"] if isinstance(said["time"], Mapping) else {}
    own = said.get("control")
    control = {key: value for key, value in own.items() if not key.startswith("decision_")} if own else {}
    period = control.get("horizon_period") or time.get("step_period", 1.0)
    if "horizon_steps" not in control and isinstance(period, int | float) and period > 0.0:
        control["horizon_steps"] = round(min(max(decide_every / period, 1.0), _MOST_STEPS))
    return {"time": {**time, "num_steps": ENDLESS}, "control": control}


def _are_recorded(targets: Any) -> bool:
    return isinstance(targets, Mapping) and targets.get("kind") == "recorded"
