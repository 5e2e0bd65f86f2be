"""Section about control: when to decide, and how an action is valued."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import (
    Chance,
    Count,
    Numbers,
    Positive,
    Probability,
    Section,
    Share,
    Steps,
    Whole,
    check,
)
from vedette.scenarios.sections.constraints import AnyConstraint
from vedette.scenarios.sections.derived import of_kind
from vedette.scenarios.sections.lookahead import Lookahead
from vedette.scenarios.sections.rewards import AnyReward
from vedette.scenarios.sections.search import AnySearch

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint, PlanningSettings


class PlanningLimits(Section):
    """How much of the density the planner works with."""

    max_prior_hypotheses: Count = Field(default=10, description="Most hypotheses at the start of the horizon [-].")
    max_version_divergence: Annotated[float, Field(ge=0.0)] = Field(
        default=1e-3,
        description="Densities of one label within so many nats of each other are taken as one at the start of the "
        "horizon; 0: none are [nats].",
    )
    max_hypotheses: Count = Field(default=10, description="Most hypotheses after each step of the horizon [-].")
    max_glmb_sensors: Annotated[Whole, Field(ge=0)] = Field(
        default=4, description="With more sensors GLMB beliefs are planned on as LMBs, which plans then say [-]."
    )
    max_glmb_targets: Annotated[Whole, Field(ge=0)] = Field(
        default=10, description="The same with more targets expected [-]."
    )
    max_bound_work: Annotated[Whole, Field(ge=0)] = Field(
        default=256, description="Ways to see a target, times samples, that are tried for the bound of a plan [-]."
    )
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
    horizon_steps: Count | None = Field(
        default=None, description="Pseudo-updates over the horizon, H; none: up to the next decision, at most 100 [-]."
    )
    horizon_period: Positive | None = Field(
        default=None,
        description="Time between pseudo-updates, T; none: time.step_period. In longer steps than scans the "
        "acceleration of motion is held longer, and predictions spread too far [s].",
    )
    num_samples: Count = Field(default=40, description="Multi-target samples of the expected reward, M [-].")
    confidence: Chance | None = Field(
        default=None,
        description="With it, samples are added until the choice is so surely the best of its candidates, whatever "
        "num_samples says [-].",
    )
    indifference: Share = Field(
        default=0.0, description="With confidence: a reward short of the best by this share of it is good enough [-]."
    )
    max_samples: Annotated[Count, Field(ge=24)] = Field(
        default=2000, description="With confidence: samples after which the decision is taken as it stands [-]."
    )
    max_seconds: Positive | None = Field(
        default=None,
        description="With confidence: time after which it is taken likewise; what a seed gives then depends on the "
        "speed of the machine [s].",
    )
    ideal_measurements: Literal["ideal", "expected", "sampled"] = Field(
        default="ideal",
        description="Pseudo-measurements of a sample, never with clutter: noise-free, of the targets whose detection "
        "probability is at least detection_threshold; noise-free, of targets seen by chance with that probability; or "
        "seen by chance, with measurement noise [-].",
    )
    detection_threshold: Probability = Field(
        default=0.5, description="Ideal measurements see a target when its detection is at least so probable [-]."
    )
    association: Literal["known", "full"] = Field(
        default="known",
        description="Pseudo-updates of LMB beliefs: each pseudo-measurement is of its own target or else clutter, "
        "which is fast for any number of targets and sensors; or the filter's own update, which asks which it was "
        "[-].",
    )
    reward: AnyReward = Field(
        default=of_kind("expected_loss"),
        description="Value of a density; none: the expected loss, of the cutoff and the order of ospa [-].",
    )
    undetected_worth: Annotated[float, Field(ge=0.0)] = Field(
        default=0.0,
        description="What finding a target of `undetected` is worth, in units of the reward; of the expected loss "
        "m to the power of its order, such as its cutoff to that power [-].",
    )
    search: AnySearch = Field(
        default=of_kind("automatic"), description="Which joint actions a joint decision evaluates [-]."
    )
    constraints: Annotated[tuple[AnyConstraint, ...], Field(strict=False)] = Field(
        default=(), description="What the sensors must not do [-]."
    )
    explain: bool = Field(
        default=True,
        description="Whether decisions are kept with why they were taken: what targets and sensors contribute to their "
        "rewards, and how near the second best came [-].",
    )
    lookahead: Lookahead | None = Field(
        default=None, description="How the strategy lookahead decides; none: by the defaults [-]."
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

    @check
    def _confidence_beside_what_belongs_to_it(self) -> Iterator[Finding]:
        if self.confidence is None:
            for name, default in (("indifference", 0.0), ("max_samples", 2000), ("max_seconds", None)):
                value = getattr(self, name)
                if value != default:
                    yield (name,), "confidence beside it, such as 0.95", describe(value)

    def build(self, horizon: tuple[int, float], num_threads: int = 0) -> PlanningSettings:
        """Samples and caps of a decision with this horizon, H and T."""
        from vedette.control import PlanningSettings, planning_limits

        return PlanningSettings(
            horizon_steps=horizon[0],
            horizon_period=horizon[1],
            num_samples=self.num_samples,
            confidence=self.confidence,
            indifference=self.indifference,
            max_samples=self.max_samples,
            max_seconds=self.max_seconds,
            ideal_measurements=self.ideal_measurements,
            detection_threshold=self.detection_threshold,
            association=self.association,
            max_glmb_sensors=self.limits.max_glmb_sensors,
            max_glmb_targets=self.limits.max_glmb_targets,
            undetected_worth=self.undetected_worth,
            max_bound_work=self.limits.max_bound_work,
            max_prior_hypotheses=self.limits.max_prior_hypotheses,
            max_version_divergence=self.limits.max_version_divergence,
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
