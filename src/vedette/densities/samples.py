"""Random multi-target states drawn from a density."""

import numbers
from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.glmb import GLMB
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.multi_bernoulli import MultiBernoulli
from vedette.densities.unlabelled import IidCluster, Poisson
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import Floats, Ints, Lmb, Tracks
from vedette.kernels.gaussian.components import components_of
from vedette.models.arguments import generator

_MOST_TARGETS = 1e9


@dataclass(frozen=True, slots=True, repr=False)
class MultiTargetSamples(SummaryRepr):
    """Samples of a multi-target state.

    Attributes:
        offsets: (num_samples + 1,) targets of sample `i` are `offsets[i]:offsets[i + 1]`.
        labels: (num_targets, 2) label of each target, in increasing order within a sample, or -1, -1 if the density
            has no labels.
        states: (num_targets, state_dim).
    """

    offsets: Ints
    labels: Ints
    states: Floats

    @property
    def num_samples(self) -> int:
        """Number of samples."""
        return len(self.offsets) - 1

    def sample(self, index: int) -> tuple[Ints, Floats]:
        """Return the labels (num, 2) and states (num, state_dim) of one sample."""
        if not 0 <= index < self.num_samples:
            raise InputError(f"index: expected one of {self.num_samples} samples; got {index}")
        targets = slice(self.offsets[index], self.offsets[index + 1])
        return self.labels[targets], self.states[targets]

    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise `InputError` unless the arrays are consistent, `error` unless the states are finite."""
        checks.check_array("states", self.states, np.float64, (None, None))
        checks.check_array("labels", self.labels, np.int64, (len(self.states), 2))
        checks.check_array("offsets", self.offsets, np.int64, (None,))
        if len(self.offsets) == 0:
            raise InputError("offsets: expected at least one entry; got none")
        checks.check_offsets("offsets", self.offsets, self.num_samples, len(self.states), empty_allowed=True)
        checks.check_finite("states", self.states, error)


def sample_glmb(density: GLMB, num_samples: int, *, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw independent samples of a GLMB: a hypothesis, then a state of each of its tracks."""
    _check(num_samples, rng)
    hyps = _choose(density.hyp_log_weights, np.array([0, density.num_hyps]), np.zeros(num_samples, np.int64), rng)
    offsets, entries = checks.take_runs(density.hyp_offsets, hyps)
    return _drawn(offsets, density.to_kernel().tracks, density.hyp_tracks[entries], rng)


def sample_lmb(density: LMB, num_samples: int, *, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw independent samples of an LMB: the existing tracks, then a state of each of them."""
    return _independent(density.to_kernel(), density.existence, num_samples, rng)


def sample_labelled(density: LabelledDensity, num_samples: int, *, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw independent samples of an LMB or a GLMB."""
    if isinstance(density, LMB):
        return sample_lmb(density, num_samples, rng=rng)
    assert isinstance(density, GLMB)
    return sample_glmb(density, num_samples, rng=rng)


def sample_poisson(density: Poisson, num_samples: int, *, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw independent samples of a Poisson density: a number of targets, then independent states.

    Raises `InputError` if the expected number of targets in all samples is more than 10^9.
    """
    _check(num_samples, rng)
    expected = density.expected_number
    if not expected * num_samples <= _MOST_TARGETS:
        got = f"{expected:g} in each of {num_samples}"
        raise InputError(
            f"density.expected_number: expected at most {_MOST_TARGETS:g} targets in all samples; got {got}"
        )
    return _identically_distributed(density, rng.poisson(expected, num_samples), rng)


def sample_iid_cluster(density: IidCluster, num_samples: int, *, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw independent samples of an iid cluster: a number of targets, then independent states."""
    _check(num_samples, rng)
    all_numbers = np.array([0, len(density.log_cardinality)])
    return _identically_distributed(
        density, _choose(density.log_cardinality, all_numbers, np.zeros(num_samples, np.int64), rng), rng
    )


def sample_multi_bernoulli(
    density: MultiBernoulli, num_samples: int, *, rng: np.random.Generator
) -> MultiTargetSamples:
    """Draw independent samples of a multi-Bernoulli: the existing Bernoullis, then a state of each of them."""
    return _independent(density.to_kernel(), density.existence, num_samples, rng)


def _independent(density: Lmb, existence: Floats, num_samples: int, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw samples of independent targets with these existence probabilities."""
    _check(num_samples, rng)
    exists = rng.random((num_samples, len(existence))) < existence
    return _drawn(checks.offsets_of(exists.sum(axis=1)), density.tracks, np.nonzero(exists)[1], rng)


def _identically_distributed(
    density: Poisson | IidCluster, numbers: Ints, rng: np.random.Generator
) -> MultiTargetSamples:
    """Draw samples of these numbers of targets, all from the density's one mixture."""
    offsets, whole = checks.offsets_of(numbers), np.array([0, len(density.log_weights)])
    mixture = Tracks(np.full((1, 2), -1), whole, components_of(density.log_weights, density.means, density.covs))
    return _drawn(offsets, mixture, np.zeros(int(offsets[-1]), np.int64), rng)


def _drawn(offsets: Ints, tracks: Tracks, chosen: Ints, rng: np.random.Generator) -> MultiTargetSamples:
    """Draw one state for each of the `chosen` tracks (num_targets,), which offsets divide into samples."""
    states = np.empty((0, tracks.components.means.shape[1]))
    if len(chosen):
        components = _choose(tracks.components.log_weights, tracks.offsets, chosen, rng)
        states = _draw_gaussians(tracks.components.means, tracks.components.covs, components, rng)
    return MultiTargetSamples(offsets, tracks.labels[chosen], states)


def _check(num_samples: Any, rng: Any) -> None:
    if isinstance(num_samples, bool) or not isinstance(num_samples, numbers.Integral) or num_samples < 0:
        raise InputError(f"num_samples: expected a whole number of at least 0; got {num_samples!r}")
    generator(rng)


def _choose(log_weights: Floats, offsets: Ints, runs: Ints, rng: np.random.Generator) -> Ints:
    """Draw one entry of each of `runs` (indices of runs of `log_weights`), in proportion to its weight."""
    lengths = np.diff(offsets)
    peaks = np.maximum.reduceat(log_weights, offsets[:-1])
    cumulative = np.cumsum(np.exp(log_weights - np.repeat(peaks, lengths)))
    before = np.concatenate([np.zeros(1), cumulative])[offsets]
    totals = np.diff(before)
    # Run i has the interval [i, i + 1); its last entry of positive weight ends at i + 1 exactly.
    edges = np.repeat(np.arange(len(lengths)), lengths) + np.minimum(
        (cumulative - np.repeat(before[:-1], lengths)) / np.repeat(totals, lengths), 1.0
    )
    # Strictly inside the run's interval, from which rounding could move the sum.
    points = np.minimum(runs + rng.random(len(runs)), np.nextafter(runs + 1.0, 0.0))
    return np.asarray(np.searchsorted(edges, points, side="right"), np.int64)


def _draw_gaussians(means: Floats, covs: Floats, components: Ints, rng: np.random.Generator) -> Floats:
    used, which = np.unique(components, return_inverse=True)
    try:
        factors = np.linalg.cholesky(covs[used])
    except np.linalg.LinAlgError:
        raise NumericalError("covs: expected positive definite covariances to sample from; got another") from None
    noise = rng.standard_normal((len(components), means.shape[1]))
    return np.asarray(means[components] + np.einsum("nij,nj->ni", factors[which], noise))
