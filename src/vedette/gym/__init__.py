"""Scenarios as environments for reinforcement learning, and policies as planners.

Importing this package registers the environment `vedette/Scenario-v0` with Gymnasium. Its argument is a `scenario`.
"""

from vedette.internal.extras import require_packages

require_packages("an environment", "gymnasium", "pettingzoo")

import gymnasium

from vedette.gym.episodes import expected_loss
from vedette.gym.observing import Observation, ObservationEncoder
from vedette.gym.parallel import ScenarioParallelEnv
from vedette.gym.policies import PolicyPlanner, policy_planner
from vedette.gym.single import ScenarioEnv

if "vedette/Scenario-v0" not in gymnasium.registry:  # a second registration would warn
    gymnasium.register("vedette/Scenario-v0", "vedette.gym.single:ScenarioEnv")

__all__ = [
    "Observation",
    "ObservationEncoder",
    "PolicyPlanner",
    "ScenarioEnv",
    "ScenarioParallelEnv",
    "expected_loss",
    "policy_planner",
]
