"""How several sensors' beliefs become one: covariance intersection, arithmetic average and parallel update."""

from vedette.fusion.arithmetic_average import ArithmeticAverage
from vedette.fusion.base import (
    MIXTURE_POWERS,
    Fusion,
    FusionInfo,
    FusionLimits,
    Linear,
    LinearRule,
    MatchesLabels,
    MixturePower,
    SharesPrediction,
    shares_prediction,
)
from vedette.fusion.clmb import Clmb
from vedette.fusion.cm_delta_glmb import CmDeltaGlmb
from vedette.fusion.laid_out import LaidOut, LaysOut, lay_out_alone
from vedette.fusion.matching import Matched, match_labels
from vedette.fusion.parallel import ParallelUpdate
from vedette.fusion.validity import ValidBeliefs
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
