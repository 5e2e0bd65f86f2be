"""Maximum of a log likelihood that is a sum of many terms, and its information matrix.

Steps are Newton's. The curvature along each parameter is that of central differences. Correlations of parameters are
those of the terms' scores (Berndt, Hall, Hall, Hausman 1974). Steps that continue near the maximum use one-sided
differences with the curvature known, at half the cost. A short last step needs none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from vedette.kernels.base.types import Bools, Floats, Ints

Terms = Callable[[Floats], Floats]  # terms of the log likelihood as a function of all parameters on their scales
_ENOUGH = 0.4  # convergence: largest further step, in standard errors
_JUMPS = 0.6  # the same where no share of it raises the sum, as the terms may jump
_LEFT = 0.5  # largest share of a whole step that is left after it if the curvature is right to a factor of 2
_FAR = 3.0  # twice the expected change of the sum by a step, per parameter, above which the curvature is computed again
_KEPT = 0.5  # share of the expected gain below which a step shows that its derivatives were too inexact
_MOST_STEPS = 12
_SHARES = (1.0, 0.5, 0.25, 0.1)  # fractions of a step to try
_TELLING = 4.0  # eigenvalue of the information, in units of `unknown`, above which a direction is determined
_WEAK = 25.0  # eigenvalue below which the curvature along a direction is computed
_CORRELATED = 0.7  # the same for parameters in units of their conditional deviations: correlations of 0.3 and more
_REFINEMENTS = 3
_ALIKE = 1.5  # largest ratio of the curvature over a step and the curvature that chose the step


class Maximum(NamedTuple):
    """Maximum over p parameters on their scales.

    at: (p,) parameters. terms: (num_terms,) there. scores: (num_terms, p) their derivatives, of where a short last step
    began. information: (p, p) minus the second derivatives of the sum. converged: whether a further step promises next
    to nothing.
    """

    at: Floats
    terms: Floats
    scores: Floats
    information: Floats
    converged: bool

    @property
    def log_likelihood(self) -> float:
        """Sum of the terms."""
        return float(self.terms.sum())


@dataclass(slots=True)
class _Search:
    """Point of the search, with what is known there. See `Maximum`. bends: (num_terms, p) minus second derivatives."""

    terms: Terms
    at: Floats
    values: Floats
    steps: Floats
    bends: Floats

    def central(self) -> Floats:
        """(num_terms, p) scores. Computes the second derivatives, too."""
        ways = np.diag(self.steps)
        up = np.stack([self.terms(self.at + way) for way in ways], axis=1)
        down = np.stack([self.terms(self.at - way) for way in ways], axis=1)
        self.bends = (2.0 * self.values[:, None] - up - down) / self.steps**2
        return np.asarray((up - down) / (2.0 * self.steps))

    def one_sided(self) -> Floats:
        """(num_terms, p) scores with second derivatives from before."""
        up = np.stack([self.terms(self.at + way) for way in np.diag(self.steps)], axis=1)
        return np.asarray((up - self.values[:, None]) / self.steps + 0.5 * self.steps * self.bends)

    def advance(self, way: Floats) -> float:
        """Move by the first share of a step that raises the sum, and return it, or 0 if none does."""
        for share in _SHARES:
            found = self.terms(self.at + share * way)
            if found.sum() > self.values.sum():
                self.at, self.values = self.at + share * way, found
                return share
        return 0.0


def maximise(
    terms: Terms,
    start: Floats,
    unknown: Floats,
    groups: Sequence[Sequence[int]],
    blocks: Ints,
    stds: Floats | None = None,
) -> Maximum:
    """Return the maximum of a sum of terms near a start.

    Args:
        terms: (num_terms,) as a function of parameters (p,).
        start: (p,).
        unknown: (p,) prior standard deviation of each parameter. Directions in which the terms hardly change over it
            are not followed.
        groups: of parameters, with second derivatives within a group. They are 0 between groups.
        blocks: (num_terms,) numbers of blocks of terms that are independent of each other.
        stds: (p,) expected standard deviations of the parameters, over which differences are taken. None: unknown.
    """
    steps = 0.1 * unknown if stds is None else np.minimum(stds, unknown)
    search = _Search(terms, start, terms(start), steps, np.zeros(0))
    prior, far, converged = np.diag(unknown**-2.0), True, False
    for _ in range(_MOST_STEPS):
        scores = search.central() if far else search.one_sided()
        if far:
            information = _information(scores, search.bends, unknown, groups)
        bounded = np.asarray(np.linalg.inv(information + prior), np.float64)
        stds = np.sqrt(np.diag(bounded))
        errors = np.maximum(stds, stds_from_blocks(scores, bounded, blocks))
        if far:  # wide steps smooth jumps, but stay near the maximum where parameters are correlated
            search.steps = errors / stds / np.sqrt(np.diag(information + prior))
        way = bounded @ scores.sum(axis=0)
        way /= max(1.0, float(np.abs(way / unknown).max()))  # a quadratic is no model farther away
        size = float(np.abs(way / errors).max())
        if converged := size < _ENOUGH:
            break
        before, length = float(search.values.sum()), float(way @ information @ way)
        share = search.advance(way)
        if not share and (far or size < _JUMPS):
            converged = size < _JUMPS
            break
        promised = share * float(way @ scores.sum(axis=0)) - 0.5 * share**2 * length
        gained, far = float(search.values.sum()) - before, share**2 * length > _FAR * len(way)
        # One-sided differences, or a curvature from far away, may be too inexact.
        far = far or not _KEPT * promised < gained < promised / _KEPT + _JUMPS
        if converged := not far and share == 1.0 and size < _ENOUGH / _LEFT:
            break
    for scale, weak in ((unknown, _WEAK), (1.0 / np.sqrt(np.diag(information)), _CORRELATED)):
        information = _refined(terms, search.at, float(search.values.sum()), information, unknown, scale, weak)
    return Maximum(search.at, search.values, scores, information, converged)


def _information(scores: Floats, bends: Floats, unknown: Floats, groups: Sequence[Sequence[int]]) -> Floats:
    """(p, p) information: curvatures, and correlations of the scores within groups."""
    centred, curvatures = scores - scores.mean(axis=0), bends.sum(axis=0)
    products = centred.T @ centred + np.diag(1e-6 * unknown**-2.0)
    sizes = np.where(curvatures > unknown**-2.0, curvatures, np.diag(products))
    same = np.zeros(products.shape, np.bool_)
    for group in groups:
        same[np.ix_(group, group)] = True
    scale = np.sqrt(sizes / np.diag(products))
    return np.asarray(np.where(same, products, 0.0) * np.outer(scale, scale))


def block_scores(scores: Floats, blocks: Ints) -> Floats:
    """(num_blocks, p) sums of scores (num_terms, p) over blocks, less their mean."""
    sums = np.stack([np.bincount(blocks, column) for column in scores.T], axis=1)
    return np.asarray(sums - sums.mean(axis=0))


def stds_from_blocks(scores: Floats, cov: Floats, blocks: Ints) -> Floats:
    """(p,) standard errors of a maximum from its scores, for quantiles of the normal distribution.

    Terms may depend on each other within a block, as errors do that last for some scans. cov: (p, p) covariance if all
    terms were independent. Its product with the scores of a block is the influence of that block on the maximum. The
    standard errors are inf for a single block.
    """
    influences = np.asarray(block_scores(scores, blocks) @ cov)
    num = len(influences)
    if num < 2:
        return np.full(len(cov), np.inf)
    widening = stdtrit(num - 1, 0.975) / stdtrit(np.inf, 0.975)  # of few blocks
    return np.asarray(np.sqrt((influences**2).sum(axis=0) * num / (num - 1)) * widening)


def covariance(information: Floats, unknown: Floats) -> tuple[Floats, Floats]:
    """Return (p, p) the covariance in the determined directions, and (p, p) the projector onto the undetermined ones.

    Args:
        information: (p, p).
        unknown: (p,) standard deviation of each parameter from which it counts as unknown. The projector is for
            parameters in these units: its diagonal is the undetermined share of each, and its other entries show which
            parameters cannot be separated.
    """
    values, vectors = _spectrum(information, unknown)
    known: Bools = values > _TELLING
    sure, lost = vectors[:, known], vectors[:, ~known]
    scale = np.outer(unknown, unknown)
    return scale * ((sure / values[known]) @ sure.T), lost @ lost.T


def conditional_maximum(maximum: Maximum, unknown: Floats, held: Sequence[bool], values: Floats) -> Floats:
    """(p,) approximate maximum with some parameters held at these values.

    Uses the second derivatives, like the mean of a Gaussian conditioned on some of its components. Directions that they
    do not determine stay within `unknown`.
    """
    known, fixed = ~np.asarray(held), np.asarray(held)
    bend = maximum.information + np.diag(unknown**-2.0)
    at = np.where(fixed, values, maximum.at)
    pull = bend[np.ix_(known, fixed)] @ (values - maximum.at)[fixed]
    at[known] -= np.linalg.solve(bend[np.ix_(known, known)], pull)
    return at


def _spectrum(information: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues and eigenvectors of the information for parameters in units of `scale`."""
    scaled = information * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    return values, vectors


def _refined(
    terms: Terms, at: Floats, highest: float, information: Floats, unknown: Floats, scale: Floats, weak: float
) -> Floats:
    """(p, p) information, each small eigenvalue by differences over the standard deviation of its direction.

    The information about a poorly determined combination of parameters is small compared with that about each
    parameter. Differences over steps in single parameters lose it in their errors, and scores do not show it well.

    scale: (p,) units of the parameters. weak: eigenvalue below which a direction is refined.
    """
    values, vectors = _spectrum(information, scale)
    for i in np.flatnonzero(values < weak).tolist():
        way = scale * vectors[:, i]
        least = float(((way / unknown) ** 2).sum())  # no farther than the prior
        for _ in range(_REFINEMENTS):
            chosen = max(values[i], least)
            step = way / np.sqrt(chosen)
            sides = float(terms(at + step).sum()) + float(terms(at - step).sum())
            values[i] = chosen * (2.0 * highest - sides)
            if chosen / _ALIKE < values[i] < chosen * _ALIKE or max(values[i], chosen) <= least:
                break
    return np.asarray((vectors * values) @ vectors.T / np.outer(scale, scale))
