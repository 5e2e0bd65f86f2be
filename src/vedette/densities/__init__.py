"""Multi-target densities, labelled and unlabelled, with Gaussian-mixture tracks."""

from vedette.densities.conversions import as_glmb, as_lmb, marginalise, resolve_labels
from vedette.densities.estimates import (
    Estimate,
    Estimator,
    TrackHistory,
    at_dominant_components,
    best_estimate,
    least_gospa_estimate,
    least_ospa_estimate,
    map_estimate,
    map_or_unlabelled,
    marginal_estimate,
    track_histories,
    unlabelled_estimate,
)
from vedette.densities.factored import FactoredGLMB
from vedette.densities.files import load_density, save_density
from vedette.densities.glmb import GLMB
from vedette.densities.inspection import Hypothesis, Target
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.multi_bernoulli import MultiBernoulli
from vedette.densities.samples import (
    MultiTargetSamples,
    sample_glmb,
    sample_iid_cluster,
    sample_lmb,
    sample_multi_bernoulli,
    sample_poisson,
)
from vedette.densities.statistics import cardinality_distribution, existence_probabilities
from vedette.densities.tracks import TrackTable, mixture_moments, track_moments
from vedette.densities.undetected import LearntRate, UndetectedIntensity, UndetectedTargets
from vedette.densities.unlabelled import IidCluster, Poisson
from vedette.kernels.gaussian.marks import marks_of

__all__ = [
    "GLMB",
    "LMB",
    "Estimate",
    "Estimator",
    "FactoredGLMB",
    "Hypothesis",
    "IidCluster",
    "LabelledDensity",
    "LearntRate",
    "MultiBernoulli",
    "MultiTargetSamples",
    "Poisson",
    "Target",
    "TrackHistory",
    "TrackTable",
    "UndetectedIntensity",
    "UndetectedTargets",
    "as_glmb",
    "as_lmb",
    "at_dominant_components",
    "best_estimate",
    "cardinality_distribution",
    "existence_probabilities",
    "least_gospa_estimate",
    "least_ospa_estimate",
    "load_density",
    "map_estimate",
    "map_or_unlabelled",
    "marginal_estimate",
    "marginalise",
    "marks_of",
    "mixture_moments",
    "resolve_labels",
    "sample_glmb",
    "sample_iid_cluster",
    "sample_lmb",
    "sample_multi_bernoulli",
    "sample_poisson",
    "save_density",
    "track_histories",
    "track_moments",
    "unlabelled_estimate",
]
