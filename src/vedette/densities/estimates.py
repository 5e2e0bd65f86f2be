"""Estimates extracted from a density, and track histories under stable labels."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from vedette.densities import checks
from vedette.densities.containers import Inspected, for_kernel
from vedette.densities.conversions import resolve_labels
from vedette.densities.factored import FactoredGLMB
from vedette.densities.glmb import GLMB
from vedette.densities.inspection import Target, Targets
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.multi_bernoulli import MultiBernoulli
from vedette.densities.statistics import cardinality_distribution, check_labelled
from vedette.densities.tracks import (
    OF_ANY_MODE,
    TrackTable,
    gaussian_tracks,
    heaviest_components,
    merged_tracks,
    mode_probabilities,
    over_modes,
    take_tracks,
)
from vedette.densities.unlabelled import IidCluster, Poisson
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.representation import TabularRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import CLASSES, Floats, Ints, Tracks
from vedette.kernels.gaussian.components import taken_components, without_modes
from vedette.kernels.gaussian.pooling import reduced_tracks
from vedette.kernels.gaussian.position_integrals import spread_nodes
from vedette.kernels.gaussian.reduction import reduce_mixture
from vedette.kernels.labelled.heaviest import map_tracks
from vedette.kernels.labelled.least_ospa import least_ospa_tracks
from vedette.models.arguments import no_gaussians, positive, reject

_MARGINAL_COMPONENTS = 10
# A component of weight 1.5 to 2 is more often one target that fits two measurements than two targets
# (docs/evidence/estimates.md).
_RANK_OF_HALF_LEFT = 0.2
_NODES = spread_nodes()[:, 1:]


@dataclass(frozen=True, slots=True, repr=False)
class Estimate(Inspected):
    """Estimated targets at one time, in increasing label order.

    Attributes:
        labels: (num_targets, 2) birth step and birth index.
        means: (num_targets, state_dim) estimated states.
        covs: (num_targets, state_dim, state_dim) their covariances.
        existence: (num_targets,) probability that the label's target exists, over the whole density.
        class_probs: (num_targets, num_classes) probability of each class of target, which sum to 1, in the order of
            `BirthModel.class_probs`, without columns if targets have no classes.
        mode_probs: (num_targets, up to num_modes) probability of each mode of motion, up to the last that any target
            may be in. They sum to 1, or to less for a new target, whose mode is not drawn yet.
    """

    labels: Ints
    means: Floats
    covs: Floats
    existence: Floats
    class_probs: Floats = field(default_factory=checks.no_classes)
    mode_probs: Floats = field(default_factory=checks.no_classes)

    def __post_init__(self) -> None:
        for name in ("class_probs", "mode_probs"):
            probs = getattr(self, name)
            if probs.size == 0:
                object.__setattr__(self, name, np.empty((len(self.labels), probs.shape[1])))

    @property
    def num_targets(self) -> int:
        """Number of estimated targets."""
        return len(self.labels)

    def __len__(self) -> int:
        """Number of estimated targets."""
        return len(self.labels)

    def targets(self) -> Iterator[Target]:
        """Iterate over label, existence probability, mean and covariance of each target, in increasing label order."""
        return self._targets().each()

    def _targets(self) -> Targets:
        return Targets(self.labels, self.existence, self.means, self.covs)

    def _summary(self) -> str:
        return f"of {pluralise(self.num_targets, 'target')}"

    @classmethod
    def empty(cls, state_dim: int) -> "Estimate":
        """Return an estimate without targets."""
        return cls(np.empty((0, 2), np.int64), *no_gaussians(state_dim), np.empty(0))

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise `InputError` for faults of form, `error` for invalid states, covariances or probabilities."""
        checks.check_array("labels", self.labels, np.int64, (None, 2))
        checks.check_array("means", self.means, np.float64, (self.num_targets, None))
        dim = self.means.shape[1]
        checks.check_array("covs", self.covs, np.float64, (self.num_targets, dim, dim))
        checks.check_array("existence", self.existence, np.float64, (self.num_targets,))
        if not checks.label_step_up(self.labels).all():
            raise InputError(f"labels: expected distinct labels in increasing order; got {self.labels.tolist()}")
        checks.check_finite("means", self.means, error)
        checks.check_covariances("covs", self.covs, error)
        checks.check_array("class_probs", self.class_probs, np.float64, (self.num_targets, None))
        checks.check_array("mode_probs", self.mode_probs, np.float64, (self.num_targets, None))
        for name in ("existence", "class_probs", "mode_probs"):
            values = getattr(self, name)
            if not np.all((values >= 0.0) & (values <= 1.0)):
                raise error(f"{name}: expected probabilities; got {values.tolist()}")


def joined_mode_probs(estimates: Sequence[Estimate], num_modes: int = 0) -> Floats:
    """Return the probabilities of modes of all targets of all estimates, in columns for at least `num_modes`."""
    width = max((estimate.mode_probs.shape[1] for estimate in estimates), default=0)
    missing = ((own.mode_probs, max(width, num_modes) - own.mode_probs.shape[1]) for own in estimates)
    return np.concatenate([np.pad(probs, ((0, 0), (0, more))) for probs, more in missing])


class Estimator(Protocol):
    """A function that estimates the targets from a density after a scan."""

    def __call__(self, density: Any, step: int) -> Estimate:
        """Return the estimate at scan `step`, counted from 1, which labels targets of an unlabelled density."""


def map_estimate(density: LabelledDensity) -> Estimate:
    """Return the most probable number of labelled targets, and the most probable ones of it (paper, Algorithm 1).

    GLMB: the heaviest hypothesis of that cardinality. LMB: that many labels of highest existence. Product of GLMBs: the
    heaviest hypothesis of that cardinality among all products of one of each factor. Ties: the smaller number, then the
    earlier hypothesis, then the smaller label. A track that is a mixture is estimated by its heaviest component, since
    the mean of two rival components may lie where the target cannot be.
    """
    given: Any = check_labelled(density)
    if not isinstance(given, GLMB | LMB):
        return _peaks(given.tracks, *map_tracks(given.to_factors()))
    number = int(np.argmax(given.cardinality_of_labels()))
    if isinstance(given, GLMB):
        return _peaks(given.tracks, *given.heaviest(number))
    chosen = np.sort(np.argsort(-given.existence_logit, kind="stable")[:number])
    return _peaks(given.tracks, chosen, given.existence[chosen])


def least_ospa_estimate(density: LabelledDensity) -> Estimate:
    """Return the targets of least expected OSPA, if each target counts as either in place or not.

    With n estimated targets of which M are in place, and N targets that exist, OSPA of order p and cutoff c is then
    c (1 - M / max(n, N))^(1/p). The estimate consists of the targets of the heaviest hypothesis of n targets (as by
    `map_estimate`), for the n with the largest mean of M / max(n, N). A target is in place if its label is estimated,
    or if it is within a Mahalanobis distance of 3 of an estimated label whose own target does not exist.

    The most probable number, in contrast, counts candidates that are unrelated: of nine targets of probability 0.11 it
    reports one, which is wrong in eight cases of nine. Targets without a label are not counted.
    Ties: the smaller number, then as `map_estimate`. A mixture is estimated by its heaviest component.
    """
    given = check_labelled(density)
    return _peaks(given.tracks, *least_ospa_tracks(given.to_factors()))


def least_gospa_estimate(density: LabelledDensity, cutoff: float = 100.0, order: float = 1.0) -> Estimate:
    """Return the targets of least expected GOSPA^p (alpha = 2) of positions, if each is matched by its label.

    A label of existence r is reported if r e + (1 - r) / 2 < r / 2. Its point is the mean of its density or of a
    component, whichever has the least e, the mean of (min(distance, c) / c)^p, by 64 nodes a component. The labels are
    those of `resolve_labels`. The cost minimised is an upper bound, as GOSPA may match a target with the estimate of
    another label. It is exact if no estimate is within c of another label's possible positions.
    Raises `InputError` unless the cutoff c (m) is above 0 and the order p at least 1.
    """
    cutoff, order = positive("cutoff", cutoff), positive("order", order)
    if order < 1.0:
        raise reject("order", "a number of at least 1", order)
    lmb = resolve_labels(check_labelled(density), max_components=_MARGINAL_COMPONENTS)
    likely = np.flatnonzero(lmb.existence > 0.5)  # others are not reported even if e is 0
    tracks, existence = take_tracks(lmb.tracks, likely), lmb.existence[likely]
    (_, means, covs, marks), errors = merged_tracks(tracks), np.empty(len(likely))
    for i, own in enumerate(map(slice, tracks.offsets[:-1], tracks.offsets[1:])):
        points = np.vstack([means[i : i + 1], tracks.means[own]])
        spreads = np.vstack([covs[i : i + 1], tracks.covs[own]])
        factors = np.linalg.cholesky(spreads[1:, :2, :2]).swapaxes(1, 2)
        nodes = points[1:, None, :2] + _NODES[:, : factors.shape[1]] @ factors
        ratios = np.minimum(np.linalg.norm(nodes - points[:, None, None, :2], axis=-1) / cutoff, 1.0)
        of_points = (ratios**order).mean(axis=-1) @ np.exp(tracks.log_weights[own])
        best = int(np.argmin(of_points))
        means[i], covs[i], errors[i] = points[best], spreads[best], of_points[best]
    chosen, modes = np.flatnonzero(2.0 * existence * (1.0 - errors) > 1.0), mode_probabilities(tracks)
    found = _peaks(gaussian_tracks(tracks.labels, means, covs, marks), chosen, existence[chosen])
    return replace(found, mode_probs=modes[chosen])


def best_estimate(density: Any, step: int) -> Estimate:
    """`Estimator` for every density: `least_ospa_estimate` for products of GLMBs, else `map_or_unlabelled`."""
    if isinstance(density, FactoredGLMB):
        return least_ospa_estimate(density)
    return map_or_unlabelled(density, step)


def map_or_unlabelled(density: Any, step: int) -> Estimate:
    """`Estimator` for every density: `map_estimate` if it has labels, else `unlabelled_estimate`."""
    return map_estimate(density) if isinstance(density, LabelledDensity) else unlabelled_estimate(density, step)


def marginal_estimate(density: LabelledDensity, threshold: float = 0.5) -> Estimate:
    """Return every target whose existence probability exceeds `threshold`, at the heaviest component of its marginal.

    For GLMBs these are the targets of `resolve_labels`: a target with several possible labels is one target, as
    probable as all of them together, and two targets whose labels may be swapped have two positions. Near components
    (Mahalanobis distance 2) are merged before their weights are compared. Raises `InputError` for a threshold outside
    [0, 1).
    """
    if not 0.0 <= threshold < 1.0:
        raise InputError(f"threshold: expected a probability below 1; got {threshold}")
    lmb = resolve_labels(check_labelled(density), max_components=_MARGINAL_COMPONENTS)
    chosen = np.flatnonzero(lmb.existence > threshold)
    return _peaks(lmb.tracks, chosen, lmb.existence[chosen])


def _peaks(tracks: TrackTable, chosen: Ints, existence: Floats) -> Estimate:
    """Return the estimate at the heaviest component of each chosen track, near ones of different modes taken as one."""
    own = over_modes(tracks)
    heaviest = heaviest_components(own.log_weights, own.offsets, chosen)
    classes = checks.no_classes()
    if tracks.num_classes:
        classes = np.exp(merged_tracks(take_tracks(tracks, chosen)).marks[:, CLASSES:])
    modes = mode_probabilities(tracks)[chosen]
    return Estimate(own.labels[chosen], own.means[heaviest], own.covs[heaviest], existence, classes, modes)


def at_dominant_components(density: LMB) -> LMB:
    """Return the density with each label at the heaviest component of its mixture, the first on a tie.

    The mean of two rival components may lie where the target cannot be, and their spread is an error that scans cannot
    reduce: after two targets have been close, no scan can distinguish their labels.
    """
    num = density.tracks.num_tracks
    if len(density.tracks.log_weights) == num:
        return density
    tracks = over_modes(density.tracks)
    peaks = heaviest_components(tracks.log_weights, tracks.offsets, np.arange(num))
    taken = taken_components(tracks.to_kernel().components, peaks)
    return density.with_fields(tracks=gaussian_tracks(tracks.labels, *taken[1:]))


def unlabelled_estimate(density: Poisson | IidCluster | MultiBernoulli, step: int) -> Estimate:
    """Return the targets of an unlabelled density. At every step they get new labels (step, 0), (step, 1), ...

    Multi-Bernoulli: the most probable number of targets, and that many Bernoullis of highest existence, each estimated
    by its heaviest component. Iid cluster: the most probable number. Poisson: the expected number, rounded. That many
    of the heaviest components, each one target. A component that was chosen is ranked again by its remaining weight if
    that is a whole target or more (weight 2 stands for two). With half a target or more it only precedes components
    lighter than 0.2. There are fewer components than targets if all targets are at one position. Existence is the
    remaining weight of the component, at most 1. Ties: the smaller number, then the earlier Bernoulli or component.
    """
    if getattr(density, "has_modes", False):
        density = _without_modes(density)
    if isinstance(density, MultiBernoulli):
        number = int(np.argmax(cardinality_distribution(density)))
        chosen = np.argsort(-density.existence_logit, kind="stable")[:number]
        components = heaviest_components(density.log_weights, density.offsets, chosen)
        existence = density.existence[chosen]
    elif isinstance(density, IidCluster):
        number = int(np.argmax(density.log_cardinality))
        components, existence = _by_units(density.expected_number * np.exp(density.log_weights), number)
    elif isinstance(density, Poisson):
        components, existence = _by_units(np.exp(density.log_weights), math.floor(density.expected_number + 0.5))
    else:
        raise InputError(f"density: expected one without labels; got {type(density).__name__}")
    labels = np.column_stack([np.full(len(components), step), np.arange(len(components))]).astype(np.int64)
    classes = np.exp(density.log_class_probs[components])
    return Estimate(labels, density.means[components], density.covs[components], existence, classes)


def _without_modes(density: Any) -> Any:
    """Return an unlabelled density whose near components of different modes are one."""
    plain = without_modes(density._components())
    if isinstance(density, MultiBernoulli):
        own = Tracks(np.zeros((len(density.existence_logit), 2), np.int64), for_kernel(density.offsets), plain)
        _, offsets, plain = reduced_tracks(own, OF_ANY_MODE)
        density = density.with_fields(offsets=offsets)
    else:
        plain = reduce_mixture(plain, OF_ANY_MODE._replace(max_components=len(plain.log_weights) + 2))
    return density.with_fields(**plain._asdict())


def _by_units(weights: Floats, number: int) -> tuple[Ints, Floats]:
    """Return the component of highest rank, up to `number` times, and its remaining weights as probabilities."""
    remaining, rank = weights.copy(), weights.copy()
    chosen: list[int] = []
    had: list[float] = []
    while len(chosen) < number and rank.max(initial=-1.0) >= 0.0:
        heaviest = int(np.argmax(rank))
        chosen.append(heaviest)
        had.append(min(float(remaining[heaviest]), 1.0))
        remaining[heaviest] -= 1.0
        left = remaining[heaviest]
        rank[heaviest] = left if left >= 1.0 else _RANK_OF_HALF_LEFT if left >= 0.5 else -1.0
    return np.array(chosen, np.int64), np.array(had)


@dataclass(frozen=True, slots=True, repr=False)
class TrackHistory(TabularRepr):
    """All estimates of one label in order of time. Scans at which it was not estimated are left out.

    Attributes:
        label: birth step and birth index.
        steps: (num,) numbers of the scans, from 1.
        times: (num,) s.
        means: (num, state_dim).
        covs: (num, state_dim, state_dim).
        existence: (num,).
        class_probs: (num, num_classes), see `Estimate`.
    """

    label: tuple[int, int]
    steps: Ints
    times: Floats
    means: Floats
    covs: Floats
    existence: Floats
    class_probs: Floats = field(default_factory=checks.no_classes)

    def to_table(self) -> dict[str, list[Any]]:
        """Return a table by columns, with one row per scan: `step`, `time_s`, and those of the table of a density."""
        scans: dict[str, list[Any]] = {"step": self.steps.tolist(), "time_s": self.times.tolist()}
        return scans | Targets(None, self.existence, self.means, self.covs).columns("existence")


def track_histories(estimates: Sequence[Estimate], times: Floats) -> tuple[TrackHistory, ...]:
    """Return the estimates of successive scans at `times` (s), grouped by label, with labels in increasing order.

    The first estimate is that of step 1.

    Raises `InputError` unless there is one time per estimate.
    """
    if len(estimates) != len(times):
        raise InputError(f"times: expected {len(estimates)}, one an estimate; got {len(times)}")
    places: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for scan, estimate in enumerate(estimates):
        for target, (step, index) in enumerate(estimate.labels.tolist()):
            places.setdefault((step, index), []).append((scan, target))
    histories = []
    for label, seen in sorted(places.items()):
        scans = np.array([scan for scan, _ in seen])
        histories.append(
            TrackHistory(
                label,
                scans + 1,
                np.asarray(times, np.float64)[scans],
                np.stack([estimates[scan].means[target] for scan, target in seen]),
                np.stack([estimates[scan].covs[target] for scan, target in seen]),
                np.array([estimates[scan].existence[target] for scan, target in seen]),
                np.stack([estimates[scan].class_probs[target] for scan, target in seen]),
            )
        )
    return tuple(histories)
