"""The planner protocol, planners without rewards (random, fixed), and a wrapper that reports violations."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from vedette.control.constraints.mask import nearest_feasible
from vedette.control.constraints.masks import violation_notes
from vedette.control.constraints.protocol import Constraint, ConstraintContext
from vedette.control.inputs import check_control_inputs, check_poses, mask_of_decision, options_of, predicted_beliefs
from vedette.control.plan import Plan
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.filters import has_labels
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, instance, reject, sequence
from vedette.platforms import Actions
from vedette.platforms.base import courses_of, scans_of
from vedette.tracking import State


class Planner(Protocol):
    """A planner, which chooses an action for every sensor."""

    @property
    def name(self) -> str:
        """Name of the strategy, as in `Plan.planner`."""

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the plan for the state of a tracker after a scan and the sensor poses (num_sensors, 3 or more)."""


@runtime_checkable
class RequiresTruth(Protocol):
    """A planner that receives the true targets at the beginning of a run, from `vedette.simulation.simulate`."""

    def with_truth(self, truth: Any) -> Planner:
        """Return the planner for these targets, a `vedette.simulation.Truth`."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomPlanner:
    """A planner that draws one of the distinct courses of each sensor, with equal probabilities (the paper's baseline).

    Attributes:
        sensors: the sensors.
        settings: the horizon, over which courses are distinguished.
        constraints: limits on the sensors' courses. A joint action that violates them is replaced by a feasible one
            near it.

    Raises:
        InputError: parts of another type, or constraints that need beliefs with filters that have no labels.
    """

    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    constraints: tuple[Constraint, ...] = ()
    name: ClassVar[str] = "random"

    def __post_init__(self) -> None:
        check_control_inputs(self)
        needing_beliefs = [constraint.name for constraint in self.constraints if constraint.needs_beliefs]
        if needing_beliefs and not all(has_labels(sensor.filter) for sensor in self.sensors):
            raise reject(
                "constraints", "none that asks where targets will be, as filters have no labels", needing_beliefs[0]
            )

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return a plan drawn from `rng`. Beliefs are used only by constraints."""
        generator(rng)
        options = options_of(self.sensors, poses, self.settings)
        if self.constraints:
            instance("state", state, State)
        mask = mask_of_decision(self.constraints, self.sensors, options, state, np.asarray(poses), self.settings)
        drawn = tuple(int(rng.integers(len(own.courses))) for own in options)
        joint = drawn if mask is None else nearest_feasible(mask, drawn)
        chosen = tuple(own.first_action(course) for own, course in zip(options, joint, strict=True))
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), {}, mask.notes if mask else ())


@dataclass(frozen=True, slots=True, eq=False)
class ConstantPlanner:
    """A planner that always takes the same action of each sensor.

    Attributes:
        actions: for each sensor its one action, in the columns of its platform: `Actions.of(heading_deg=30.0)`.

    Raises:
        InputError: no sensor, or not exactly one action for each.
    """

    actions: tuple[Actions, ...]
    name: ClassVar[str] = "constant"

    def __post_init__(self) -> None:
        expected = "one action of each sensor, such as Actions.of(heading_deg=30.0)"
        given = sequence("actions", self.actions, expected)
        if not given or not all(isinstance(own, Actions) and len(own) == 1 for own in given):
            raise reject("actions", expected, self.actions)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the fixed actions, whatever the state."""
        generator(rng)
        check_poses(poses, len(self.actions))
        return Plan(self.name, self.actions, (0,) * len(self.actions), (), {})


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintReportingPlanner:
    """A planner that decides as another does, and notes which sensors violate which constraints.

    Attributes:
        planner: the planner that decides, regardless of the constraints.
        sensors: the sensors that it steers.
        settings: the horizon, over which courses are tested.
        constraints: the constraints that are tested.
    """

    planner: Planner
    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    constraints: tuple[Constraint, ...]

    def __post_init__(self) -> None:
        check_control_inputs(self)

    @property
    def name(self) -> str:
        """Name of the planner."""
        return self.planner.name

    def with_truth(self, truth: Any) -> "ConstraintReportingPlanner":
        """Return this planner with the true targets, if the wrapped planner requires them."""
        planner = self.planner
        return replace(self, planner=planner.with_truth(truth)) if isinstance(planner, RequiresTruth) else self

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the planner's decision. Raises its errors, and `InputError` as `feasible_action_mask`."""
        plan, settings = self.planner.plan(state, poses, rng=rng), self.settings
        at, times = check_poses(poses, len(self.sensors)), settings.horizon_times()
        rows = zip(self.sensors, at, plan.chosen_actions, strict=True)
        arguments = [
            (f"sensors[{s}].platform", own.platform, pose, row[np.newaxis], times)
            for s, (own, pose, row) in enumerate(rows)
        ]
        courses, scans = tuple(courses_of(*way) for way in arguments), tuple(scans_of(*way) for way in arguments)
        beliefs = predicted_beliefs(self.constraints, self.sensors, state, settings, 1, settings.horizon_steps)
        unseen = getattr(state, "unseen", None)
        notes = violation_notes(self.constraints, ConstraintContext(courses, times, beliefs, at, scans, unseen))
        return replace(plan, notes=(*plan.notes, *notes))
