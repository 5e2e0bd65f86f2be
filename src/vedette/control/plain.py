"""Rewards by the public functions, one joint action and sample at a time: for any reward, any fusion, any density."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.pseudo import PseudoPosteriors, case_density
from vedette.control.reward import CauchySchwarzReward, Reward
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion
from vedette.kernels.base.types import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class PlainRewards:
    """What `FusedRewards` computes, and every other reward, by `fusion.fuse` and the reward itself.

    Attributes:
        posteriors: one a sensor.
        prediction: the fused density at the horizon.
        fusion: None for a single sensor, whose own density is then compared with the prediction.
        reward, num_samples: as in the planners.
    """

    posteriors: Sequence[PseudoPosteriors]
    prediction: Belief
    fusion: Fusion[Any, Any] | None
    reward: Reward
    num_samples: int
    _densities: dict[tuple[int, int], Belief] = field(default_factory=dict)

    def __call__(self, actions: Ints) -> Floats:
        """(num_joint, num_samples) rewards of joint actions (num_joint, num_sensors)."""
        rewards = np.empty((len(actions), self.num_samples))
        for joint, chosen in enumerate(actions.tolist()):
            for sample in range(self.num_samples):
                densities = [self._density(s, action, sample) for s, action in enumerate(chosen)]
                updated = densities[0] if self.fusion is None else self.fusion.fuse(densities)[0]
                rewards[joint, sample] = self._reward(updated)
        return rewards

    def _density(self, sensor: int, action: int, sample: int) -> Belief:
        key = sensor, action * self.num_samples + sample
        if key not in self._densities:
            self._densities[key] = case_density(self.posteriors[sensor], key[1])
        return self._densities[key]

    def _reward(self, updated: Any) -> float:
        value = self.reward(self.prediction, updated)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise InputError(f"reward: expected a number; got {type(value).__name__} {value!r}") from None


def can_be_laid_out(
    posteriors: Sequence[PseudoPosteriors], prediction: Belief, fusion: Fusion[Any, Any] | None, reward: Reward
) -> bool:
    """Whether `FusedRewards` computes exactly what `PlainRewards` does, and the inputs fit each other."""
    is_lmb = isinstance(prediction, LMB)
    # A subclass may do anything: only the very classes are known to be sums of rows.
    if type(reward) is not CauchySchwarzReward or any(own.is_lmb != is_lmb for own in posteriors):
        return False
    # A set that lost all its weight in one case counts as missing there, and not in others.
    if any((own.log_weights == -np.inf).any() for own in posteriors):
        return False
    if fusion is None:
        return True
    if type(fusion) is not (Clmb if is_lmb else CmDeltaGlmb):
        return False
    assert isinstance(fusion, Clmb | CmDeltaGlmb)
    if len(fusion.weights) != len(posteriors) or min(fusion.weights) <= 0.0:
        return False
    sets = [set(own.sets) for own in posteriors]
    # Stand-ins for missing sets are the only mixtures, and powers of single Gaussians are exact.
    exact = fusion.mixture_power == "moment_matched" or all(own == sets[0] for own in sets)
    return exact and fusion.mixture_power != "quadrature" and len(set().union(*sets)) <= fusion.limits.max_hypotheses
