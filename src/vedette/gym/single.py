"""An environment in which one agent sends all sensors."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vedette.gym.episodes import RENDER_MODES, AnyReward, Episodes, Scenarios
from vedette.gym.observing import Observation
from vedette.gym.spaces import space_of
from vedette.simulation import RunRecord, World


class ScenarioEnv(gymnasium.Env[dict[str, Any], Any]):
    """A scenario from decision to decision; one agent chooses the actions of all sensors that have a choice.

    A step sends the sensors and takes their scans up to and including that after which the next decision is due, or the
    last of the scenario. The end is a limit of time, as targets live on: `truncated`, never `terminated`.

    Observation: see `vedette.gym.ObservationEncoder`, and docs/gym.md for its layout. Action: the index of an action of
    each sensor that decides (`MultiDiscrete`), of a single one a number (`Discrete`).
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
        """Nothing is simulated before `reset`.

        Args:
            scenario: name of a built-in one, file or `Scenario`; or several, of which every run draws one; or a
                function of a random generator that gives the one of a run. All must have as many sensors, actions and
                numbers in states and poses.
            reward: "ospa": minus the OSPA under the scenario's cutoff and order, mean over the scans of the step [m];
                "expected_loss": minus `vedette.gym.expected_loss` of the fused belief, likewise, which knows no truth;
                or a function of these `Moment`s and their `Truth`.
            num_labels: targets that an observation shows.
            render_mode: "rgb_array" or "human"; None: nothing is drawn.

        Raises `VedetteError` for a scenario that cannot be had, or has no decisions or nobody to decide about.
        """
        self.episodes, self.render_mode = Episodes(scenario, reward, num_labels, render_mode), render_mode
        self.observation_space = space_of(self.episodes.layout.shapes)
        sizes = self.episodes.layout.num_actions
        self.action_space = spaces.Discrete(sizes[0]) if len(sizes) == 1 else spaces.MultiDiscrete(list(sizes))

    @property
    def world(self) -> World:
        """The present run, with its truth."""
        return self.episodes.world

    def record(self) -> RunRecord:
        """The present run so far, as one of a campaign."""
        return self.episodes.record()

    def action_masks(self) -> NDArray[np.bool_]:
        """(sum of numbers of actions,) which action of each sensor constraints allow, one sensor's after another's."""
        mask = self.episodes.context.observation["action_mask"].astype(np.bool_)
        return np.concatenate([row[:num] for row, num in zip(mask, self.episodes.layout.num_actions, strict=True)])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """The first decision of a run.

        Args:
            seed: truth and scans are those of run 0 of a campaign of that seed; None: of the next run of the seed
                before, which is drawn where none was ever given.
            options: `run`, the number of the run instead.
        """
        super().reset(seed=seed)
        self.episodes.start(seed, (options or {}).get("run"))
        return self.episodes.context.observation, self.episodes.info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send the sensors, and go on to the next decision or the end; raises `InputError` after the end."""
        self.episodes.decide(action)
        episodes = self.episodes
        return episodes.context.observation, episodes.reward(), False, episodes.is_over, episodes.info()

    def render(self) -> NDArray[np.uint8] | None:
        """The last scan, as a frame of `vedette video`: (height, width, 3) for "rgb_array", else in a window."""
        return self.episodes.render()

    def close(self) -> None:
        """Close the window."""
        self.episodes.close()
