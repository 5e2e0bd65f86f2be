"""Where to send the sensors next: ideal measurements, rewards, joint action search, constraints, planners."""

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
from vedette.control.plan import Plan, RewardTable
from vedette.control.planners import FixedPlanner, IndependentPlanner, JointPlanner, Planner, RandomPlanner
from vedette.control.reward import CauchySchwarzReward, PowerReward, RenyiReward, Reward
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
    "AutomaticSearch",
    "CauchySchwarzReward",
    "Constraint",
    "CoordinateAscent",
    "CrossEntropy",
    "Evaluator",
    "ExhaustiveSearch",
    "FixedPlanner",
    "IndependentPlanner",
    "JointPlanner",
    "JointProblem",
    "JointSearch",
    "KeepOut",
    "Mask",
    "MobileSensor",
    "Plan",
    "Planner",
    "PlanningSettings",
    "PowerReward",
    "RandomPlanner",
    "RenyiReward",
    "Reward",
    "RewardTable",
    "Separation",
    "SequentialGreedy",
    "Situation",
    "StayInside",
    "VoidProbability",
    "mask_of",
    "planning_limits",
    "void_probability",
]
