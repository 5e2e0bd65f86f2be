"""An oracle that knows where the targets are: the floor of what control can reach, beside which plans are put."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from vedette.control import (
    AutomaticSearch,
    Constraint,
    JointProblem,
    JointSearch,
    MobileSensor,
    Plan,
    PlanningSettings,
)
from vedette.control.constraints import Mask, nearest_feasible
from vedette.control.inputs import check_control_inputs, check_poses, mask_of_decision, options_of
from vedette.densities import Estimator, best_estimate
from vedette.errors import InputError
from vedette.filters import common_target_model
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import MotionModel
from vedette.models.arguments import dimension, generator, instance, positive
from vedette.models.fields import Count
from vedette.platforms import Options
from vedette.platforms.base import courses_of, scans_of
from vedette.simulation.cramer_rao import CovarianceRecursion, scan_information, transition_jacobians
from vedette.simulation.true_targets import match_tracks, with_components
from vedette.simulation.truth import Truth
from vedette.tracking import State


class Schedule(NamedTuple):
    """When sensors scan and decide, and how what they say becomes one.

    times: (num_scans,) s. decision_steps: scans, from 1, after which they decide. powers: of each sensor, with which
    what it says counts in the fused density. one_belief: whether all scans go into one belief, to which sensors return
    after every scan; otherwise each keeps its own. rebirths: whether a target that was lost may be found again.
    scans_at: (num_sensors, num_scans or more) whether each scans then; None: always.
    """

    times: Floats
    decision_steps: tuple[int, ...]
    powers: tuple[float, ...]
    one_belief: bool
    rebirths: bool
    scans_at: Bools | None = None


class _DecisionState(NamedTuple):
    """Where a decision begins."""

    step: int
    poses: Floats
    covs: tuple[Floats, ...]  # (num_targets, dim, dim) of each belief


@dataclass(frozen=True, slots=True, eq=False)
class OraclePlanner:
    """The joint action of least Cramer-Rao error at the true targets, over all scans up to the next decision.

    It starts from the filters' covariances of the targets that they track, and propagates them through all scans
    (`vedette.simulation.cramer_rao.CovarianceRecursion`). Scans may miss targets and filters may err, so the result
    does not bound a single run; it is a lower bound on the localisation error that control can reach on average.
    Targets that appear later are not foreseen. State components of the motion model that recorded targets lack, such as
    a turn rate, are taken as 0.

    Attributes:
        sensors: the sensors.
        schedule: when they scan and decide.
        cutoff: the error that counts as a lost target, m.
        depth: decisions in a row that it looks at.
        beam_width: joint actions, those best for one decision, that it follows to the next.
        settings: the horizon, over which courses are told apart.
        search: which joint actions are looked at.
        constraints: what the sensors must not do, tested at the decision at hand.
        estimate: reads the tracks off a belief.
        truth: the targets; None: `with_truth` sets them.

    Raises:
        InputError: parts of another kind, or targets with more components than the motion's states.
    """

    sensors: tuple[MobileSensor, ...]
    schedule: Schedule
    cutoff: float = 100.0
    depth: Count = 1
    beam_width: Count = 8
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    search: JointSearch = field(default_factory=AutomaticSearch)
    constraints: tuple[Constraint, ...] = ()
    estimate: Estimator = best_estimate
    truth: Truth | None = None
    name: ClassVar[str] = "oracle"

    def __post_init__(self) -> None:
        check_control_inputs(self)
        positive("cutoff", self.cutoff)
        dimension("depth", self.depth)
        dimension("beam_width", self.beam_width)
        instance("search", self.search, JointSearch)
        if self.truth is not None:
            object.__setattr__(self, "truth", with_components(self.truth, self._motion.state_dim))

    @property
    def _motion(self) -> MotionModel:
        """How the filters take the targets to move."""
        return common_target_model([sensor.filter for sensor in self.sensors]).motion

    def with_truth(self, truth: Truth) -> OraclePlanner:
        """The same for the targets of a run."""
        return replace(self, truth=truth)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """The joint action of least cost; `rng` is for the search. Raises `InputError` for inputs that do not fit."""
        generator(rng)
        instance("state", state, State)
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        at = check_poses(poses, len(self.sensors))
        options = options_of(self.sensors, at, self.settings)
        mask = mask_of_decision(self.constraints, self.sensors, options, state.fused, at, self.settings)
        step = max(state.step, 1)
        ids, covs = self._tracked(state, *self.truth.at(step - 1))
        best, _ = self._decide(_DecisionState(step, at, covs), self.truth, ids, self.depth, mask, rng)
        chosen = tuple(own.first_action(course) for own, course in zip(options, best, strict=True))
        notes = mask.notes if mask is not None else ()
        return Plan(self.name, tuple(own.actions for own in options), chosen, (), {}, notes)

    def _tracked(self, state: State, ids: Ints, states: Floats) -> tuple[Ints, tuple[Floats, ...]]:
        """The targets that can be helped, and their covariances in each belief."""
        table = self.schedule
        held = [
            match_tracks(self.estimate, belief, state.step, states, self.cutoff)
            for belief in (state.fused, *(() if table.one_belief else state.local))
        ]
        kept = held[0].found | table.rebirths
        return ids[kept], tuple(own.covs[kept] for own in (held if table.one_belief else held[1:]))

    def _decide(
        self, moment: _DecisionState, truth: Truth, ids: Ints, depth: int, mask: Mask | None, rng: np.random.Generator
    ) -> tuple[tuple[int, ...], float]:
        """The best joint action, and what it costs together with the decisions after it."""
        last = next((own for own in self.schedule.decision_steps if own > moment.step), len(self.schedule.times))
        options = options_of(self.sensors, moment.poses, self.settings)
        courses, scans = self._courses(moment, options, last)
        stretch = self._stretch(moment.step, last, courses, scans, truth, ids)
        known: dict[tuple[int, ...], float] = {}

        def evaluate(actions: Ints) -> Floats:
            costs = stretch.follow(moment.covs, actions)[0]
            known.update(zip(map(tuple, actions.tolist()), costs.tolist(), strict=True))
            return -costs

        first = (0,) * len(self.sensors)
        first = first if mask is None else nearest_feasible(mask, first)
        problem = JointProblem(tuple(len(own.courses) for own in options), evaluate, lambda: first, mask)
        best = self.search.search(problem, rng=rng)
        if depth == 1 or last >= len(self.schedule.times):
            return best, known[best]
        totals, stay = {}, np.isin(ids, truth.at(last - 1)[0])
        for joint in sorted(known, key=lambda joint: (known[joint], joint))[: self.beam_width]:
            ends = np.stack([own[course, -1] for own, course in zip(courses, joint, strict=True)])
            covs = tuple(own[0][stay] for own in stretch.follow(moment.covs, np.array([joint]))[1])
            later = self._decide(_DecisionState(last, ends, covs), truth, ids[stay], depth - 1, None, rng)
            totals[joint] = known[joint] + later[1]
        best = min(totals, key=lambda joint: (totals[joint], joint))
        return best, totals[best]

    def _courses(
        self, moment: _DecisionState, options: tuple[Options, ...], last: int
    ) -> tuple[tuple[Floats, ...], tuple[Bools, ...]]:
        """Of each sensor (num_courses, num_scans, pose_dim) where it is at the times of scans up to the next decision,
        and (num_courses, num_scans) whether it scans then."""
        times, table = self.schedule.times, self.schedule.scans_at
        waits, found, scans = times[moment.step : last] - times[moment.step - 1], [], []
        for s, (sensor, own) in enumerate(zip(self.sensors, options, strict=True)):
            actions = own.actions.values[[own.first_action(course) for course in range(len(own.courses))]]
            of_platform = f"sensors[{s}].platform", sensor.platform, moment.poses[s], actions, waits
            found.append(courses_of(*of_platform))
            scans.append(scans_of(*of_platform) & (True if table is None else table[s, moment.step : last]))
        return tuple(found), tuple(scans)

    def _stretch(
        self,
        first: int,
        last: int,
        courses: tuple[Floats, ...],
        scans: tuple[Bools, ...],
        truth: Truth,
        ids: Ints,
    ) -> CovarianceRecursion:
        """The scans after scan `first`, when all of `ids` are there, to scan `last`; who ends stays where it was."""
        table, times = self.schedule, self.schedule.times
        motion = self._motion
        dim, num = motion.state_dim, len(ids)
        states, alive = np.full((last - first + 1, num, dim), np.nan), np.zeros((last - first + 1, num))
        for k in range(len(states)):
            now, own = truth.at(first - 1 + k)
            _, places, rows = np.intersect1d(ids, now, assume_unique=True, return_indices=True)
            states[k] = states[max(k - 1, 0)]
            states[k, places], alive[k, places] = own[rows], 1.0
        steps = list(zip(states[:-1], np.diff(times[first - 1 : last]).tolist(), strict=True))
        told = []
        for sensor, own, when in zip(self.sensors, courses, scans, strict=True):
            said = np.zeros((*own.shape[:2], num, dim, dim))
            for course, k in np.argwhere(when).tolist():
                said[course, k] = scan_information(sensor.filter.sensor, states[k + 1], own[course, k])
            told.append(said)
        return CovarianceRecursion(
            np.array([transition_jacobians(motion, own, dt) for own, dt in steps]).reshape(len(steps), num, dim, dim),
            np.array([motion.noise_covs(own, dt) for own, dt in steps]).reshape(len(steps), num, dim, dim),
            alive[1:],
            tuple(told),
            table.powers,
            table.one_belief,
            self.cutoff,
        )
