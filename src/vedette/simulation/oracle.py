"""Oracle planner that knows the true targets: a lower bound for control, to compare plans with."""

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
from vedette.control.constraints.mask import Mask, nearest_feasible
from vedette.control.inputs import check_control_inputs, check_poses, mask_of_decision, options_of
from vedette.densities import Estimator, best_estimate
from vedette.errors import InputError
from vedette.filters import common_target_model
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import MotionModel
from vedette.models.arguments import generator, instance
from vedette.models.fields import Count, Positive, check_fields
from vedette.platforms import Options
from vedette.platforms.base import courses_of, scans_of
from vedette.simulation.cramer_rao import CovarianceRecursion, scan_information, transition_jacobians
from vedette.simulation.true_targets import match_tracks, with_components
from vedette.simulation.truth import Truth
from vedette.tracking import State


class Schedule(NamedTuple):
    """Schedule of scans and decisions, and the fusion weights.

    times: (num_scans,) s. decision_steps: scans, from 1, followed by a decision. powers: weight of each sensor in the
    fused density. one_belief: whether all scans update one density, which sensors share after every scan. Otherwise
    each has its own. rebirths: whether a lost target can be found again. scans_at: (num_sensors, num_scans or more)
    whether each sensor scans. None: always.
    """

    times: Floats
    decision_steps: tuple[int, ...]
    powers: tuple[float, ...]
    one_belief: bool
    rebirths: bool
    scans_at: Bools | None = None


class _DecisionState(NamedTuple):
    """State at a decision."""

    step: int
    poses: Floats
    covs: tuple[Floats, ...]  # (num_targets, dim, dim) per density


@dataclass(frozen=True, slots=True, eq=False)
class OraclePlanner:
    """Planner that minimises the Cramer-Rao error at the true targets, over all scans up to the next decision.

    It starts from the filters' covariances of the targets that they track, and propagates them through all scans
    (`vedette.simulation.cramer_rao.CovarianceRecursion`). Scans may miss targets and filters may err, so the result
    does not bound a single run. For localisation it is the lower bound of what control can reach. Targets that appear
    later are not foreseen. State components of the motion model that recorded targets lack, such as a turn rate, are
    taken as 0.

    Attributes:
        sensors: the sensors.
        schedule: scans and decisions.
        cutoff: error that counts as a lost target, m.
        depth: number of consecutive decisions to consider.
        beam_width: number of joint actions, the best for one decision, to continue with the next decision.
        settings: the horizon over which courses are distinguished.
        search: search over joint actions.
        constraints: constraints of the sensors, tested at the present decision only.
        estimate: extracts the tracks from a density.
        truth: the targets. None: set by `with_truth`.

    Raises:
        InputError: parts of another type, or targets with more components than the motion's states.
    """

    sensors: tuple[MobileSensor, ...]
    schedule: Schedule
    cutoff: Positive = 100.0
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
        check_fields(self)
        if self.truth is not None:
            object.__setattr__(self, "truth", with_components(self.truth, self._motion.state_dim))

    @property
    def _motion(self) -> MotionModel:
        """Motion model of the targets in the filters."""
        return common_target_model([sensor.filter for sensor in self.sensors]).motion

    def with_truth(self, truth: Truth) -> "OraclePlanner":
        """Return the planner for the targets of a run."""
        return replace(self, truth=truth)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the joint action of least cost. `rng` is for the search. Raises `InputError` for invalid inputs."""
        generator(rng)
        instance("state", state, State)
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        current = check_poses(poses, len(self.sensors))
        options = options_of(self.sensors, current, self.settings)
        mask = mask_of_decision(self.constraints, self.sensors, options, state, current, self.settings)
        step = max(state.step, 1)
        ids, covs = self._tracked(state, *self.truth.at(step - 1))
        best, _ = self._decide(_DecisionState(step, current, covs), self.truth, ids, self.depth, mask, rng)
        chosen = tuple(each.first_action(course) for each, course in zip(options, best, strict=True))
        notes = mask.notes if mask is not None else ()
        return Plan(self.name, tuple(each.actions for each in options), chosen, (), {}, notes)

    def _tracked(self, state: State, ids: Ints, states: Floats) -> tuple[Ints, tuple[Floats, ...]]:
        """Return the targets that the sensors can still affect, and their covariances in each density."""
        table = self.schedule
        held = [
            match_tracks(self.estimate, belief, state.step, states, self.cutoff)
            for belief in (state.fused, *(() if table.one_belief else state.local))
        ]
        retained = held[0].found | table.rebirths
        return ids[retained], tuple(matched.covs[retained] for matched in (held if table.one_belief else held[1:]))

    def _decide(
        self, moment: _DecisionState, truth: Truth, ids: Ints, depth: int, mask: Mask | None, rng: np.random.Generator
    ) -> tuple[tuple[int, ...], float]:
        """Return the best joint action, and its cost together with the decisions after it."""
        last = next((step for step in self.schedule.decision_steps if step > moment.step), len(self.schedule.times))
        options = options_of(self.sensors, moment.poses, self.settings)
        courses, scans = self._courses(moment, options, last)
        stretch = self._stretch(moment.step, last, courses, scans, truth, ids)
        cost_of: dict[tuple[int, ...], float] = {}

        def evaluate(actions: Ints) -> Floats:
            costs = stretch.follow(moment.covs, actions)[0]
            cost_of.update(zip(map(tuple, actions.tolist()), costs.tolist(), strict=True))
            return -costs

        first = (0,) * len(self.sensors)
        first = first if mask is None else nearest_feasible(mask, first)
        problem = JointProblem(tuple(len(each.courses) for each in options), evaluate, lambda: first, mask)
        best = self.search.search(problem, rng=rng)
        if depth == 1 or last >= len(self.schedule.times):
            return best, cost_of[best]
        totals, stay = {}, np.isin(ids, truth.at(last - 1)[0])
        for joint in sorted(cost_of, key=lambda joint: (cost_of[joint], joint))[: self.beam_width]:
            ends = np.stack([poses[course, -1] for poses, course in zip(courses, joint, strict=True)])
            covs = tuple(cov[0][stay] for cov in stretch.follow(moment.covs, np.array([joint]))[1])
            later = self._decide(_DecisionState(last, ends, covs), truth, ids[stay], depth - 1, None, rng)
            totals[joint] = cost_of[joint] + later[1]
        best = min(totals, key=lambda joint: (totals[joint], joint))
        return best, totals[best]

    def _courses(
        self, moment: _DecisionState, options: tuple[Options, ...], last: int
    ) -> tuple[tuple[Floats, ...], tuple[Bools, ...]]:
        """Return poses and activity of each sensor at the scans up to the next decision, per course.

        Per sensor: (num_courses, num_scans, pose_dim) poses, and (num_courses, num_scans) whether it scans.
        """
        times, table = self.schedule.times, self.schedule.scans_at
        waits, courses, scans = times[moment.step : last] - times[moment.step - 1], [], []
        for s, (sensor, own) in enumerate(zip(self.sensors, options, strict=True)):
            actions = own.actions.values[[own.first_action(course) for course in range(len(own.courses))]]
            of_platform = f"sensors[{s}].platform", sensor.platform, moment.poses[s], actions, waits
            courses.append(courses_of(*of_platform))
            scans.append(scans_of(*of_platform) & (True if table is None else table[s, moment.step : last]))
        return tuple(courses), tuple(scans)

    def _stretch(
        self,
        first: int,
        last: int,
        courses: tuple[Floats, ...],
        scans: tuple[Bools, ...],
        truth: Truth,
        ids: Ints,
    ) -> CovarianceRecursion:
        """Return the recursion over the scans after scan `first`, with all of `ids` alive, to scan `last`.

        Targets that end keep their last state.
        """
        table, times = self.schedule, self.schedule.times
        motion = self._motion
        dim, num = motion.state_dim, len(ids)
        states, alive = np.full((last - first + 1, num, dim), np.nan), np.zeros((last - first + 1, num))
        for k in range(len(states)):
            present, present_states = truth.at(first - 1 + k)
            _, columns, rows = np.intersect1d(ids, present, assume_unique=True, return_indices=True)
            states[k] = states[max(k - 1, 0)]
            states[k, columns], alive[k, columns] = present_states[rows], 1.0
        steps = list(zip(states[:-1], np.diff(times[first - 1 : last]).tolist(), strict=True))
        truths = []
        for sensor, poses, scanned in zip(self.sensors, courses, scans, strict=True):
            information = np.zeros((*poses.shape[:2], num, dim, dim))
            for course, k in np.argwhere(scanned).tolist():
                information[course, k] = scan_information(sensor.filter.sensor, states[k + 1], poses[course, k])
            truths.append(information)
        return CovarianceRecursion(
            np.array([transition_jacobians(motion, x, dt) for x, dt in steps]).reshape(len(steps), num, dim, dim),
            np.array([motion.noise_covs(x, dt) for x, dt in steps]).reshape(len(steps), num, dim, dim),
            alive[1:],
            tuple(truths),
            table.powers,
            table.one_belief,
            self.cutoff,
        )
