"""Protocols of filters, and the report of a step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LMB, LabelledDensity
from vedette.errors import InputError
from vedette.models import SensorModel, TargetModel


@dataclass(frozen=True, slots=True)
class FilterInfo:
    """Report of one step.

    Attributes:
        log_likelihood: log density of the scan (as a set, with the Poisson clutter's exp(-rate)) given the prior, over
            the kept hypotheses. NaN for the CB-MeMBer filter, which does not need it.
        num_hypotheses, num_tracks: size of the posterior. For a PHD or CPHD filter 1 and the number of components, for
            a CB-MeMBer filter 1 and the number of Bernoullis.
        truncation_error_bound: upper bound on the share of the posterior weight that the caps left out. Attained unless
            tracks that share measurements compete for more than six of them. 0 if nothing was left out. Weight outside
            the gates is not included. For an LMB, the share of all joint choices that is left out of the inexact
            clusters, where the overlap of pairs of tracks is counted once. It bounds the error of every existence and
            association probability, and is 0 without such clusters. For a CPHD filter, the probability of the large
            numbers of targets that were left out, and for a PHD filter 0. NaN for a multi-Bernoulli, which is not a sum
            of hypotheses, and if an LMB is associated by belief propagation or a custom function, whose error is
            unknown. With several sensors, weight cut at one of them is counted with its value there, though later ones
            may raise it. Combinations that an LMB drops are included.
        dropped_existence: expected number of targets in labels that an LMB, or Bernoullis that a CB-MeMBer filter,
            dropped or bounded by `Limits.max_existence`. 0 for a PHD or CPHD filter, which redistributes the weight it
            drops.
        num_clutter_floored: number of measurements whose clutter intensity was raised to `Limits.min_log_clutter`.
        num_duplicates: number of measurements that repeat another to the last digit and were left out.
        num_inexact_clusters: number of LMB clusters summed over their heaviest joint choices only (with several
            sensors: clusters in which not all sets of taken measurements were followed). 0 for other filters.
        search_truncated: True if ranking stopped at `Limits.max_search_nodes` before it was complete, False if nothing
            is ranked. For an LMB of several sensors, or updated apart from its prediction, True if a track had more
            than `Limits.max_hypotheses` combinations.
        limit_reached: True if the posterior was as large as `Limits` allows, so that more may have been cut off:
            hypotheses of a GLMB, labels of an LMB, Bernoullis of a CB-MeMBer filter, components of a PHD or CPHD
            filter.
        independence_error_bound: for a factored density, upper bound on the L1 error of treating labels as independent
            at this scan. 0 for other filters.
        reduction_error: for a factored density, upper bound on the L1 error of merging versions of a label, and of
            reducing the Gaussians of a track, at this scan. 0 for other filters, which do not compute it. Not stored
            with runs. The posterior is within independence_error_bound + reduction_error + 4 truncation_error_bound of
            the exact one in L1, apart from gates and dropped labels: weight that is cut off is missing once and added
            to the rest once, and twice if the association probabilities are those of the rest alone. The error of
            belief propagation between groups that share several measurements in a cycle is not included. The bound is
            for one scan, given the belief before it. Bounds of several scans do not add up to a bound, as a scan may
            amplify an earlier error.
    """

    log_likelihood: float
    num_hypotheses: int
    num_tracks: int
    truncation_error_bound: float = 0.0
    dropped_existence: float = 0.0
    num_clutter_floored: int = 0
    num_duplicates: int = 0
    num_inexact_clusters: int = 0
    search_truncated: bool = False
    limit_reached: bool = False
    independence_error_bound: float = 0.0
    reduction_error: float = 0.0


@runtime_checkable
class Filter(Protocol):
    """Prediction and update of one sensor's belief. Custom filters with these members are fully supported.

    The belief may be anything that the fusion and the estimator accept. A filter is labelled if its belief is a `GLMB`,
    an `LMB` or a `FactoredGLMB`. Planning needs a labelled filter.
    """

    @property
    def targets(self) -> TargetModel:
        """Model of the targets, the same object for all sensors."""

    @property
    def sensor(self) -> SensorModel:
        """Model of the sensor."""

    def initial(self) -> Any:
        """Return the belief before the first scan."""

    def step(
        self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with a scan. See `DeltaGlmbFilter.step`."""


@runtime_checkable
class PredictUpdateFilter(Filter, Protocol):
    """A filter with separate prediction and update, for several scans at one time, or none.

    A custom filter needs these methods if a sensor may miss a scan, if sensors share their prediction, and for births
    from measurements: `births` then replaces the birth sites of the targets' model.
    """

    def step(
        self,
        belief: Any,
        scan: Any,
        pose: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with a scan. See `DeltaGlmbFilter.step`."""

    def predict(self, belief: Any, dt: float, step: int, *, births: LMB | None = None) -> tuple[Any, FilterInfo]:
        """Return the belief `dt` seconds later, with the births of that time. See `DeltaGlmbFilter.predict`."""

    def update(self, belief: Any, scan: Any, pose: Any, *, rng: np.random.Generator) -> tuple[Any, FilterInfo]:
        """Return the posterior after a scan at the time of the belief. See `DeltaGlmbFilter.update`."""


def has_labels(tracker: Filter) -> bool:
    """Return True if the filter's belief is a `GLMB`, an `LMB` or a `FactoredGLMB`."""
    return isinstance(tracker.initial(), LabelledDensity)


def common_target_model(filters: Sequence[Filter]) -> TargetModel:
    """Return the target model that all these filters share. Raises `InputError` if they do not share one."""
    targets = filters[0].targets
    for i, other in enumerate(filters):
        if other.targets != targets:
            raise InputError(f"filters[{i}].targets: expected the target model of filters[0]; got another")
    return targets
