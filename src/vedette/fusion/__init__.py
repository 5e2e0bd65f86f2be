"""Fusion of the densities of several sensors: covariance intersection, arithmetic average and parallel update."""

from vedette.fusion.base import (
    Fusion,
    FusionInfo,
    LogLinearFusion,
    LogLinearPool,
    PrevalidatedBeliefs,
    RequiresCommonPrior,
    SupportsLabelMatching,
    requires_common_prior,
)
from vedette.fusion.cm_delta_glmb import CmDeltaGlmb
from vedette.fusion.lmbs import ArithmeticAverage, Clmb
from vedette.fusion.matching import LabelMatchedFusion, match_labels
from vedette.fusion.parallel import ParallelUpdate
from vedette.fusion.powers import MIXTURE_POWERS, FusionLimits, MixturePower
from vedette.fusion.precomputed import PrecomputedFusion, SupportsPrecomputation, precompute_single_sensor
from vedette.fusion.views import FieldsOfView

__all__ = [
    "MIXTURE_POWERS",
    "ArithmeticAverage",
    "Clmb",
    "CmDeltaGlmb",
    "FieldsOfView",
    "Fusion",
    "FusionInfo",
    "FusionLimits",
    "LabelMatchedFusion",
    "LogLinearFusion",
    "LogLinearPool",
    "MixturePower",
    "ParallelUpdate",
    "PrecomputedFusion",
    "PrevalidatedBeliefs",
    "RequiresCommonPrior",
    "SupportsLabelMatching",
    "SupportsPrecomputation",
    "match_labels",
    "precompute_single_sensor",
    "requires_common_prior",
]
