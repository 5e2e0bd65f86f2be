"""An environment in which every sensor is an agent."""

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from vedette.gym.episodes import RENDER_MODES, AnyReward, Episodes, OfEpisodes, Scenarios
from vedette.gym.observing import Observation, belief_arrays
from vedette.gym.spaces import space_of
from vedette.models.arguments import one_of, reject

_BELIEF = ("existence", "means", "sqrt_covs", "mask")


class ScenarioParallelEnv(OfEpisodes, ParallelEnv):  # type: ignore[misc]  # PettingZoo is untyped
    """A scenario from decision to decision.

    Each sensor that has a choice is an agent, and all agents get the same reward.

    Steps, rewards and the end are those of `ScenarioEnv`. An agent is named `sensor_2`, by its position in the
    scenario, from 1. Its observation has its own row of `ends` and `action_mask`, and its own row of `poses` first.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": 2, "name": "vedette_scenario_v0"}

    def __init__(
        self,
        scenario: Scenarios = "paper-a",
        *,
        reward: AnyReward = "ospa",
        num_labels: int = 10,
        belief: Literal["fused", "own"] = "fused",
        render_mode: str | None = None,
    ) -> None:
        """Arguments as in `ScenarioEnv`.

        belief: whether agents observe the fused belief, or that of their own sensor.
        """
        self.episodes, self.render_mode = Episodes(scenario, reward, num_labels, render_mode), render_mode
        self._own, self._num_labels = one_of("belief", belief, ("fused", "own")) == "own", num_labels
        layout = self.episodes.layout
        self._sensors = {f"sensor_{s + 1}": (row, s) for row, s in enumerate(layout.deciding)}
        self.possible_agents = list(self._sensors)
        self.agents: list[str] = []
        self._action_spaces = {
            agent: spaces.Discrete(num) for agent, num in zip(self._sensors, layout.num_actions, strict=True)
        }
        self._observation_spaces = {}
        for agent, num in zip(self._sensors, layout.num_actions, strict=True):
            own = {"ends": (num, *layout.shapes["ends"][2:]), "action_mask": (num,)}
            self._observation_spaces[agent] = space_of(layout.shapes | own)

    def observation_space(self, agent: str) -> spaces.Dict:
        """Return the observation space of an agent."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return the action space of an agent: the indices of its sensor's actions."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Return the first decision of a run, with arguments as in `ScenarioEnv.reset`."""
        self.episodes.start(seed, (options or {}).get("run"))
        self.agents = self.possible_agents[:]
        return self._observations(), self._all(self.episodes.info)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Apply the action of each agent to its sensor, and advance to the next decision or the end.

        Raises `InputError` for an agent without an action, or after the end.
        """
        missing = [agent for agent in self._sensors if agent not in actions]
        if missing and self.agents:
            raise reject("actions", f"one of each of {', '.join(self._sensors)}", list(actions))
        self.episodes.decide([actions[agent] for agent in self._sensors])
        over, infos = self.episodes.is_over, self._all(self.episodes.info)
        rewards = dict.fromkeys(self._sensors, self.episodes.reward())
        ended = dict.fromkeys(self._sensors, over)
        if over:
            self.agents = []
        return self._observations(), rewards, dict.fromkeys(self._sensors, False), ended, infos

    def _observations(self) -> dict[str, Observation]:
        context, found = self.episodes.context, {}
        for (agent, (row, s)), num in zip(self._sensors.items(), self.episodes.layout.num_actions, strict=True):
            shown, poses = context.observation, context.observation["poses"]
            own = {name: shown[name][row, :num] for name in ("ends", "action_mask")}
            own["poses"] = np.concatenate([poses[s : s + 1], poses[:s], poses[s + 1 :]])
            if self._own:
                num_modes = self.episodes.built.encoder.num_modes
                own |= belief_arrays(context.state.local[s], context.state.step, self._num_labels, num_modes)
            found[agent] = {name: array.copy() for name, array in (shown | own).items()}
        return found

    def _all(self, make: Callable[[], dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {agent: make() for agent in self._sensors}
