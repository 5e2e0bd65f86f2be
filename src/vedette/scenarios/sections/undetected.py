"""The targets that no sensor has found yet, of which planners are told that search for them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Positive
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import UndetectedModel
    from vedette.scenarios.sections.scenario import ScenarioModel

# Of every sensor, P_D is asked at nine places in each at every scan: some 40 ms for so many.
MAX_CELLS = 250_000


@derived("vedette.models.undetected:UndetectedModel", first=("cell",))
class UndetectedSection(Derived):
    """How many targets there are that no sensor has found yet, on a grid: some at first, others that appear later."""

    cell: Positive = Field(description="Side of a cell, at most [m].")
    expected: float = Field(ge=0.0, description="Mean number of them at the first scan, spread evenly [-].")
    speed: float = Field(
        ge=0.0,
        description="Standard deviation of both components of their velocity, drawn anew at every scan [m/s].",
    )
    region: RegionSection | None = Field(
        default=None, description="Where they are; none: in the region of the scenario [-]."
    )

    def build(self, region: RegionSection) -> UndetectedModel:
        """The model; region: of the scenario, for want of one of its own."""
        from vedette.models import CellGrid, UndetectedModel

        grid = CellGrid.covering((self.region or region).build(), self.cell)
        return UndetectedModel(grid, **self.given())


def cells_of_undetected(model: ScenarioModel) -> Iterator[Finding]:
    """The region is cut into a number of cells that can be held and worked on; what is worth finding may be there."""
    section = model.undetected
    if section is None:
        worth = model.control.undetected_worth
        if worth > 0.0:
            wanted = "0, or a section `undetected`, which says where such targets may be"
            yield ("control", "undetected_worth"), wanted, describe(worth)
        return
    region = section.region or model.region
    width, height = region.x_max - region.x_min, region.y_max - region.y_min
    if min(width, height) <= 0.0:
        return
    if max(math.ceil(width / section.cell), 1) * max(math.ceil(height / section.cell), 1) > MAX_CELLS:
        wanted = f"at least {_enough(width, height):.3g}, as at most {MAX_CELLS:,} cells may fill the region"
        yield ("undetected", "cell"), wanted, describe(section.cell)


def _enough(width: float, height: float) -> float:
    """A size that is large enough and stays so when it is rounded to three digits."""
    half = 0.5 * (width + height) / (MAX_CELLS - 1)  # (width / size + 1) (height / size + 1) = MAX_CELLS
    return 1.005 * (half + math.sqrt(half * half + width * height / (MAX_CELLS - 1)))
