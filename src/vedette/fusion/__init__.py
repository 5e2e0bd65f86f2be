"""How several sensors' beliefs become one: generalized covariance intersection (GCI) of labelled densities."""

from vedette.fusion.base import MIXTURE_POWERS, Fusion, FusionInfo, FusionLimits, MixturePower
from vedette.fusion.clmb import Clmb
from vedette.fusion.cm_delta_glmb import CmDeltaGlmb
from vedette.fusion.laid_out import LaidOut, LaysOut, lay_out_alone
from vedette.fusion.views import Views

__all__ = [
    "MIXTURE_POWERS",
    "Clmb",
    "CmDeltaGlmb",
    "Fusion",
    "FusionInfo",
    "FusionLimits",
    "LaidOut",
    "LaysOut",
    "MixturePower",
    "Views",
    "lay_out_alone",
]
