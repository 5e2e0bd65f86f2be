"""Sections about tracking: the filters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import (
    Chance,
    Count,
    DetectionAt,
    GaussianMethod,
    Positive,
    Probability,
    Section,
    Share,
    check,
)
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the filters comes the compiler, which a check does without
    from vedette.filters import BeliefPropagation, Gibbs, Limits, Marginals, Ranked
    from vedette.filters import Filter as LocalFilter
    from vedette.models import SensorModel, TargetModel
    from vedette.tracking import CentralFilter


class RankedAssignment(Section):
    """The best associations of each hypothesis, in order (exact); for an lmb the exact sum over all."""

    kind: Literal["ranked"] = Field(default="ranked", description="Kind of association [-].")

    def build(self, folder: Path) -> Ranked:
        """How the filter associates."""
        from vedette.filters import Ranked

        return Ranked()


class GibbsAssignment(Section):
    """Associations drawn by a Gibbs sampler; for scenes too busy to rank."""

    kind: Literal["gibbs"] = Field(default="gibbs", description="Kind of association [-].")
    num_samples: Count = Field(default=1000, description="Number of draws a scan, over all hypotheses [-].")

    def build(self, folder: Path) -> Gibbs:
        """How the filter associates."""
        from vedette.filters import Gibbs

        return Gibbs(self.num_samples)


class PropagatedAssignment(Section):
    """Probabilities of associations by loopy belief propagation; for an lmb with very many contending tracks."""

    kind: Literal["belief_propagation"] = Field(default="belief_propagation", description="Kind of association [-].")
    max_sweeps: Count = Field(default=1000, description="Most sweeps over all options a scan [-].")
    tolerance: float = Field(
        default=1e-6, ge=0.0, description="Relative change of a message below which it stands still [-]."
    )

    def build(self, folder: Path) -> BeliefPropagation:
        """How the filter associates."""
        from vedette.filters import BeliefPropagation

        return BeliefPropagation(self.max_sweeps, self.tolerance)


class CustomAssignment(Custom):
    """A user's own `vedette.filters.Marginals`, for an lmb."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of association [-].")
    gives: ClassVar[str] = "vedette.filters:Marginals"

    def build(self, folder: Path) -> Marginals:
        """How the filter associates."""
        made: Marginals = self.made(folder)
        return made


Assignment = Annotated[
    RankedAssignment | GibbsAssignment | PropagatedAssignment | CustomAssignment, Field(discriminator="kind")
]


class FilterLimits(Section):
    """Caps and thresholds of a filter: what it throws away, and so what it costs."""

    max_hypotheses: Count = Field(
        default=300, description="Most hypotheses kept after a scan; of a factored_glmb, in each factor [-]."
    )
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
        default=1e-4,
        description="LMB tracks, tracks alone in their factor and Bernoullis less probable than this are dropped [-].",
    )
    max_labels: Count = Field(
        default=200, description="Most tracks of an LMB or factored_glmb, Bernoullis of a cb_member [-]."
    )
    max_position_std: Positive | None = Field(
        default=None,
        description="Labels whose position is less certain than this along both axes are dropped; none: never [m].",
    )
    max_intensity_components: Count = Field(
        default=100, description="Most Gaussian components of the intensity of a phd or cphd, all targets together [-]."
    )
    max_existence: Chance = Field(
        default=0.999, description="Bernoullis of a cb_member surer than this are taken as this sure [-]."
    )

    def build(self) -> Limits:
        """Caps and thresholds of the filters."""
        from vedette.filters import Limits

        given = self.model_dump()
        return Limits(**given | {"max_position_std": self.max_position_std or math.inf})


# Filters that keep no identity of their targets.
UNLABELLED = ("phd", "cphd", "cb_member")
# How filters can associate; others rank.
# Filters of which `max_labels` bounds how many targets there can be.
ASSIGNMENTS = {
    "delta_glmb": ("ranked", "gibbs"),
    "m_delta_glmb": ("ranked", "gibbs"),
    "lmb": ("ranked", "belief_propagation", "custom"),
}
LABELS_CAPPED = ("lmb", "factored_glmb", "cb_member")


class Filter(Section):
    """The filter that every sensor runs on its own scans."""

    kind: Literal["delta_glmb", "m_delta_glmb", "lmb", "factored_glmb", "phd", "cphd", "cb_member"] = Field(
        default="factored_glmb",
        description="delta-GLMB; delta-GLMB marginalised after each scan (one component a label set); LMB; product of "
        "delta-GLMBs, each of the labels that contend with each other, for any number of targets; or, without labels "
        "and for a single sensor that nobody steers by its density: PHD, CPHD, cardinality-balanced multi-Bernoulli "
        "[-].",
    )
    max_split_error: Annotated[float, Field(ge=0.0, le=2.0)] = Field(
        default=0.01,
        description="Of a factored_glmb: L1 error up to which labels that contended are taken as independent again, "
        "and versions of a label as one; 2: always, as an LMB; 0: where they are [-].",
    )
    max_factor_labels: Count = Field(default=20, description="Of a factored_glmb: most labels of a factor [-].")
    gaussian_method: GaussianMethod = Field(
        default="auto",
        description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist, but unscented for a "
        "target that is close to a sensor for how well its place is known [-].",
    )
    detection_at: DetectionAt = Field(
        default="centre",
        description="Of a predicted Gaussian, the probability of detection at its centre, as in the paper, or its mean "
        "over the Gaussian: for sensors whose view ends [-].",
    )
    assignment: Assignment = Field(default=RankedAssignment(), description="How measurements are associated [-].")
    limits: FilterLimits = Field(default=FilterLimits(), description="What is thrown away [-].")

    @check
    def _assignment_fits(self) -> Iterator[Finding]:
        fitting = ASSIGNMENTS.get(self.kind, ("ranked",))
        if self.assignment.kind not in fitting:
            yield (
                ("assignment", "kind"),
                f"{' or '.join(fitting)}, as the filter is {self.kind}",
                describe(self.assignment.kind),
            )

    def _assignment(self, folder: Path) -> Any:
        """Of a kind that the filter takes."""
        return self.assignment.build(folder)

    def build(self, targets: TargetModel, sensor: SensorModel, folder: Path) -> LocalFilter:
        """The filter of one sensor."""
        from vedette.filters import (
            CbMemberFilter,
            CphdFilter,
            DeltaGlmbFilter,
            FactoredGlmbFilter,
            LmbFilter,
            PhdFilter,
        )

        limits, assignment = self.limits.build(), self._assignment(folder)
        match self.kind:
            case "lmb":
                return LmbFilter(targets, sensor, limits, assignment)
            case "factored_glmb":
                return FactoredGlmbFilter(targets, sensor, limits, self.max_split_error, self.max_factor_labels)
            case "phd":
                return PhdFilter(targets, sensor, limits)
            case "cphd":
                return CphdFilter(targets, sensor, limits)
            case "cb_member":
                return CbMemberFilter(targets, sensor, limits)
        return DeltaGlmbFilter(targets, sensor, limits, assignment, self.kind == "m_delta_glmb")

    def build_central(
        self, targets: TargetModel, sensors: tuple[SensorModel, ...], folder: Path, *, in_turn: bool
    ) -> CentralFilter:
        """The filter of all sensors' scans; in_turn: whether they are taken one after the other, else jointly."""
        from vedette.filters import (
            MultiSensorGlmbFilter,
            MultiSensorLmbFilter,
            SequentialFactoredFilter,
            SequentialLmbFilter,
        )

        limits = self.limits.build()
        if self.kind == "factored_glmb":
            return SequentialFactoredFilter(targets, sensors, limits, self.max_split_error, self.max_factor_labels)
        if self.kind == "lmb":
            if in_turn:
                return SequentialLmbFilter(targets, sensors, limits, self._assignment(folder))
            return MultiSensorLmbFilter(targets, sensors, limits)
        return MultiSensorGlmbFilter(targets, sensors, limits, marginalised=self.kind == "m_delta_glmb")


class CustomFilter(Custom):
    """A user's own `vedette.filters.Filter`, made for each sensor; called with `targets` and `sensor`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of filter [-].")
    gaussian_method: GaussianMethod = Field(
        default="auto",
        description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist, but unscented for a "
        "target that is close to a sensor for how well its place is known [-].",
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
