"""Where to send the sensors next: ideal measurements, rewards, joint action search, constraints, planners."""

from vedette.control.additive.evaluator import AdditiveEvaluator
from vedette.control.constraints import (
    Constraint,
    KeepOut,
    Mask,
    Separation,
    Situation,
    StayInside,
    VoidProbability,
    mask_of,
    void_probability,
)
from vedette.control.evaluator import Evaluator
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
from vedette.control.search import (
    AutomaticSearch,
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    JointProblem,
    JointSearch,
    SequentialGreedy,
)
from vedette.control.settings import MobileSensor, PlanningSettings, planning_limits

__all__ = [
    "AdditiveEvaluator",
    "AutomaticSearch",
    "Bound",
    "CardinalityVarianceReward",
    "CauchySchwarzReward",
    "Constraint",
    "CoordinateAscent",
    "CrossEntropy",
    "Evaluator",
    "ExhaustiveSearch",
    "ExpectedGospaReward",
    "ExpectedLossReward",
    "FixedPlanner",
    "IndependentPlanner",
    "JointPlanner",
    "JointProblem",
    "JointSearch",
    "KeepOut",
    "KullbackLeiblerReward",
    "LabelReward",
    "Mask",
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
    "Separation",
    "SequentialGreedy",
    "Situation",
    "StayInside",
    "VoidProbability",
    "mask_of",
    "planning_limits",
    "void_probability",
]
