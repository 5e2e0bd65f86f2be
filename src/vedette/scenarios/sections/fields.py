"""The fields of a scenario, and what follows from several of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Chance, Name, Section, check
from vedette.scenarios.sections.birth import Birth
from vedette.scenarios.sections.control import Control
from vedette.scenarios.sections.courses import courses_to_headings
from vedette.scenarios.sections.derived import of_kind
from vedette.scenarios.sections.fusion import AnyFusion, Fusion, NetworkSection
from vedette.scenarios.sections.places import OriginSection, in_metres
from vedette.scenarios.sections.planners import STRATEGIES, AnyPlanner
from vedette.scenarios.sections.recording import RecordingSection
from vedette.scenarios.sections.scoring import (
    AnyEstimator,
    AnyMetric,
    LeastGospaEstimator,
    LeastOspaEstimator,
    MapEstimator,
    Ospa,
)
from vedette.scenarios.sections.sensors import CLUTTER, Sensor, SensorDefaults
from vedette.scenarios.sections.targets import Targets
from vedette.scenarios.sections.tracking import AnyFilter, Filter
from vedette.scenarios.sections.undetected import UndetectedSection
from vedette.scenarios.sections.world import Motion, RegionSection, Survival, Time

if TYPE_CHECKING:  # importing it imports the models, which a check does not need
    from vedette.kernels.base.types import Floats
    from vedette.platforms.compass import Compass
    from vedette.scenarios.sections.strategies import Strategy

# Largest number of steps of a horizon that ends at the next decision.
_MAX_STEPS = 100


def merge_sensor_defaults(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a scenario's data in which `sensor_defaults` fills in keys that a sensor does not give."""
    merged = dict(data)
    defaults, sensors = data.get("sensor_defaults"), data.get("sensors")
    if isinstance(defaults, Mapping) and isinstance(sensors, list | tuple):
        given = {key: value for key, value in defaults.items() if value is not None}
        merged["sensors"] = [{**given, **item} if isinstance(item, Mapping) else item for item in sensors]
    return merged


def with_reward(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a scenario's data in which decisions without a reward use the error of the score."""
    control, score = data.get("control"), data.get("ospa")
    if not isinstance(control, Mapping) or "reward" in control or not isinstance(score, Mapping):
        return data
    given = {name: score[name] for name in ("cutoff", "order") if name in score}
    if score.get("components", "position") != "position" or not all(map(_is_positive, given.values())):
        return data
    return {**data, "control": {**control, "reward": {"kind": "expected_loss", **given}}}


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < math.inf


class ScenarioFields(Section):
    """The fields of a scenario, each checked by itself. `ScenarioModel` also checks that they go together."""

    format: Literal[1] = Field(default=1, description="Version of this format [-].")
    name: Name = Field(description="Short name [-].")
    description: str = Field(default="", description="What it is, where it comes from [-].")
    time: Time = Field(description="The scans [-].")
    origin: OriginSection | None = Field(
        default=None, description="Where x = y = 0 is on the Earth; none: nowhere, and all places are in metres [-]."
    )
    coastline: str | None = Field(
        default=None,
        description="GeoJSON file of lines or polygons in longitude and latitude, which pictures show and nothing "
        "obeys, relative to the scenario file; none: there is none [-].",
    )
    region: RegionSection = Field(description="Surveillance region [-].")
    motion: Motion = Field(default=of_kind("constant_velocity"), description="How targets move [-].")
    survival: Survival = Field(default=of_kind("constant"), description="Whether they go on living [-].")
    birth: Birth = Field(description="Where they appear, as the filters know it [-].")
    classes: dict[Name, Chance] = Field(
        default={},
        description="Probability of each class of target, for sensors with `classification`; none: targets have no "
        "classes [-].",
    )
    targets: Targets = Field(description="The true targets [-].")
    recording: RecordingSection | None = Field(
        default=None, description="Scans that were recorded; none: they are simulated [-]."
    )
    sensor_defaults: SensorDefaults | None = Field(
        default=None, exclude=True, description="What the sensors share; merged into them when read [-]."
    )
    sensors: Annotated[tuple[Sensor, ...], Field(strict=False, min_length=1)] = Field(description="The sensors [-].")
    filter: AnyFilter = Field(default=Filter(), description="The local filters [-].")
    fusion: AnyFusion = Field(default=Fusion(), description="How their densities become one [-].")
    network: NetworkSection | None = Field(
        default=None, description="The radio between the sensors; none: all that one knows, all know at once [-]."
    )
    undetected: UndetectedSection | None = Field(
        default=None, description="The targets not yet found, for planners that search; none: no account of them [-]."
    )
    estimator: AnyEstimator | None = Field(
        default=None,
        description="How estimates are read off; none: with a filter of kind factored_glmb, or lmb with births: "
        "poisson, least_gospa if control.reward is expected_gospa, else least_ospa; with other filters map [-].",
    )
    control: Control = Field(default=Control(), description="When and how the sensors decide [-].")
    planners: dict[Name, AnyPlanner] = Field(
        default={},
        description="Further strategies by name, beside jdm, idm, lookahead, nearest, assigned_target, centroid, "
        "oracle, true_targets, random, constant and stationary [-].",
    )
    ospa: Ospa = Field(default=Ospa(), description="How the estimates are scored [-].")
    metrics: dict[Name, AnyMetric] = Field(
        default={}, description="Measures beside the built-in ones by name, each a column of the scans [-]."
    )

    @check
    def _names_of_strategies(self) -> Iterator[Finding]:
        for name in self.planners:
            if name in STRATEGIES:
                yield ("planners", name), f"another name than {', '.join(STRATEGIES)}", describe(name)
            elif name.startswith("-"):
                yield ("planners", name), "a name that does not begin as an option does", describe(name)

    @property
    def class_probs(self) -> Floats | None:
        """Probability of each class of target, (num_classes,); None if targets have no classes."""
        return np.array(list(self.classes.values())) if self.classes else None

    @check
    def _classes_of_targets(self) -> Iterator[Finding]:
        if CLUTTER in self.classes:
            yield ("classes", CLUTTER), f"another name than {CLUTTER}, which is of false measurements", CLUTTER
        if self.classes and (len(self.classes) < 2 or abs(sum(self.classes.values()) - 1.0) > 1e-6):
            total = f"{len(self.classes)} of sum {sum(self.classes.values()):g}"
            yield ("classes",), "at least 2 probabilities that sum to 1", total
        for i, sensor in enumerate(self.sensors):
            if sensor.classification is not None:
                for path, wanted, got in sensor.classification.faults(self.classes):
                    yield ("sensors", i, "classification", *path), wanted, got

    @check
    def _names_of_measures(self) -> Iterator[Finding]:
        for name in self.metrics:
            if not name.isidentifier():
                yield ("metrics", name), "a name of letters, digits and underscores", describe(name)

    @classmethod
    def in_metres(cls, data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the mapping with places in degrees converted to metres, by its origin, and courses to headings."""
        return courses_to_headings(in_metres(data))

    @classmethod
    def prepared(cls, data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the mapping in metres, with `sensor_defaults` filled in, and a reward if none is given."""
        return with_reward(merge_sensor_defaults(cls.in_metres(data)))

    @field_validator("sensor_defaults")
    @classmethod
    def _merged(cls, _: SensorDefaults | None) -> None:
        return None

    def strategy(self, name: str) -> Strategy:
        """Return a strategy by its name. Raises `KeyError` for an unknown one."""
        return self.planners[name] if name in self.planners else STRATEGIES[name]

    def describe_strategy(self, name: str) -> str:
        """Return the description of a strategy; empty for an unknown name, such as `recorded`."""
        known = name in self.planners or name in STRATEGIES
        return self.strategy(name).description(self.control) if known else ""

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Name of each sensor; `sensor 1`, `sensor 2`, ... for those without."""
        return tuple(sensor.name or f"sensor {number}" for number, sensor in enumerate(self.sensors, 1))

    @property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the modes of motion, or () if targets have one motion."""
        return tuple(getattr(self.motion, "modes", ()))

    @property
    def by_compass(self) -> bool:
        """True if directions are given and returned as courses, clockwise from true north, as on a chart."""
        recorded = self.recording is not None and self.recording.bearings == "north"
        return self.origin is not None or recorded or any(sensor.compass for sensor in self.sensors)

    def north(self) -> Compass:
        """Return the direction of true north: with an origin by the place on the Earth, else along y."""
        from vedette.platforms.compass import PlaneCompass

        return PlaneCompass() if self.origin is None else self.origin.build()

    @property
    def estimates_by(self) -> Any:
        """The estimator section in use, given or default, with the cutoff and order of the score unless given."""
        estimator: Any = self.estimator
        if estimator is None:
            by_gospa = self.control.reward.kind == "expected_gospa"
            best = LeastGospaEstimator() if by_gospa else LeastOspaEstimator()
            estimator = best if self.filter.built_kind == "factored_glmb" else MapEstimator()
        missing = [name for name in ("cutoff", "order") if getattr(estimator, name, 0.0) is None]
        if not missing:
            return estimator  # the section itself, by which faults find their place
        return estimator.model_copy(update={name: getattr(self.ospa, name) for name in missing})

    @property
    def decision_steps(self) -> tuple[int, ...]:
        """The scans after which the sensors decide, from any form of schedule."""
        every = self.control.decision_every
        if every is not None:
            return tuple(range(every, self.time.num_steps, every))
        if self.control.decision_times is None:
            return self.control.decision_steps or ()
        time = self.time
        steps = map(time.step_at, self.control.decision_times)
        return tuple(step for step in steps if step is not None)

    @property
    def horizon(self) -> tuple[int, float]:
        """H and T, s, of decisions; the default is scan by scan over the usual time to the next decision."""
        control, scan = self.control, self.time.step_period
        period = control.horizon_period or scan
        if control.horizon_steps is not None:
            return control.horizon_steps, period
        gaps = Counter(after - before for before, after in pairwise((*self.decision_steps, self.time.num_steps)))
        gap = max(gaps, key=lambda scans: (gaps[scans], scans), default=1)
        return round(min(max(gap * scan / period, 1.0), _MAX_STEPS)), period
