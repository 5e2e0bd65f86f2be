"""Sections about target birth, as the filters assume it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from vedette.internal.covariances import SMALLEST_VARIANCE
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Chance, Positive, Reals, Section, Steps, check
from vedette.scenarios.sections.world import Motion, RegionSection, grouped_order

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.kernels.base.types import Floats
    from vedette.models import BirthModel

CovRows = Annotated[tuple[Reals, ...], Field(strict=False)]


def _spreads(stds: Reals) -> Iterator[Finding]:
    """Yield faults of the standard deviations of a birth."""
    for j, std in enumerate(stds):
        if std <= 0.0:
            yield ("std", j), "a number above 0", describe(std)
        elif std * std < SMALLEST_VARIANCE:
            yield ("std", j), f"a number of at least {math.sqrt(SMALLEST_VARIANCE):g}", describe(std)


class BirthSite(Section):
    """A place where targets appear: one Bernoulli of the birth density."""

    existence: float = Field(
        gt=0.0, lt=1.0, description="Probability that a target appears, at each such scan or within the period [-]."
    )
    mean: Reals = Field(description="Mean state [m, m/s, ...].")
    std: Reals | None = Field(
        default=None, description="Standard deviation of each state component; else give cov [m, m/s, ...]."
    )
    cov: CovRows | None = Field(
        default=None, description="Covariance of the state, row by row; else give std [m^2, m^2/s, ...]."
    )

    @check
    def _one_spread(self) -> Iterator[Finding]:
        if (self.std is None) == (self.cov is None):
            yield (), "either std or cov", "both" if self.std else "neither"

    _positive = check(lambda self: _spreads(self.std or ()))

    def covariance(self) -> Floats:
        """Return the covariance of the state, in the order of the file."""
        return np.array(self.cov) if self.cov is not None else np.diag(np.square(self.std or ()))


class MeasuredBirth(Section):
    """Births anywhere in the region, of which tracks start where something is measured that no track explains."""

    expected: Positive | Literal["learnt"] = Field(
        default=0.5,
        description="Mean number of such births a scan; learnt: estimated from the scans, where undetected targets are "
        "an intensity. Where planners then search for them, a number is where that estimate starts [-].",
    )
    max_existence: Chance = Field(
        default=0.03,
        description="Most that any of them may have as existence in filters with labelled births; in others it follows "
        "from the probability of detection and the clutter [-].",
    )
    std: Reals = Field(description="Standard deviation of each state component of a birth [m, m/s, ...].")

    _positive = check(lambda self: _spreads(self.std))


class Birth(Section):
    """LMB births. Label = (birth step, index of the site); those from measurements have the indices after the sites."""

    steps: Literal["every"] | Steps = Field(
        default="every", description='Scans at which targets may appear at the sites: a list, or "every" [-].'
    )
    sites: Annotated[tuple[BirthSite, ...], Field(strict=False)] = Field(
        default=(), description="The sites, the same at every sensor [-]."
    )
    from_measurements: MeasuredBirth | None = Field(
        default=None, description="Births from measurements, beside the sites; none: at the sites alone [-]."
    )

    period: Positive | None = Field(
        default=None,
        description="Time for which the probabilities of births are meant, those from measurements too; none: a scan, "
        "however long after another [s].",
    )

    @check
    def _has_births(self) -> Iterator[Finding]:
        if not self.sites and self.from_measurements is None:
            yield ("sites",), "at least one site, or from_measurements", "neither"

    @check
    def _unique_steps(self) -> Iterator[Finding]:
        earlier: set[int] = set()
        for i, step in enumerate(() if self.steps == "every" else self.steps):
            if step in earlier:
                yield ("steps", i), "each step once", f"{step} again"
            earlier.add(step)

    def build(self, motion: Motion, region: RegionSection) -> BirthModel:
        """Return the births, shared by all sensors. region: of births from measurements."""
        from vedette.models import BirthModel, MeasurementBirth

        order, dim, num = grouped_order(motion), len(motion.components), len(self.sites)
        measured = self.from_measurements
        return BirthModel(
            np.array([site.existence for site in self.sites]),
            np.array([site.mean for site in self.sites]).reshape(num, dim)[:, order],
            np.array([site.covariance() for site in self.sites]).reshape(num, dim, dim)[:, order][:, :, order],
            None if self.steps == "every" else frozenset(self.steps),
            None
            if measured is None
            else MeasurementBirth(
                measured.expected, measured.max_existence, np.array(measured.std)[order], region.build()
            ),
            self.period,
        )
