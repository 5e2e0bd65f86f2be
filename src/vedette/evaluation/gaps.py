"""Likelihood ratios of gaps: whether a new label is the target of one that ended, or a newborn target."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vedette.densities import FactoredGLMB, TrackHistory
from vedette.evaluation.observation_history import (
    ObservationHistory,
    birth_count_ratio,
    birth_intensity,
    undetected_priors,
)
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.gaussian.components import components_of, joined_components, taken_components
from vedette.models import BirthModel

# Estimates of a new label that are compared with the motion of an ended one: later ones add little information.
_FIRST_ESTIMATES = 10
# Share of a variance below which a scan counts as uninformative in that direction.
_LEAST_INFORMATION = 1e-6
_MOST_CERTAIN = 1.0 - 1e-12
# Scans after which an ended label is no candidate.
_LONGEST_GAP = 200
# A smaller ratio changes no sum of ratios that contains one above 1, in double precision.
LEAST_LOG_RATIO = -60.0


class _Information(NamedTuple):
    """Information of scans about a state: exp(linear'u - u'matrix u / 2) with u = state - reference, up to a factor."""

    scan: int
    reference: Floats  # (dim,)
    linear: Floats  # (dim,)
    matrix: Floats  # (dim, dim), positive semidefinite


@dataclass(slots=True)
class _EndedLabels:
    """The labels that have ended so far: densities of their targets if alive, and the evidence of the scans since.

    Log weights are of the probability that the target existed at the last estimate and has survived until now.
    """

    tracks: Ints  # (num,) indices of their histories
    num_scans: Floats  # (num,) since the last estimate
    mixture: Mixture
    log_missed: Floats  # (num,) log probability that all scans since have missed it at its predicted place
    detected: Floats  # (num,) probability that a scan since would have detected it

    @classmethod
    def none(cls, dim: int) -> "_EndedLabels":
        empty = components_of(np.empty(0), np.empty((0, dim)), np.empty((0, dim, dim)))
        return cls(np.empty(0, np.int64), np.empty(0), empty, np.empty(0), np.empty(0))

    def add(self, track: int, history: TrackHistory) -> None:
        with np.errstate(divide="ignore"):
            weight = np.log(history.existence[-1:])
        new = components_of(weight, history.means[-1:].copy(), history.covs[-1:].copy())
        self.mixture = joined_components([self.mixture, new])
        self.tracks = np.append(self.tracks, track)
        self.num_scans, self.log_missed, self.detected = (
            np.append(values, 0.0) for values in (self.num_scans, self.log_missed, self.detected)
        )

    def keep(self, places: Ints) -> None:
        """Keep only the labels at the indices `places`."""
        self.tracks = self.tracks[places]
        self.mixture = taken_components(self.mixture, places)
        self.num_scans = self.num_scans[places]
        self.log_missed, self.detected = self.log_missed[places], self.detected[places]

    def update_missed(self, observations: ObservationHistory, scan: int) -> None:
        """Update by a scan that detected none of them."""
        log_missed = np.zeros(len(self.tracks))
        with np.errstate(divide="ignore"):
            for s in np.flatnonzero(observations.scanned[scan]).tolist():
                prob_detection = observations.sensors[s].mean_detection(
                    self.mixture.means, self.mixture.covs, observations.poses[scan, s]
                )
                log_missed += np.log1p(-prob_detection)
        self.detected -= np.exp(self.mixture.log_weights + self.log_missed) * np.expm1(log_missed)
        self.log_missed = self.log_missed + log_missed

    def log_undetected(self, prob_hidden: float) -> Floats:
        """Return the log probability of no detection until now and a possible one at this scan, if alive, (num,)."""
        with np.errstate(divide="ignore"):
            hidden = np.log(prob_hidden / self.num_scans)
            return np.asarray(np.logaddexp(hidden, np.log1p(-prob_hidden) + self.log_missed))

    def log_never_detected(self, prob_hidden: float) -> Floats:
        """Return the log probability that no scan since has detected the target, alive or not, shape (num,)."""
        return np.asarray(np.log1p(-(1.0 - prob_hidden) * np.minimum(self.detected, _MOST_CERTAIN)))


class GapRatios(NamedTuple):
    """Log likelihood ratios of pairs of labels, in increasing order of the indices of their histories.

    Left out are pairs that cannot be one target, and pairs of a ratio below `LEAST_LOG_RATIO`, on which the probability
    of no other join depends.
    """

    ended: Ints  # (num_pairs,) index of the label that continues
    began: Ints  # (num_pairs,)
    log_ratios: Floats  # (num_pairs,)


def gap_log_ratios(
    histories: Sequence[TrackHistory],
    observations: ObservationHistory,
    *,
    progress: Callable[[int], object] = lambda scan: None,
) -> GapRatios:
    """Return, for pairs of labels, the log likelihood ratio of one target with a gap against all alternatives.

    Label i ended with existence r and density N(m, P) at its last estimate. The first of label j is n scans later. With
    P_S(n) the probability of surviving until then, U = h / n + (1 - h) * product of 1 - P_D over the scans between (h
    is `prob_hidden`), p_i the density N(m, P) predicted to that time, L_j the likelihood of the first scans of j, D the
    intensity of undetected targets there, G the probability that target i, which may have died, is detected by no scan
    until the last of these, b the number of births in the record divided by the expected number (`birth_count_ratio`),
    and e the existence of j at that scan, as j may be clutter:

        ratio(i, j) = r P_S(n) U * integral p_i(x) L_j(x) dx / (G * (b + (1 - e) / e) * integral D(x) L_j(x) dx).

    Classes of targets add the factor sum over k of c_i(k) c_j(k) / c(k), with the last class probabilities of both
    labels, c_i and c_j, and those of any target, c.

    This is exact for linear Gaussian models and a probability of detection that is the same everywhere, if the first
    estimate of j is from the scan that began it. D is the default filter's intensity of targets that no scan has
    detected. L_j is the product of the information that each estimate of j adds to the previous one, predicted to its
    time. The first estimate is divided by the component of D that it began from, so that this prior counts only in D.

    Args:
        histories: of all labels, see `track_histories`.
        observations: models, times and poses.
        progress: called with the number of every finished scan.
    """
    first_scans = [int(history.steps[0]) - 1 for history in histories]
    birth_ratio = birth_count_ratio(histories, observations)
    starts, ends = _by_scan(first_scans), _by_scan(int(history.steps[-1]) - 1 for history in histories)
    compared = _by_scan(int(history.steps[:_FIRST_ESTIMATES][-1]) - 1 for history in histories)
    ended = _EndedLabels.none(observations.targets.state_dim)
    pending: dict[int, tuple[Ints, Floats]] = {}  # ended labels and log ratios without G, by the label that began
    pairs = [GapRatios(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))]
    for scan, undetected in enumerate(undetected_priors(observations, first_scans)):
        if len(ended.tracks):
            ended.mixture = observations.predict(ended.mixture, scan - 1, scan)
            ended.num_scans += 1.0
            for j in starts.get(scan, ()):
                log_ratios = _log_ratios(histories[j], ended, scan, undetected, observations, birth_ratio)
                pending[j] = ended.tracks, log_ratios
            ended.update_missed(observations, scan)
        log_undetected = ended.log_never_detected(observations.prob_hidden)
        for j in [j for j in compared.get(scan, ()) if j in pending]:
            tracks, log_ratios = pending.pop(j)
            still_ended, places, present = np.intersect1d(tracks, ended.tracks, return_indices=True)
            log_ratios = log_ratios[places] - log_undetected[present]
            likely = log_ratios > -np.inf
            pairs.append(GapRatios(still_ended[likely], np.full(likely.sum(), j), log_ratios[likely]))
        ended.keep(np.flatnonzero(ended.num_scans <= _LONGEST_GAP))
        for i in ends.get(scan, ()):
            ended.add(i, histories[i])
        progress(scan + 1)
    return _likely_pairs(pairs, histories, observations.targets.birth)


def _by_scan(scans: Iterable[int]) -> dict[int, list[int]]:
    """Return the indices of the labels of each scan."""
    groups: dict[int, list[int]] = {}
    for index, scan in enumerate(scans):
        groups.setdefault(scan, []).append(index)
    return groups


def _log_ratios(
    began: TrackHistory,
    ended: _EndedLabels,
    scan: int,
    undetected: FactoredGLMB,
    observations: ObservationHistory,
    birth_ratio: float,
) -> Floats:
    """Return the log ratios without G and classes of a label that began at a scan, for each ended label, (num,)."""
    prior = birth_intensity(undetected, began, observations)
    if not (prior.log_weights > -np.inf).any():
        return np.full(len(ended.tracks), -np.inf)  # the models exclude births and do not explain how the label began
    information = list(_estimate_information(began, prior, observations))
    log_undetected = ended.log_undetected(observations.prob_hidden)
    continuing = ended.mixture._replace(log_weights=ended.mixture.log_weights + log_undetected)
    continued, born = (_log_fits(mixture, scan, information, observations) for mixture in (continuing, prior))
    alternatives = birth_ratio - 1.0 + 1.0 / began.existence[:_FIRST_ESTIMATES][-1]
    return np.asarray(continued - np.logaddexp.reduce(born) - np.log(alternatives))


def _likely_pairs(pairs: Sequence[GapRatios], histories: Sequence[TrackHistory], birth: BirthModel) -> GapRatios:
    """Return the pairs of a ratio, with the factor of the classes, that joins depend on, in order."""
    ended, began, log_ratios = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
    if birth.class_probs is not None and histories:
        probs = np.stack([history.class_probs[-1] for history in histories])
        with np.errstate(divide="ignore"):
            log_ratios = log_ratios + np.log((probs[ended] * (probs / birth.class_probs)[began]).sum(axis=1))
    order = np.lexsort((began, ended))
    order = order[log_ratios[order] >= LEAST_LOG_RATIO]
    return GapRatios(ended[order], began[order], log_ratios[order])


def _estimate_information(
    history: TrackHistory, prior: Mixture, observations: ObservationHistory
) -> Iterator[_Information]:
    """Yield the information in the scans of each of the first estimates. prior: of births, before the first."""
    scans = (history.steps[:_FIRST_ESTIMATES] - 1).tolist()
    covs, offsets = prior.covs + history.covs[0], prior.means - history.means[0]
    squared = (offsets * np.linalg.solve(covs, offsets[..., np.newaxis])[..., 0]).sum(axis=-1)
    log_fits = prior.log_weights - 0.5 * (squared + np.linalg.slogdet(covs)[1])  # up to a constant
    nearest = taken_components(prior, np.array([int(np.argmax(log_fits))]))
    yield _information(scans[0], nearest, history.means[0], history.covs[0])
    for k, (last, now) in enumerate(pairwise(scans)):
        posterior = components_of(np.zeros(1), history.means[k : k + 1].copy(), history.covs[k : k + 1].copy())
        yield _information(now, observations.predict(posterior, last, now), history.means[k + 1], history.covs[k + 1])


def _information(scan: int, prior: Mixture, mean: Floats, cov: Floats) -> _Information:
    """Return the quotient of N(mean, cov) and the Gaussian before the scan, in the directions in which that is wider.

    With cov = R R' and the eigenvectors of 1 - R' P^-1 R, P the covariance before, the information of the scan in each
    direction is the eigenvalue, from 0 (none) to 1 (all that is known).
    """
    root, precision = np.linalg.cholesky(cov), np.linalg.inv(prior.covs[0])
    values, axes = np.linalg.eigh(np.eye(len(mean)) - root.T @ precision @ root)
    is_informative = values > _LEAST_INFORMATION
    whitened = axes.T @ root.T @ precision @ (mean - prior.means[0])
    back = axes.T @ np.linalg.inv(root)
    return _Information(scan, mean, back.T @ (is_informative * whitened), (back.T * (is_informative * values)) @ back)


def _log_fits(
    mixture: Mixture, scan: int, informations: Sequence[_Information], observations: ObservationHistory
) -> Floats:
    """Return the log of weight times likelihood of the information, (num,), for each component of a mixture at `scan`.

    The integral of N(x; m, P) exp(y'u - u'Yu / 2) with u = x - c, d = m - c, g = y - Y d is
    |1 + P Y|^(-1/2) exp(y'd - d'Yd / 2 + g'(1 + P Y)^-1 P g / 2).
    """
    for information in informations:
        mixture = observations.predict(mixture, scan, information.scan)
        scan, offset = information.scan, mixture.means - information.reference
        scale = np.eye(mixture.means.shape[1]) + mixture.covs @ information.matrix
        solved = np.linalg.solve(scale, mixture.covs)
        covs = np.ascontiguousarray(0.5 * (solved + solved.transpose(0, 2, 1)), np.float64)
        slope = information.linear - offset @ information.matrix
        shift = (covs @ slope[..., np.newaxis])[..., 0]
        exponents = offset @ information.linear - 0.5 * ((offset @ information.matrix) * offset).sum(axis=-1)
        logs = exponents + 0.5 * (slope * shift).sum(axis=-1) - 0.5 * np.linalg.slogdet(scale)[1]
        mixture = components_of(mixture.log_weights + logs, mixture.means + shift, covs)
    return mixture.log_weights
