"""Shared parts of all strategies of a scenario: the parts of planners, and strategies that value densities."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import Field

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.deciding import AnyReward

if TYPE_CHECKING:  # importing the planners imports the compiler, which a check does not need
    from vedette.control import Constraint, JointSearch, MobileSensor, Planner, PlanningSettings
    from vedette.control.decisions import OthersAssumption
    from vedette.control.preparation import AnyReward as PlannedReward
    from vedette.densities import Estimator
    from vedette.fusion import Fusion
    from vedette.platforms import Actions
    from vedette.scenarios.sections.control import Control


class Parts(NamedTuple):
    """Parts of planners."""

    sensors: tuple[MobileSensor, ...]  # the sensors that are controlled
    fusion: Fusion  # of their densities; with one sensor, of that alone
    settings: PlanningSettings  # horizon, samples, caps, threads
    reward: PlannedReward  # the value of a density
    search: JointSearch  # which joint actions are evaluated
    others: OthersAssumption  # assumption of independent decisions about the other sensors
    first_actions: tuple[Actions, ...]  # action of each sensor before any decision
    constraints: tuple[Constraint, ...]  # on the sensors
    notes: tuple[str, ...]  # texts of plans about fusion and network
    lookahead: dict[str, Any]  # arguments of `vedette.control.HorizonPlanner` by name, about sequences of decisions
    estimate: Estimator  # estimates the targets from the fused belief
    oracle: dict[str, Any]  # arguments of `vedette.simulation.OraclePlanner` by name, about scans and scores
    scene: Callable[[], dict[str, Any]]  # function that returns the data of the scenario that a program receives


class Strategy(Section):
    """A way to decide, of every scenario or under a name of its own."""

    needs_labels: ClassVar[bool] = False
    words: ClassVar[str] = "sensors do not move"

    def description(self, control: Control) -> str:
        """Return a description for readers of results: `joint decisions, expected loss`."""
        return self.words

    def planner(self, parts: Parts, folder: Path) -> Planner | None:
        """Return the planner; None if the sensors do not move."""
        return None


class ValuedStrategy(Strategy):
    """A strategy that decides by a reward of its own."""

    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")
    needs_labels: ClassVar[bool] = True

    def description(self, control: Control) -> str:
        """Return the description of decisions with their reward."""
        reward = self.reward or control.reward
        return f"{self.words}, {reward.words.removeprefix('minus ') or 'custom reward'}"

    def shared(self, parts: Parts, folder: Path) -> dict[str, Any]:
        """Return the arguments of all planners that value densities."""
        reward = parts.reward if self.reward is None else self.reward.build(folder)
        names = ("sensors", "fusion", "settings", "constraints", "notes")
        return {"reward": reward, **{name: getattr(parts, name) for name in names}}


class LookaheadStrategy(ValuedStrategy):
    """Decisions over several periods, as the section about control has it."""

    words: ClassVar[str] = "joint decisions over several periods"

    def ahead(self, parts: Parts) -> dict[str, Any]:
        """Return the arguments of the depth and the search."""
        return parts.lookahead

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner with that search."""
        from vedette.control import HorizonPlanner

        return HorizonPlanner(**self.shared(parts, folder), **self.ahead(parts))


def with_reported_violations(decides: Planner, parts: Parts) -> Planner:
    """Return a planner whose plans report violated constraints, for one that does not observe all of them."""
    from vedette.control import ConstraintReportingPlanner

    if not parts.constraints:
        return decides
    return ConstraintReportingPlanner(decides, parts.sensors, parts.settings, parts.constraints)
