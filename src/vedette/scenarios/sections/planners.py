"""The strategies by name: their only declarations, and custom ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Count, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.deciding import AnySearch, Lookahead
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.program import ProgramSection
from vedette.scenarios.sections.strategies import (
    LookaheadStrategy,
    Parts,
    Strategy,
    ValuedStrategy,
    with_reported_violations,
)

if TYPE_CHECKING:  # importing the planners imports the compiler, which a check does not need
    from vedette.control import Plan, Planner
    from vedette.scenarios.sections.control import Control
    from vedette.simulation import Truth


class NamedJoint(ValuedStrategy):
    """Joint decisions, as of jdm, by a search or a reward of its own: strategies to compare in one campaign."""

    kind: Literal["joint"] = Field(default="joint", description="Kind of planner [-].")
    search: AnySearch | None = Field(default=None, description="In place of control.search; none: that one [-].")
    words: ClassVar[str] = "joint decisions"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the joint planner with the search."""
        from vedette.control import JointPlanner

        search = parts.search if self.search is None else self.search.build(folder)
        return JointPlanner(**self.shared(parts, folder), search=search)


class NamedJointWithTruth(NamedJoint):
    """Joint decisions on the true targets (`true_targets`): the floor that strategies are compared with."""

    kind: Literal["true_targets"] = Field(default="true_targets", description="Kind of planner [-].")  # type: ignore[assignment]

    def description(self, control: Control) -> str:
        """Return a description: joint, with the true targets."""
        return "joint decisions, true targets given"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the joint planner on beliefs about the true targets, without undetected ones."""
        from vedette.simulation import TrueTargetsPlanner

        settings = replace(parts.settings, undetected_target_value=0.0)
        joint = super().planner(parts._replace(settings=settings), folder)
        return TrueTargetsPlanner(joint, parts.sensors, parts.oracle["cutoff"], parts.estimate)


class NamedIndependent(ValuedStrategy):
    """Independent decisions, as of idm, by a reward or a presumption of its own."""

    kind: Literal["independent"] = Field(default="independent", description="Kind of planner [-].")
    others: Literal["stay", "absent"] | None = Field(
        default=None, description="In place of control.others; none: that one [-]."
    )
    words: ClassVar[str] = "independent decisions"

    def description(self, control: Control) -> str:
        """Return a description: independent, by which reward, and the assumption about other sensors."""
        return f"{super().description(control)}, other sensors {self.others or control.others}"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner; its plans report violated constraints, as it ignores those on pairs of sensors."""
        from vedette.control import IndependentPlanner

        own = IndependentPlanner(**self.shared(parts, folder), others=self.others or parts.others)
        return with_reported_violations(own, parts)


class NamedLookahead(LookaheadStrategy, Lookahead):
    """Decisions over several periods, as of lookahead, by a reward or a depth of its own."""

    kind: Literal["lookahead"] = Field(default="lookahead", description="Kind of planner [-].")

    def ahead(self, parts: Parts) -> dict[str, Any]:
        """Return the arguments from the section itself."""
        return self.build()


_RULES = {
    "nearest": "each sensor to its nearest target",
    "assigned_target": "sensor s to target s",
    "centroid": "all sensors to the centroid of the targets",
}


class NamedRule(Strategy):
    """Sensors that head for the estimated targets by a rule of thumb, as of the strategies of these names."""

    kind: Literal["nearest", "assigned_target", "centroid"] = Field(
        description="For each sensor its nearest target that none before it took; the s-th target for the s-th sensor; "
        "the middle of all targets [-]."
    )
    targets: Annotated[tuple[Count, ...], Field(strict=False)] | None = Field(
        default=None, description="Of assigned: the number of each sensor's target instead, counted from 1 [-]."
    )

    @check
    def _targets_of_assigned(self) -> Iterator[Finding]:
        if self.targets is not None and self.kind != "assigned_target":
            yield ("targets",), f"none, as the rule is {self.kind}", describe(list(self.targets))

    def description(self, control: Control) -> str:
        """Return a description: the rule."""
        return f"rule of thumb: {_RULES[self.kind]}"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner of the rule."""
        from vedette.control import RulePlanner

        return RulePlanner(parts.sensors, self.kind, parts.settings, parts.constraints, parts.estimate, self.targets)


@derived("vedette.simulation.oracle:OraclePlanner", without=("cutoff",))
class NamedOracle(Strategy, Derived):
    """What is done by who knows where the targets are, as of oracle: the floor beside which strategies are put."""

    kind: Literal["oracle"] = Field(default="oracle", description="Kind of planner [-].")
    words: ClassVar[str] = "best decisions for the true targets"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner; it receives the true targets later."""
        from vedette.simulation import OraclePlanner

        own: dict[str, Any] = {"settings": parts.settings, "constraints": parts.constraints, "estimate": parts.estimate}
        return OraclePlanner(parts.sensors, **own, **parts.oracle, **self.to_arguments())


class CustomPlanner(Strategy, Custom):
    """A user's own planner; called with `sensors`, `fusion`, `settings`, `reward`, `search`, `others`,
    `first_actions`, `constraints`, `notes`, `lookahead`, `estimate`, `oracle`, `scene`, of which it names those that it
    wants."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of planner [-].")
    spared: ClassVar[tuple[str, ...]] = ("name",)  # given by the scenario
    gives: ClassVar[str] = "vedette.control:Planner"

    def description(self, control: Control) -> str:
        """Return a description: the class or function."""
        return f"custom planner {self.function}"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the custom planner."""
        return with_reported_violations(self.instantiate(folder, **parts._asdict()), parts)


class ProgramStrategy(Strategy, ProgramSection):
    """A planner that is a program."""

    def description(self, control: Control) -> str:
        """Return a description: the command."""
        return f"external program {self.code}"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        """Return the planner that runs the program."""
        from vedette.control import ProgramPlanner

        names = ("sensors", "scene", "settings", "constraints", "estimate")
        return ProgramPlanner(**{name: getattr(parts, name) for name in names}, **self.call_arguments(folder))


class _Random(Strategy):
    words: ClassVar[str] = "random actions"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        from vedette.control import RandomPlanner

        return RandomPlanner(parts.sensors, parts.settings, parts.constraints)


class _Fixed(Strategy):
    words: ClassVar[str] = "first course kept"

    def planner(self, parts: Parts, folder: Path) -> Planner:
        from vedette.control import ConstantPlanner

        return with_reported_violations(ConstantPlanner(parts.first_actions), parts)


# The strategies of every scenario. Not validated: that would build the validators of rewards and searches at import.
STRATEGIES: dict[str, Strategy] = {
    "jdm": NamedJoint.model_construct(),
    "idm": NamedIndependent.model_construct(),
    "lookahead": LookaheadStrategy.model_construct(),
    "nearest": NamedRule(kind="nearest"),
    "assigned_target": NamedRule(kind="assigned_target"),
    "centroid": NamedRule(kind="centroid"),
    "oracle": NamedOracle(),
    "true_targets": NamedJointWithTruth.model_construct(),
    "random": _Random(),
    "constant": _Fixed(),
    "stationary": Strategy(),
}


@dataclass(frozen=True, slots=True)
class NamedPlanner:
    """A planner with its name in the scenario."""

    name: str
    planner: Planner

    def plan(self, *situation: Any, rng: np.random.Generator) -> Plan:
        """Return the planner's plan, under this name."""
        return replace(self.planner.plan(*situation, rng=rng), planner=self.name)

    def with_truth(self, truth: Truth) -> NamedPlanner:
        """Return the planner with the true targets, if it requires them; else unchanged."""
        from vedette.simulation import RequiresTruth

        return (
            replace(self, planner=self.planner.with_truth(truth)) if isinstance(self.planner, RequiresTruth) else self
        )


AnyPlanner = Annotated[
    NamedJoint
    | NamedIndependent
    | NamedLookahead
    | NamedRule
    | NamedOracle
    | NamedJointWithTruth
    | CustomPlanner
    | ProgramStrategy,
    Field(discriminator="kind"),
]
