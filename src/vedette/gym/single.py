"""An environment in which one agent controls all sensors."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vedette.gym.episodes import RENDER_MODES, AnyReward, Episodes, OfEpisodes, Scenarios
from vedette.gym.observing import Observation
from vedette.gym.spaces import space_of


class ScenarioEnv(OfEpisodes, gymnasium.Env[dict[str, Any], Any]):
    """A scenario from decision to decision. One agent chooses the actions of all sensors that have a choice.

    A step applies the actions and takes the scans up to and including the one before the next decision, or the last one
    of the scenario. The end is a time limit, as targets live on: `truncated`, never `terminated`.

    Observation: see `vedette.gym.ObservationEncoder`, and docs/gym.md for its layout. Action: the index of an action of
    each sensor that decides (`MultiDiscrete`), for a single sensor a number (`Discrete`).
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": 2}  # type: ignore[misc]

    def __init__(
        self,
        scenario: Scenarios = "paper-a",
        *,
        reward: AnyReward = "ospa",
        num_labels: int = 10,
        render_mode: str | None = None,
    ) -> None:
        """Create the environment. Nothing is simulated before `reset`.

        Args:
            scenario: name of a built-in one, file or `Scenario`, or several, of which every run draws one, or a
                function of a random generator that returns the scenario of a run. All must have the same numbers of
                sensors, of actions and of components of states and poses.
            reward: "ospa": minus the OSPA under the scenario's cutoff and order, mean over the scans of the step [m].
                "expected_loss": minus `vedette.gym.expected_loss` of the fused belief, also the mean, which does not
                use the truth, or a function of these `ScanOutcome`s and their `Truth`.
            num_labels: number of targets in an observation.
            render_mode: "rgb_array" or "human". None: nothing is drawn.

        Raises `VedetteError` for a scenario that cannot be loaded, or without decisions or sensors that decide.
        """
        self.episodes, self.render_mode = Episodes(scenario, reward, num_labels, render_mode), render_mode
        self.observation_space = space_of(self.episodes.layout.shapes)
        sizes = self.episodes.layout.num_actions
        self.action_space = spaces.Discrete(sizes[0]) if len(sizes) == 1 else spaces.MultiDiscrete(list(sizes))

    def action_masks(self) -> NDArray[np.bool_]:
        """Mask of the allowed actions of all sensors, concatenated, shape (sum of numbers of actions,)."""
        mask = self.episodes.context.observation["action_mask"].astype(np.bool_)
        return np.concatenate([row[:num] for row, num in zip(mask, self.episodes.layout.num_actions, strict=True)])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Return the first decision of a run.

        Args:
            seed: truth and scans are those of run 0 of a campaign with that seed. None: the next run of the previous
                seed, which is drawn if none was ever given.
            options: `run`, the number of another run.
        """
        super().reset(seed=seed)
        self.episodes.start(seed, (options or {}).get("run"))
        return self.episodes.context.observation, self.episodes.info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply the actions, and advance to the next decision or the end. Raises `InputError` after the end."""
        self.episodes.decide(action)
        episodes = self.episodes
        return episodes.context.observation, episodes.reward(), False, episodes.is_over, episodes.info()
