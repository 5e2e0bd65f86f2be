"""How much a planned update is worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from vedette.densities import GLMB, LMB, existence_probabilities
from vedette.divergence import cauchy_schwarz, power_integrals, reference_unit_volume, renyi
from vedette.errors import InputError
from vedette.kernels.base.types import Floats

Exponents: TypeAlias = Sequence[tuple[float, float]]
UnitVolume: TypeAlias = float | Literal["reference"]


class Reward(Protocol):
    """Value of an ideally updated density over the predicted one; larger is better, and it must be finite.

    The prediction is of the fused density's kind, the update of the fusion's (or, for a sensor alone, of its filter's):
    a marginalised GLMB or an LMB. Tracks are single Gaussians, but in what a fusion of the user's own makes. A label
    set of weight zero is left out of the update.
    """

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float: ...


@runtime_checkable
class PowerReward(Protocol):
    """A reward made of power integrals Z(a, b) of prediction and update: then no fused density need be formed.

    Z(a, b) is the log of the set integral of K^((a + b - 1) |X|) predicted(X)^a updated(X)^b over the label sets that
    both have (see `vedette.divergence.power_integral`). The update need not be normalised: exp(Z(0, 1)) is what it
    integrates to. Where it has an attribute `unit_volume`, that is K: a number, or "reference" for
    `vedette.divergence.reference_unit_volume` of the prediction; otherwise K is 1.
    """

    @property
    def exponents(self) -> Exponents:
        """The pairs (a, b) that are wanted."""
        ...

    def combine(self, z: Floats) -> Floats:
        """Rewards (...) of z (..., num_exponents)."""
        ...


@dataclass(frozen=True, slots=True)
class CauchySchwarzReward:
    """Cauchy-Schwarz divergence between prediction and update (paper eq. 8), on the label sets that both have.

    Attributes:
        unit_volume: K of eq. 5; or "reference", under which K <p, p> of the prediction is about 1 (paper-notes 15).

    Raises:
        InputError: another word, or a number that is not finite and above 0.
    """

    unit_volume: UnitVolume = 1.0
    exponents: ClassVar[Exponents] = ((0.0, 2.0), (1.0, 1.0), (2.0, 0.0))

    def __post_init__(self) -> None:
        check_unit_volume(self.unit_volume)

    def combine(self, z: Floats) -> Floats:
        """(Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1)."""
        return 0.5 * (z[..., 0] + z[..., 2]) - z[..., 1]

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        volume = unit_volume_of(self, predicted)
        return cauchy_schwarz(predicted, updated, unit_volume=volume, support="common")


@dataclass(frozen=True, slots=True)
class RenyiReward:
    """Renyi divergence of the prediction from the update, on the label sets that both have, where both sum to one.

    log(integral of predicted^order updated^(1 - order)) / (order - 1); see `vedette.divergence.renyi`. It needs no K.

    Attributes:
        order: above 0 and not 1. 1/2 is symmetric, twice the Bhattacharyya distance. Above 1 it is infinite, and so no
            reward, where the prediction is much wider than the update.

    Raises:
        InputError: another order.
    """

    order: float = 0.5

    def __post_init__(self) -> None:
        value = self.order
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 < value < math.inf or value == 1.0:
            raise InputError(f"order: expected a finite number above 0 other than 1; got {value!r}")

    @property
    def exponents(self) -> Exponents:
        """(order, 1 - order), and what normalises the two."""
        return (0.0, 1.0), (self.order, 1.0 - self.order), (1.0, 0.0)

    def combine(self, z: Floats) -> Floats:
        """(Z(order, 1 - order) - order Z(1, 0) - (1 - order) Z(0, 1)) / (order - 1)."""
        order = self.order
        return np.asarray((z[..., 1] - order * z[..., 2] - (1.0 - order) * z[..., 0]) / (order - 1.0))

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        return renyi(predicted, updated, self.order, support="common")


def check_unit_volume(value: Any) -> None:
    """`InputError` unless K is a finite number above 0, or the word "reference"."""
    if value != "reference" and (isinstance(value, bool | str) or not 0.0 < value < math.inf):
        raise InputError(f"unit_volume: expected a finite number above 0 or 'reference'; got {value!r}")


def unit_volume_of(reward: Any, predicted: GLMB | LMB) -> float:
    """K of a reward; "reference" is 1 for a prediction that expects no target, where K has no say."""
    value = getattr(reward, "unit_volume", 1.0)
    check_unit_volume(value)
    if value != "reference":
        return float(value)
    return reference_unit_volume(predicted) if existence_probabilities(predicted)[1].sum() > 0.0 else 1.0


def combined(reward: PowerReward, z: Floats) -> Floats:
    """The rewards (...) of z (..., num_exponents); `InputError` unless `combine` gives a number for each."""
    try:
        rewards = np.asarray(reward.combine(z), np.float64)
    except (TypeError, ValueError) as fault:
        raise InputError(f"reward.combine: expected numbers; got a fault: {fault}") from fault
    if rewards.shape != z.shape[:-1]:
        raise InputError(f"reward.combine: expected shape {z.shape[:-1]} for z of shape {z.shape}; got {rewards.shape}")
    return rewards


def speaks_for(thing: Any, method: str, other: str) -> bool:
    """Whether one method may be asked instead of the other: not where a subclass has changed the other alone."""
    for owner in type(thing).__mro__:
        if method in vars(owner) or other in vars(owner):
            return method in vars(owner)
    return True  # methods of the object itself


def reward_value(reward: Reward | PowerReward, predicted: GLMB | LMB, updated: Any) -> float:
    """The reward of one update; `InputError` where it is no number."""
    value: Any
    if callable(reward) and speaks_for(reward, "__call__", "combine"):
        value = reward(predicted, updated)
    else:
        assert isinstance(reward, PowerReward)
        volume = unit_volume_of(reward, predicted)
        z = power_integrals(predicted, updated, reward.exponents, unit_volume=volume, support="common")
        value = combined(reward, z[None])[0]
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"reward: expected a number; got {type(value).__name__} {value!r}") from None
