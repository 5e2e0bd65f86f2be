"""How several sensors' beliefs become one: covariance intersection, arithmetic average and parallel update."""

from vedette.fusion.base import (
    Fusion,
    FusionInfo,
    Linear,
    LinearRule,
    MatchesLabels,
    SharesPrediction,
    ValidBeliefs,
    shares_prediction,
)
from vedette.fusion.cm_delta_glmb import CmDeltaGlmb
from vedette.fusion.laid_out import LaidOut, LaysOut, lay_out_alone
from vedette.fusion.lmbs import ArithmeticAverage, Clmb
from vedette.fusion.matching import Matched, match_labels
from vedette.fusion.parallel import ParallelUpdate
from vedette.fusion.powers import MIXTURE_POWERS, FusionLimits, MixturePower
from vedette.fusion.views import Views

__all__ = [
    "MIXTURE_POWERS",
    "ArithmeticAverage",
    "Clmb",
    "CmDeltaGlmb",
    "Fusion",
    "FusionInfo",
    "FusionLimits",
    "LaidOut",
    "LaysOut",
    "Linear",
    "LinearRule",
    "Matched",
    "MatchesLabels",
    "MixturePower",
    "ParallelUpdate",
    "SharesPrediction",
    "ValidBeliefs",
    "Views",
    "lay_out_alone",
    "match_labels",
    "shares_prediction",
]
