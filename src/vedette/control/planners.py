"""Planners: joint and independent decision making (paper, Algorithms 2 and 3)."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vedette.control.constraints.protocol import Constraint
from vedette.control.decisions import OthersAssumption, decide_independently, decide_jointly
from vedette.control.inputs import check_control_inputs, check_reward_inputs
from vedette.control.plan import Plan
from vedette.control.preparation import AnyReward, Preparation
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.search.ascent import AutomaticSearch
from vedette.control.search.problem import JointSearch
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.fusion import Fusion
from vedette.kernels.base.types import Floats
from vedette.models.arguments import generator, instance, one_of
from vedette.tracking import State


@dataclass(frozen=True, slots=True, eq=False)
class JointPlanner:
    """Joint decision making: the reward of combinations of actions, after fusion (paper, Algorithm 2).

    Attributes:
        sensors: the sensors, in the order of the beliefs and of the fusion weights.
        fusion: fusion rule of their pseudo-updated densities.
        settings: horizon, samples, caps.
        reward: one of `vedette.control.rewards`, or a custom one.
        search: which joint actions are evaluated: all of them, as in the paper, or fewer.
        constraints: limits on the sensors' courses.
        notes: notes that every plan repeats, such as that the tracks are fused in another way.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: AnyReward = field(default_factory=ExpectedLossReward)
    search: JointSearch = field(default_factory=AutomaticSearch)
    constraints: tuple[Constraint, ...] = ()
    notes: tuple[str, ...] = ()
    name: ClassVar[str] = "jdm"

    def __post_init__(self) -> None:
        check_control_inputs(self)
        check_reward_inputs(self.fusion, self.reward, self.notes)
        instance("search", self.search, JointSearch)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the joint action with the largest mean reward that the search finds, of equal ones the first printed.

        Rewards are equal within 1e-9, relative to the best or to 1.

        Args:
            state: the belief of each sensor, as its filter left it, and the fused belief, from which samples and
                prediction are taken. With `vedette.tracking.Central` they are all the same.
            poses: (num_sensors, 3 or more) present poses.
            rng: draws the samples, then the random numbers of the search.

        Raises:
            InputError: invalid inputs, or more joint actions than the search allows.
            ModelError, NumericalError: errors of the filters, or a reward that is not finite.
        """
        generator(rng)
        prepared = Preparation.of(self.sensors, self.fusion, self.settings, self.reward, state, poses, self.constraints)
        return decide_jointly(self.name, prepared, self.search, self.notes, rng=rng)


@dataclass(frozen=True, slots=True, eq=False)
class IndependentPlanner:
    """Independent decision making: each sensor maximises the reward alone (paper, Algorithm 3).

    Attributes:
        sensors: the sensors, in the order of the beliefs.
        fusion: fusion rule of their pseudo-updated densities, if the others are assumed to stay.
        settings: horizon, samples, caps.
        reward: one of `vedette.control.rewards`, or a custom one.
        constraints: limits on each sensor's courses. Constraints on pairs of sensors are ignored.
        notes: notes that every plan repeats.
        others: what each sensor assumes about the others. "stay": they continue as they are, on the course that changes
            their pose least (`vedette.control.inputs.stationary_courses`), and the reward is that of all scans
            together. "absent", as in the paper: there are none, and the reward is that of its own update alone.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings = field(default_factory=PlanningSettings)
    reward: AnyReward = field(default_factory=ExpectedLossReward)
    constraints: tuple[Constraint, ...] = ()
    notes: tuple[str, ...] = ()
    others: OthersAssumption = "stay"
    name: ClassVar[str] = "idm"

    def __post_init__(self) -> None:
        check_control_inputs(self)
        check_reward_inputs(self.fusion, self.reward, self.notes)
        one_of("others", self.others, ("stay", "absent"))

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return each sensor's action with the largest mean reward.

        Arguments, ties and errors are as in `JointPlanner.plan`.
        """
        generator(rng)
        prepared = Preparation.of(self.sensors, self.fusion, self.settings, self.reward, state, poses, self.constraints)
        return decide_independently(self.name, prepared, self.others, self.notes, rng=rng)
