"""Where to send the sensors next: actions, ideal measurements, rewards, joint action search, planners."""

from vedette.control.actions import PAPER_HEADINGS_DEG, ActionSet, HeadingActions
from vedette.control.evaluator import Evaluator
from vedette.control.plan import Plan, RewardTable
from vedette.control.planners import FixedPlanner, IndependentPlanner, JointPlanner, Planner, RandomPlanner
from vedette.control.reward import CauchySchwarzReward, PowerReward, RenyiReward, Reward
from vedette.control.search import CoordinateAscent, ExhaustiveSearch, JointProblem, JointSearch
from vedette.control.settings import MobileSensor, PlanningSettings, planning_limits

__all__ = [
    "PAPER_HEADINGS_DEG",
    "ActionSet",
    "CauchySchwarzReward",
    "CoordinateAscent",
    "Evaluator",
    "ExhaustiveSearch",
    "FixedPlanner",
    "HeadingActions",
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
