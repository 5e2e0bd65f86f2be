"""Rules of thumb: sensors head for the estimated targets, without any reward, as one would steer them by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

import numpy as np

from vedette.control.beyond_horizon import BeyondHorizon
from vedette.control.constraints import Constraint, VisibilityGraph, nearest_feasible, visibility_graph
from vedette.control.inputs import check_steering, mask_of_decision, options_of, single_mask
from vedette.control.plan import Plan
from vedette.control.search import first_best
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import Estimator, best_estimate
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import dimension, generator, instance, one_of, reject, sequence
from vedette.platforms import Options
from vedette.platforms.camera import HALF_WIDTH, POINTING
from vedette.tracking import State

Rule: TypeAlias = Literal["nearest", "assigned", "centroid"]

# Weight of how well it points, relative to distances: above rounding, below what tells places apart.
_AIM = 1e-6
# m, added to the distance of a course that goes nowhere, where the path to its place has bends.
_WAITING = 1e6


def _nearest(gaps: Floats) -> Ints:
    """The nearest target of each sensor that none before it took; when all are taken, again from all."""
    taken = np.zeros(gaps.shape[1], np.int64)
    chosen = []
    for own in gaps:
        chosen.append(int(np.argmin(np.where(taken == taken.min(), own, np.inf))))
        taken[chosen[-1]] += 1
    return np.array(chosen)


@dataclass(frozen=True, slots=True, eq=False)
class RulePlanner:
    """Every sensor heads for a place among the targets that are estimated now, by a rule of thumb.

    Of its courses it takes the one that is nearest to that place on the mean over the horizon, which for courses of one
    speed is the one nearest in heading; a camera that stays where it is turns to it. Where no target is estimated, each
    takes its first course. Where constraints forbid zones, distances are lengths of shortest paths around them; a place
    that no such path leads to is approached as near as they do, and plans name the targets that no sensor can see.

    Attributes:
        sensors: the sensors.
        rule: "nearest": for each sensor, in printed order, its nearest target that none before it took; "assigned": the
            s-th target, in the order of labels, for the s-th sensor; "centroid": the mean of all, for all sensors.
        settings: the horizon, over which courses are told apart.
        constraints: what the sensors must not do; each then takes the best of what it may, and a joint action that is
            not allowed is moved to one near it. Where only some sensors may scan, those do that come nearest.
        estimate: reads the targets off the fused belief.
        targets: of "assigned": the number of each sensor's target instead, counted from 1; those beyond the last begin
            again.

    Raises:
        InputError: parts of another kind, or `targets` of another rule or number of sensors.
    """

    sensors: tuple[MobileSensor, ...]
    rule: Rule
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    constraints: tuple[Constraint, ...] = ()
    estimate: Estimator = best_estimate
    targets: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        check_steering(self)
        one_of("rule", self.rule, get_args(Rule))
        if self.targets is not None:
            given = sequence("targets", self.targets, f"{len(self.sensors)} numbers of targets, one a sensor")
            if self.rule != "assigned" or len(given) != len(self.sensors):
                expected = f"{len(self.sensors)} numbers of targets, one a sensor, for the rule assigned"
                raise reject("targets", expected, f"{self.targets} for {self.rule}")
            object.__setattr__(self, "targets", tuple(dimension(f"targets[{s}]", own) for s, own in enumerate(given)))

    @property
    def name(self) -> str:
        """The strategy, as of the rule."""
        return self.rule

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """The courses that head for the rule's places; of equal ones the first in printed order. Draws nothing.

        Raises `InputError` for inputs that do not fit, and as the estimator.
        """
        generator(rng)
        instance("state", state, State)
        options = options_of(self.sensors, poses, self.settings)
        at = np.asarray(poses, np.float64)
        mask = mask_of_decision(self.constraints, self.sensors, options, state.fused, at, self.settings)
        estimate, graph = self.estimate(state.fused, state.step), visibility_graph(self.constraints)
        places = np.ascontiguousarray(np.asarray(estimate.means)[:, :2])
        beyond = (
            BeyondHorizon.of(self.sensors, options, estimate.labels, places, graph, None) if graph is not None else None
        )
        goals = self._goals(places, at[:, :2], beyond) if len(places) else [None] * len(options)
        merits = [_merits(own, goal, graph) for own, goal in zip(options, goals, strict=True)]
        joint = tuple(
            first_best(np.where(single_mask(mask, s, len(own)), own, -np.inf)) for s, own in enumerate(merits)
        )
        if mask is not None:
            if mask.active is not None:
                joint = mask.active.kept(joint, [own[course] for own, course in zip(merits, joint, strict=True)])
            joint = nearest_feasible(mask, joint)
        chosen = tuple(own.first_action(course) for own, course in zip(options, joint, strict=True))
        notes = (*(mask.notes if mask else ()), *(beyond.notes() if beyond else ()))
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), {}, notes)

    def _goals(self, places: Floats, sensors: Floats, beyond: BeyondHorizon | None) -> Floats:
        """(num_sensors, 2) m, where the sensors (num_sensors, 2) head for, of the places (num_targets, 2)."""
        if self.rule == "centroid":
            return np.tile(places.mean(axis=0), (len(sensors), 1))
        if self.rule == "assigned":
            numbers = np.arange(len(sensors)) if self.targets is None else np.array(self.targets) - 1
            return np.asarray(places[numbers % len(places)])
        if beyond is not None:
            return np.asarray(places[_nearest(beyond.distances())])
        return np.asarray(places[_nearest(np.hypot(*(sensors[:, np.newaxis] - places).transpose(2, 0, 1)))])


def _merits(own: Options, goal: Floats | None, graph: VisibilityGraph | None) -> Floats:
    """(num_courses,) less the mean distance to a place; of courses that are equal in it, how well a camera points."""
    if goal is None:
        return np.zeros(len(own.courses))
    offsets = goal - own.courses[..., :2]
    gaps, waits = np.hypot(offsets[..., 0], offsets[..., 1]), np.zeros(len(own.courses))
    if graph is not None:
        paths, moves = graph.to(goal[np.newaxis], own.pose[:2]), (own.courses[..., :2] != own.pose[:2]).any(axis=(1, 2))
        if not paths.are_straight(own.pose[np.newaxis, :2].copy())[0, 0]:  # It may have to step aside first.
            waits[~moves] = _WAITING
        free = moves & ~graph.is_barred(own.pose[:2], own.courses[..., :2])
        around = paths.distances(own.courses[free, :, :2].reshape(-1, 2)).reshape(gaps[free].shape)
        gaps[free] = np.where(np.isfinite(around), around, gaps[free])
    near: Floats = -gaps.mean(axis=1)
    if own.courses.shape[2] > HALF_WIDTH and (own.courses[..., HALF_WIDTH] > 0.0).any():
        turn = np.arctan2(offsets[..., 1], offsets[..., 0]) - own.courses[..., POINTING]
        near = near + _AIM * max(1.0, float(-near.min())) * np.cos(turn).mean(axis=1)
    return np.asarray(near - waits)
