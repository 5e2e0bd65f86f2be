"""Joint decisions over several periods, whose first actions are taken: open-loop receding horizon."""

import copy
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from vedette.control.constraints.paths import visibility_graph
from vedette.control.constraints.protocol import Constraint
from vedette.control.decisions import combine_parts
from vedette.control.evaluator import Evaluator
from vedette.control.evidence import Evidence, Part
from vedette.control.inputs import check_control_inputs, check_poses, check_reward_inputs
from vedette.control.lookahead.beam import BeamSearch
from vedette.control.lookahead.constraints import MultiStepConstraints, Stages
from vedette.control.lookahead.courses import CourseTree
from vedette.control.lookahead.feasibility import FeasibleSequences
from vedette.control.lookahead.problem import Best, JointSequence, PrecomputedCourses, SequenceProblem, SequenceSearch
from vedette.control.plan import Plan
from vedette.control.preparation import AnyReward, PlanningBeliefs, check_sums, planning_beliefs, state_notes
from vedette.control.problem import searched, upper_bound
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.search.ascent import AutomaticSearch
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.errors import NumericalError
from vedette.fusion import Fusion
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, reject
from vedette.models.fields import Count, Positive, Probability, check_fields
from vedette.platforms import Options
from vedette.tracking import State

MOST_DECISIONS, MOST_STEPS = 100, 10_000  # decisions of a sequence, and pseudo-updates between two of them


class _Given(NamedTuple):
    """The inputs of one plan."""

    stages: Stages
    trees: tuple[CourseTree, ...]
    rules: FeasibleSequences | None  # None: there are no constraints
    planned: PlanningBeliefs


@dataclass(frozen=True, slots=True, eq=False)
class HorizonPlanner:
    """Joint decision making over `depth` successive decisions: the first joint action of the best joint sequence.

    The later actions are chosen without regard to what the scans before them will show (open loop), and chosen anew
    when their time comes. Targets move, and pseudo-updates continue, up to the end of the last decision's horizon. With
    a depth of 1 it is a `JointPlanner` on LMB beliefs, as it is if `PlanningSettings.end` leaves one decision.

    The value of a sequence is the sum of g^(d - 1) times the reward at the end of the horizon of decision d, relative
    to the prediction for that time. The `discount` g should be small: the first reward is known best, and its cost is
    certain, while targets will deviate from their prediction, and later decisions correct earlier ones. A divergence
    measures all information gained until then, so that the sum counts early information several times. Without a
    discount only the reward at the end of the last horizon counts. Late information then weighs most, and repeated
    decisions may postpone their intended action. Undetected targets (`PlanningSettings.undetected_target_value`) are
    assumed not to move, and count with the expected number that all scans until then find.

    The best single decision, repeated, is the first sequence evaluated, so no plan has a lower value. Plans note if the
    depth did not improve on it.

    Attributes:
        sensors, fusion, settings, reward: as in `JointPlanner`. The horizon of the settings is that of one decision.
            Reward and fusion must be sums over labels. GLMB beliefs are planned on as LMBs, and plans say so.
        depth: number of decisions.
        period: time from a decision to the next, a whole multiple of horizon_period. None: the horizon of a decision,
            horizon_steps times horizon_period [s].
        search: which joint sequences are evaluated, where the budget is too small for all.
        budget: maximum number of joint sequences evaluated for a decision.
        discount: weight g of a decision's reward relative to that of the decision before. None: only the reward at
            the end of the last horizon counts.
        constraints: limits on the sensors' courses, tested at every decision of a sequence: from where its courses
            begin to the end of its horizon, or to the next decision if that is later.
        notes: notes that every plan repeats.

    Raises:
        InputError: a field out of range, or a reward, association or fusion that is not a sum over labels.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: AnyReward = field(default_factory=ExpectedLossReward)
    depth: Count = 3
    period: Positive | None = None
    search: SequenceSearch = field(default_factory=BeamSearch)
    budget: Count = 2000
    discount: Probability | None = 0.25
    constraints: tuple[Constraint, ...] = ()
    notes: tuple[str, ...] = ()
    name: ClassVar[str] = "lookahead"

    def __post_init__(self) -> None:
        check_control_inputs(self)
        check_reward_inputs(self.fusion, self.reward, self.notes)
        check_fields(self)
        if self.depth > MOST_DECISIONS:
            raise reject("depth", f"at most {MOST_DECISIONS} decisions", self.depth)
        if self.period is not None:
            steps = self.period / self.settings.horizon_period
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
                multiple = f"a whole multiple of the horizon_period, {self.settings.horizon_period:g}"
                raise reject("period", multiple, self.period)
            if steps > MOST_STEPS:
                raise reject("period", f"at most {MOST_STEPS} times the horizon_period", self.period)
        check_sums("sequences of decisions", len(self.sensors), self.fusion, self.settings, self.reward)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the first actions of the best joint sequence found, of equal ones the first in printed order.

        If constraints allow no course of a sensor at some decision, all are kept. If no joint sequence is found that
        satisfies all constraints on pairs of sensors, these constraints are dropped from some decision on. The notes
        say so. The tables contain the first actions, each with the value of the best sequence found that begins with
        it. The whole sequence is in `Plan.sequence`, and the counts of the curve are of joint sequences. Arguments as
        in `JointPlanner.plan`. The search draws random numbers after the samples.

        Raises:
            InputError: invalid inputs.
            ModelError, NumericalError: errors of the filters, or no sequence with a finite reward.
        """
        generator(rng)
        why = "so are all sequences of decisions"
        planned = planning_beliefs(self.sensors, self.fusion, self.settings, self.reward, state, why)
        given, samples = self._given(state, poses, planned), copy.deepcopy(rng)
        evidence, choice = self._single(given, rng)
        if given.stages.depth == 1:
            return self._plan(given, evidence, choice, None)
        problem = self._problem(given, evidence.evaluator, samples)
        if math.prod(tree.count(self.budget) for tree in given.trees) <= self.budget:
            problem.evaluate(itertools.product(*(tree.all() for tree in given.trees)))
        else:
            problem.begin(choice)
            self.search.search(problem, rng=rng)
        return self._plan(given, evidence, choice, problem)

    def _stages(self, state: State) -> Stages:
        """Return `depth` decisions, or those that remain until the end."""
        settings, depth = self.settings, self.depth
        stride = settings.horizon_steps if self.period is None else round(self.period / settings.horizon_period)
        if settings.end is not None and state.time is not None:
            still = (settings.end - state.time) / (stride * settings.horizon_period)
            depth = min(depth, max(1, math.ceil(still - 1e-9)))
        return Stages(depth, stride, settings.horizon_steps, float(settings.horizon_period))

    def _given(self, state: State, poses: Floats, planned: PlanningBeliefs) -> _Given:
        at, stages = check_poses(poses, len(self.sensors)), self._stages(state)
        trees = tuple(CourseTree(s, sensor.platform, at[s], stages) for s, sensor in enumerate(self.sensors))
        if not self.constraints:
            return _Given(stages, trees, None, planned)
        at = np.array([tree.pose for tree in trees])
        rules = FeasibleSequences.of(
            trees, MultiStepConstraints(self.constraints, self.sensors, self.settings, state, at, stages)
        )
        return _Given(stages, rules.trees, rules, planned)

    def _single(self, given: _Given, rng: np.random.Generator) -> tuple[Evidence, tuple[int, ...]]:
        """Return the evidence and the choice of a `JointPlanner`."""
        options, steps = tuple(tree.options(()) for tree in given.trees), given.stages.steps
        now = tuple(
            own._replace(courses=np.ascontiguousarray(own.courses[:, :steps]), scans=own.scans[:, :steps])
            for own in options
        )
        evaluator = self._lay_out(given, 1, None, now, rng)
        evidence = Evidence(evaluator, tuple(range(len(now))), evaluator.joint())
        mask = None if given.rules is None else given.rules.first()
        return evidence, searched(AutomaticSearch(), evidence, mask, rng=rng)

    def _problem(self, given: _Given, first: Evaluator, samples: np.random.Generator) -> SequenceProblem:
        """Return the search problem. samples: generator of the samples. first: evaluator whose counts are continued."""
        depth = given.stages.depth

        def part(weight: float, stage: int) -> PrecomputedCourses:
            # Each call starts from the same generator state, so the samples are the same.
            def lay_out(options: tuple[Options, ...]) -> Evaluator:
                horizons = first.horizons if stage == 1 else ()
                return self._lay_out(given, stage, horizons, options, copy.deepcopy(samples))

            begin = 0 if self.discount is None else stage - 1
            return PrecomputedCourses(given.trees, stage, lay_out, weight, begin, first.counts)

        if self.discount is None:
            parts = [part(1.0, depth)]
        else:
            parts = [part(self.discount**d, d + 1) for d in range(depth) if self.discount > 0.0 or d == 0]
        return SequenceProblem(given.trees, depth, tuple(parts), self.budget, given.rules)

    def _lay_out(
        self,
        given: _Given,
        stage: int,
        horizons: tuple[PlanningSettings, ...] | None,
        options: tuple[Options, ...],
        rng: np.random.Generator,
    ) -> Evaluator:
        """Return rewards at the end of the horizon of a decision, counted from 1."""
        rule, settings = given.planned.rule, replace(self.settings, horizon_steps=given.stages.num_steps(stage))
        assert rule is not None
        state = given.planned.state
        graph = visibility_graph(self.constraints)
        return Evaluator.of_sums(
            self.sensors, options, rule, settings, self.reward, state, horizons=horizons, graph=graph, rng=rng
        )

    def _plan(
        self, given: _Given, evidence: Evidence, choice: tuple[int, ...], problem: SequenceProblem | None
    ) -> Plan:
        """Return the plan of the best sequence found. problem: None for a single decision."""
        sequence: JointSequence = tuple((course,) for course in choice)
        if problem is not None:
            sequence, evidence = _best(problem).sequence, Evidence(evidence.evaluator, evidence.which, evidence.rewards)
            evidence.note(np.array(list(problem.found)), np.array([own.rewards for own in problem.found.values()]))
        stages, (state, *_, formed) = given.stages, given.planned
        courses = tuple(own[0] for own in sequence)
        ahead = replace(self.settings, horizon_steps=stages.num_steps(stages.depth))
        plan = combine_parts(
            self.name,
            (Part.together(evidence, courses),),
            (
                *self.notes,
                *(() if given.rules is None else given.rules.notes(sequence)),
                *formed,
                *state_notes(self.sensors, ahead, state, sums=True),
            ),
            tuple(self._notes(choice, courses, stages.depth)),
            curve=evidence.curve() if problem is None else problem.curve(),
            bound=upper_bound(evidence, courses) if problem is None else problem.bound(),
            sequence=tuple(tree.rows(own) for tree, own in zip(given.trees, sequence, strict=True)),
        )
        return plan if problem is None else replace(plan, analysis=None)

    def _notes(self, choice: tuple[int, ...], courses: tuple[int, ...], depth: int) -> Iterator[str]:
        """Yield notes on the depth and on the samples."""
        if depth < self.depth:
            yield f"depth {depth} in place of {self.depth}: no more decisions come before the end"
        if depth > 1 and courses == choice:
            yield f"depth {depth} does not pay: the actions are those of the best single decision"
        if self.settings.confidence is not None:
            yield "decided on num_samples samples, whatever the confidence: sequences are not raced"


def _best(problem: SequenceProblem) -> Best:
    if not any(math.isfinite(own.value) for own in problem.found.values()):
        raise NumericalError("sequences of actions: expected at least one whose reward is a finite number; got none")
    return problem.best()
