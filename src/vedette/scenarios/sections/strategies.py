"""What all strategies of a scenario share: what planners are made of, and strategies that value densities."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import Field

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.deciding import AnyReward
from vedette.scenarios.sections.targets import RECORDED_DIM
from vedette.scenarios.sections.tracking import LABELLING, UNLABELLED

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint, JointSearch, MobileSensor, Planner, PlanningSettings
    from vedette.control.decisions import OthersAssumption
    from vedette.control.preparation import AnyReward as PlannedReward
    from vedette.densities import Estimator
    from vedette.fusion import Fusion
    from vedette.platforms import Actions
    from vedette.scenarios.sections.scenario import ScenarioModel


class Parts(NamedTuple):
    """What planners are made of.

    sensors: the sensors that are steered. fusion: how their densities become one; of one sensor, of it alone. settings:
    horizon, samples, caps, threads. reward: the value of a density. search: which joint actions are evaluated. others:
    what independent decisions presume of the other sensors. first_actions: what each sensor does where nothing decides.
    constraints: what they must not do. notes: what plans are to say of the fusion and of who hears whom. lookahead:
    arguments of `vedette.control.HorizonPlanner` by name, about sequences of decisions. estimate: reads the targets off
    the fused belief. oracle: arguments of `vedette.simulation.OraclePlanner` by name, about scans and scores. scene:
    what a program is told of the scenario, as plain data.
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

    def misfit(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """What is expected instead, and why, where the planner does not suit a scenario; "" where it does.

        labels: whether the filter labels its targets, where it was made; None: as its kind says.
        """
        return ""

    def words(self, model: ScenarioModel) -> str:
        """What it is, for a reader of results: `joint decisions, expected loss`."""
        return "sensors do not move"

    def planner(self, parts: Parts, folder: Path) -> Planner | None:
        """Who decides; None: nobody."""
        return None


class ValuedStrategy(Strategy):
    """A strategy that decides by a reward of its own."""

    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")
    needs_labels: ClassVar[bool] = True

    def misfit(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """Unfit where filters have no labels, which its values are of."""
        kind = model.filter.kind
        if kind not in UNLABELLED if labels is None else labels:
            return ""
        return f"nearest, assigned, centroid, oracle or custom, as {kind} filters have no labels ({LABELLING} do)"

    def by_reward(self, decisions: str, model: ScenarioModel) -> str:
        """Decisions with what they go by."""
        reward = self.reward or model.control.reward
        return f"{decisions}, {reward.words.removeprefix('minus ') or 'custom reward'}"

    def shared(self, parts: Parts, folder: Path) -> dict[str, Any]:
        """What all planners that value densities are made of."""
        reward = parts.reward if self.reward is None else self.reward.build(folder)
        names = ("sensors", "fusion", "settings", "constraints", "notes")
        return {"reward": reward, **{name: getattr(parts, name) for name in names}}


class LookaheadStrategy(ValuedStrategy):
    """Decisions over several periods, as the section about control has it."""

    def ahead(self, parts: Parts) -> dict[str, Any]:
        """How far, and by which search."""
        return parts.lookahead

    def misfit(self, model: ScenarioModel, *, labels: bool | None = None) -> str:
        """Unfit also where decisions are no sums over labels."""
        reward = self.reward or model.control.reward
        if unfit := super().misfit(model, labels=labels):
            return unfit
        if model.control.association == "known" or reward.kind == "expected_loss":
            return ""
        return "joint or another, as with control.association full decisions are no sums over labels (known has them)"

    def words(self, model: ScenarioModel) -> str:
        """Joint over several periods, and by which reward."""
        return self.by_reward("joint decisions over several periods", model)

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """With that search."""
        from vedette.control import HorizonPlanner

        return HorizonPlanner(**self.shared(parts, folder), **self.ahead(parts))


def unknown_truth(model: ScenarioModel) -> str:
    """What is expected instead where a planner needs to know the true targets and does not; "" where it does."""
    motion = model.motion
    if model.targets.kind == "unknown":
        return "one that does not know the targets, as these are unknown"
    if model.targets.kind != "recorded" or motion.kind != "custom" or motion.state_dim == RECORDED_DIM:
        return ""
    return (
        f"another kind, as states have {motion.state_dim} components under motion and the recorded targets "
        f"{RECORDED_DIM} (a motion of {RECORDED_DIM} components, or targets that are simulated, would do)"
    )


def watched(decides: Planner, parts: Parts) -> Planner:
    """A planner that does not keep to all constraints: its plans say which they violate."""
    from vedette.control import ConstraintReportingPlanner

    if not parts.constraints:
        return decides
    return ConstraintReportingPlanner(decides, parts.sensors, parts.settings, parts.constraints)
