"""The section about undetected targets: the cells of their intensity."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import NonNegative, Positive, check
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.models import UndetectedModel


@derived("vedette.models.undetected:UndetectedModel", first=("cell_size",))
class UndetectedSection(Derived):
    """How many targets there are that no sensor has found yet, on a grid: some at first, others that appear later."""

    cell_size: Positive = Field(description="Side of a cell, at most [m].")
    expected: float = Field(ge=0.0, description="Mean number of them at the first scan, spread evenly [-].")
    speed: float = Field(
        ge=0.0,
        description="Standard deviation of both components of their velocity, drawn anew at every scan [m/s].",
    )
    birth_rate: NonNegative | Literal["learnt"] | None = Field(
        default=None,
        description="Mean number of targets that appear in the region in a second; learnt: estimated from the first "
        "detections, where undetected targets are an intensity; none: learnt where they are and tracks start from "
        "measurements, else 0 [1/s].",
    )
    prior_rate: Positive | None = Field(
        default=None,
        description="Where the birth rate is learnt, the mean of its prior density, a gamma of shape 1/2; none: what "
        "birth.from_measurements expects, or one target in ten scans [1/s].",
    )
    region: RegionSection | None = Field(
        default=None, description="Where they are; none: in the region of the scenario [-]."
    )

    @check
    def _prior_of_learnt(self) -> Iterator[Finding]:
        if self.prior_rate is not None and self.birth_rate != "learnt":
            yield ("prior_rate",), "none, as birth_rate is not learnt", describe(self.prior_rate)

    def build(self, region: RegionSection) -> UndetectedModel:
        """Return the model; region: of the scenario, used if the section has none."""
        from vedette.models import CellGrid, UndetectedModel

        grid = CellGrid.covering((self.region or region).build(), self.cell_size)
        return UndetectedModel(
            grid, **{name: value for name, value in self.to_arguments().items() if value is not None}
        )
