"""Sections about the sensors: position, motion, models and scan times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field, create_model

from vedette.internal.quantities import HEIGHT_DEPENDENT, is_doppler
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import BEAM, BUDGET, OWN_HEIGHT
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import (
    GaussianMethod,
    Name,
    NonNegative,
    Point,
    Positive,
    Probability,
    Section,
    check,
)
from vedette.scenarios.sections.derived import Part, derived, of_kind
from vedette.scenarios.sections.platforms import AnyPlatform
from vedette.scenarios.sections.scan_times import Correlation, ScanTimes
from vedette.scenarios.sections.sensing import (
    Clutter,
    Detection,
    Measurement,
    Noise,
    clutter_findings,
    noise_findings,
)
from vedette.scenarios.sections.true_sensors import BiasSection, Names, TrueSensor, build_parts

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.models import ClassFeatures, Region, SensorModel
    from vedette.simulation import TrueSensor as TrueSensorModel


CLUTTER = "clutter"  # key of false measurements among those of the classes


@derived("vedette.models.turns:Turn")
class TurnSection(Part):
    """How a radar's beam turns: a scan is one turn, and a target is measured when the beam passes it.

    In a simulation the time of a scan is the middle of the turn, when the beam points east; targets and radar move
    straight on in half a turn. In a recording the beam is where the rows say.
    """


class Budget(Section):
    """Scanning time of a sensor. Once none is left, the sensor does not scan before its next decision.

    A total for the run is `seconds` with a refill of 0; a share of the time is a small number of seconds with that
    share as refill.
    """

    seconds: Positive = Field(description="Scanning time at the start, and the most that it can be [s].")
    refill: float = Field(
        default=0.0,
        ge=0.0,
        description="What is added each second, up to `seconds`: 0.1 lets it scan a tenth of the time [-].",
    )


@derived("vedette.models.signal:SignalModel")
class SignalSection(Part):
    """Signal-to-noise ratios of a sensor's measurements: of targets that fluctuate (Swerling I), and of noise."""


class SizeSection(Section):
    """Measured sizes, such as the lengths of ships: a Gaussian."""

    mean: Positive = Field(description="Mean [m].")
    std: Positive = Field(description="Standard deviation, between targets and by the measurement [m].")


class ClassificationSection(Section):
    """Evidence of a sensor's measurements about the class of a target.

    The keys are the names in `classes`, and optionally `clutter` for false measurements; without it, they report what
    targets do.
    """

    confusion: dict[Name, dict[Name, Probability]] = Field(
        default={},
        description="For each class the probability of each value of the column `class`; none: it is not read [-].",
    )
    size: dict[Name, SizeSection] = Field(
        default={}, description="For each class the values of the column `size_m`; none: it is not read [-]."
    )

    def faults(self, classes: Mapping[str, float]) -> Iterator[Finding]:
        """Yield the faults of its tables for targets of these classes."""
        if not self.confusion and not self.size:
            yield ("confusion",), "probabilities of reported classes, or `size`", "neither"
        for name, table in (("confusion", self.confusion), ("size", self.size)):
            if table and set(table) - {CLUTTER} != set(classes):
                wanted = f"the classes {', '.join(classes)}" if classes else "`classes` of targets in the file"
                yield (name,), f"{wanted}, and optionally {CLUTTER}", ", ".join(table)
        for name, probs in self.confusion.items():
            reports = set().union(*self.confusion.values())
            if missing := sorted(reports - set(probs)):
                wanted = f"the same reports for each class: also {', '.join(missing)}"
                yield ("confusion", name), wanted, ", ".join(probs)
            elif abs(sum(probs.values()) - 1.0) > 1e-6:
                yield ("confusion", name), "probabilities that sum to 1", describe(sum(probs.values()))

    def build(self, classes: Mapping[str, float]) -> ClassFeatures | None:
        """Return the features of the sensor; None if the tables have faults. classes: probability of each."""
        from vedette.models import ClassFeatures

        if any(True for _ in self.faults(classes)):
            return None
        reports = tuple(next(iter(self.confusion.values()), {}))
        rows = {name: tuple(probs[report] for report in reports) for name, probs in self.confusion.items()}
        sizes = {name: (each.mean, each.std) for name, each in self.size.items()}
        return ClassFeatures(
            tuple(classes.values()),
            reports,
            tuple(rows[name] for name in classes if rows),
            rows.get(CLUTTER, ()),
            tuple(sizes[name] for name in classes if sizes),
            sizes.get(CLUTTER, ()),
        )


class Sensor(Section):
    """One sensor and the platform that carries it."""

    name: Name | None = Field(default=None, description="What to call it; none: `sensor 1`, `sensor 2`, ... [-].")
    position: Point = Field(description="Where it starts [m].")
    heading_deg: float = Field(
        default=0.0,
        description="Heading at the start, counter-clockwise from east; with an origin or a compass `course_deg` may "
        "stand instead, clockwise from true north [deg].",
    )
    height: float = Field(
        default=0.0, description="Above the plane, for measurements that depend on the heights of targets [m]."
    )
    platform: AnyPlatform = Field(default=of_kind("stationary"), description="What carries it: what it may do [-].")
    price: float | str | None = Field(
        default=None,
        description="What each of its actions costs, in units of the reward, which planners subtract; or, of a custom "
        "platform, the column of its actions that has the price of each; none: nothing, or as a custom platform says "
        "[-].",
    )
    switchable: bool = Field(
        default=False,
        description="Whether it can be switched off: each of its actions is listed a second time with `on` 0, by which "
        "it makes no measurement and no clutter until its next decision, and pays no price [-].",
    )
    budget: Budget | None = Field(
        default=None, description="Of scanning time, from the first decision on; none: without limit [-]."
    )
    stationary_until_first_decision: bool = Field(
        default=True,
        description="Whether it is stationary until its first decision, as in the paper; otherwise it moves on its "
        "course, or by the first of its actions, from the first scan on [-].",
    )
    measurement: Measurement = Field(default=of_kind("bearing_range"), description="What it measures [-].")
    compass: bool = Field(
        default=False,
        description="Whether it tells bearings as a compass does, in degrees clockwise from true north: in recordings "
        "and lines that say nothing else, and where scans are written; else in radians from the east. Plans and tables "
        "of the scenario then have courses [-].",
    )
    turn: TurnSection | None = Field(
        default=None,
        description="How its beam turns; none: its measurements are of one time, in a recording unless their bearings "
        "and times show a turn [-].",
    )
    extent: NonNegative | None = Field(
        default=None,
        description="Largest distance between neighbouring returns of one target in a recorded scan; 0: each "
        "measurement is of a target of its own; none: as `recording.extents` says [m].",
    )
    noise: Noise = Field(
        default=of_kind("range_dependent"),
        description="Measurement noise; of a recorded row that gives standard deviations, these [-].",
    )
    signal: SignalSection | None = Field(
        default=None,
        description="What the column `snr_db` of a recording says of a row; none: the column is not read [-].",
    )
    classification: ClassificationSection | None = Field(
        default=None,
        description="Probabilities of the columns `class` and `size_m` of a recording for each class of target; none: "
        "they are not read [-].",
    )
    detection: Detection = Field(default=of_kind("gaussian"), description="Probability of detection [-].")
    clutter: Clutter = Field(default=of_kind("region"), description="False measurements [-].")
    correlation: Correlation = Field(
        default=Correlation(), description="Of errors and visibility from scan to scan [-]."
    )
    bias: BiasSection = Field(
        default=BiasSection(),
        description="What its scans say too much, taken off before filters see them; `vedette calibrate` finds it [-].",
    )
    true_parameters: TrueSensor | None = Field(
        default=None,
        description="Its true models and bias, where they differ from those that the filters use [-].",
    )
    scans: ScanTimes = Field(default=ScanTimes(), description="Steps at which it scans [-].")

    @check
    def _a_camera_carries_a_camera(self) -> Iterator[Finding]:
        true = (
            ()
            if self.true_parameters is None
            else (self.true_parameters.detection, self.true_parameters.first_detection)
        )
        kinds = [section.kind for section in (self.detection, *true) if section is not None]
        if "camera" in kinds and len(self.platform.components()) < 2:
            yield ("platform",), "a camera, as its detection is a camera's", self.platform.kind

    @check
    def _a_budget_is_the_sixth_component(self) -> Iterator[Finding]:
        if self.budget is not None and len(self.platform.components()) > 2:
            yield ("budget",), "none, as the poses of the platform have a component 5 of their own", "a budget"

    @check
    def _prices_stand_in_custom_columns(self) -> Iterator[Finding]:
        if isinstance(self.price, str) and self.platform.kind != "custom":
            yield ("price",), "a number, as only a custom platform has a column of prices", describe(self.price)

    @check
    def _a_compass_tells_bearings(self) -> Iterator[Finding]:
        if self.compass and self.measurement.kind == "custom":
            yield ("compass",), "false, as nobody knows which component of a custom measurement is a bearing", "true"

    @check
    def _a_turn_passes_bearings(self) -> Iterator[Finding]:
        kind = self.measurement.kind
        if self.turn is not None and kind in ("custom", "range_only"):
            yield ("turn",), "none, as its measurements do not say in which direction they were taken", kind

    @check
    def _a_height_counts(self) -> Iterator[Finding]:
        kind = self.measurement.kind
        if self.height and kind not in (*HEIGHT_DEPENDENT, "custom"):
            yield ("height",), f"0, as a {kind} measurement does not depend on heights", describe(self.height)

    _noise_fits = check(lambda self: noise_findings(self.measurement, self.noise, ("noise",)))
    _clutter_is_measured = check(lambda self: clutter_findings(self.measurement, self.clutter, ("clutter",)))

    @check
    def _bias_is_of_what_is_measured(self) -> Iterator[Finding]:
        for path, wanted, came in self.bias.findings_beside(self.measurement):
            yield ("bias", *path), wanted, came

    @check
    def _true_parameters_fit_the_model(self) -> Iterator[Finding]:
        if self.true_parameters is not None:
            yield from self.true_parameters.findings_beside(self.measurement)

    @property
    def is_not_as_assumed(self) -> bool:
        """True if the true sensor of a simulation differs from the model of the filters."""
        return self.true_parameters is not None or self.correlation != Correlation()

    @property
    def pose(self) -> tuple[float, ...]:
        """Pose at the start: [px, py, heading_rad], and further components of its platform."""
        pose = (*self.position, math.radians(self.heading_deg), *self.platform.components())
        if self.budget is not None:
            pose = (*pose, *(0.0,) * (BUDGET - len(pose)), self.budget.seconds)
        # A custom platform may have a velocity at the start.
        pose = (*pose, *(0.0,) * (BEAM - len(pose))) if self.needs_velocity else pose
        return (*pose, *(0.0,) * (OWN_HEIGHT - len(pose)), self.height) if self.height else pose

    @property
    def needs_velocity(self) -> bool:
        """True if its measurements depend on its own velocity, which its poses then contain."""
        return is_doppler(self.measurement.kind) or self.turn is not None

    @property
    def turning_pose(self) -> tuple[float, ...]:
        """Pose at the start, with its beam in the middle of a turn."""
        if self.turn is None:
            return self.pose
        return (*self.pose[:BEAM], 0.0, self.turn.build().rate, *self.pose[OWN_HEIGHT:])

    def build(
        self, region: Region, method: GaussianMethod, folder: Path, state: Names, detection_at: str | None = None
    ) -> SensorModel:
        """Return the model of the sensor in the filters; the file of a custom model is relative to `folder`.

        Raises:
            InputError: a custom model that cannot be loaded, or parts that do not fit together.
        """
        from vedette.models import SensorModel

        parts = build_parts(self, self.measurement, region, folder, state)
        with suppress_unit_warnings():
            return SensorModel(**parts, method=method, detection_at=detection_at)

    def build_true(self, known: SensorModel, region: Region, folder: Path, state: Names) -> TrueSensorModel:
        """Return the true sensor for the model that `build` returns; raises like it."""
        from vedette.simulation.true_sensors import TrueSensor as Made

        if self.true_parameters is None:
            return Made(known, noise_s=self.correlation.noise_s, stays_s=self.correlation.stays_s)
        made = self.true_parameters.build(known, self, region, folder, state)
        # The bias of a compass is clockwise; simulated bearings are from the east.
        return replace(made, bias=replace(made.bias, bearing=-made.bias.bearing)) if self.compass else made


if TYPE_CHECKING:
    SensorDefaults = Section
else:
    SensorDefaults = create_model(
        "SensorDefaults",
        __base__=Section,
        __module__=__name__,
        __doc__="What every sensor has unless it says otherwise; key by key, a sensor's own value replaces the whole "
        "default.",
        **{
            name: (f"{Sensor.__annotations__[name]} | None", Field(default=None, description=field.description))
            for name, field in Sensor.model_fields.items()
            if name not in ("name", "position")
        },
    )
