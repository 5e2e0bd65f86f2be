"""Policies as planners: in a campaign, on the same seeds as any other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vedette.control import Plan
from vedette.gym.episodes import policy_plan
from vedette.gym.observing import Observation, ObservationEncoder
from vedette.kernels.base.types import Floats
from vedette.tracking import State

Policy: TypeAlias = Callable[[Observation], ArrayLike]


@dataclass(frozen=True, slots=True, eq=False)
class PolicyPlanner:
    """A planner that follows a policy, which receives the observations of an environment.

    Attributes:
        policy: returns the index of an action of each sensor that decides, for an observation of `ScenarioEnv`.
        encoder: makes the observation of a decision.
        name: name of the strategy.
    """

    policy: Policy
    encoder: ObservationEncoder
    name: str = "policy"

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the policy's actions, changed if constraints forbid them. `rng` is not used.

        Raises `InputError` for invalid actions.
        """
        context = self.encoder.decision_context(state, np.asarray(poses, np.float64))
        chosen, _ = self.encoder.resolve_actions(context, self.policy(context.observation))
        return policy_plan(self.name, context, chosen)


def policy_planner(policy: Policy, *, num_labels: int = 10) -> Callable[..., PolicyPlanner]:
    """Return a function that makes a planner of a policy in a scenario.

    In `mine.py` next to a scenario, `steer = policy_planner(policy)`, and in the scenario
    `planners: {mine: {kind: custom, function: "mine.py:steer"}}`. num_labels: as in the environment.
    """

    def make(**parts: Any) -> PolicyPlanner:
        return PolicyPlanner(policy, ObservationEncoder.of(parts, num_labels))

    return make
