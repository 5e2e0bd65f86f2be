"""How much a planned update is worth."""

from vedette.control.rewards.base import LabelReward, LinearReward, PowerReward, Reward, WithMissedCost, WithUnitVolume
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
    "KullbackLeiblerReward",
    "LabelReward",
    "LinearReward",
    "PeecsReward",
    "PowerReward",
    "RenyiReward",
    "Reward",
    "WithMissedCost",
    "WithUnitVolume",
]
