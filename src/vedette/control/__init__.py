"""Sensor control: ideal measurements, rewards, searches over joint actions, constraints and planners."""

from vedette.control.baselines import ConstantPlanner, ConstraintReportingPlanner, Planner, RandomPlanner, RequiresTruth
from vedette.control.constraints.active import MaxActive
from vedette.control.constraints.mask import Mask
from vedette.control.constraints.masks import feasible_action_mask
from vedette.control.constraints.protocol import (
    ActivationConstraint,
    Constraint,
    ConstraintContext,
    QuantifiedConstraint,
    RangeLimitedConstraint,
    TimeInvariantConstraint,
    ZoneConstraint,
)
from vedette.control.constraints.regions import KeepOut, StayInside
from vedette.control.constraints.revisit import Revisit
from vedette.control.constraints.separation import Separation
from vedette.control.constraints.void import VoidProbability, void_probability
from vedette.control.evaluator import Evaluator
from vedette.control.explanation import Bound, Counterfactual, Explanation, RunnerUp, TargetGains
from vedette.control.lookahead.beam import BeamSearch
from vedette.control.lookahead.planner import HorizonPlanner
from vedette.control.lookahead.problem import SequenceProblem, SequenceSearch
from vedette.control.lookahead.tree_search import TreeSearch
from vedette.control.plan import Plan, RewardTable, SamplingOutcome, SearchCurve
from vedette.control.planners import IndependentPlanner, JointPlanner
from vedette.control.program import ProgramPlanner
from vedette.control.rewards.base import HasMissedCost, HasUnitVolume, LabelReward, LinearReward, PowerReward, Reward
from vedette.control.rewards.labels import (
    CardinalityVarianceReward,
    ExpectedGospaReward,
    KullbackLeiblerReward,
    PeecsReward,
)
from vedette.control.rewards.power import CauchySchwarzReward, ExpectedLossReward, RenyiReward
from vedette.control.rules_of_thumb import RulePlanner
from vedette.control.search.ascent import AutomaticSearch, CoordinateAscent
from vedette.control.search.cross_entropy import CrossEntropy
from vedette.control.search.greedy import SequentialGreedy
from vedette.control.search.problem import ExhaustiveSearch, JointProblem, JointSearch
from vedette.control.settings import MobileSensor, PlanningSettings, planning_limits

__all__ = [
    "ActivationConstraint",
    "AutomaticSearch",
    "BeamSearch",
    "Bound",
    "CardinalityVarianceReward",
    "CauchySchwarzReward",
    "ConstantPlanner",
    "Constraint",
    "ConstraintContext",
    "ConstraintReportingPlanner",
    "CoordinateAscent",
    "Counterfactual",
    "CrossEntropy",
    "Evaluator",
    "ExhaustiveSearch",
    "ExpectedGospaReward",
    "ExpectedLossReward",
    "Explanation",
    "HasMissedCost",
    "HasUnitVolume",
    "HorizonPlanner",
    "IndependentPlanner",
    "JointPlanner",
    "JointProblem",
    "JointSearch",
    "KeepOut",
    "KullbackLeiblerReward",
    "LabelReward",
    "LinearReward",
    "Mask",
    "MaxActive",
    "MobileSensor",
    "PeecsReward",
    "Plan",
    "Planner",
    "PlanningSettings",
    "PowerReward",
    "ProgramPlanner",
    "QuantifiedConstraint",
    "RandomPlanner",
    "RangeLimitedConstraint",
    "RenyiReward",
    "RequiresTruth",
    "Revisit",
    "Reward",
    "RewardTable",
    "RulePlanner",
    "RunnerUp",
    "SamplingOutcome",
    "SearchCurve",
    "Separation",
    "SequenceProblem",
    "SequenceSearch",
    "SequentialGreedy",
    "StayInside",
    "TargetGains",
    "TimeInvariantConstraint",
    "TreeSearch",
    "VoidProbability",
    "ZoneConstraint",
    "feasible_action_mask",
    "planning_limits",
    "void_probability",
]
