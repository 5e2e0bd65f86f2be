"""Sections about tracking: the local filters, and the fusion of their densities."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import (
    Chance,
    Count,
    DetectionAt,
    GaussianMethod,
    Probability,
    Section,
    Share,
    check,
)
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the filters comes the compiler, which a check does without
    from vedette.filters import Filter as LocalFilter
    from vedette.filters import Limits
    from vedette.fusion import Clmb, CmDeltaGlmb
    from vedette.fusion import Fusion as FusionRule
    from vedette.models import SensorModel, TargetModel
    from vedette.tracking import CentralFilter


_WEIGHT_TOLERANCE = 1e-6


class RankedAssignment(Section):
    """The best associations of each hypothesis, in order (exact)."""

    kind: Literal["ranked"] = Field(default="ranked", description="Kind of truncation [-].")


class GibbsAssignment(Section):
    """Associations drawn by a Gibbs sampler; for scenes too busy to rank."""

    kind: Literal["gibbs"] = Field(default="gibbs", description="Kind of truncation [-].")
    num_samples: Count = Field(default=1000, description="Number of draws a scan, over all hypotheses [-].")


Assignment = Annotated[RankedAssignment | GibbsAssignment, Field(discriminator="kind")]


class FilterLimits(Section):
    """Caps and thresholds of a filter: what it throws away, and so what it costs."""

    max_hypotheses: Count = Field(default=300, description="Most hypotheses kept after a scan [-].")
    min_relative_weight: Share = Field(
        default=1e-6,
        description="Hypotheses (of a cphd: large numbers of targets) lighter than this times the heaviest are dropped "
        "[-].",
    )
    min_track_weight: Probability = Field(
        default=1e-5,
        description="Each label's heaviest hypothesis is kept unless lighter than this times the heaviest of all [-].",
    )
    gate_probability: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=1.0 - 1e-7, description="Probability that a target's measurement falls in its gate; 1: no gate [-]."
    )
    min_log_clutter: float = Field(
        default=-60.0, description="Floor of the log clutter intensity, for places where clutter is impossible [-]."
    )
    max_search_nodes: Count = Field(default=1_000_000, description="Bound on the ranking search [-].")
    min_component_weight: Share = Field(
        default=1e-5, description="Components lighter than this share of their track or intensity are dropped [-]."
    )
    merge_distance: float = Field(
        default=2.0, ge=0.0, description="Mahalanobis distance within which components are merged; 0: never [-]."
    )
    max_components: Count = Field(default=10, description="Most Gaussian components of a track [-].")
    min_existence: Share = Field(
        default=1e-4, description="LMB tracks and Bernoullis less probable than this are dropped [-]."
    )
    max_labels: Count = Field(default=200, description="Most tracks of an LMB, Bernoullis of a cb_member [-].")
    max_intensity_components: Count = Field(
        default=100, description="Most Gaussian components of the intensity of a phd or cphd, all targets together [-]."
    )
    max_existence: Chance = Field(
        default=0.999, description="Bernoullis of a cb_member surer than this are taken as this sure [-]."
    )

    def build(self) -> Limits:
        """Caps and thresholds of the filters."""
        from vedette.filters import Limits

        return Limits(**self.model_dump())


# Filters that keep no identity of their targets.
UNLABELLED = ("phd", "cphd", "cb_member")


class Filter(Section):
    """The filter that every sensor runs on its own scans."""

    kind: Literal["delta_glmb", "m_delta_glmb", "lmb", "phd", "cphd", "cb_member"] = Field(
        default="m_delta_glmb",
        description="delta-GLMB; delta-GLMB marginalised after each scan (one component a label set); LMB; or, without "
        "labels and for a single sensor that nobody steers by its density: PHD, CPHD, cardinality-balanced "
        "multi-Bernoulli [-].",
    )
    gaussian_method: GaussianMethod = Field(
        default="auto", description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist [-]."
    )
    detection_at: DetectionAt = Field(
        default="centre",
        description="Of a predicted Gaussian, the probability of detection at its centre, as in the paper, or its mean "
        "over the Gaussian: for sensors whose view ends [-].",
    )
    assignment: Assignment = Field(default=RankedAssignment(), description="How associations are truncated [-].")
    limits: FilterLimits = Field(default=FilterLimits(), description="What is thrown away [-].")

    @check
    def _assignment_fits(self) -> Iterator[Finding]:
        if self.kind in ("lmb", *UNLABELLED) and self.assignment.kind == "gibbs":
            yield ("assignment", "kind"), f"ranked, as the filter is {self.kind}", '"gibbs"'

    def build(self, targets: TargetModel, sensor: SensorModel, folder: Path) -> LocalFilter:
        """The filter of one sensor."""
        from vedette.filters import CbMemberFilter, CphdFilter, DeltaGlmbFilter, LmbFilter, PhdFilter

        limits = self.limits.build()
        match self.kind:
            case "lmb":
                return LmbFilter(targets, sensor, limits)
            case "phd":
                return PhdFilter(targets, sensor, limits)
            case "cphd":
                return CphdFilter(targets, sensor, limits)
            case "cb_member":
                return CbMemberFilter(targets, sensor, limits)
        gibbs = self.assignment if isinstance(self.assignment, GibbsAssignment) else GibbsAssignment()
        return DeltaGlmbFilter(
            targets,
            sensor,
            limits,
            assignment=self.assignment.kind,
            num_gibbs_samples=gibbs.num_samples,
            marginalised=self.kind == "m_delta_glmb",
        )

    def build_central(self, targets: TargetModel, sensors: tuple[SensorModel, ...]) -> CentralFilter:
        """The filter of all sensors' scans, for a fusion of kind central."""
        from vedette.filters import MultiSensorGlmbFilter, MultiSensorLmbFilter

        limits = self.limits.build()
        if self.kind == "lmb":
            return MultiSensorLmbFilter(targets, sensors, limits)
        return MultiSensorGlmbFilter(targets, sensors, limits, marginalised=self.kind == "m_delta_glmb")


class CustomFilter(Custom):
    """A user's own `vedette.filters.Filter`, made for each sensor; called with `targets` and `sensor`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of filter [-].")
    gaussian_method: GaussianMethod = Field(
        default="auto", description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist [-]."
    )
    detection_at: DetectionAt = Field(
        default="centre",
        description="Of a predicted Gaussian, the probability of detection at its centre, as in the paper, or its mean "
        "over the Gaussian: for sensors whose view ends [-].",
    )
    gives: ClassVar[str] = "vedette.filters:Filter"

    def build(self, targets: TargetModel, sensor: SensorModel, folder: Path) -> LocalFilter:
        """The filter of one sensor."""
        made: LocalFilter = self.made(folder, targets=targets, sensor=sensor)
        return made


AnyFilter = Annotated[Filter | CustomFilter, Field(discriminator="kind")]


Weights = Annotated[tuple[Probability, ...], Field(strict=False, min_length=1)]


class FusionLimits(Section):
    """Caps on the cost of a fusion."""

    max_hypotheses: Count = Field(default=1000, description="Most label sets of the fused density [-].")
    max_components: Count = Field(
        default=4, description="Most components of a track before its power is taken; unused when moment matched [-]."
    )
    min_component_weight: Chance = Field(
        default=1e-5, description="Lighter components are dropped; unused when moment matched [-]."
    )
    merge_distance: Annotated[float, Field(ge=0.0)] | None = Field(
        default=None,
        description="Closer components are merged; none: 2 for component_wise, 0.5 for quadrature powers [-].",
    )
    max_combinations: Count = Field(
        default=4096, description="Bound on the combinations of components of one label at all sensors [-]."
    )


class CustomCentral(Custom):
    """A user's own `vedette.tracking.CentralFilter`, of all sensors' scans; called with `targets` and `sensors`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of filter [-].")
    gives: ClassVar[str] = "vedette.tracking:CentralFilter"


class Fusion(Section):
    """How the sensors' densities become one: generalised covariance intersection (paper section II-D)."""

    kind: Literal["cm_delta_glmb", "clmb", "central", "none"] = Field(
        default="cm_delta_glmb",
        description="Of marginalised delta-GLMB densities, of LMB densities, or none (a single sensor). central: one "
        "filter takes the scans of all sensors, and nothing is fused while tracking; what is set here then serves the "
        "joint decisions alone [-].",
    )
    filter: CustomCentral | None = Field(
        default=None,
        description="Of a central fusion: a filter of your own for all sensors' scans; none: that of the filter's kind "
        "[-].",
    )
    weights: Weights | None = Field(
        default=None, description="Weight of each sensor, with sum 1; none: equal weights [-]."
    )
    mixture_power: Literal["moment_matched", "component_wise", "quadrature"] = Field(
        default="moment_matched",
        description="Power of a Gaussian mixture: of the Gaussian with its moments; of each component, which is valid "
        "for well separated ones; or the latter corrected by cubature [-].",
    )
    missing_weight: Chance = Field(
        default=1e-6, description="Weight of a label set where a sensor lost it by truncation (cm_delta_glmb) [-]."
    )
    missing_existence: Chance = Field(
        default=1e-4, description="Existence of a label where a sensor lost it by truncation (clmb) [-]."
    )
    feedback: bool = Field(
        default=False, description="Whether the fused density replaces the sensors' own; the paper's does not [-]."
    )
    limits: FusionLimits = Field(default=FusionLimits(), description="What is thrown away [-].")

    @check
    def _sum_to_one(self) -> Iterator[Finding]:
        if self.weights is not None and abs(math.fsum(self.weights) - 1.0) > _WEIGHT_TOLERANCE:
            yield ("weights",), "weights with sum 1", f"a sum of {math.fsum(self.weights):g}"

    @check
    def _filter_of_all(self) -> Iterator[Finding]:
        if self.filter is not None and self.kind != "central":
            yield ("filter",), "none, as the fusion is not central", "a filter"

    def scaled_weights(self, num_sensors: int) -> tuple[float, ...]:
        """Weight of each sensor: equal where none are given; scaled to sum to one beyond the rounding of the file."""
        given = self.weights or (1.0,) * num_sensors
        return tuple(weight / math.fsum(given) for weight in given)

    def build(self, num_sensors: int, folder: Path) -> CmDeltaGlmb | Clmb | None:
        """The fusion of the sensors' densities after each scan; None where there is none."""
        from vedette.fusion import Clmb, CmDeltaGlmb, FusionLimits

        if self.kind in ("none", "central"):
            return None
        weights, caps = self.scaled_weights(num_sensors), self.limits
        limits = FusionLimits(
            math.log(caps.min_component_weight),
            caps.merge_distance,
            caps.max_components,
            caps.max_combinations,
            caps.max_hypotheses,
        )
        if self.kind == "clmb":
            return Clmb(weights, self.mixture_power, self.missing_existence, limits)
        return CmDeltaGlmb(weights, self.mixture_power, math.log(self.missing_weight), limits)


class CustomFusion(Custom):
    """A user's own `vedette.fusion.Fusion`; called with `num_sensors`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of fusion [-].")
    feedback: bool = Field(default=False, description="Whether the fused density replaces the sensors' own [-].")
    gives: ClassVar[str] = "vedette.fusion:Fusion"

    def build(self, num_sensors: int, folder: Path) -> FusionRule:
        """The fusion of the sensors' densities."""
        made: FusionRule = self.made(folder, num_sensors=num_sensors)
        return made


AnyFusion = Annotated[Fusion | CustomFusion, Field(discriminator="kind")]
