"""The strategies by name: the one place where they are declared, and those of the user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.rewards import AnyReward
from vedette.scenarios.sections.search import AnySearch

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint, JointSearch, MobileSensor, Plan, Planner, PlanningSettings
    from vedette.control.preparation import AnyReward as PlannedReward
    from vedette.fusion import Fusion
    from vedette.platforms import Actions


class Parts(NamedTuple):
    """What planners are made of.

    sensors: the sensors that are steered. fusion: how their densities become one; of one sensor, of it alone. settings:
    horizon, samples, caps, threads. reward: the value of a density. search: which joint actions are evaluated.
    first_actions: what each sensor does where nothing decides. constraints: what they must not do. notes: what plans
    are to say of the fusion and of who hears whom. lookahead: arguments of `vedette.control.HorizonPlanner` by name,
    about sequences of decisions.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings
    reward: PlannedReward
    search: JointSearch
    first_actions: tuple[Actions, ...]
    constraints: tuple[Constraint, ...]
    notes: tuple[str, ...]
    lookahead: dict[str, Any]


class Strategy(NamedTuple):
    """A strategy that every scenario has: whether it needs labels, and how its planner is made."""

    needs_labels: bool
    planner: Callable[[Parts], Planner | None]


def _joint(parts: Parts) -> Planner:
    from vedette.control import JointPlanner

    return JointPlanner(
        parts.sensors,
        parts.fusion,
        parts.settings,
        parts.reward,
        parts.search,
        parts.constraints,
        parts.notes,
    )


def _lookahead(parts: Parts) -> Planner:
    from vedette.control import HorizonPlanner

    return HorizonPlanner(
        parts.sensors,
        parts.fusion,
        parts.settings,
        parts.reward,
        constraints=parts.constraints,
        notes=parts.notes,
        **parts.lookahead,
    )


def _independent(parts: Parts) -> Planner:
    from vedette.control import IndependentPlanner

    decides = IndependentPlanner(
        parts.sensors, parts.fusion, parts.settings, parts.reward, parts.constraints, parts.notes
    )
    return _watched(decides, parts)  # of pairs of sensors it knows nothing


def _random(parts: Parts) -> Planner:
    from vedette.control import RandomPlanner

    return RandomPlanner(parts.sensors, parts.settings, parts.constraints)


def _fixed(parts: Parts) -> Planner:
    from vedette.control import FixedPlanner

    return _watched(FixedPlanner(parts.first_actions), parts)


def _watched(decides: Planner, parts: Parts) -> Planner:
    """A planner that does not keep to all constraints: its plans say which they violate."""
    from vedette.control import WatchedPlanner

    if not parts.constraints:
        return decides
    return WatchedPlanner(decides, parts.sensors, parts.settings, parts.constraints)


STRATEGIES = {
    "jdm": Strategy(True, _joint),
    "idm": Strategy(True, _independent),
    "lookahead": Strategy(True, _lookahead),
    "random": Strategy(False, _random),
    "fixed": Strategy(False, _fixed),
    "still": Strategy(False, lambda parts: None),
}


class NamedJoint(Section):
    """Joint decisions, as of jdm, by a search or a reward of its own: strategies to compare in one campaign."""

    kind: Literal["joint"] = Field(default="joint", description="Kind of planner [-].")
    search: AnySearch | None = Field(default=None, description="In place of control.search; none: that one [-].")
    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")
    needs_labels: ClassVar[bool] = STRATEGIES["jdm"].needs_labels

    def build(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        search = parts.search if self.search is None else self.search.build(folder)
        reward = parts.reward if self.reward is None else self.reward.build(folder)
        return Named(name, _joint(parts._replace(search=search, reward=reward)))


class NamedIndependent(Section):
    """Independent decisions, as of idm, by a reward of its own."""

    kind: Literal["independent"] = Field(default="independent", description="Kind of planner [-].")
    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")
    needs_labels: ClassVar[bool] = STRATEGIES["idm"].needs_labels

    def build(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        reward = parts.reward if self.reward is None else self.reward.build(folder)
        return Named(name, _independent(parts._replace(reward=reward)))


class CustomPlanner(Custom):
    """A user's own planner; called with `sensors`, `fusion`, `settings`, `reward`, `search`, `first_actions`,
    `constraints`, `notes`, `lookahead`, of which it names those that it wants."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of planner [-].")
    spared: ClassVar[tuple[str, ...]] = ("name",)  # which the scenario gives
    gives: ClassVar[str] = "vedette.control:Planner"
    needs_labels: ClassVar[bool] = False

    def build(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The user's own, under the name that the scenario gives it."""
        return Named(name, _watched(self.made(folder, **parts._asdict()), parts))


@dataclass(frozen=True, slots=True)
class Named:
    """A planner under the name that the scenario gives it."""

    name: str
    planner: Planner

    def plan(self, *situation: Any, rng: np.random.Generator) -> Plan:
        """What the planner decides."""
        return replace(self.planner.plan(*situation, rng=rng), planner=self.name)


AnyPlanner = Annotated[NamedJoint | NamedIndependent | CustomPlanner, Field(discriminator="kind")]
