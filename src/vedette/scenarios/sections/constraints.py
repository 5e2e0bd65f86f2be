"""Sections about what sensors must not do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vedette.plausible import told_elsewhere
from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import Point, Section, check
from vedette.scenarios.sections.derived import Part, derived, one_of
from vedette.scenarios.sections.world import RegionSection


@derived("vedette.control.constraints.regions:StayInside")
class StayInside(Part):
    """Every platform stays inside a rectangle."""

    kind: Literal["stay_inside"] = Field(default="stay_inside", description="Kind of constraint [-].")
    region: RegionSection


class KeepOut(Section):
    """No platform enters a rectangle or a polygon."""

    kind: Literal["keep_out"] = Field(default="keep_out", description="Kind of constraint [-].")
    region: RegionSection | None = Field(default=None, description="A rectangle [-].")
    polygon: Annotated[tuple[Point, ...], Field(strict=False, min_length=3)] | None = Field(
        default=None, description="The corners of a polygon in order, instead of a rectangle [m]."
    )

    @check
    def _one_area(self) -> Iterator[Finding]:
        if (self.region is None) == (self.polygon is None):
            yield (), "either region or polygon", "none" if self.region is None else "both"

    def build(self, folder: Path) -> Any:
        """The constraint."""
        from vedette.control import KeepOut

        with told_elsewhere():
            return KeepOut(np.array(self.polygon) if self.region is None else self.region.build())


if TYPE_CHECKING:
    AnyConstraint = Part
else:
    AnyConstraint = one_of("constraint", "control/constraints", "vedette.control:Constraint", own=(StayInside, KeepOut))
