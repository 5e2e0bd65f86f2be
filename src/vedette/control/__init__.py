"""Where to send the sensors next: ideal measurements, rewards, joint action search, planners."""

from vedette.control.additive.evaluator import AdditiveEvaluator
from vedette.control.evaluator import Evaluator
from vedette.control.lookahead import BeamSearch, HorizonPlanner, SequenceProblem, SequenceSearch, TreeSearch
from vedette.control.plan import Bound, Plan, RewardTable, SearchCurve
from vedette.control.planners import FixedPlanner, IndependentPlanner, JointPlanner, Planner, RandomPlanner
from vedette.control.rewards import (
    CardinalityVarianceReward,
    CauchySchwarzReward,
    ExpectedGospaReward,
    ExpectedLossReward,
    KullbackLeiblerReward,
    LabelReward,
    PeecsReward,
    PowerReward,
    RenyiReward,
    Reward,
)
from vedette.control.search import CoordinateAscent, ExhaustiveSearch, JointProblem, JointSearch
from vedette.control.settings import MobileSensor, PlanningSettings, planning_limits

__all__ = [
    "AdditiveEvaluator",
    "BeamSearch",
    "Bound",
    "CardinalityVarianceReward",
    "CauchySchwarzReward",
    "CoordinateAscent",
    "Evaluator",
    "ExhaustiveSearch",
    "ExpectedGospaReward",
    "ExpectedLossReward",
    "FixedPlanner",
    "HorizonPlanner",
    "IndependentPlanner",
    "JointPlanner",
    "JointProblem",
    "JointSearch",
    "KullbackLeiblerReward",
    "LabelReward",
    "MobileSensor",
    "PeecsReward",
    "Plan",
    "Planner",
    "PlanningSettings",
    "PowerReward",
    "RandomPlanner",
    "RenyiReward",
    "Reward",
    "RewardTable",
    "SearchCurve",
    "SequenceProblem",
    "SequenceSearch",
    "TreeSearch",
    "planning_limits",
]
