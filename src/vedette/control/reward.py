"""How much a planned update is worth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

from vedette.densities import GLMB, LMB, existence_probabilities
from vedette.divergence import cauchy_schwarz, reference_unit_volume
from vedette.errors import InputError


class Reward(Protocol):
    """Value of an ideally updated density over the predicted one; larger is better, and it must be finite.

    The prediction is of the fused density's kind, the update of the fusion's (or, for a sensor alone, of its filter's):
    a marginalised GLMB or an LMB. Tracks are single Gaussians, but in what a fusion of the user's own makes. A label
    set of weight zero is left out of the update.
    """

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float: ...


@dataclass(frozen=True, slots=True)
class CauchySchwarzReward:
    """Cauchy-Schwarz divergence between prediction and update (paper eq. 8), on the label sets that both have.

    Attributes:
        unit_volume: K of eq. 5; or "reference", under which K <p, p> of the prediction is about 1 (paper-notes 15).

    Raises:
        InputError: another word, or a number that is not finite and above 0.
    """

    unit_volume: float | Literal["reference"] = 1.0

    def __post_init__(self) -> None:
        value = self.unit_volume
        if value != "reference" and (isinstance(value, bool | str) or not 0.0 < value < math.inf):
            raise InputError(f"unit_volume: expected a finite number above 0 or 'reference'; got {value!r}")

    def volume(self, predicted: GLMB | LMB) -> float:
        """K for this prediction; "reference" is 1 for one that expects no target, where K has no say."""
        if self.unit_volume != "reference":
            return float(self.unit_volume)
        return reference_unit_volume(predicted) if existence_probabilities(predicted)[1].sum() > 0.0 else 1.0

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        return cauchy_schwarz(predicted, updated, unit_volume=self.volume(predicted), support="common")
