"""How much a planned update is worth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

from vedette.densities import GLMB, LMB
from vedette.divergence import cauchy_schwarz, reference_unit_volume
from vedette.errors import InputError


class Reward(Protocol):
    """Value of an ideally updated density over the predicted one; larger is better, and it must be finite.

    Both are of the kind that the planner's filters hold: marginalised GLMB (one Gaussian a track) or LMB.
    """

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float: ...


@dataclass(frozen=True, slots=True)
class CauchySchwarzReward:
    """Cauchy-Schwarz divergence between prediction and update (paper eq. 8), on the label sets that both have.

    Attributes:
        unit_volume: K of eq. 5; or "reference", under which K <p, p> of the prediction is about 1 (paper-notes 15).
    """

    unit_volume: float | Literal["reference"] = 1.0

    def __post_init__(self) -> None:
        if self.unit_volume != "reference" and not 0.0 < float(self.unit_volume) < math.inf:
            raise InputError(f"unit_volume: expected a finite number above 0 or 'reference'; got {self.unit_volume!r}")

    def volume(self, predicted: GLMB | LMB) -> float:
        """K for this prediction."""
        return reference_unit_volume(predicted) if self.unit_volume == "reference" else float(self.unit_volume)

    def __call__(self, predicted: GLMB | LMB, updated: GLMB | LMB) -> float:
        return cauchy_schwarz(predicted, updated, unit_volume=self.volume(predicted), support="common")
