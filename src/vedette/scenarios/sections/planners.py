"""The strategies by name: the one place where they are declared, and those of the user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import JointSearch, MobileSensor, Plan, Planner, PlanningSettings, PowerReward, Reward
    from vedette.fusion import Fusion
    from vedette.platforms import Actions


class Parts(NamedTuple):
    """What planners are made of.

    sensors: the sensors that are steered. fusion: how their densities become one; of one sensor, of it alone. settings:
    horizon, samples, caps, threads. reward: the value of a density. search: which joint actions are evaluated.
    first_actions: what each sensor does where nothing decides. notes: what plans are to say of the fusion. lookahead:
    arguments of `vedette.control.HorizonPlanner` by name, about sequences of decisions.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings
    reward: Reward | PowerReward
    search: JointSearch
    first_actions: tuple[Actions, ...]
    notes: tuple[str, ...]
    lookahead: dict[str, Any]


class Strategy(NamedTuple):
    """A strategy that every scenario has: whether it needs labels, and how its planner is made."""

    needs_labels: bool
    planner: Callable[[Parts], Planner | None]


def _joint(parts: Parts) -> Planner:
    from vedette.control import JointPlanner

    return JointPlanner(parts.sensors, parts.fusion, parts.settings, parts.reward, parts.search, notes=parts.notes)


def _lookahead(parts: Parts) -> Planner:
    from vedette.control import HorizonPlanner

    return HorizonPlanner(
        parts.sensors, parts.fusion, parts.settings, parts.reward, notes=parts.notes, **parts.lookahead
    )


def _independent(parts: Parts) -> Planner:
    from vedette.control import IndependentPlanner

    return IndependentPlanner(parts.sensors, parts.fusion, parts.settings, parts.reward)


def _random(parts: Parts) -> Planner:
    from vedette.control import RandomPlanner

    return RandomPlanner(parts.sensors, parts.settings)


def _fixed(parts: Parts) -> Planner:
    from vedette.control import FixedPlanner

    return FixedPlanner(parts.first_actions)


STRATEGIES = {
    "jdm": Strategy(True, _joint),
    "idm": Strategy(True, _independent),
    "lookahead": Strategy(True, _lookahead),
    "random": Strategy(False, _random),
    "fixed": Strategy(False, _fixed),
    "still": Strategy(False, lambda parts: None),
}


class CustomPlanner(Custom):
    """A user's own planner; called with `sensors`, `fusion`, `settings`, `reward`, `search`, `first_actions`, `notes`,
    `lookahead`, of which it names those that it wants."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of planner [-].")
    spared: ClassVar[tuple[str, ...]] = ("name",)  # which the scenario gives
    gives: ClassVar[str] = "vedette.control:Planner"

    def build(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The user's own, under the name that the scenario gives it."""
        return Named(name, self.made(folder, **parts._asdict()))


@dataclass(frozen=True, slots=True)
class Named:
    """A planner of the user's own under the name that the scenario gives it."""

    name: str
    planner: Planner

    def plan(self, *situation: Any, rng: np.random.Generator) -> Plan:
        """What the planner decides."""
        return replace(self.planner.plan(*situation, rng=rng), planner=self.name)
