"""Where to send the sensors next: ideal measurements, rewards, joint action search, planners."""

from vedette.control.evaluator import Evaluator
from vedette.control.plan import Plan, RewardTable
from vedette.control.planners import FixedPlanner, IndependentPlanner, JointPlanner, Planner, RandomPlanner
from vedette.control.reward import CauchySchwarzReward, PowerReward, RenyiReward, Reward
from vedette.control.search import CoordinateAscent, ExhaustiveSearch, JointProblem, JointSearch
from vedette.control.settings import MobileSensor, PlanningSettings, planning_limits

__all__ = [
    "CauchySchwarzReward",
    "CoordinateAscent",
    "Evaluator",
    "ExhaustiveSearch",
    "FixedPlanner",
    "IndependentPlanner",
    "JointPlanner",
    "JointProblem",
    "JointSearch",
    "MobileSensor",
    "Plan",
    "Planner",
    "PlanningSettings",
    "PowerReward",
    "RandomPlanner",
    "RenyiReward",
    "Reward",
    "RewardTable",
    "planning_limits",
]
