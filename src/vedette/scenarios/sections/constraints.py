"""Sections about what sensors must not do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vedette.plausible import told_elsewhere
from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import Point, Positive, Probability, Section, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint


class StayInside(Section):
    """Every platform stays inside a rectangle."""

    kind: Literal["stay_inside"] = Field(default="stay_inside", description="Kind of constraint [-].")
    region: RegionSection = Field(description="The rectangle [-].")

    def build(self, folder: Path) -> Constraint:
        """The constraint."""
        from vedette.control import StayInside

        return StayInside(self.region.build())


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

    def build(self, folder: Path) -> Constraint:
        """The constraint."""
        from vedette.control import KeepOut

        with told_elsewhere():
            return KeepOut(np.array(self.polygon) if self.region is None else self.region.build())


class Separation(Section):
    """Any two platforms keep a least distance."""

    kind: Literal["separation"] = Field(default="separation", description="Kind of constraint [-].")
    distance: Positive = Field(description="Least distance [m].")

    def build(self, folder: Path) -> Constraint:
        """The constraint."""
        from vedette.control import Separation

        return Separation(self.distance)


class VoidProbability(Section):
    """Around every sensor no target is near, with a least probability."""

    kind: Literal["void_probability"] = Field(default="void_probability", description="Kind of constraint [-].")
    radius: Positive = Field(description="Within which no target is to be [m].")
    probability: Probability = Field(description="That there is none, at least, at each time of the horizon [-].")

    def build(self, folder: Path) -> Constraint:
        """The constraint."""
        from vedette.control import VoidProbability

        return VoidProbability(self.radius, self.probability)


class CustomConstraint(Custom):
    """A user's own `vedette.control.Constraint`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of constraint [-].")
    gives: ClassVar[str] = "vedette.control:Constraint"

    def build(self, folder: Path) -> Constraint:
        """The user's own."""
        made: Constraint = self.made(folder)
        return made


AnyConstraint = Annotated[
    StayInside | KeepOut | Separation | VoidProbability | CustomConstraint, Field(discriminator="kind")
]
