"""Rewards of joint actions from power integrals, without forming a fused density, where fusion and reward allow it."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vedette.control.inputs import Belief
from vedette.control.rewards.base import LabelReward, PowerReward, Reward, combined, speaks_for, unit_volume_of
from vedette.densities.cases import LabelledCases
from vedette.errors import SlowRewardWarning
from vedette.fusion import Fusion, LaidOut, LaysOut, lay_out_alone
from vedette.kernels.base.types import Floats, Ints

# Of decisions of paper-a, two sensors of 13 actions each: benchmarks/planning.py --one-by-one.
SLOWER_BY = "a joint decision of two sensors takes 40 to 70 times as long, an independent one 4 to 6 times,"


@dataclass(frozen=True, slots=True, eq=False)
class LaidRewards:
    """What `PlainRewards` computes, for all joint actions and samples at once.

    Attributes:
        laid: the sensors' cases and the prediction.
        reward: what is made of their power integrals.
        unit_volume: K.
    """

    laid: LaidOut
    reward: PowerReward
    unit_volume: float

    def __call__(self, actions: Ints) -> Floats:
        """(num_joint, num_samples) rewards of joint actions (num_joint, num_sensors)."""
        return combined(self.reward, self.laid.z(actions, self.reward.exponents, self.unit_volume))


def lay_out_rewards(
    cases: Sequence[LabelledCases],
    prediction: Belief,
    fusion: Fusion | None,
    reward: Reward | PowerReward | LabelReward,
) -> LaidRewards | str:
    """The rewards laid out, or why they cannot be. fusion: None for a sensor alone."""
    if not isinstance(reward, PowerReward) or not speaks_for(reward, "combine", "__call__"):
        return f"{_name(reward)} is a function of two densities"
    laid: LaidOut | None = None
    if fusion is None:
        laid = lay_out_alone(cases[0], prediction)
    elif isinstance(fusion, LaysOut) and speaks_for(fusion, "lay_out", "fuse"):
        laid = fusion.lay_out(cases, prediction)
    if laid is None:
        return f"{'a sensor alone' if fusion is None else _name(fusion)} cannot lay out these beliefs"
    return LaidRewards(laid, reward, unit_volume_of(reward, prediction))


def _name(thing: Any) -> str:
    named = getattr(thing, "func", thing)  # of a partial
    return str(getattr(named, "__name__", type(named).__name__))


@functools.cache
def warn_slow(why: str) -> None:
    """Warn, once in a process, that rewards are computed one by one."""
    warnings.warn(
        f"rewards are computed one by one: {SLOWER_BY} as by a PowerReward under a fusion that lays out; {why}",
        SlowRewardWarning,
        stacklevel=2,
    )
