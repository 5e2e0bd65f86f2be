"""Rules of thumb: sensors head for the estimated targets, without any reward, as manual control would."""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

import numpy as np

from vedette.control.constraints.mask import nearest_feasible
from vedette.control.constraints.paths import VisibilityGraph, visibility_graph
from vedette.control.constraints.protocol import Constraint
from vedette.control.cost_to_go import CostToGo
from vedette.control.inputs import check_control_inputs, mask_of_decision, options_of, single_mask
from vedette.control.plan import Plan
from vedette.control.search.problem import first_best
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Estimator, best_estimate
from vedette.kernels.base.types import HALF_WIDTH, POINTING, Floats, Ints
from vedette.models.arguments import dimension, generator, instance, one_of, reject, sequence
from vedette.platforms import Options
from vedette.tracking import State

Rule: TypeAlias = Literal["nearest", "assigned_target", "centroid"]

# Weight of the pointing error relative to distances: above rounding, below relevant differences of distances.
_AIM = 1e-6
# m, added to the distance of a course that does not move, if the path to its place has bends.
_WAITING = 1e6


def _nearest(gaps: Floats) -> Ints:
    """Return each sensor's nearest target not taken by a sensor before it. When all are taken, from all again."""
    taken = np.zeros(gaps.shape[1], np.int64)
    chosen = []
    for own in gaps:
        chosen.append(int(np.argmin(np.where(taken == taken.min(), own, np.inf))))
        taken[chosen[-1]] += 1
    return np.array(chosen)


@dataclass(frozen=True, slots=True, eq=False)
class RulePlanner:
    """A planner by a rule of thumb: every sensor heads for a place among the presently estimated targets.

    It takes the course that is nearest to that place in the mean over the horizon, which for courses of one speed is
    the one nearest in heading. A stationary camera turns to it. If no target is estimated, each sensor takes its first
    course. If constraints forbid zones, distances are lengths of shortest paths around them. A place that no path
    reaches is approached as closely as paths allow, and plans name the targets that no sensor can see.

    Attributes:
        sensors: the sensors.
        rule: "nearest": for each sensor, in printed order, its nearest target that no sensor before it took.
            "assigned_target": the s-th target, in the order of labels, for the s-th sensor. "centroid": the mean of
            all, for all sensors.
        settings: the horizon, over which courses are distinguished.
        constraints: limits on the sensors' courses. Each sensor takes its best feasible course, and a joint action that
            is not allowed is replaced by a feasible one near it. If only some sensors may scan, those that come nearest
            do.
        estimate: estimator that extracts targets from the fused belief.
        targets: for "assigned_target": the number of each sensor's target instead, counted from 1. Numbers beyond the
            last target start again from the first.

    Raises:
        InputError: parts of another type, or `targets` with another rule or number of sensors.
    """

    sensors: tuple[MobileSensor, ...]
    rule: Rule
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    constraints: tuple[Constraint, ...] = ()
    estimate: Estimator = best_estimate
    targets: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        check_control_inputs(self)
        one_of("rule", self.rule, get_args(Rule))
        if self.targets is not None:
            given = sequence("targets", self.targets, f"{len(self.sensors)} numbers of targets, one a sensor")
            if self.rule != "assigned_target" or len(given) != len(self.sensors):
                expected = f"{len(self.sensors)} numbers of targets, one per sensor, for the rule assigned_target"
                raise reject("targets", expected, f"{self.targets} for {self.rule}")
            object.__setattr__(self, "targets", tuple(dimension(f"targets[{s}]", own) for s, own in enumerate(given)))

    @property
    def name(self) -> str:
        """Name of the strategy: the rule."""
        return self.rule

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the courses that head for the rule's places, of equal ones the first in printed order. Draws nothing.

        Raises `InputError` for invalid inputs, and the errors of the estimator.
        """
        generator(rng)
        instance("state", state, State)
        options = options_of(self.sensors, poses, self.settings)
        at = np.asarray(poses, np.float64)
        mask = mask_of_decision(self.constraints, self.sensors, options, state, at, self.settings)
        estimate, graph = self.estimate(state.fused, state.step), visibility_graph(self.constraints)
        places = np.ascontiguousarray(np.asarray(estimate.means)[:, :2])
        to_go = CostToGo.of(self.sensors, options, estimate.labels, places, graph, None)
        goals = self._goals(places, to_go) if len(places) else [None] * len(options)
        merits = [_merits(own, goal, graph) for own, goal in zip(options, goals, strict=True)]
        joint = tuple(
            first_best(np.where(single_mask(mask, s, len(own)), own, -np.inf)) for s, own in enumerate(merits)
        )
        if mask is not None:
            if mask.active is not None:
                joint = mask.active.within_limit(
                    joint, [own[course] for own, course in zip(merits, joint, strict=True)]
                )
            joint = nearest_feasible(mask, joint)
        chosen = tuple(own.first_action(course) for own, course in zip(options, joint, strict=True))
        notes = (*(mask.notes if mask else ()), *to_go.notes())
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), {}, notes)

    def _goals(self, places: Floats, to_go: CostToGo) -> Floats:
        """Return (num_sensors, 2) m, goals of the sensors among the places (num_targets, 2)."""
        if self.rule == "centroid":
            return np.tile(places.mean(axis=0), (len(self.sensors), 1))
        if self.rule == "assigned_target":
            numbers = np.arange(len(self.sensors)) if self.targets is None else np.array(self.targets) - 1
            return np.asarray(places[numbers % len(places)])
        return np.asarray(places[_nearest(to_go.distances())])


def _merits(own: Options, goal: Floats | None, graph: VisibilityGraph) -> Floats:
    """Return (num_courses,) the negative mean distance to a place. Ties are broken by how well a camera points."""
    if goal is None:
        return np.zeros(len(own.courses))
    offsets = goal - own.courses[..., :2]
    gaps, waiting_costs = np.hypot(offsets[..., 0], offsets[..., 1]), np.zeros(len(own.courses))
    paths, moves = graph.to(goal[np.newaxis], own.pose[:2]), (own.courses[..., :2] != own.pose[:2]).any(axis=(1, 2))
    if not paths.are_straight(own.pose[np.newaxis, :2].copy())[0, 0]:  # The sensor may have to step aside first.
        waiting_costs[~moves] = _WAITING
    free = moves & ~graph.is_blocked(own.pose[:2], own.courses[..., :2])
    around = paths.distances(own.courses[free, :, :2].reshape(-1, 2)).reshape(gaps[free].shape)
    gaps[free] = np.where(np.isfinite(around), around, gaps[free])
    near: Floats = -gaps.mean(axis=1)
    if own.courses.shape[2] > HALF_WIDTH and (own.courses[..., HALF_WIDTH] > 0.0).any():
        turn = np.arctan2(offsets[..., 1], offsets[..., 0]) - own.courses[..., POINTING]
        near = near + _AIM * max(1.0, float(-near.min())) * np.cos(turn).mean(axis=1)
    return np.asarray(near - waiting_costs)
