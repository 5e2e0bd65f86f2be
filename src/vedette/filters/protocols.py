"""What every filter is, and what it reports of a step beside its posterior."""

from __future__ import annotations

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
        log_likelihood: log density of the scan (as a set, with the Poisson clutter's exp(-rate)) given the prior; of
            the kept hypotheses. NaN for the CB-MeMBer filter, which does not need it.
        num_hypotheses, num_tracks: size of the posterior; of a PHD or CPHD filter 1 and the number of components, of a
            CB-MeMBer filter 1 and the number of Bernoullis.
        discarded_weight_bound: upper bound on the share of the posterior weight that was left out by the caps. Attained
            unless tracks that share measurements contend for more than six of them; 0 where nothing was left out.
            Weight outside the gates is not in it. For an LMB the share of all joint choices that is left out of the
            inexact clusters, where what pairs of tracks contend for is counted once; it bounds the error of every
            existence and association probability; 0 without them. For a CPHD filter the probability of the large
            numbers of targets that were left out, for a PHD filter 0. NaN for a multi-Bernoulli, which is no sum of
            hypotheses, and where an LMB is associated by belief propagation or a function of the user's own, whose
            error is not known. For several sensors what is cut at one of them is counted as it weighs there, though
            later ones may raise it; and combinations that an LMB drops are in it.
        dropped_existence: expected number of targets in labels that an LMB, or Bernoullis that a CB-MeMBer filter,
            dropped or bounded by `Limits.max_existence`; 0 for a PHD or CPHD filter, which keeps the weight of what it
            drops.
        num_clutter_raised: measurements whose clutter intensity was raised to `Limits.min_log_clutter`.
        num_duplicates: measurements that repeat another to the last digit and were left out.
        num_inexact_clusters: LMB clusters summed over their heaviest joint choices only (of several sensors: of which
            not all sets of taken measurements were followed); 0 for other filters.
        search_cut: whether ranking stopped at `Limits.max_search_nodes` before it had found all it was asked for; false
            where nothing is ranked. For an LMB of several sensors, or updated apart from its prediction, whether a
            track had more than `Limits.max_hypotheses` combinations.
        cap_met: whether the posterior was as large as `Limits` allows, so that more may have been cut off: hypotheses
            of a GLMB, labels of an LMB, Bernoullis of a CB-MeMBer filter, components of a PHD or CPHD filter.
        factoring_error: of a factored density, upper bound on the L1 error that taking labels as independent has made
            at this scan; 0 for other filters.
        reduction_error: of a factored density, upper bound on the L1 error that taking versions of a label as one, and
            fewer Gaussians for a track, has made at this scan; other filters do not count it and say 0. Not kept with
            runs. The posterior is within factoring_error + reduction_error + 4 discarded_weight_bound of the exact one
            in L1, but for gates and dropped labels: what is cut off is missed once and spread over the rest once, twice
            where the claims to measurements are of the rest alone. The error of belief propagation between groups
            that share several measurements in a cycle is not in it. All this is of one scan, from the belief before it;
            bounds of several scans do not add up to a bound, as a scan may enlarge the error that it finds.
    """

    log_likelihood: float
    num_hypotheses: int
    num_tracks: int
    discarded_weight_bound: float
    dropped_existence: float
    num_clutter_raised: int
    num_duplicates: int
    num_inexact_clusters: int
    search_cut: bool
    cap_met: bool
    factoring_error: float = 0.0
    reduction_error: float = 0.0


@runtime_checkable
class Filter(Protocol):
    """How one sensor's belief meets time and a scan; one of your own is as good as those that are here.

    What it believes may be anything that the fusion and the estimator after it take. A filter labels its targets if
    that is a `GLMB`, an `LMB` or a `FactoredGLMB`; decisions need one that does.
    """

    @property
    def targets(self) -> TargetModel:
        """The targets, the same object for all sensors."""
        ...

    @property
    def sensor(self) -> SensorModel:
        """What the sensor sees."""
        ...

    def initial(self) -> Any:
        """The belief before the first scan."""
        ...

    def step(
        self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[Any, FilterInfo]:
        """Predict over `dt` seconds and update with a scan; see `DeltaGlmbFilter.step`."""
        ...


@runtime_checkable
class PredictUpdateFilter(Filter, Protocol):
    """A filter whose prediction and update can also be had apart: for several scans at one time, or none.

    Needed of a filter of your own where a sensor may miss a scan, where sensors share their prediction, and where
    targets are born of measurements: `births` then stand in for the sites of the targets' model.
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
        """Predict over `dt` seconds and update with a scan; see `DeltaGlmbFilter.step`."""
        ...

    def predict(self, belief: Any, dt: float, step: int, *, births: LMB | None = None) -> tuple[Any, FilterInfo]:
        """The belief `dt` seconds later, with those who may have been born by then; see `DeltaGlmbFilter.predict`."""
        ...

    def update(self, belief: Any, scan: Any, pose: Any, *, rng: np.random.Generator) -> tuple[Any, FilterInfo]:
        """The belief after a scan of its own time; see `DeltaGlmbFilter.update`."""
        ...


def has_labels(tracker: Filter) -> bool:
    """Whether the filter's belief is a `GLMB`, an `LMB` or a `FactoredGLMB`."""
    return isinstance(tracker.initial(), LabelledDensity)


def common_target_model(filters: Sequence[Filter]) -> TargetModel:
    """The one model of the targets that all these filters hold; `InputError` if they do not."""
    targets = filters[0].targets
    for i, other in enumerate(filters):
        if other.targets != targets:
            raise InputError(f"filters[{i}].targets: expected the target model of filters[0]; got another")
    return targets
