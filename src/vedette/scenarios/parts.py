"""The parts of a scenario that are valid by themselves, so that checks across parts can run on a faulty file too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticUndefined

from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import Steps
from vedette.scenarios.sections.control import Control
from vedette.scenarios.sections.scoring import Estimator, Ospa
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.targets import RecordedTargets, ScriptedTarget
from vedette.scenarios.sections.tracking import Filter, Fusion
from vedette.scenarios.sections.world import BirthSite, Motion, RegionSection, Survival, Time


@dataclass(frozen=True, slots=True)
class Parts:
    """What could be read of each part; None where it could not.

    A section that is faulty only in keys that could have been left out is there, with None for these keys.
    `folder` is where the scenario file is, if it is a file.
    """

    time: Time | None
    region: RegionSection | None
    motion: Motion | None
    survival: Survival | None
    birth_steps: tuple[int, ...]
    sites: tuple[BirthSite | None, ...]
    tracks: tuple[ScriptedTarget | None, ...]
    recorded: RecordedTargets | None
    sensors: tuple[Sensor | None, ...]
    filter: Filter | None
    fusion: Fusion | None
    estimator: Estimator | None
    control: Control | None
    ospa: Ospa | None
    folder: Path | None

    @property
    def state_dim(self) -> int | None:
        """Length of a state under the motion model."""
        return None if self.motion is None else self.motion.state_dim

    @property
    def num_steps(self) -> int | None:
        """Number of scans."""
        return None if self.time is None else self.time.num_steps


def parts_of_model(model: ScenarioModel, folder: Path | None) -> Parts:
    """The parts of a scenario that is valid part by part."""
    targets = model.targets
    return Parts(
        time=model.time,
        region=model.region,
        motion=model.motion,
        survival=model.survival,
        birth_steps=_listed(model.birth.steps),
        sites=model.birth.sites,
        tracks=() if isinstance(targets, RecordedTargets) else targets.tracks,
        recorded=targets if isinstance(targets, RecordedTargets) else None,
        sensors=model.sensors,
        filter=model.filter,
        fusion=model.fusion,
        estimator=model.estimator,
        control=model.control,
        ospa=model.ospa,
        folder=folder,
    )


def parts_of_data(data: Mapping[str, Any], folder: Path | None) -> Parts:
    """The parts of faulty data, in which unknown keys have been left out and sensors have their defaults."""

    def section(name: str, annotation: Any) -> Any:
        default = ScenarioModel.model_fields[name].default
        return _valid(annotation, data[name]) if name in data else None if default is PydanticUndefined else default

    birth = data.get("birth")
    return Parts(
        time=section("time", Time),
        region=section("region", RegionSection),
        motion=section("motion", Motion),
        survival=section("survival", Survival),
        birth_steps=_listed(_valid(Steps, birth.get("steps")) if isinstance(birth, Mapping) else None),
        sites=_valid_items(BirthSite, data, "birth", "sites"),
        tracks=_valid_items(ScriptedTarget, data, "targets", "tracks"),
        recorded=_valid(RecordedTargets, data.get("targets")),
        sensors=_valid_items(Sensor, data, "sensors"),
        filter=section("filter", Filter),
        fusion=section("fusion", Fusion),
        estimator=section("estimator", Estimator),
        control=section("control", Control),
        ospa=section("ospa", Ospa),
        folder=folder,
    )


def _listed(steps: Any) -> tuple[int, ...]:
    return steps if isinstance(steps, tuple) else ()


def _valid(annotation: Any, value: Any) -> Any:
    """The section, None in place of what is faulty but could have been left out; None if more is faulty."""
    adapter = TypeAdapter(annotation)
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        faulty = {detail["loc"][0] for detail in error.errors(include_url=False) if detail["loc"]}
    if not isinstance(value, Mapping) or not faulty <= value.keys():
        return None
    try:
        rest = adapter.validate_python({key: item for key, item in value.items() if key not in faulty})
    except ValidationError:
        return None
    return rest.model_copy(update=dict.fromkeys(faulty))


def _valid_items(annotation: Any, data: Any, *path: str) -> tuple[Any, ...]:
    for key in path:
        data = data.get(key) if isinstance(data, Mapping) else None
    return tuple(_valid(annotation, item) for item in data) if isinstance(data, list) else ()
