"""A scenario of scans that were recorded, or are to come: what a file about the sensors says, the rest of the scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError, ScenarioError
from vedette.kernels.base.types import Floats
from vedette.reading import read_text
from vedette.recorded import Conventions, RecordedScans
from vedette.scenarios.assumed_clutter import assumed_clutter, place_stds
from vedette.scenarios.extents import measured_region, reached_region, region_in_words
from vedette.scenarios.faults import Fault, describe
from vedette.scenarios.loading import Scenario, diagnose
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.yaml_reader import MOST_BYTES, Document, read_yaml

# What a file about sensors need not say; a scenario must.
_STAND_INS: dict[str, Any] = {
    "time": {"num_steps": 1},
    "region": {"x_min": -1e6, "x_max": 1e6, "y_min": -1e6, "y_max": 1e6},
}
_EXISTENCE = 0.03  # of a birth where something was measured
_EXPECTED = 0.5  # births from measurements, in the region between two scans
_LOST_PER_SECOND = 0.001
_BIRTH_STDS = 2.0  # of the noise across, where most was measured
_ENDLESS = 1_000_000  # steps, the most of a scenario
_MOST_STEPS = 100  # of a horizon


class OfRecording(NamedTuple):
    """A scenario of a recording.

    scenario: which a run tracks. recording: its scans. assumed: what nobody said, and was taken instead, in words.
    """

    scenario: Scenario
    recording: RecordedScans
    assumed: tuple[str, ...]


def scenario_of_recording(
    sensors: FilePath, scans: FilePath, truth: FilePath | None = None, *, speed: float = 10.0, bad_rows: str = "refuse"
) -> OfRecording:
    """The scenario of scans that were recorded.

    Args:
        sensors: a YAML file with `sensors`, and whatever else of a scenario is known: `origin`, `recording` (columns,
            units, conventions), `motion`, `survival`, `birth`, `filter`, `fusion`, ...; of `control` the constraints.
        scans: the CSV or Parquet file of the scans.
        truth: the file of the targets' own reports; None: as the file about sensors says, or unknown.
        speed: m/s that targets hardly exceed; motion and births go by it where nothing is said of them.
        bad_rows: "refuse" or "skip", see `vedette.recorded.Conventions`.

    Raises:
        InputError: a file that is not there, or rows that cannot be read.
        ScenarioError: with every fault of the file about sensors.
    """
    for file, what in ((scans, "scans"), (truth, "the targets' reports")):
        if file is not None and (file.is_dir() or not file.exists()):
            raise InputError(f"{file}: {'a folder' if file.is_dir() else 'no such file'}; expected a file of {what}")
    document = _document(sensors)
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
    first = {**_STAND_INS, "birth": _measured_birth(100.0, speed, _state_dim(said)), **said}
    first["targets"] = {"kind": "unknown"}
    model = _model(document, first, sensors)
    assert model.recording is not None
    recording = model.recording.build(model, sensors.parent)
    told, assumed = _assumed(said, model, recording, sensors.parent, speed)
    return OfRecording(Scenario(_model(document, {**said, **told}, sensors), sensors), recording, assumed)


class OfSensors(NamedTuple):
    """A scenario of scans that are to come.

    scenario: which a loop takes scans by. conventions: of what they say. assumed: what nobody said, in words.
    """

    scenario: Scenario
    conventions: Conventions
    assumed: tuple[str, ...]


def scenario_of_sensors(
    sensors: FilePath, *, speed: float = 10.0, decide_every: float | None = None, plan_within: float | None = None
) -> OfSensors:
    """The scenario of scans that are to come.

    Args:
        sensors: a YAML file as of `scenario_of_recording`, or a whole scenario. Of `recording` the units and bearings
            count, and of `targets` nothing. Without `region` it is as far as the sensors see.
        speed: m/s, likewise.
        decide_every: s from one decision to the next, in place of the times that `control` says; the horizon is as
            long, unless `control` says another.
        plan_within: s after which the search of a decision ends, in place of `control.max_seconds`.

    Raises:
        InputError: a file that is not there, units or bearings that are none, no region where nothing says how far
            a sensor sees.
        ScenarioError: with every fault of the file.
    """
    document = _document(sensors)
    said = {key: value for key, value in document.data.items() if key not in ("recording", "targets")}
    own = document.data.get("recording")
    own = own if isinstance(own, Mapping) else {}
    conventions = Conventions({}, own.get("units") or {}, own.get("bearings"))
    if conventions.bearings == "north":  # who counts from north is answered so; units stay what they would be
        conventions = replace(conventions, units={"bearing": "rad", **conventions.units})
        said["sensors"] = _with_compass(said)
    words = list[str]()
    told = {**_STAND_INS, "name": sensors.stem, **said, "targets": {"kind": "scripted", "tracks": []}}
    told |= _assumed_motion(said, speed, words)
    if decide_every is not None:
        told |= _endless(told, decide_every)
    if plan_within is not None:
        told["control"] = {**(told.get("control") or {}), "max_seconds": plan_within}
    told.setdefault("birth", _measured_birth(100.0, speed, _state_dim(said)))  # until its deviations can be said
    model = _model(document, told, sensors)
    if "region" not in said:
        told["region"] = region = reached_region(model, sensors)
        words.append(f"region: {region_in_words(region)}, as far as the sensors see from where they are first")
        model = _model(document, told, sensors)
    if "birth" not in said:
        side = max(model.region.x_max - model.region.x_min, model.region.y_max - model.region.y_min)
        measured = [[np.array([[0.0, side / 4.0]])]] * len(model.sensors)
        model = _model(document, {**told, **_assumed_birth(model, measured, sensors.parent, speed, words)}, sensors)
    return OfSensors(Scenario(model, sensors), conventions, tuple(words))


def _with_compass(said: Mapping[str, Any]) -> Any:
    """The sensors, those with bearings that say nothing else with a compass."""
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
    """Time and decisions of a scenario that decides for as long as scans come."""
    time = said["time"] if isinstance(said["time"], Mapping) else {}
    own = said.get("control")
    control = {key: value for key, value in own.items() if not key.startswith("decision_")} if own else {}
    period = control.get("horizon_period") or time.get("step_period", 1.0)
    if "horizon_steps" not in control and isinstance(period, int | float) and period > 0.0:
        control["horizon_steps"] = round(min(max(decide_every / period, 1.0), _MOST_STEPS))
    return {"time": {**time, "num_steps": _ENDLESS}, "control": control}


def _document(sensors: FilePath) -> Document:
    document = read_yaml(read_text(sensors, "file about sensors", MOST_BYTES), str(sensors))
    if not isinstance(document.data, Mapping):
        raise InputError(f"{sensors}: expected a mapping with `sensors`; got {describe(document.data)}")
    return document


def _model(document: Document, data: Mapping[str, Any], sensors: FilePath) -> ScenarioModel:
    """The scenario of a document with other data; raises for its faults."""
    model, faults = diagnose(replace(document, data=data), sensors.parent)
    if model is None:
        raise ScenarioError([_in_words_of_user(fault, document, data, sensors) for fault in faults])
    return model


def _in_words_of_user(fault: Fault, document: Document, data: Mapping[str, Any], sensors: FilePath) -> str:
    """The message of a fault, without fields and places that the file about sensors does not have."""
    path = fault.told.path
    if path == ("recording",):
        got = fault.told.got
        return got if data["recording"]["path"] in got else f"{sensors}: recording.{got}"
    if path[:1] == ("targets",) and "targets" not in document.data:
        file, got = data["targets"]["path"], fault.told.got
        if path == ("targets", "path"):
            return got if file in got else f"{file}: {got}"
        where = ".".join(map(str, path))
        return f"{file}: {where}: expected {fault.told.expected}, got {got} (it belongs in {sensors})"
    if path[:1] == ("sensors",) and path[-2:] == ("measurement", "kind") and "birth" not in document.data:
        wanted = "a measurement that says where a target is, or births at sites: give one wide site in birth.sites"
        fault = Fault(fault.place, fault.told._replace(expected=wanted))
    return fault.message(str(sensors))


def _are_recorded(targets: Any) -> bool:
    return isinstance(targets, Mapping) and targets.get("kind") == "recorded"


def _assumed(
    said: Mapping[str, Any], model: ScenarioModel, recording: RecordedScans, folder: FilePath, speed: float
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The sections that are missing, by the scans; and in words what they say."""
    told: dict[str, Any] = {"time": _time(recording)}
    words = list[str]()
    if "region" not in said:
        told["region"] = region = measured_region(model, recording)
        words.append(f"region: {region_in_words(region)}")
    told |= _assumed_motion(said, speed, words)
    if "birth" not in said:
        measured = [
            [scan for scans in recording.scans if (scan := scans[s]) is not None and len(scan)]
            for s in range(len(model.sensors))
        ]
        told |= _assumed_birth(model, measured, folder, speed, words)
    told |= assumed_clutter(said, model, recording, folder, speed, words)
    if _are_recorded(said["targets"]) and "time_origin" not in said["targets"]:
        told["targets"] = {**said["targets"], "time_origin": recording.start}
    return told, tuple(words)


def _assumed_motion(said: Mapping[str, Any], speed: float, words: list[str]) -> dict[str, Any]:
    """How targets move and live, where it is not said."""
    told: dict[str, Any] = {}
    if "motion" not in said:
        # Held over the times between scans of several sensors, it would be the less the more often some of them scans.
        told["motion"] = {"kind": "constant_velocity", "sigma_v": speed / 20.0, "acceleration": "continuous"}
        words.append(f"motion: constant_velocity, sigma_v {speed / 20.0:g} m/s^1.5, continuous (speed {speed:g} m/s)")
    if "survival" not in said:
        told["survival"] = {"kind": "constant", "probability": 1.0 - _LOST_PER_SECOND, "period": 1.0}
        words.append(f"survival: {1.0 - _LOST_PER_SECOND:g} a second")
    return told


def _assumed_birth(
    model: ScenarioModel, measured: Sequence[Sequence[Floats]], folder: FilePath, speed: float, words: list[str]
) -> dict[str, Any]:
    """Births of what is measured, by the scans of each sensor."""
    std = _BIRTH_STDS * _spread(model, measured, folder)
    words.append(
        f"birth: {_EXPECTED:g} a scan, anywhere in the region (std {std:.3g} m and {speed:g} m/s where measured)"
    )
    return {"birth": _measured_birth(std, speed, model.motion.state_dim)}


def _state_dim(said: Mapping[str, Any]) -> int:
    motion = said.get("motion")
    found = motion.get("state_dim") if isinstance(motion, Mapping) else None
    turns = isinstance(motion, Mapping) and motion.get("kind") == "coordinated_turn"
    return found if isinstance(found, int) else 4 + turns


def _measured_birth(std: float, speed: float, state_dim: int) -> dict[str, Any]:
    rest = [0.1] * (state_dim - 4)  # a turn rate, rad/s
    stds = [std, std, speed, speed, *rest]
    return {"sites": [], "from_measurements": {"expected": _EXPECTED, "max_existence": _EXISTENCE, "std": stds}}


def _time(recording: RecordedScans) -> dict[str, Any]:
    """A regular time that says as much of the recording's as one can."""
    gaps = np.diff(recording.times)
    period = float(np.median(gaps)) if len(gaps) else 1.0
    return {"num_steps": len(recording.times), "step_period": period, "start": float(recording.times[0])}


def _spread(model: ScenarioModel, measured: Sequence[Sequence[Floats]], folder: FilePath) -> float:
    """Standard deviation of where was measured, m: the upper quartile over all measurements that say a place."""
    region, method = model.region.build(), model.filter.gaussian_method
    found = list[Floats]()
    for section, scans in zip(model.sensors, measured, strict=True):
        stds = section.build(region, method, folder, model.filter.detection_taken_at).noise.least_stds
        if stds is None or not scans:
            continue
        found.append(place_stds(section.measurement.kind, stds, np.concatenate(scans)))
    if not sum(map(len, found)):
        raise InputError("birth: expected it in the file about sensors, as what they measure says no places; got none")
    return float(np.quantile(np.concatenate(found), 0.75))
