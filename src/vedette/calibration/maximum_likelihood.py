"""Maximum of a log likelihood that is a sum of many terms, and its information matrix.

Steps use the outer products of the terms' scores (Berndt, Hall, Hall, Hausman 1974), which need no second differences
and equal the information if the model holds. The final information uses second differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.types import Bools, Floats

Terms = Callable[[Floats], Floats]  # terms of the log likelihood as a function of all parameters on their scales
_ENOUGH = 0.05  # convergence: log likelihood that a further step promises
_JUMPS = 0.5  # the same by second derivatives: the terms may jump by this much
_MOST_STEPS = 15
_SHARES = (1.0, 0.5, 0.25, 0.1)  # fractions of a step to try
_STEP = 0.5  # step of differences, in conditional standard deviations
_TELLING = 4.0  # eigenvalue of the information, in units of `unknown`, above which a direction is determined
_REFINEMENTS = 3
_ALIKE = 1.5  # largest ratio of the curvature over a step and the curvature that chose the step


class Maximum(NamedTuple):
    """Maximum over p parameters on their scales.

    at: (p,) parameters. log_likelihood: value there. information: (p, p) minus its second derivatives there. converged:
    whether a further step promises next to nothing, by outer products or by second derivatives.
    """

    at: Floats
    log_likelihood: float
    information: Floats
    converged: bool


def maximise(terms: Terms, start: Floats, unknown: Floats, blocks: Sequence[Sequence[int]]) -> Maximum:
    """Return the maximum of a sum of terms near a start.

    Args:
        terms: (num_terms,) as a function of parameters (p,).
        start: (p,).
        unknown: (p,) prior scale of each parameter; directions in which the terms hardly change over it are not
            followed.
        blocks: groups of parameters with second derivatives within a group; they are 0 between groups.
    """
    at, steps = start.copy(), 0.01 * unknown
    highest, converged = float(terms(at).sum()), False
    for _ in range(_MOST_STEPS):
        scores = _scores(terms, at, steps)
        slope, products = scores.sum(axis=0), scores.T @ scores
        steps = _STEP / np.sqrt(np.diag(products) + unknown**-2.0)
        way = np.linalg.solve(products + np.diag(unknown**-2.0), slope)
        promised = float(0.5 * slope @ way)
        if converged := promised < _ENOUGH:
            break
        at, found = _best(terms, at, way, highest)
        if found <= highest:
            break
        highest = found
    slope, information = _second(terms, at, highest, 2.0 * steps, blocks)
    way = covariance(information, unknown)[0] @ slope
    converged = converged or float(0.5 * slope @ way) < _JUMPS  # outer products promise too much if the terms jump
    at, highest = _best(terms, at, way, highest)
    return Maximum(at, highest, _refined(terms, at, highest, information, unknown), converged)


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
    """(p, p) information, each eigenvalue by differences over the standard deviation of its direction.

    The information about a poorly determined combination of parameters is small compared with that about each
    parameter, and differences over steps in single parameters lose it in their errors.
    """
    values, vectors = _spectrum(information, unknown)
    for i in range(len(values)):
        for _ in range(_REFINEMENTS):
            chosen = max(values[i], 1.0)
            way = unknown * vectors[:, i] / np.sqrt(chosen)
            sides = float(terms(at + way).sum()) + float(terms(at - way).sum())
            values[i] = chosen * (2.0 * highest - sides)
            if chosen / _ALIKE < values[i] < chosen * _ALIKE or max(values[i], chosen) <= 1.0:
                break
    return np.asarray((vectors * values) @ vectors.T / np.outer(unknown, unknown))


def _best(terms: Terms, at: Floats, way: Floats, highest: float) -> tuple[Floats, float]:
    """Return the point after the first share of a step that improves the sum, and its value; the start if none does.

    If the whole step improves it, longer ones are tried, as far from the maximum outer products make too short steps.
    """
    for share in _SHARES:
        found = float(terms(at + share * way).sum())
        if found > highest:
            break
    else:
        return at, highest
    while share >= 1.0 and (further := float(terms(at + 2.0 * share * way).sum())) > found:
        share, found = 2.0 * share, further
    return at + share * way, found


def _scores(terms: Terms, at: Floats, steps: Floats) -> Floats:
    """(num_terms, p) derivatives of each term by central differences."""
    ways = np.diag(steps)
    found = [(terms(at + way) - terms(at - way)) / (2.0 * step) for way, step in zip(ways, steps, strict=True)]
    return np.stack(found, axis=1)


def _second(
    terms: Terms, at: Floats, highest: float, steps: Floats, blocks: Sequence[Sequence[int]]
) -> tuple[Floats, Floats]:
    """(p,) gradient and (p, p) minus the second derivatives, by central differences over `steps`."""
    ways = np.diag(steps)
    up = np.array([float(terms(at + way).sum()) for way in ways])
    down = np.array([float(terms(at - way).sum()) for way in ways])
    bend = up + down - 2.0 * highest
    second = np.diag(bend)
    for i, j in {(i, j) for block in blocks for i in block for j in block if i < j}:
        both = float(terms(at + ways[i] + ways[j]).sum()) + float(terms(at - ways[i] - ways[j]).sum())
        second[i, j] = second[j, i] = 0.5 * (both - 2.0 * highest - bend[i] - bend[j])
    return (up - down) / (2.0 * steps), -second / np.outer(steps, steps)
