"""Sections about the results: estimators and scores."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Chance, Count, Positive, Section, check
from vedette.scenarios.sections.derived import Part, derived, one_of

if TYPE_CHECKING:  # importing the densities imports the compiler, which a check does not need
    from vedette.densities import Estimate, Estimator
    from vedette.filters import Belief


class MapEstimator(Section):
    """Most probable number of targets, then the best hypothesis with that number (as in the paper). Of a filter without
    labels, the heaviest components or Bernoullis instead, newly labelled at each scan; a phd's number is the mean."""

    kind: Literal["map"] = Field(default="map", description="Kind of estimate [-].")

    def build(self, folder: Path) -> Estimator:
        """Return a function of a density and the number of its scan, by which unlabelled estimates are named."""
        from vedette.densities import map_or_unlabelled

        return map_or_unlabelled


class LeastOspaEstimator(Section):
    """Best hypothesis with the number of targets that has the least expected OSPA, where a target is in place or not;
    for filters that have labels. Candidates that are each improbable are not shown, however many there are."""

    kind: Literal["least_ospa"] = Field(default="least_ospa", description="Kind of estimate [-].")

    def build(self, folder: Path) -> Estimator:
        """Return a function of a density and the number of its scan that returns the estimates."""
        from vedette.densities import least_ospa_estimate

        return lambda density, step: least_ospa_estimate(density)


class LeastGospaEstimator(Section):
    """Every label whose report lowers the expected GOSPA of the positions (alpha = 2), at the point of least expected
    error; for filters that have labels. The less certain the position, the more must existence exceed 0.5."""

    kind: Literal["least_gospa"] = Field(default="least_gospa", description="Kind of estimate [-].")
    cutoff: Positive | None = Field(
        default=None, description="Error that counts as a missed and a false target, c; none: that of `ospa` [m]."
    )
    order: float | None = Field(default=None, ge=1.0, description="Order p; none: that of `ospa` [-].")

    def build(self, folder: Path) -> Estimator:
        """Return a function of a density and the number of its scan that returns the estimates."""
        from vedette.densities import least_gospa_estimate

        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        return lambda density, step: least_gospa_estimate(density, **given)


class MarginalEstimator(Section):
    """Every label whose existence is probable enough; for filters that have labels."""

    kind: Literal["marginal"] = Field(default="marginal", description="Kind of estimate [-].")
    threshold: Chance = Field(default=0.5, description="Least probability of existence [-].")

    def build(self, folder: Path) -> Estimator:
        """Return a function of a density and the number of its scan that returns the estimates."""
        from vedette.densities import LabelledDensity, marginal_estimate, unlabelled_estimate

        def estimate(density: Belief, step: int) -> Estimate:
            if not isinstance(density, LabelledDensity):
                return unlabelled_estimate(density, step)
            return marginal_estimate(density, self.threshold)

        return estimate


@derived("vedette.evaluation.metrics.tracked_fraction:TrackedFraction", without=("cutoff", "order"))
class TrackedFraction(Part):
    """At each scan, the share of the targets seen by some sensor that have an estimate within the cutoff of `ospa`."""

    kind: Literal["tracked_fraction"] = Field(default="tracked_fraction", description="Kind of measure [-].")


@derived("vedette.evaluation.metrics.tracked_fraction:TimeToTrack", without=("cutoff", "order"))
class TimeToTrack(Part):
    """At each scan, the mean time until the targets that appear at it are tracked, within the cutoff of `ospa` [s]."""

    kind: Literal["time_to_track"] = Field(default="time_to_track", description="Kind of measure [-].")


if TYPE_CHECKING:
    AnyEstimator = Part
    AnyMetric = Part
else:
    _ESTIMATOR = "vedette.densities:Estimator, a function of the density and the number of the scan"
    _METRIC = "vedette.simulation.records:Measure, a function of a run's record that gives one number a scan"
    _OWN = (MapEstimator, LeastOspaEstimator, LeastGospaEstimator, MarginalEstimator)
    AnyEstimator = one_of("estimator", "densities", _ESTIMATOR, own=_OWN)
    AnyMetric = one_of("metric", "evaluation/metrics", _METRIC, own=(TrackedFraction, TimeToTrack))


class Ospa(Section):
    """The score: optimal subpattern assignment distance between estimates and truth."""

    cutoff: Positive = Field(default=100.0, description="Cost of a missed or false target, c [m].")
    order: float = Field(default=1.0, ge=1.0, description="Order p [-].")
    components: Literal["position", "position_and_height", "state"] = Field(
        default="position",
        description="What OSPA compares: positions in the plane, or with their heights, in metres; or whole states, "
        "with metres, m/s and rad/s as numbers of one kind, and the cutoff in no unit. Measures beside OSPA are of "
        "positions in the plane [-].",
    )
    truth: Literal["complete", "partial"] = Field(
        default="complete",
        description="Whether all targets are known, or only some of them, such as ships with AIS. With partial truth "
        "no estimate counts that is as far as the cutoff from every known target [-].",
    )
    window: Count = Field(default=10, description="Scans of the window of OSPA(2) [-].")
    first_scan: Count | None = Field(
        default=None, description="First scan of the reported mean; none: the one after the first decision, or 1 [-]."
    )
    last_scan: Count | None = Field(
        default=None, description="Last scan of the reported mean; none: the last scan [-]."
    )

    @check
    def _in_order(self) -> Iterator[Finding]:
        if self.first_scan is not None and self.last_scan is not None and self.last_scan < self.first_scan:
            yield ("last_scan",), f"a scan from first_scan, {self.first_scan}, on", describe(self.last_scan)

    @property
    def unit(self) -> str:
        """Unit of the score: that of a position, or none."""
        return "" if self.components == "state" else "m"
