"""What a planner is, and those without rewards: random, fixed, and a planner that is watched for what it violates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from vedette.control.constraints import Constraint, ConstraintContext, nearest_feasible, violation_notes
from vedette.control.inputs import beliefs_ahead, check_poses, check_steering, mask_of_decision, options_of
from vedette.control.plan import Plan
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.filters import labels_targets
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, instance, reject, sequence
from vedette.platforms import Actions
from vedette.platforms.base import courses_of, scans_of
from vedette.tracking import State


class Planner(Protocol):
    """Chooses an action for every sensor."""

    @property
    def name(self) -> str:
        """Name of the strategy, as in `Plan.planner`."""
        ...

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Decide from what a tracker believes after a scan and the poses (num_sensors, 3 or more)."""
        ...


@runtime_checkable
class RequiresTruth(Protocol):
    """A planner that is told the true targets at the beginning of a run; `vedette.simulation.simulate` does."""

    def with_truth(self, truth: Any) -> Planner:
        """The planner for these targets, a `vedette.simulation.Truth`."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RandomPlanner:
    """Every sensor takes one of its different courses at random, each as likely (the paper's baseline).

    Attributes:
        sensors: the sensors.
        settings: the horizon, over which courses are told apart.
        constraints: what the sensors must not do; a joint action that is drawn and not allowed is moved to one near it.

    Raises:
        InputError: parts of another kind, or constraints that look at beliefs with filters that have no labels.
    """

    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    constraints: tuple[Constraint, ...] = ()
    name: ClassVar[str] = "random"

    def __post_init__(self) -> None:
        check_steering(self)
        asking = [own.name for own in self.constraints if own.needs_beliefs]
        if asking and not all(labels_targets(sensor.filter) for sensor in self.sensors):
            raise reject("constraints", "none that asks where targets will be, as filters have no labels", asking[0])

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Drawn from `rng`; the beliefs are not looked at, but by constraints."""
        generator(rng)
        options, fused = options_of(self.sensors, poses, self.settings), None
        if self.constraints:
            instance("state", state, State)
            fused = state.fused
        mask = mask_of_decision(self.constraints, self.sensors, options, fused, np.asarray(poses), self.settings)
        drawn = tuple(int(rng.integers(len(own.courses))) for own in options)
        joint = drawn if mask is None else nearest_feasible(mask, drawn)
        chosen = tuple(own.first_action(course) for own, course in zip(options, joint, strict=True))
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), {}, mask.notes if mask else ())


@dataclass(frozen=True, slots=True, eq=False)
class FixedPlanner:
    """Every sensor keeps to an action set beforehand.

    Attributes:
        actions: for each sensor its one action, in the columns of its platform: `Actions.of(heading_deg=30.0)`.

    Raises:
        InputError: no sensor, or not one action of each.
    """

    actions: tuple[Actions, ...]
    name: ClassVar[str] = "fixed"

    def __post_init__(self) -> None:
        expected = "one action of each sensor, such as Actions.of(heading_deg=30.0)"
        given = sequence("actions", self.actions, expected)
        if not given or not all(isinstance(own, Actions) and len(own) == 1 for own in given):
            raise reject("actions", expected, self.actions)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """The set actions, whatever is believed."""
        generator(rng)
        check_poses(poses, len(self.actions))
        return Plan(self.name, self.actions, (0,) * len(self.actions), (), {})


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintReportingPlanner:
    """A planner as it is; notes of its plans name the sensors whose courses violate constraints, and the constraints.

    Attributes:
        planner: decides, whatever the constraints.
        sensors: that it steers.
        settings: the horizon, over which courses are judged.
        constraints: what the sensors must not do.

    Raises:
        InputError: parts of another kind.
    """

    planner: Planner
    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    constraints: tuple[Constraint, ...]

    def __post_init__(self) -> None:
        check_steering(self)

    @property
    def name(self) -> str:
        """Of the planner."""
        return self.planner.name

    def with_truth(self, truth: Any) -> ConstraintReportingPlanner:
        """The same, where the planner is one that is told the targets of a run."""
        planner = self.planner
        return replace(self, planner=planner.with_truth(truth)) if isinstance(planner, RequiresTruth) else self

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """What the planner decides; raises what it raises, and `InputError` as `feasible_action_mask`."""
        plan, settings = self.planner.plan(state, poses, rng=rng), self.settings
        at, times = check_poses(poses, len(self.sensors)), settings.horizon_times()
        rows = zip(self.sensors, at, plan.chosen_actions, strict=True)
        ways = [
            (f"sensors[{s}].platform", own.platform, pose, row[np.newaxis], times)
            for s, (own, pose, row) in enumerate(rows)
        ]
        courses, scans = tuple(courses_of(*way) for way in ways), tuple(scans_of(*way) for way in ways)
        fused = getattr(state, "fused", None)
        beliefs = beliefs_ahead(self.constraints, self.sensors, fused, settings, 1, settings.horizon_steps)
        told = violation_notes(self.constraints, ConstraintContext(courses, times, beliefs, at, scans))
        return replace(plan, notes=(*plan.notes, *told))
