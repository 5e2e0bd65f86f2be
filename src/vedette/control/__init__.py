"""Where to send the sensors next: ideal measurements, rewards, joint action search, constraints, planners."""

from vedette.control.baselines import FixedPlanner, Planner, RandomPlanner, WatchedPlanner
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
from vedette.control.explanation import Bound, Explanation, Had, RunnerUp, TargetGains
from vedette.control.lookahead import BeamSearch, HorizonPlanner, SequenceProblem, SequenceSearch, TreeSearch
from vedette.control.plan import Certainty, Plan, RewardTable, SearchCurve
from vedette.control.planners import IndependentPlanner, JointPlanner
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
from vedette.control.rules_of_thumb import RulePlanner
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
    "BeamSearch",
    "Bound",
    "CardinalityVarianceReward",
    "CauchySchwarzReward",
    "Certainty",
    "Constraint",
    "CoordinateAscent",
    "CrossEntropy",
    "Evaluator",
    "ExhaustiveSearch",
    "ExpectedGospaReward",
    "ExpectedLossReward",
    "Explanation",
    "FixedPlanner",
    "Had",
    "HorizonPlanner",
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
    "RulePlanner",
    "RunnerUp",
    "SearchCurve",
    "Separation",
    "SequenceProblem",
    "SequenceSearch",
    "SequentialGreedy",
    "Situation",
    "StayInside",
    "TargetGains",
    "TreeSearch",
    "VoidProbability",
    "WatchedPlanner",
    "mask_of",
    "planning_limits",
    "void_probability",
]
