"""Policies as planners: in a campaign, on the same seeds as any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vedette.control import Plan
from vedette.gym.episodes import plan_of
from vedette.gym.observing import Observation, Observer
from vedette.kernels.base.types import Floats
from vedette.tracking import State

Policy: TypeAlias = Callable[[Observation], ArrayLike]


@dataclass(frozen=True, slots=True, eq=False)
class PolicyPlanner:
    """A planner that asks a policy, showing it what an environment shows.

    Attributes:
        policy: gives the index of an action of each sensor that decides, for an observation of `ScenarioEnv`.
        observer: shows the decision.
        name: of the strategy.
    """

    policy: Policy
    observer: Observer
    name: str = "policy"

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """What the policy says, moved where constraints forbid it; `rng` is not asked.

        Raises `InputError` for what are no actions.
        """
        outlook = self.observer.outlook(state, np.asarray(poses, np.float64))
        chosen, _ = self.observer.chosen(outlook, self.policy(outlook.observation))
        return plan_of(self.name, outlook, chosen)


def planner_of(policy: Policy, *, num_labels: int = 10) -> Callable[..., PolicyPlanner]:
    """What makes a planner of a policy in a scenario.

    In `mine.py` beside a scenario, `steer = planner_of(policy)`; in the scenario
    `planners: {mine: {kind: custom, function: "mine.py:steer"}}`. num_labels: as of the environment.
    """

    def make(**parts: Any) -> PolicyPlanner:
        return PolicyPlanner(policy, Observer.of(parts, num_labels))

    return make
