"""The strategies by name: the one place where they are declared, and those of the user's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Count, Section, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.lookahead import Lookahead
from vedette.scenarios.sections.rewards import AnyReward
from vedette.scenarios.sections.search import AnySearch

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import Constraint, JointSearch, MobileSensor, Plan, Planner, PlanningSettings
    from vedette.control.preparation import AnyReward as PlannedReward
    from vedette.control.rules_of_thumb import Rule
    from vedette.densities import Estimator
    from vedette.fusion import Fusion
    from vedette.platforms import Actions
    from vedette.simulation import Truth


class Parts(NamedTuple):
    """What planners are made of.

    sensors: the sensors that are steered. fusion: how their densities become one; of one sensor, of it alone. settings:
    horizon, samples, caps, threads. reward: the value of a density. search: which joint actions are evaluated.
    first_actions: what each sensor does where nothing decides. constraints: what they must not do. notes: what plans
    are to say of the fusion and of who hears whom. lookahead: arguments of `vedette.control.HorizonPlanner` by name,
    about sequences of decisions. estimate: reads the targets off the fused belief. oracle: arguments of
    `vedette.simulation.OraclePlanner` by name, about scans and scores.
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
    estimate: Estimator
    oracle: dict[str, Any]


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


def _rule(rule: Rule, targets: tuple[int, ...] | None = None) -> Callable[[Parts], Planner]:
    def planner(parts: Parts) -> Planner:
        from vedette.control import RulePlanner

        return RulePlanner(parts.sensors, rule, parts.settings, parts.constraints, parts.estimate, targets)

    return planner


def _oracle(parts: Parts, **given: Any) -> Planner:
    from vedette.simulation import OraclePlanner

    own: dict[str, Any] = {"settings": parts.settings, "constraints": parts.constraints, "estimate": parts.estimate}
    return OraclePlanner(parts.sensors, **own, **parts.oracle, **given)


STRATEGIES = {
    "jdm": Strategy(True, _joint),
    "idm": Strategy(True, _independent),
    "lookahead": Strategy(True, _lookahead),
    "nearest": Strategy(False, _rule("nearest")),
    "assigned": Strategy(False, _rule("assigned")),
    "centroid": Strategy(False, _rule("centroid")),
    "oracle": Strategy(False, _oracle),
    "random": Strategy(False, _random),
    "fixed": Strategy(False, _fixed),
    "still": Strategy(False, lambda parts: None),
}


class _Valued(Section):
    """A strategy that decides by a reward of its own."""

    reward: AnyReward | None = Field(default=None, description="In place of control.reward; none: that one [-].")

    def valued(self, parts: Parts, folder: Path) -> Parts:
        """With that reward."""
        return parts if self.reward is None else parts._replace(reward=self.reward.build(folder))


class NamedJoint(_Valued):
    """Joint decisions, as of jdm, by a search or a reward of its own: strategies to compare in one campaign."""

    kind: Literal["joint"] = Field(default="joint", description="Kind of planner [-].")
    search: AnySearch | None = Field(default=None, description="In place of control.search; none: that one [-].")
    needs_labels: ClassVar[bool] = STRATEGIES["jdm"].needs_labels

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        search = parts.search if self.search is None else self.search.build(folder)
        return Named(name, _joint(self.valued(parts, folder)._replace(search=search)))


class NamedIndependent(_Valued):
    """Independent decisions, as of idm, by a reward of its own."""

    kind: Literal["independent"] = Field(default="independent", description="Kind of planner [-].")
    needs_labels: ClassVar[bool] = STRATEGIES["idm"].needs_labels

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        return Named(name, _independent(self.valued(parts, folder)))


class NamedLookahead(_Valued, Lookahead):
    """Decisions over several periods, as of lookahead, by a reward or a depth of its own."""

    kind: Literal["lookahead"] = Field(default="lookahead", description="Kind of planner [-].")
    needs_labels: ClassVar[bool] = STRATEGIES["lookahead"].needs_labels

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        return Named(name, _lookahead(self.valued(parts, folder)._replace(lookahead=self.build())))


class NamedRule(Section):
    """Sensors that head for the estimated targets by a rule of thumb, as of the strategies of these names."""

    kind: Literal["nearest", "assigned", "centroid"] = Field(
        description="For each sensor its nearest target that none before it took; the s-th target for the s-th sensor; "
        "the middle of all targets [-]."
    )
    targets: Annotated[tuple[Count, ...], Field(strict=False)] | None = Field(
        default=None, description="Of assigned: the number of each sensor's target instead, counted from 1 [-]."
    )
    needs_labels: ClassVar[bool] = False

    @check
    def _targets_of_assigned(self) -> Iterator[Finding]:
        if self.targets is not None and self.kind != "assigned":
            yield ("targets",), f"none, as the rule is {self.kind}", describe(list(self.targets))

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        return Named(name, _rule(self.kind, self.targets)(parts))


@derived("vedette.simulation.oracle:OraclePlanner")
class NamedOracle(Derived):
    """What is done by who knows where the targets are, as of oracle: the floor beside which strategies are put."""

    kind: Literal["oracle"] = Field(default="oracle", description="Kind of planner [-].")
    needs_labels: ClassVar[bool] = False

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
        """The planner, under the name that the scenario gives it."""
        return Named(name, _oracle(parts, **self.given()))


class CustomPlanner(Custom):
    """A user's own planner; called with `sensors`, `fusion`, `settings`, `reward`, `search`, `first_actions`,
    `constraints`, `notes`, `lookahead`, `estimate`, `oracle`, of which it names those that it wants."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of planner [-].")
    spared: ClassVar[tuple[str, ...]] = ("name",)  # which the scenario gives
    gives: ClassVar[str] = "vedette.control:Planner"
    needs_labels: ClassVar[bool] = False

    def planner(self, name: str, parts: Parts, folder: Path) -> Planner:
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

    def told(self, truth: Truth) -> Named:
        """The same, where the planner is one that knows the targets of a run."""
        from vedette.simulation import KnowsTruth

        return replace(self, planner=self.planner.told(truth)) if isinstance(self.planner, KnowsTruth) else self


AnyPlanner = Annotated[
    NamedJoint | NamedIndependent | NamedLookahead | NamedRule | NamedOracle | CustomPlanner,
    Field(discriminator="kind"),
]
