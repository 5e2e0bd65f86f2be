"""Sections about decisions: rewards, constraints, searches, and lookahead."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from vedette.errors import InputError
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Count, Point, Probability, Section, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Derived, Part, derived, one_of
from vedette.scenarios.sections.world import RegionSection


@derived("vedette.control.rewards.power:RenyiReward")
class RenyiReward(Part):
    """Renyi divergence of the predicted from the updated density."""

    kind: Literal["renyi"] = Field(default="renyi", description="Kind of reward [-].")

    @check
    def _not_one(self) -> Iterator[Finding]:
        if self.order == 1.0:
            yield ("order",), "a number other than 1", "1"


class CustomReward(Custom):
    """A user's own `vedette.control.Reward`, a function of the predicted and the updated density, `PowerReward` or
    `LabelReward`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of reward [-].")
    words: ClassVar[str] = ""
    gives: ClassVar[str] = "vedette.control:Reward"

    def protocol_mismatch(self, reward: object) -> str:
        """Return in words how an object fails as a reward; a reward of sums need not be a function."""
        from vedette.control import LabelReward, PowerReward

        return "" if isinstance(reward, PowerReward | LabelReward) else super().protocol_mismatch(reward)

    def build(self, folder: Path) -> Any:
        """Return the custom reward."""
        return self.instantiate(folder)


if TYPE_CHECKING:
    AnyReward = Part
else:
    AnyReward = one_of("reward", "control/rewards", own=(RenyiReward, CustomReward))


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
    holes: Annotated[
        tuple[Annotated[tuple[Point, ...], Field(strict=False, min_length=3)], ...], Field(strict=False)
    ] = Field(default=(), description="Polygons inside it that may be entered: the corners of each in order [m].")
    geojson: str | None = Field(
        default=None,
        description="GeoJSON file, relative to the scenario file, each polygon of which is such a zone; needs an "
        "origin. A scenario that was read has the polygons instead [-].",
    )

    @check
    def _one_area(self) -> Iterator[Finding]:
        given = [name for name in ("region", "polygon", "geojson") if getattr(self, name) is not None]
        if len(given) != 1:
            yield (), "either region, polygon or geojson", " and ".join(given) or "none"

    def build(self, folder: Path) -> Any:
        """Return the constraint. Raises `InputError` if its file was not read, as `load_scenario` does."""
        from vedette.control import KeepOut

        if self.geojson is not None:
            raise InputError("geojson: expected its polygons, as load_scenario reads them; got the name of a file")
        with suppress_unit_warnings():
            area = np.array(self.polygon) if self.region is None else self.region.build()
            return KeepOut(area, tuple(np.array(hole) for hole in self.holes))


@derived("vedette.control.constraints.revisit:Revisit")
class Revisit(Part):
    """Maximum time between visits of each place by any moving sensor, or between scans of each target by any sensor."""

    kind: Literal["revisit"] = Field(default="revisit", description="Kind of constraint [-].")
    places: Annotated[tuple[Point, ...], Field(strict=False)] = Field((), description="Places; none: targets [m].")


if TYPE_CHECKING:
    AnyConstraint = Part
else:
    _OWN = (StayInside, KeepOut, Revisit)
    AnyConstraint = one_of("constraint", "control/constraints", "vedette.control:Constraint", own=_OWN)


@derived(
    "vedette.control.lookahead.planner:HorizonPlanner",
    only=("depth", "period", "budget", "discount"),
    first=("depth", "period", "method", "beam_width", "exploration", "rollout"),
)
class Lookahead(Derived):
    """How many decisions the strategy `lookahead` takes at once, of which it carries out the first."""

    depth: Annotated[Count, Field(le=100)] = 3
    method: Literal["beam", "tree"] = Field(
        default="beam",
        description="Search where there are more joint sequences than the budget: beams of sequences, sensor by "
        "sensor; or Monte-Carlo tree search [-].",
    )
    beam_width: Count | None = Field(
        default=None, description="Of beam: sequences of a sensor kept at each decision; none: 8 [-]."
    )
    exploration: Probability | None = Field(
        default=None, description="Of tree: weight of what was seldom tried; none: 0.3 [-]."
    )
    rollout: Literal["random", "repeat_last"] | None = Field(
        default=None,
        description="Of tree: how a beginning is completed, by random actions, or by keeping to the last one; none: "
        "random [-].",
    )

    @check
    def _fields_of_other_methods(self) -> Iterator[Finding]:
        for name, method in (("beam_width", "beam"), ("exploration", "tree"), ("rollout", "tree")):
            if method != self.method and getattr(self, name) is not None:
                yield (name,), f"none, as it is of method {method}", describe(getattr(self, name))

    def build(self) -> dict[str, Any]:
        """Return arguments of `vedette.control.HorizonPlanner` by name."""
        from vedette.control import BeamSearch, TreeSearch

        names = ("beam_width",) if self.method == "beam" else ("exploration", "rollout")
        given = {name: value for name in names if (value := getattr(self, name)) is not None}
        search = BeamSearch(**given) if self.method == "beam" else TreeSearch(**given)
        return {"search": search, **self.to_arguments()}


if TYPE_CHECKING:
    AnySearch = Part
else:
    AnySearch = one_of("search", "control/search", "vedette.control:JointSearch")
