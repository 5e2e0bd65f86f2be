"""Rewards by the public functions, one joint action and sample at a time: for any reward, any fusion, any density."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.rewards.base import LabelReward, PowerReward, Reward, reward_value
from vedette.densities.cases import LabelledCases
from vedette.fusion import Fusion, Views
from vedette.kernels.base.types import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class PlainRewards:
    """What `LaidRewards` computes, and every other reward, by `fusion.fuse` and the reward itself.

    Attributes:
        posteriors: one a sensor.
        prediction: the fused density at the horizon.
        fusion: None for a single sensor, whose own density is then compared with the prediction.
        reward, num_samples: as in the planners.
        views: what the sensors could see at the end of a joint action, which a fusion may ask for.
    """

    posteriors: Sequence[LabelledCases]
    prediction: Belief
    fusion: Fusion | None
    reward: Reward | PowerReward | LabelReward
    num_samples: int
    views: Callable[[Sequence[int]], Views]
    _densities: dict[tuple[int, int], Belief] = field(default_factory=dict)

    def __call__(self, actions: Ints) -> Floats:
        """(num_joint, num_samples) rewards of joint actions (num_joint, num_sensors)."""
        rewards = np.empty((len(actions), self.num_samples))
        for joint, chosen in enumerate(actions.tolist()):
            views = None if self.fusion is None else self.views(chosen)
            for sample in range(self.num_samples):
                densities = [self._density(s, action, sample) for s, action in enumerate(chosen)]
                updated = densities[0] if self.fusion is None else self.fusion.fuse(densities, views)[0]
                rewards[joint, sample] = reward_value(self.reward, self.prediction, updated)
        return rewards

    def _density(self, sensor: int, action: int, sample: int) -> Belief:
        key = sensor, action * self.num_samples + sample
        if key not in self._densities:
            self._densities[key] = self.posteriors[sensor].density(key[1])
        return self._densities[key]
