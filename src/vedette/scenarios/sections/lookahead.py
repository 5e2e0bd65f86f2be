"""Section about decisions over several periods."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Count, Positive, Probability, Section, check


class Lookahead(Section):
    """How many decisions the strategy `lookahead` takes at once, of which it carries out the first."""

    depth: Annotated[Count, Field(le=100)] = Field(default=3, description="Number of decisions [-].")
    period: Positive | None = Field(
        default=None,
        description="Time from a decision to the next, a whole multiple of horizon_period; none: horizon_steps times "
        "horizon_period [s].",
    )
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
    rollout: Literal["random", "kept"] | None = Field(
        default=None,
        description="Of tree: how a beginning is completed, by random actions, or by keeping to the last one; none: "
        "random [-].",
    )
    budget: Count = Field(default=2000, description="Most joint sequences that are evaluated for a decision [-].")
    discount: Probability | None = Field(
        default=0.25,
        description="Weight of the reward at the end of a decision's horizon relative to that of the decision before; "
        "none: only the end of the last one's counts [-].",
    )

    @check
    def _of_the_method(self) -> Iterator[Finding]:
        for name, method in (("beam_width", "beam"), ("exploration", "tree"), ("rollout", "tree")):
            if method != self.method and getattr(self, name) is not None:
                yield (name,), f"none, as it is of method {method}", describe(getattr(self, name))

    def build(self) -> dict[str, Any]:
        """Arguments of `vedette.control.HorizonPlanner` by name."""
        from vedette.control import BeamSearch, TreeSearch

        names = ("beam_width",) if self.method == "beam" else ("exploration", "rollout")
        given = {name: value for name in names if (value := getattr(self, name)) is not None}
        search = BeamSearch(**given) if self.method == "beam" else TreeSearch(**given)
        shared = {name: getattr(self, name) for name in ("depth", "period", "budget", "discount")}
        return {"search": search, **shared}
