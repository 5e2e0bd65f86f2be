"""Planners that do not keep to constraints, whose plans say which of them they violate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vedette.control.allowed import beliefs_ahead
from vedette.control.constraints import Constraint, Situation, violated
from vedette.control.inputs import check_poses, check_steering
from vedette.control.plan import Plan
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.kernels.base.types import Floats
from vedette.platforms.base import course_of
from vedette.tracking import State

if TYPE_CHECKING:
    from vedette.control.planners import Planner


@dataclass(frozen=True, slots=True, eq=False)
class WatchedPlanner:
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

    def told(self, truth: Any) -> WatchedPlanner:
        """The same, where the planner is one that is told the targets of a run (`vedette.simulation.KnowsTruth`)."""
        tell = getattr(self.planner, "told", None)
        return self if tell is None else replace(self, planner=tell(truth))

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """What the planner decides; raises what it raises, and `InputError` as `mask_of`."""
        plan, settings = self.planner.plan(state, poses, rng=rng), self.settings
        at, times = check_poses(poses, len(self.sensors)), settings.horizon_times()
        rows = zip(self.sensors, at, plan.chosen_actions, strict=True)
        courses = tuple(
            course_of(f"sensors[{s}].platform", sensor.platform, pose, row, times)[np.newaxis]
            for s, (sensor, pose, row) in enumerate(rows)
        )
        fused = getattr(state, "fused", None)
        beliefs = beliefs_ahead(self.constraints, self.sensors, fused, settings, 1, settings.horizon_steps)
        told = violated(self.constraints, Situation(courses, times, beliefs, at))
        return replace(plan, notes=(*plan.notes, *told))
