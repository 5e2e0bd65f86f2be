"""Protocols of rewards, and the value of a planned update."""

import math
import numbers
from collections.abc import Sequence
from typing import Any, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from vedette.densities import GLMB, LMB, as_lmb, existence_probabilities, track_moments
from vedette.densities.tracks import places_of
from vedette.divergence import power_integrals, reference_unit_volume
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject
from vedette.models.functions import ModelFunction

Exponents: TypeAlias = Sequence[tuple[float, float]]
UnitVolume: TypeAlias = float | Literal["reference"]


class Reward(Protocol):
    """A value of an ideally updated density relative to the predicted one. Larger is better, and it must be finite.

    The prediction has the type of the fused density, the update that of the fusion's output (or, for a sensor alone, of
    its filter's): a marginalised GLMB or an LMB. Tracks are single Gaussians, except in the output of a custom fusion.
    A label set of weight zero is left out of the update.
    """

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float: ...


@runtime_checkable
class PowerReward(Protocol):
    """A reward made of power integrals Z(a, b) of prediction and update. No fused density needs to be formed.

    Z(a, b) is the log of the set integral of K^((a + b - 1) |X|) predicted(X)^a updated(X)^b over the label sets that
    both have (see `vedette.divergence.power_integral`). The update need not be normalised: exp(Z(0, 1)) is its
    integral. The
    reward may have the members of `HasUnitVolume` and `LinearReward`, too. Without the former K is 1.
    """

    @property
    def exponents(self) -> Exponents:
        """The required pairs (a, b)."""

    def combine(self, z: Floats) -> Floats:
        """Return rewards (...) of z (..., num_exponents)."""


@runtime_checkable
class LabelReward(Protocol):
    """A reward made of sums over the targets: each target is evaluated by itself, and no density needs to be formed.

    Each label adds `num_terms` numbers, which `function` computes from its Bernoulli before and after. `combine` turns
    their sums into the reward.
    """

    @property
    def function(self) -> ModelFunction:
        """Function of kind `label_reward`: see `vedette.models.model_function`."""

    @property
    def params(self) -> Floats:
        """Parameter vector of the function."""

    @property
    def num_terms(self) -> int:
        """Number of terms that a label adds."""

    def combine(self, sums: Floats) -> Floats:
        """Return rewards (...) of sums over the labels (..., num_terms)."""


@runtime_checkable
class HasUnitVolume(Protocol):
    """A reward of densities that has a unit of volume."""

    @property
    def unit_volume(self) -> UnitVolume:
        """K: a number, or "reference" for `vedette.divergence.reference_unit_volume` of the prediction."""


@runtime_checkable
class HasMissedCost(Protocol):
    """A reward that has a cost of a missed target, which is the value of finding an undetected target."""

    @property
    def missed_cost(self) -> float:
        """Cost in units of the reward, at least 0."""


@runtime_checkable
class LinearReward(Protocol):
    """A reward whose `combine` is linear.

    Searches then have bounds and compiled ascents, and explanations have gains of targets.
    """

    @property
    def coefficients(self) -> Sequence[float] | Floats | None:
        """Coefficients (num,) of the combined numbers. None, as without this member: the reward is not linear."""


def check_unit_volume(value: Any) -> None:
    """Raise `InputError` unless K is a finite number above 0, or the word "reference"."""
    if isinstance(value, str) and value == "reference":
        return
    is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    if not is_number or not 0.0 < value < math.inf:
        raise reject("unit_volume", "a finite number above 0 or 'reference'", value)


def unit_volume_of(reward: Any, predicted: GLMB | LMB) -> float:
    """Return K of a reward. "reference" is 1 for a prediction without expected targets, for which K has no effect."""
    value = getattr(reward, "unit_volume", 1.0)
    check_unit_volume(value)
    if value != "reference":
        return float(value)
    return reference_unit_volume(predicted) if existence_probabilities(predicted)[1].sum() > 0.0 else 1.0


def combined(reward: PowerReward, z: Floats) -> Floats:
    """Return rewards (...) of z (..., num_exponents). Raises `InputError` unless `combine` gives a number for each."""
    try:
        rewards = np.asarray(reward.combine(z), np.float64)
    except (TypeError, ValueError) as fault:
        raise InputError(f"reward.combine: expected numbers; got a fault: {fault}") from fault
    if rewards.shape != z.shape[:-1]:
        raise InputError(f"reward.combine: expected shape {z.shape[:-1]} for z of shape {z.shape}; got {rewards.shape}")
    return rewards


def may_replace(thing: Any, method: str, other: str) -> bool:
    """Return True if `method` may replace `other`, that is, no subclass overrides only `other`."""
    for owner in type(thing).__mro__:
        if method in vars(owner) or other in vars(owner):
            return method in vars(owner)
    return True  # methods set on the object itself


def _of_labels(reward: LabelReward, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
    """Return the reward of two densities, GLMBs converted to LMBs. A label missing in the update has existence 0."""
    before, after = (as_lmb(density) for density in (predicted, updated))
    places = places_of(before.tracks.labels, after.tracks.labels)
    old, new = track_moments(before.tracks), track_moments(after.tracks)
    sums, out = np.zeros(reward.num_terms), np.empty(reward.num_terms)
    for i, at in enumerate(places.tolist()):
        existence, moments = (
            (0.0, (old[0][i], old[1][i])) if at < 0 else (after.existence[at], (new[0][at], new[1][at]))
        )
        reward.function(before.existence[i], old[0][i], old[1][i], existence, *moments, reward.params, out)
        sums += out
    return float(reward.combine(sums))


def reward_value(reward: Reward | PowerReward | LabelReward, predicted: GLMB | LMB, updated: Any) -> float:
    """Return the reward of one update. Raises `InputError` if it is not a number."""
    value: Any
    if callable(reward) and may_replace(reward, "__call__", "combine"):
        value = reward(predicted, updated)
    elif isinstance(reward, LabelReward):
        value = _of_labels(reward, predicted, updated)
    else:
        assert isinstance(reward, PowerReward)
        volume = unit_volume_of(reward, predicted)
        z = power_integrals(predicted, updated, reward.exponents, unit_volume=volume, support="common")
        value = combined(reward, z[None])[0]
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"reward: expected a number; got {type(value).__name__} {value!r}") from None
