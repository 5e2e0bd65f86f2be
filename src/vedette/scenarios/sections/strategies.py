"""Shared parts of all strategies of a scenario: the parts of planners, and strategies that value densities."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import Field

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.deciding import AnyReward
from vedette.scenarios.sections.targets import RECORDED_DIM
from vedette.scenarios.sections.tracking import LABELLING, UNLABELLED

if TYPE_CHECKING:  # importing the planners imports the compiler, which a check does not need
    from vedette.control import Constraint, JointSearch, MobileSensor, Planner, PlanningSettings
    from vedette.control.decisions import OthersAssumption
    from vedette.control.preparation import AnyReward as PlannedReward
    from vedette.densities import Estimator
    from vedette.fusion import Fusion
    from vedette.platforms import Actions
    from vedette.scenarios.sections.scenario import ScenarioModel


class Parts(NamedTuple):
    """Parts of planners.

    sensors: the sensors that are controlled. fusion: of their densities; with one sensor, of that alone. settings:
    horizon, samples, caps, threads. reward: the value of a density. search: which joint actions are evaluated. others:
    assumption of independent decisions about the other sensors. first_actions: action of each sensor before any
    decision. constraints: on the sensors. notes: texts of plans about fusion and network. lookahead: arguments of
    `vedette.control.HorizonPlanner` by name, about sequences of decisions. estimate: estimates the targets from the
    fused belief. oracle: arguments of `vedette.simulation.OraclePlanner` by name, about scans and scores. scene:
    function that returns the data of the scenario that a program receives.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings
    reward: PlannedReward
    search: JointSearch
    others: OthersAssumption
    first_actions: tuple[Actions, ...]
    constraints: tuple[Constraint, ...]
    notes: tuple[str, ...]
    lookahead: dict[str, Any]
    estimate: Estimator
    oracle: dict[str, Any]
    scene: Callable[[], dict[str, Any]]


class Strategy(Section):
    """A way to decide, of every scenario or under a name of its own."""

    needs_labels: ClassVar[bool] = False

    def incompatibility(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """Return the requirement that is not met, and why, if the planner does not suit a scenario; "" if it does.

        labels: True if the filter, already built, labels its targets; None: determined from its kind.
        """
        return ""

    def description(self, model: ScenarioModel) -> str:
        """Return a description for readers of results: `joint decisions, expected loss`."""
        return "sensors do not move"

    def planner(self, parts: Parts, folder: Path) -> Planner | None:
        """Return the planner; None if the sensors do not move."""
        return None


class ValuedStrategy(Strategy):
    """A strategy that decides by a reward of its own."""

    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")
    needs_labels: ClassVar[bool] = True

    def incompatibility(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """Return the requirement that is not met if filters have no labels, which the values need."""
        kind = model.filter.kind
        if kind not in UNLABELLED if labels is None else labels:
            return ""
        return (
            f"nearest, assigned_target, centroid, oracle or custom, as {kind} filters have no labels ({LABELLING} do)"
        )

    def by_reward(self, decisions: str, model: ScenarioModel) -> str:
        """Return the description of decisions with their reward."""
        reward = self.reward or model.control.reward
        return f"{decisions}, {reward.words.removeprefix('minus ') or 'custom reward'}"

    def shared(self, parts: Parts, folder: Path) -> dict[str, Any]:
        """Return the arguments of all planners that value densities."""
        reward = parts.reward if self.reward is None else self.reward.build(folder)
        names = ("sensors", "fusion", "settings", "constraints", "notes")
        return {"reward": reward, **{name: getattr(parts, name) for name in names}}


class LookaheadStrategy(ValuedStrategy):
    """Decisions over several periods, as the section about control has it."""

    def ahead(self, parts: Parts) -> dict[str, Any]:
        """Return the arguments of the depth and the search."""
        return parts.lookahead

    def incompatibility(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """Return the requirement that is not met, also if decisions are not sums over labels."""
        reward = self.reward or model.control.reward
        if unfit := super().incompatibility(model, labels=labels):
            return unfit
        if model.control.association == "known" or reward.kind == "expected_loss":
            return ""
        return "joint or another, as with control.association full decisions are no sums over labels (known has them)"

    def description(self, model: ScenarioModel) -> str:
        """Return a description: joint over several periods, and by which reward."""
        return self.by_reward("joint decisions over several periods", model)

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner with that search."""
        from vedette.control import HorizonPlanner

        return HorizonPlanner(**self.shared(parts, folder), **self.ahead(parts))


def missing_truth(model: ScenarioModel) -> str:
    """Return the requirement of a planner that uses true targets; "" if these are known completely."""
    motion = model.motion
    if model.targets.kind == "unknown":
        return "one that does not know the targets, as these are unknown"
    if model.targets.kind != "recorded" or motion.kind != "custom" or motion.state_dim == RECORDED_DIM:
        return ""
    return (
        f"another kind, as states have {motion.state_dim} components under motion and the recorded targets "
        f"{RECORDED_DIM} (a motion of {RECORDED_DIM} components, or targets that are simulated, would do)"
    )


def with_reported_violations(decides: Planner, parts: Parts) -> Planner:
    """Return a planner whose plans report violated constraints, for one that does not observe all of them."""
    from vedette.control import ConstraintReportingPlanner

    if not parts.constraints:
        return decides
    return ConstraintReportingPlanner(decides, parts.sensors, parts.settings, parts.constraints)
