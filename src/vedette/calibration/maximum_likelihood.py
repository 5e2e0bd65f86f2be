"""Maximum of a log likelihood that is a sum of many terms, and its information matrix.

Steps are Newton's. The curvature along each parameter is that of central differences; correlations of parameters are
those of the terms' scores (Berndt, Hall, Hall, Hausman 1974). Steps that continue near the maximum use one-sided
differences with the curvature known, at half the cost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from vedette.kernels.base.types import Bools, Floats, Ints

Terms = Callable[[Floats], Floats]  # terms of the log likelihood as a function of all parameters on their scales
_ENOUGH = 0.4  # convergence: largest further step, in standard errors
_JUMPS = 0.6  # the same where no share of it raises the sum, as the terms may jump
_NEAR = 4.0  # the same, below which the curvature is not computed again
_RAISED = 1.0  # log likelihood that twice a step must gain
_MOST_STEPS = 12
_SHARES = (1.0, 0.5, 0.25, 0.1)  # fractions of a step to try
_TELLING = 4.0  # eigenvalue of the information, in units of `unknown`, above which a direction is determined
_WEAK = 25.0  # eigenvalue below which the curvature along a direction is computed
_CORRELATED = 0.3  # correlation above which second derivatives of a pair are computed
_REFINEMENTS = 3
_ALIKE = 1.5  # largest ratio of the curvature over a step and the curvature that chose the step


class Maximum(NamedTuple):
    """Maximum over p parameters on their scales.

    at: (p,) parameters. terms: (num_terms,) there. scores: (num_terms, p) their derivatives. information: (p, p) minus
    the second derivatives of the sum. stds: (p,) standard deviations if correlations are by second derivatives.
    converged: whether a further step promises next to nothing.
    """

    at: Floats
    terms: Floats
    scores: Floats
    information: Floats
    stds: Floats
    converged: bool

    @property
    def log_likelihood(self) -> float:
        """Sum of the terms."""
        return float(self.terms.sum())


@dataclass(slots=True)
class _Search:
    """Point of the search, with what is known there; see `Maximum`. bends: (num_terms, p) minus second derivatives."""

    terms: Terms
    at: Floats
    values: Floats
    steps: Floats
    bends: Floats

    def central(self) -> Floats:
        """(num_terms, p) scores; computes the second derivatives, too."""
        ways = np.diag(self.steps)
        up = np.stack([self.terms(self.at + way) for way in ways], axis=1)
        down = np.stack([self.terms(self.at - way) for way in ways], axis=1)
        self.bends = (2.0 * self.values[:, None] - up - down) / self.steps**2
        return np.asarray((up - down) / (2.0 * self.steps))

    def one_sided(self) -> Floats:
        """(num_terms, p) scores with second derivatives from before."""
        up = np.stack([self.terms(self.at + way) for way in np.diag(self.steps)], axis=1)
        return np.asarray((up - self.values[:, None]) / self.steps + 0.5 * self.steps * self.bends)

    def advance(self, way: Floats) -> bool:
        """Move by the first share of a step that raises the sum, and further if the whole does; False if none does."""
        for share in _SHARES:
            found = self.terms(self.at + share * way)
            if found.sum() > self.values.sum():
                break
        else:
            return False
        while share >= 1.0 and (further := self.terms(self.at + 2.0 * share * way)).sum() > found.sum() + _RAISED:
            share, found = 2.0 * share, further
        self.at, self.values = self.at + share * way, found
        return True


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
        unknown: (p,) prior standard deviation of each parameter; directions in which the terms hardly change over it
            are not followed.
        groups: of parameters, with second derivatives within a group; they are 0 between groups.
        blocks: (num_terms,) numbers of blocks of terms that are independent of each other.
        stds: (p,) expected standard deviations of the parameters, over which differences are taken; None: unknown.
    """
    steps = 0.1 * unknown if stds is None else np.minimum(stds, unknown)
    search = _Search(terms, start, terms(start), steps, np.zeros(0))
    prior, size, converged = np.diag(unknown**-2.0), np.inf, False
    for _ in range(_MOST_STEPS):
        far = size > _NEAR
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
        if not search.advance(way):
            if far or size < _JUMPS:
                converged = size < _JUMPS
                break
            size = np.inf  # one-sided differences may be too inexact
    refined = _refined(terms, search.at, search.values.sum(), information, unknown)
    wide = _stds_by_differences(terms, search.at, information, bounded, unknown)
    return Maximum(search.at, search.values, scores, refined, wide, converged)


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


def _stds_by_differences(terms: Terms, at: Floats, information: Floats, cov: Floats, unknown: Floats) -> Floats:
    """(p,) standard deviations if entries of correlated parameters are differences over two conditional deviations.

    Scores do not show these correlations well, above all those of a clock: the sum jumps where the order of scans
    changes. cov: (p, p) covariance by the scores.
    """
    steps, found = np.diag(2.0 / np.sqrt(np.diag(information))), information.copy()
    correlations = np.tril(cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov))), -1)
    for i, j in np.argwhere(np.abs(correlations) > _CORRELATED).tolist():
        sides = [a * b * float(terms(at + a * steps[i] + b * steps[j]).sum()) for a in (1.0, -1.0) for b in (1.0, -1.0)]
        found[i, j] = found[j, i] = -sum(sides) / (4.0 * steps[i, i] * steps[j, j])
    values, vectors = _spectrum(found, unknown)
    return np.asarray(unknown * np.sqrt((vectors**2 / np.maximum(values, 1.0)).sum(axis=1)))


def block_scores(scores: Floats, blocks: Ints) -> Floats:
    """(num_blocks, p) sums of scores (num_terms, p) over blocks, less their mean."""
    sums = np.stack([np.bincount(blocks, column) for column in scores.T], axis=1)
    return np.asarray(sums - sums.mean(axis=0))


def stds_from_blocks(scores: Floats, cov: Floats, blocks: Ints) -> Floats:
    """(p,) standard errors of a maximum from its scores, for quantiles of the normal distribution.

    Terms may depend on each other within a block, as errors do that last for some scans. cov: (p, p) covariance if all
    terms were independent; its product with the scores of a block is the influence of that block on the maximum.
    """
    influences = np.asarray(block_scores(scores, blocks) @ cov)
    num = len(influences)
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

    Uses the second derivatives, like the mean of a Gaussian conditioned on some of its components; directions that they
    do not determine stay within `unknown`.
    """
    known, fixed = ~np.asarray(held), np.asarray(held)
    bend = maximum.information + np.diag(unknown**-2.0)
    at = np.where(fixed, values, maximum.at)
    pull = bend[np.ix_(known, fixed)] @ (values - maximum.at)[fixed]
    at[known] -= np.linalg.solve(bend[np.ix_(known, known)], pull)
    return at


def _spectrum(information: Floats, unknown: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues and eigenvectors of the information for parameters in units of `unknown`."""
    scaled = information * np.outer(unknown, unknown)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    return values, vectors


def _refined(terms: Terms, at: Floats, highest: float, information: Floats, unknown: Floats) -> Floats:
    """(p, p) information, each small eigenvalue by differences over the standard deviation of its direction.

    The information about a poorly determined combination of parameters is small compared with that about each
    parameter, and differences over steps in single parameters lose it in their errors.
    """
    values, vectors = _spectrum(information, unknown)
    for i in np.flatnonzero(values < _WEAK).tolist():
        for _ in range(_REFINEMENTS):
            chosen = max(values[i], 1.0)
            way = unknown * vectors[:, i] / np.sqrt(chosen)
            sides = float(terms(at + way).sum()) + float(terms(at - way).sum())
            values[i] = chosen * (2.0 * highest - sides)
            if chosen / _ALIKE < values[i] < chosen * _ALIKE or max(values[i], chosen) <= 1.0:
                break
    return np.asarray((vectors * values) @ vectors.T / np.outer(unknown, unknown))
