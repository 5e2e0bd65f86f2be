"""Filters: prediction and update of a multi-target density with the scans of one or several sensors."""

from typing import TypeAlias

from vedette.densities import IidCluster, LabelledDensity, MultiBernoulli, Poisson
from vedette.filters.assignment import Assignment, BeliefPropagation, CustomMarginals, Gibbs, RankedAssignment
from vedette.filters.factored import FactoredGlmbFilter, SequentialFactoredFilter, with_labelled_births
from vedette.filters.glmb import DeltaGlmbFilter, MultiSensorGlmbFilter
from vedette.filters.limits import Limits
from vedette.filters.lmb import LmbFilter, SequentialLmbFilter
from vedette.filters.multi_sensor_lmb import MultiSensorLmbFilter
from vedette.filters.protocols import Filter, FilterInfo, PredictUpdateFilter, common_target_model, has_labels
from vedette.filters.unlabelled import CbMemberFilter, CphdFilter, PhdFilter

Belief: TypeAlias = LabelledDensity | Poisson | IidCluster | MultiBernoulli

__all__ = [
    "Assignment",
    "Belief",
    "BeliefPropagation",
    "CbMemberFilter",
    "CphdFilter",
    "CustomMarginals",
    "DeltaGlmbFilter",
    "FactoredGlmbFilter",
    "Filter",
    "FilterInfo",
    "Gibbs",
    "Limits",
    "LmbFilter",
    "MultiSensorGlmbFilter",
    "MultiSensorLmbFilter",
    "PhdFilter",
    "PredictUpdateFilter",
    "RankedAssignment",
    "SequentialFactoredFilter",
    "SequentialLmbFilter",
    "common_target_model",
    "has_labels",
    "with_labelled_births",
]
