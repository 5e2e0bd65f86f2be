"""How a belief meets time and a scan."""

from typing import TypeAlias

from vedette.densities import IidCluster, Labelled, MultiBernoulli, Poisson
from vedette.filters.assignment import Assignment, BeliefPropagation, Gibbs, Marginals, Ranked
from vedette.filters.factored import FactoredGlmbFilter, SequentialFactoredFilter, with_labelled_births
from vedette.filters.glmb import DeltaGlmbFilter, MultiSensorGlmbFilter
from vedette.filters.limits import Limits
from vedette.filters.lmb import LmbFilter, SequentialLmbFilter
from vedette.filters.multi_sensor_lmb import MultiSensorLmbFilter
from vedette.filters.protocols import Filter, FilterInfo, TwoStepFilter, labels_targets, shared_targets
from vedette.filters.unlabelled import CbMemberFilter, CphdFilter, PhdFilter

Belief: TypeAlias = Labelled | Poisson | IidCluster | MultiBernoulli

__all__ = [
    "Assignment",
    "Belief",
    "BeliefPropagation",
    "CbMemberFilter",
    "CphdFilter",
    "DeltaGlmbFilter",
    "FactoredGlmbFilter",
    "Filter",
    "FilterInfo",
    "Gibbs",
    "Limits",
    "LmbFilter",
    "Marginals",
    "MultiSensorGlmbFilter",
    "MultiSensorLmbFilter",
    "PhdFilter",
    "Ranked",
    "SequentialFactoredFilter",
    "SequentialLmbFilter",
    "TwoStepFilter",
    "labels_targets",
    "shared_targets",
    "with_labelled_births",
]
