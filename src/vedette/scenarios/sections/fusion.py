"""Sections about fusion of the sensors' beliefs or scans, and the radio network over which they are sent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Chance, Probability, Section, Whole, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Derived, Part, derived
from vedette.scenarios.sections.program import ProgramCentral

if TYPE_CHECKING:  # importing the fusions imports the compiler, which a check does not need
    from vedette.fusion import Fusion as FusionRule
    from vedette.fusion import FusionLimits as RuleLimits


_WEIGHT_TOLERANCE = 1e-6

FusionKind: TypeAlias = Literal[
    "sequential", "parallel", "clmb", "cm_delta_glmb", "arithmetic_average", "central", "none"
]
# All scans update one belief: no fusion in tracking.
SCAN_FUSIONS: tuple[FusionKind, ...] = ("sequential", "central")
SINGLE_BELIEF_FUSIONS: tuple[FusionKind, ...] = (*SCAN_FUSIONS, "none")
# Every sensor's scan counts in full.
FULL_INFORMATION_FUSIONS: tuple[FusionKind, ...] = (*SCAN_FUSIONS, "parallel")
# Fusion of local beliefs of the sensors, by their labels.
LABEL_FUSIONS: tuple[FusionKind, ...] = ("clmb", "cm_delta_glmb", "arithmetic_average")
# Those with an LMB as fused density, which may use views.
LMB_FUSIONS: tuple[FusionKind, ...] = ("clmb", "arithmetic_average")


Weights = Annotated[tuple[Probability, ...], Field(strict=False, min_length=1)]


@derived(
    "vedette.fusion.powers:FusionLimits",
    without=("log_min_component_weight",),
    first=("max_hypotheses", "max_components", "min_component_weight"),
)
class FusionLimits(Derived):
    """Caps on the cost of a fusion."""

    min_component_weight: Chance = Field(
        default=1e-5, description="Lighter components are dropped; unused when moment matched [-]."
    )

    def build(self) -> RuleLimits:
        """Return the caps, with the log of the weight."""
        from vedette.fusion import FusionLimits

        return FusionLimits(log_min_component_weight=math.log(self.min_component_weight), **self.to_arguments())


class CustomCentral(Custom):
    """A user's own `vedette.tracking.CentralFilter`, of all scans; called with `targets`, `sensors` and `scene`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of filter [-].")
    gives: ClassVar[str] = "vedette.tracking:CentralFilter"


class Fusion(Section):
    """Fusion of the beliefs or scans of all sensors."""

    kind: FusionKind = Field(
        default="sequential",
        description="cm_delta_glmb, clmb: generalised covariance intersection of marginalised delta-GLMB or of LMB "
        "densities (paper section II-D). arithmetic_average: of LMB densities; other ones are converted. sequential: "
        "one belief is predicted, then updated with each sensor's scan in turn. parallel: each sensor updates one "
        "common prediction, and the posteriors are divided by it; the sensors go on from the result (lmb, "
        "factored_glmb). central: one filter takes the scans of all sensors, of GLMBs as sequential. none: of a single "
        "sensor. Joint decisions by the expected loss take all scans in full whatever the kind; by other rewards they "
        "do so under sequential, parallel, central, arithmetic_average and by views, and are by plain covariance "
        "intersection under cm_delta_glmb and clmb [-].",
    )
    filter: Annotated[CustomCentral | ProgramCentral, Field(discriminator="kind")] | None = Field(
        default=None,
        description="Of a central fusion: a filter of your own for all sensors' scans; none: that of the filter's kind "
        "[-].",
    )
    weights: Weights | None = Field(
        default=None,
        description="Weight of each sensor, with sum 1; none: equal weights. Not used by sequential, parallel and "
        "central [-].",
    )
    field_of_view_weighting: bool = Field(
        default=False,
        description="Whether a sensor's weight at each label is in proportion to the odds with which it detects it, so "
        "that one that cannot see a target has no say in it (clmb, arithmetic_average) [-].",
    )
    matching: Literal["labels", "assignment"] = Field(
        default="labels",
        description="What is one target at several sensors: that of one label, or what is found so by place before "
        "each fusion (clmb, cm_delta_glmb, arithmetic_average, without feedback or over a network) [-].",
    )
    mixture_power: Literal["auto", "moment_matched", "component_wise", "quadrature"] = Field(
        default="auto",
        description="Power of a Gaussian mixture: of the Gaussian with its moments; of each component, which is valid "
        "for well separated ones; the latter corrected by cubature; auto: of each of as many components as the number "
        "of sensors allows [-].",
    )
    missing_weight: Chance = Field(
        default=1e-6, description="Weight of a label set where a sensor lost it by truncation (cm_delta_glmb) [-]."
    )
    missing_existence: Chance = Field(
        default=1e-4,
        description="Existence of a label where a sensor lost it by truncation (clmb, parallel) [-].",
    )
    feedback: bool = Field(
        default=False,
        description="Whether the fused density replaces the sensors' own; the paper's does not, that of parallel "
        "always does [-].",
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

    @check
    def _views_of_lmbs(self) -> Iterator[Finding]:
        if self.field_of_view_weighting and self.kind not in LMB_FUSIONS:
            yield (
                ("field_of_view_weighting",),
                f"false, as {self.kind} does not weigh labels ({' and '.join(LMB_FUSIONS)} do)",
                "true",
            )

    @check
    def _matching_of_own_labels(self) -> Iterator[Finding]:
        if self.matching == "assignment" and self.kind not in LABEL_FUSIONS:
            yield ("matching",), f"labels, as under {self.kind} all sensors share them", describe(self.matching)

    @property
    def feeds_back(self) -> bool:
        """True if the fused density replaces the sensors' own."""
        return self.feedback or self.kind == "parallel"

    def scaled_weights(self, num_sensors: int) -> tuple[float, ...]:
        """Return the weight of each sensor (default: equal), scaled to a sum of one beyond the rounding of the file."""
        given = self.weights or (1.0,) * num_sensors
        return tuple(weight / math.fsum(given) for weight in given)

    def build(self, num_sensors: int, folder: Path) -> FusionRule | None:
        """Return the fusion of the sensors' densities after each scan; None if all scans update one belief."""
        from vedette.fusion import LabelMatchedFusion, ParallelUpdate

        if self.kind in SINGLE_BELIEF_FUSIONS:
            return None
        if self.kind == "parallel":
            return ParallelUpdate(missing_existence=self.missing_existence, limits=self.limits.build())
        rule = self._by_label(num_sensors)
        return LabelMatchedFusion(rule) if self.matching == "assignment" else rule

    def build_of_decisions(self, num_sensors: int, *, of_lmbs: bool) -> FusionRule:
        """Return the fusion for joint decisions: a parallel update, of any density, or plain covariance intersection.

        Averages and fusion by views are planned as if each sensor's scans counted in full.
        of_lmbs: True if the filters use LMBs, on which a single sensor is then planned.
        """
        from vedette.fusion import ParallelUpdate

        if self.kind in (*FULL_INFORMATION_FUSIONS, "arithmetic_average") or self.field_of_view_weighting:
            return ParallelUpdate()
        lmbs = self.kind == "clmb" or (of_lmbs and self.kind == "none")
        kind: FusionKind = "clmb" if lmbs else "cm_delta_glmb"
        return self.model_copy(update={"kind": kind})._by_label(num_sensors)

    def _by_label(self, num_sensors: int) -> FusionRule:
        from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb

        weights, limits = self.scaled_weights(num_sensors), self.limits.build()
        if self.kind == "arithmetic_average":
            return ArithmeticAverage(weights, self.field_of_view_weighting, limits)
        if self.kind == "clmb":
            return Clmb(weights, self.mixture_power, self.missing_existence, limits, self.field_of_view_weighting)
        return CmDeltaGlmb(weights, self.mixture_power, math.log(self.missing_weight), limits)


class CustomFusion(Custom):
    """A user's own `vedette.fusion.Fusion`; called with `num_sensors`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of fusion [-].")
    feedback: bool = Field(default=False, description="Whether the fused density replaces the sensors' own [-].")
    gives: ClassVar[str] = "vedette.fusion:Fusion"

    @property
    def feeds_back(self) -> bool:
        """True if the fused density replaces the sensors' own."""
        return self.feedback

    def build(self, num_sensors: int, folder: Path) -> FusionRule:
        """Return the fusion of the sensors' densities."""
        rule: FusionRule = self.instantiate(folder, num_sensors=num_sensors)
        return rule


AnyFusion = Annotated[Fusion | CustomFusion, Field(discriminator="kind")]


@derived("vedette.tracking.network:Network")
class NetworkSection(Part):
    """Links between sensors. Messages pass from sensor to sensor, and each continues from those it received."""

    delay: Annotated[Whole, Field(ge=0, le=1000)]

    @check
    def _consensus_is_at_once(self) -> Iterator[Finding]:
        for name in ("max_hops", "delay"):
            if self.consensus_rounds is not None and getattr(self, name):
                yield (name,), "none with consensus_rounds", describe(getattr(self, name))
