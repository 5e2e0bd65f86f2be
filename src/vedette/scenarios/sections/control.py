"""Section about control: decision times and the value of actions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Count, Numbers, Positive, Share, Step, Steps, check
from vedette.scenarios.sections.deciding import AnyConstraint, AnyReward, AnySearch, Lookahead, Revisit
from vedette.scenarios.sections.derived import Derived, derived, of_kind

if TYPE_CHECKING:  # importing these imports the compiler, which a check does not need
    from vedette.control import Constraint, PlanningSettings


_SETTINGS = "vedette.control.settings:PlanningSettings"
_LIMITS = (
    "max_prior_hypotheses",
    "max_version_divergence",
    "max_glmb_sensors",
    "max_glmb_targets",
    "max_bound_work",
)
# Settings that a file does not give, or gives in another form.
_ELSEWHERE = (*_LIMITS, "horizon_steps", "horizon_period", "end", "limits", "num_threads")
# Alternatives for the decision times; at most one is given.
_SCHEDULES = ("decision_steps", "decision_times", "decision_every")
_FIRST = (
    *("decision_steps", "decision_times", "decision_every", "horizon_steps", "horizon_period"),
    *("num_samples", "confidence", "indifference", "max_samples", "max_seconds"),
    *("ideal_measurements", "detection_threshold", "association", "reward"),
)


@derived(_SETTINGS, only=_LIMITS, first=("max_prior_hypotheses", "max_version_divergence", "max_hypotheses"))
class PlanningLimits(Derived):
    """How much of the density the planner works with."""

    max_hypotheses: Count = Field(default=10, description="Most hypotheses after each step of the horizon [-].")
    min_relative_weight: Share = Field(
        default=1e-5, description="Hypotheses lighter than this times the heaviest are dropped [-]."
    )


def _order(name: str, moments: Sequence[float]) -> Iterator[Finding]:
    for i, (before, after) in enumerate(pairwise(moments)):
        if after <= before:
            yield (name, i + 1), f"more than the one before it, {before:g}", describe(after)


@derived(_SETTINGS, without=_ELSEWHERE, first=_FIRST)
class Control(Derived):
    """When and how the sensors decide where to go. Without decisions they keep their course.

    Over the horizon no target is born and none dies (paper-notes 11).
    """

    decision_steps: Steps | None = Field(default=None, description="Scans after which they decide [-].")
    decision_times: Numbers | None = Field(
        default=None, description="The same as times, instead of decision_steps; each the time of a scan [s]."
    )
    decision_every: Step | None = Field(
        default=None,
        description="Scans from one decision to the next, the first after as many and none after the last scan; "
        "instead of decision_steps [-].",
    )
    horizon_steps: Count | None = Field(
        default=None, description="Pseudo-updates over the horizon, H; none: up to the next decision, at most 100 [-]."
    )
    horizon_period: Positive | None = Field(
        default=None,
        description="Time between pseudo-updates, T; none: time.step_period. In longer steps than scans the "
        "acceleration of motion is held longer, and predictions spread too far [s].",
    )
    reward: AnyReward = Field(
        default=of_kind("expected_loss"),
        description="Value of a density; none: the expected loss, of the cutoff and the order of ospa [-].",
    )
    search: AnySearch = Field(
        default=of_kind("automatic"), description="Which joint actions a joint decision evaluates [-]."
    )
    others: Literal["stay", "absent"] = Field(
        default="stay",
        description="What each sensor presumes of the others under idm: they go on as they are, or, as in the paper, "
        "there are none [-].",
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
        given = [name for name in _SCHEDULES if getattr(self, name) is not None]
        if len(given) > 1:
            yield (), f"one of {', '.join(_SCHEDULES)}", " and ".join(given)

    _steps_in_order = check(lambda self: _order("decision_steps", self.decision_steps or ()))
    _times_in_order = check(lambda self: _order("decision_times", self.decision_times or ()))

    @check
    def _confidence_for_sampling_settings(self) -> Iterator[Finding]:
        if self.confidence is None:
            for name, default in (("indifference", 0.0), ("max_samples", 2000)):
                value = getattr(self, name)
                if value != default:
                    yield (name,), "confidence beside it, such as 0.95", describe(value)

    def build(self, horizon: tuple[int, float], num_threads: int = 0) -> PlanningSettings:
        """Return samples and caps of a decision with this horizon, H and T."""
        from vedette.control import PlanningSettings, planning_limits

        return PlanningSettings(
            horizon_steps=horizon[0],
            horizon_period=horizon[1],
            **self.to_arguments(),
            **self.limits.to_arguments(),
            limits=replace(
                planning_limits(),
                max_hypotheses=self.limits.max_hypotheses,
                min_relative_weight=self.limits.min_relative_weight,
            ),
            num_threads=num_threads,
        )

    def build_constraints(self, folder: FilePath) -> tuple[Constraint, ...]:
        """Return the constraints on the sensors; raises `InputError` for one that cannot be built."""
        return tuple(constraint.build(folder) for constraint in self.constraints)

    def revisit(self, *, of_targets: bool = False) -> Revisit | None:
        """Return the constraint on places, or targets, to be visited repeatedly; None if there is none."""
        revisits = [own for own in self.constraints if isinstance(own, Revisit)]
        return next((own for own in revisits if of_targets != bool(own.places)), None)
