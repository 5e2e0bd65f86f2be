"""Section about control: when to decide, and how an action is valued."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Count, Numbers, Positive, Probability, Section, Share, Steps, check
from vedette.scenarios.sections.constraints import AnyConstraint
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.search import AnySearch, Automatic

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint, PlanningSettings, PowerReward, Reward


class CauchySchwarzReward(Section):
    """Cauchy-Schwarz divergence between the predicted and the updated density (paper eqs. 5, 8 and 13 to 17)."""

    kind: Literal["cauchy_schwarz"] = Field(default="cauchy_schwarz", description="Kind of reward [-].")
    unit_volume: Literal["reference"] | Positive = Field(
        default=1.0,
        description='Unit K of hyper-volume: a number, or "reference" for (4 pi)^(d/2) sqrt(det P) of the predicted '
        "density, under which localisation counts as much as cardinality [-].",
    )

    def build(self, folder: Path) -> Reward | PowerReward:
        """The value of an updated density."""
        from vedette.control import CauchySchwarzReward

        return CauchySchwarzReward(self.unit_volume)


class RenyiReward(Section):
    """Renyi divergence of the predicted from the updated density."""

    kind: Literal["renyi"] = Field(default="renyi", description="Kind of reward [-].")
    order: Positive = Field(
        default=0.5, description="Exponent of the predicted density; not 1. 0.5: twice the Bhattacharyya distance [-]."
    )

    @check
    def _not_one(self) -> Iterator[Finding]:
        if self.order == 1.0:
            yield ("order",), "a number other than 1", "1"

    def build(self, folder: Path) -> Reward | PowerReward:
        """The value of an updated density."""
        from vedette.control import RenyiReward

        return RenyiReward(self.order)


class CustomReward(Custom):
    """A user's own `vedette.control.Reward`, a function of the predicted and the updated density, or `PowerReward`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of reward [-].")
    gives: ClassVar[str] = "vedette.control:Reward"

    def lacking(self, found: object) -> str:
        """As of other kinds; a reward of power integrals is no function."""
        from vedette.control import PowerReward

        return "" if isinstance(found, PowerReward) else super().lacking(found)

    def build(self, folder: Path) -> Reward | PowerReward:
        """The user's own."""
        made: Reward | PowerReward = self.made(folder)
        return made


AnyReward = Annotated[CauchySchwarzReward | RenyiReward | CustomReward, Field(discriminator="kind")]


class PlanningLimits(Section):
    """How much of the density the planner works with."""

    max_prior_hypotheses: Count = Field(default=10, description="Most hypotheses at the start of the horizon [-].")
    max_hypotheses: Count = Field(default=40, description="Most hypotheses after each step of the horizon [-].")
    min_relative_weight: Share = Field(
        default=1e-5, description="Hypotheses lighter than this times the heaviest are dropped [-]."
    )


def _order(name: str, moments: Sequence[float]) -> Iterator[Finding]:
    for i, (before, after) in enumerate(pairwise(moments)):
        if after <= before:
            yield (name, i + 1), f"more than the one before it, {before:g}", describe(after)


class Control(Section):
    """When and how the sensors decide where to go. Without decisions they keep their course.

    Over the horizon no target is born and none dies (paper-notes 11).
    """

    decision_steps: Steps | None = Field(default=None, description="Scans after which they decide [-].")
    decision_times: Numbers | None = Field(
        default=None, description="The same as times, instead of decision_steps; each the time of a scan [s]."
    )
    horizon_steps: Count = Field(default=5, description="Pseudo-updates over the horizon, H [-].")
    horizon_period: Positive = Field(default=2.0, description="Time between pseudo-updates, T [s].")
    num_samples: Count = Field(default=40, description="Multi-target samples of the expected reward, M [-].")
    ideal_measurements: Literal["ideal", "expected", "sampled"] = Field(
        default="ideal",
        description="Pseudo-measurements of a sample, never with clutter: noise-free, of the targets whose detection "
        "probability is at least detection_threshold; noise-free, of targets seen by chance with that probability; or "
        "seen by chance, with measurement noise [-].",
    )
    detection_threshold: Probability = Field(
        default=0.5, description="Ideal measurements see a target when its detection is at least so probable [-]."
    )
    reward: AnyReward = Field(default=CauchySchwarzReward(), description="Value of a density [-].")
    search: AnySearch = Field(default=Automatic(), description="Which joint actions a joint decision evaluates [-].")
    constraints: Annotated[tuple[AnyConstraint, ...], Field(strict=False)] = Field(
        default=(), description="What the sensors must not do [-]."
    )
    limits: PlanningLimits = Field(default=PlanningLimits(), description="How much it works with [-].")

    @check
    def _one_schedule(self) -> Iterator[Finding]:
        if self.decision_steps is not None and self.decision_times is not None:
            yield (), "either decision_steps or decision_times", "both"

    @check
    def _steps_in_order(self) -> Iterator[Finding]:
        yield from _order("decision_steps", self.decision_steps or ())

    @check
    def _times_in_order(self) -> Iterator[Finding]:
        yield from _order("decision_times", self.decision_times or ())

    def build(self, num_threads: int = 0) -> PlanningSettings:
        """Horizon, samples and caps of a decision."""
        from vedette.control import PlanningSettings, planning_limits

        return PlanningSettings(
            horizon_steps=self.horizon_steps,
            horizon_period=self.horizon_period,
            num_samples=self.num_samples,
            ideal_measurements=self.ideal_measurements,
            detection_threshold=self.detection_threshold,
            max_prior_hypotheses=self.limits.max_prior_hypotheses,
            limits=replace(
                planning_limits(),
                max_hypotheses=self.limits.max_hypotheses,
                min_relative_weight=self.limits.min_relative_weight,
            ),
            num_threads=num_threads,
        )

    def build_constraints(self, folder: Path) -> tuple[Constraint, ...]:
        """What the sensors must not do; raises `InputError` for what cannot be had."""
        return tuple(constraint.build(folder) for constraint in self.constraints)
