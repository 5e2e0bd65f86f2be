"""Recorded scans and true targets of a scenario, and the faults of recorded scans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vedette.errors import InputError
from vedette.internal.quantities import HEIGHT_DEPENDENT
from vedette.kernels.base.types import STATE_COMPONENTS
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import is_complete, readable_findings
from vedette.scenarios.sections.field_of_view import max_range
from vedette.scenarios.sections.recording import RecordingSection, noise_stds
from vedette.scenarios.sections.targets import RecordedTargets

if TYPE_CHECKING:
    from vedette.recorded import RecordedScans, RecordedSensor
    from vedette.recorded import RecordedTargets as RecordedSource
    from vedette.recorded.returns import ReturnsModel

_ASSUMED_DETECTION = 0.9  # where a detection model has no constant probability


def recorded_targets(world: ScenarioModel, folder: Path) -> RecordedSource:
    """Return the recorded targets, with heights if the states of the scenario and the file have them.

    Raises `InputError` for a file that cannot be read, or lacks targets or heights that are measured or compared.
    """
    section = world.targets
    assert isinstance(section, RecordedTargets)
    origin = None if world.origin is None else (world.origin.lon, world.origin.lat)
    has_height = world.motion.components == STATE_COMPONENTS["constant_velocity_height"]
    found = section.source(world.region, origin, has_height, folder)
    if found.with_height:
        return found
    measured = world.recording is None and any(each.measurement.kind in HEIGHT_DEPENDENT for each in world.sensors)
    if measured or world.ospa.components == "position_and_height":
        wanted = "a column altitude_m of every report, and a motion with only pz and vz behind the velocity"
        raise InputError(f"{section.path}: expected {wanted}, as true heights are measured or compared; got none")
    return found


def recorded_scans(world: ScenarioModel, folder: Path, *, as_told: bool = False) -> RecordedScans:
    """Return the scans of the section `recording`, without the sensors' biases unless `as_told`.

    Raises `InputError` for a file that cannot be read, with row and column.
    """
    from vedette.models.bias import NO_BIAS

    assert world.recording is not None
    sites = recorded_sensors(world)
    if as_told:
        sites = [replace(site, bias=NO_BIAS) for site in sites]
    origin = None if world.origin is None else world.origin.build()
    return world.recording.build(tuple(sites), returns_models(world), origin, folder)


def returns_models(world: ScenarioModel) -> tuple[ReturnsModel, ...]:
    """Return for each sensor its extent, or the assumed parameters that an extent is learnt from."""
    from vedette.recorded.returns import ReturnsModel

    found = list[ReturnsModel]()
    learnt = world.recording is not None and world.recording.extents == "found"
    for sensor in world.sensors:
        extent = sensor.extent if sensor.extent is not None or learnt else 0.0
        probability = float(getattr(sensor.detection, "probability", _ASSUMED_DETECTION))
        found.append(ReturnsModel(extent, noise_stds(sensor), probability))
    return tuple(found)


def recorded_sensors(world: ScenarioModel) -> list[RecordedSensor]:
    """Return the sensors of a recording."""
    from vedette.recorded import RecordedSensor

    north = world.north()
    shown_by_rows = "none" if world.recording is None else world.recording.turns
    return [
        RecordedSensor(
            name,
            sensor.measurement.kind,
            sensor.pose,
            sensor.bias.build(),
            sensor.compass,
            max_range(sensor),
            north,
            shown_by_rows if sensor.turn is None else sensor.turn.build(),
            None if sensor.signal is None else sensor.signal.build(),
            None if sensor.classification is None else sensor.classification.build(world.classes),
        )
        for name, sensor in zip(world.sensor_names, world.sensors, strict=True)
    ]


def recording_findings(world: ScenarioModel, folder: Path) -> Iterator[Finding]:
    """Yield faults of recorded scans, and of sections that do not suit them."""
    section = world.recording
    if section is None:
        return
    yield from readable_findings(_content, section, world, folder)
    if world.targets.kind not in ("recorded", "unknown"):
        yield ("targets", "kind"), "recorded or unknown, as the scans are recorded", describe(world.targets.kind)
    if world.decision_steps:
        wanted = "no decisions, as it is recorded where the sensors went"
        yield ("control",), wanted, f"{len(world.decision_steps)} of them"


def _content(section: RecordingSection, world: ScenarioModel, folder: Path) -> Iterator[Finding]:
    if not is_complete(section):
        return
    try:
        recorded_scans(world, folder)
    except InputError as error:
        yield ("recording",), "scans that can be read", str(error)
