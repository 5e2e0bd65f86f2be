"""Planners: joint and independent decision making (paper, Algorithms 2 and 3), random and fixed actions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vedette.control.allowed import single_mask
from vedette.control.bounds import bound_of
from vedette.control.constraints import Constraint
from vedette.control.cutoff import beyond_cutoff
from vedette.control.evidence import Evidence
from vedette.control.explaining import Part, Questions
from vedette.control.inputs import check_steering, check_valuing
from vedette.control.plan import Plan, RewardTable
from vedette.control.preparation import AnyReward, Preparation, check_sums, stay_glmbs
from vedette.control.problem import searched
from vedette.control.rewards import ExpectedLossReward
from vedette.control.rounds import Decided, decide_alone, decide_jointly
from vedette.control.search import AutomaticSearch, JointSearch, SequentialGreedy, all_joint_actions, first_best
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.fusion import Fusion
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, instance, reject
from vedette.tracking import State


@dataclass(frozen=True, slots=True, eq=False)
class JointPlanner:
    """Joint decision making: the reward of combinations of actions, after fusion (paper, Algorithm 2).

    Attributes:
        sensors: the sensors, in the order of the beliefs and of the fusion weights.
        fusion: how their pseudo-updated densities become one.
        settings: horizon, samples, caps.
        reward: one of `vedette.control.rewards`, or of the user's own.
        search: which joint actions are evaluated: all of them, as in the paper, or fewer.
        constraints: what the sensors must not do.
        notes: what every plan is to say beside what comes up, such as that the tracks are fused in another way.

    Raises:
        InputError: parts of another kind, or a `SequentialGreedy` search of rewards that are no sums over labels.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: AnyReward = field(default_factory=ExpectedLossReward)
    search: JointSearch = field(default_factory=AutomaticSearch)
    constraints: tuple[Constraint, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_steering(self)
        check_valuing(self.fusion, self.reward, self.notes)
        instance("search", self.search, JointSearch)
        if not isinstance(self.search, SequentialGreedy):
            return
        purpose = "SequentialGreedy, which asks for rewards of some of the sensors alone"
        check_sums(purpose, len(self.sensors), self.fusion, self.settings, self.reward)
        if stay_glmbs(self.sensors, self.fusion, self.settings, self.reward):
            expected = f"filters of LMBs, or of products of GLMBs, or settings.max_glmb_targets of 0, for {purpose}"
            raise reject("sensors", expected, "filters of GLMBs")

    @property
    def name(self) -> str:
        """The strategy "jdm"."""
        return "jdm"

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """The joint action of largest mean reward that the search finds; of equal ones the first in printed order.

        Rewards are equal within 1e-9, relative to the best or to 1.

        Args:
            state: the belief of each sensor, as its filter left it; and the fused one, from which samples and
                prediction are taken. Under `vedette.tracking.Central` they are all the same.
            poses: (num_sensors, 3 or more) present poses.
            rng: draws the samples, then whatever the search draws.

        Raises:
            InputError: inputs that do not fit, or more joint actions than the search takes.
            ModelError, NumericalError: as the filters; a reward that is not finite.
        """
        generator(rng)
        prepared = Preparation.of(self.sensors, self.fusion, self.settings, self.reward, state, poses, self.constraints)
        if prepared.races:
            return _plan_of(self.name, prepared, decide_jointly(prepared, self.search, rng=rng), self.notes)
        evaluator = prepared.evaluator(self.settings.num_samples, rng=rng)
        evidence = Evidence(evaluator, tuple(range(len(self.sensors))), evaluator.joint())
        best = searched(self.search, evidence, prepared.mask, rng=rng)
        chosen = tuple(own.first_action(course) for own, course in zip(evaluator.options, best, strict=True))
        actions = tuple(own.actions for own in evaluator.options)
        tables, (counts, found), bound = evidence.tables(best), evaluator.account(), bound_of(evidence, best)
        notes = (*self.notes, *found, *beyond_cutoff(evaluator, best))
        return Plan(
            self.name,
            actions,
            chosen,
            tables,
            counts,
            notes,
            evidence.curve(),
            bound,
            prepared.certainty,
            questions=Questions(self.name, (Part.together(evidence, best),), bound),
        )


@dataclass(frozen=True, slots=True, eq=False)
class IndependentPlanner:
    """Independent decision making: each sensor maximises the reward of its own update alone (paper, Algorithm 3).

    Attributes:
        sensors: the sensors, in the order of the beliefs.
        fusion: how the beliefs became one; the decision itself does not use it.
        settings: horizon, samples, caps.
        reward: one of `vedette.control.rewards`, or of the user's own.
        constraints: what each sensor by itself must not do; those on pairs of sensors are not looked at.
        notes: what every plan is to say beside what comes up.

    Raises:
        InputError: parts of another kind.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: AnyReward = field(default_factory=ExpectedLossReward)
    constraints: tuple[Constraint, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_steering(self)
        check_valuing(self.fusion, self.reward, self.notes)

    @property
    def name(self) -> str:
        """The strategy "idm"."""
        return "idm"

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Each sensor's action of largest mean reward; arguments, ties and errors as `JointPlanner.plan`."""
        generator(rng)
        prepared = Preparation.of(self.sensors, self.fusion, self.settings, self.reward, state, poses, self.constraints)
        if prepared.races:
            return _plan_of(self.name, prepared, decide_alone(prepared, rng=rng), self.notes)
        evaluator = prepared.evaluator(self.settings.num_samples, rng=rng)
        courses: list[int] = []
        tables: list[RewardTable] = []
        parts: list[Part] = []
        for s, own in enumerate(evaluator.options):
            evidence = Evidence(evaluator, (s,), evaluator.alone(s))
            allowed = all_joint_actions((len(own.courses),))[single_mask(prepared.mask, s, len(own.courses))]
            best = int(allowed[first_best(evidence.evaluate(allowed)), 0])
            courses.append(best)
            tables.extend(evidence.tables((best,)))
            parts.append(Part.alone(evidence, best))
        counts, found = evaluator.account()
        return Plan(
            self.name,
            tuple(own.actions for own in evaluator.options),
            tuple(own.first_action(course) for own, course in zip(evaluator.options, courses, strict=True)),
            tuple(tables),
            counts,
            (*self.notes, *found, *beyond_cutoff(evaluator, courses)),
            certainty=prepared.certainty,
            questions=Questions(self.name, tuple(parts)),
        )


def _plan_of(name: str, prepared: Preparation, decided: Decided, notes: tuple[str, ...]) -> Plan:
    """The plan of a decision that took as many samples as it needed, and says so."""
    chosen = tuple(own.first_action(course) for own, course in zip(prepared.options, decided.best, strict=True))
    actions = tuple(own.actions for own in prepared.options)
    told, certainty = (*notes, *decided.notes, str(decided.certainty)), decided.certainty
    return Plan(name, actions, chosen, decided.tables, decided.counts, told, decided.curve, decided.bound, certainty)
