"""Rewards: the value of a planned update."""

from vedette.control.rewards.base import HasMissedCost, HasUnitVolume, LabelReward, LinearReward, PowerReward, Reward
from vedette.control.rewards.labels import (
    CardinalityVarianceReward,
    ExpectedGospaReward,
    KullbackLeiblerReward,
    PeecsReward,
)
from vedette.control.rewards.power import CauchySchwarzReward, ExpectedLossReward, RenyiReward

__all__ = [
    "CardinalityVarianceReward",
    "CauchySchwarzReward",
    "ExpectedGospaReward",
    "ExpectedLossReward",
    "HasMissedCost",
    "HasUnitVolume",
    "KullbackLeiblerReward",
    "LabelReward",
    "LinearReward",
    "PeecsReward",
    "PowerReward",
    "RenyiReward",
    "Reward",
]
