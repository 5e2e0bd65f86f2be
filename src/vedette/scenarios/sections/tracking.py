"""Sections about tracking: the filters."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import (
    DetectionAt,
    GaussianMethod,
    Section,
    check,
)
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Derived, Part, derived, of_kind, one_of

if TYPE_CHECKING:  # importing the filters imports the compiler, which a check does not need
    from vedette.filters import Filter as LocalFilter
    from vedette.models import SensorModel, TargetModel
    from vedette.tracking import CentralFilter


if TYPE_CHECKING:
    Assignment = Part
else:
    Assignment = one_of("assignment", "filters", "vedette.filters:CustomMarginals, for an lmb")


@derived("vedette.filters.limits:Limits")
class FilterLimits(Part):
    """Caps and thresholds of a filter: what it throws away, and so what it costs."""


# Filters without labels.
UNLABELLED = ("phd", "cphd", "cb_member")
# Filters with labels, for messages.
LABELLING = "delta_glmb, m_delta_glmb, lmb and factored_glmb"
# Kinds of assignment that a filter supports, if not all.
_REQUIRED_RESULTS = {"delta_glmb": "choices", "m_delta_glmb": "choices", "lmb": "marginals"}
# Filters with a number of targets limited by `max_labels`.
LABEL_LIMITED = ("lmb", "factored_glmb", "cb_member")


class _Sensing(Section):
    """How any filter takes what a sensor measures and detects."""

    gaussian_method: GaussianMethod = Field(
        default="auto",
        description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist, but linearised "
        "again at each measurement of a target whose position is too uncertain for the sensor's noise [-].",
    )
    detection_at: DetectionAt | None = Field(
        default=None,
        description="Of a predicted Gaussian, the probability of detection at its centre, as in the paper, or its mean "
        "over the Gaussian, where a miss also moves the density out of view; none: mean with kind factored_glmb, or "
        "lmb with births: poisson, else centre [-].",
    )

    @property
    def built_kind(self) -> str:
        """Kind of the filter that is built: an lmb with Poisson births is a factored_glmb of independent labels."""
        kind: str = getattr(self, "kind", "")
        return "factored_glmb" if kind == "lmb" and getattr(self, "births", None) == "poisson" else kind


@derived("vedette.filters.factored:FactoredGlmbFilter", only=("max_split_error", "max_factor_labels", "births"))
class Filter(_Sensing, Derived):
    """The filter that every sensor runs on its own scans."""

    kind: Literal["delta_glmb", "m_delta_glmb", "lmb", "factored_glmb", "phd", "cphd", "cb_member"] = Field(
        default="factored_glmb",
        description="delta-GLMB; delta-GLMB marginalised after each scan (one component a label set); LMB; product of "
        "delta-GLMBs, each of the labels that contend with each other, for any number of targets; or, without labels "
        "and for a single sensor that nobody steers by its density: PHD, CPHD, cardinality-balanced multi-Bernoulli "
        "[-].",
    )
    births: Literal["poisson", "labelled"] | None = Field(
        default=None,
        description="Of a factored_glmb or lmb: poisson: targets that were never detected are a Poisson intensity, and "
        "a label begins with a first detection, except at sites with an existence of .15 or more; so a site may have "
        "several undetected targets. An lmb is then a factored_glmb with a max_split_error of 2 (a PMB). labelled: a "
        "label begins at each birth site at each scan. none: labelled with kind lmb, else poisson. Filters whose "
        "beliefs are fused by label have labelled births, whatever this value is [-].",
    )
    assignment: Assignment = Field(default=of_kind("ranked"), description="How measurements are associated [-].")
    limits: FilterLimits = Field(default=FilterLimits(), description="What is thrown away [-].")

    @check
    def _assignment_fits(self) -> Iterator[Finding]:
        required = _REQUIRED_RESULTS.get(self.built_kind, "choices and marginals")
        fitting = [
            section.model_fields["kind"].default
            for section in get_args(get_args(Assignment)[0])
            if required in getattr(section, "finds", "marginals")  # those of the user's own
        ]
        if self.assignment.kind not in fitting:
            yield (
                ("assignment", "kind"),
                f"{' or '.join(fitting)}, as the filter is {self.kind}"
                f"{' with births: poisson' * (self.built_kind != self.kind)}",
                describe(self.assignment.kind),
            )

    def to_arguments(self) -> dict[str, Any]:
        """Return the arguments of a `FactoredGlmbFilter`."""
        split = {"max_split_error": 2.0} if self.kind == "lmb" else {}
        return {**super().to_arguments(), "births": self.births or "poisson", **split}

    def build(self, targets: TargetModel, sensor: SensorModel, folder: Path) -> LocalFilter:
        """Return the filter of one sensor."""
        from vedette.filters import (
            CbMemberFilter,
            CphdFilter,
            DeltaGlmbFilter,
            FactoredGlmbFilter,
            LmbFilter,
            PhdFilter,
        )

        limits, assignment = self.limits.build(), self.assignment.build(folder)
        match self.built_kind:
            case "lmb":
                return LmbFilter(targets, sensor, limits, assignment)
            case "factored_glmb":
                return FactoredGlmbFilter(targets, sensor, limits, **self.to_arguments())
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
        """Return the filter of all sensors' scans; in_turn: True for sequential updates, else joint ones."""
        from vedette.filters import (
            MultiSensorGlmbFilter,
            MultiSensorLmbFilter,
            SequentialFactoredFilter,
            SequentialLmbFilter,
        )

        limits = self.limits.build()
        if self.built_kind == "factored_glmb":
            return SequentialFactoredFilter(targets, sensors, limits, **self.to_arguments())
        if self.kind == "lmb":
            if in_turn:
                return SequentialLmbFilter(targets, sensors, limits, self.assignment.build(folder))
            return MultiSensorLmbFilter(targets, sensors, limits)
        return MultiSensorGlmbFilter(targets, sensors, limits, marginalised=self.kind == "m_delta_glmb")


class CustomFilter(_Sensing, Custom):
    """A user's own `vedette.filters.Filter`, made for each sensor; called with `targets` and `sensor`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of filter [-].")
    gives: ClassVar[str] = "vedette.filters:Filter"

    def build(self, targets: TargetModel, sensor: SensorModel, folder: Path) -> LocalFilter:
        """Return the filter of one sensor."""
        local_filter: LocalFilter = self.instantiate(folder, targets=targets, sensor=sensor)
        return local_filter


AnyFilter = Annotated[Filter | CustomFilter, Field(discriminator="kind")]
