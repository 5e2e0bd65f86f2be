"""Fit of estimates to scans that they were not made from, by blocks of time."""

from collections.abc import Sequence

import numpy as np

from vedette.calibration.maximum_likelihood import Maximum, Terms, block_scores
from vedette.kernels.base.types import Floats, Ints

_SCANS_A_BLOCK = 10
_BLOCKS = 8, 30  # least and largest number of blocks


def blocks_of_time(times: Floats) -> Ints:
    """(num_terms,) numbers of the blocks of terms at these times. Blocks have about as many terms each."""
    instants, places = np.unique(times, return_inverse=True)
    num = min(max(len(instants) // _SCANS_A_BLOCK, _BLOCKS[0]), _BLOCKS[1], len(instants))
    return np.asarray(places.ravel() * num // len(instants), np.int64)


def held_back_gains(
    terms: Terms, maximum: Maximum, cov: Floats, start: Floats, groups: Sequence[Sequence[int]], blocks: Ints
) -> list[tuple[float, float]]:
    """Return for each group of parameters the log likelihood of held-back blocks that it gains, and its standard error.

    Every second block is held back, then the others. The estimates from a half are a Newton step from the maximum. A
    group that gains no more than its error is at the start for the groups after it. Where this holds for a quadratic,
    with the scores of the blocks and equal parts of the information, the terms are not evaluated.

    Args:
        terms, maximum: of `maximise`.
        cov: (p, p) covariance of its parameters.
        start: (p,) values to compare with.
        groups: of parameters.
        blocks: (num_terms,) number of the block of each term.
    """
    sums = block_scores(maximum.scores, blocks)

    def change_of_blocks(point: Floats, reset: Floats, exact: bool) -> Floats:
        if exact:
            return np.asarray(np.bincount(blocks, terms(point) - terms(reset)), np.float64)
        drops = [0.5 * float(step @ maximum.information @ step) for step in (point - maximum.at, reset - maximum.at)]
        return np.asarray(sums @ (point - reset) + (drops[1] - drops[0]) / len(sums))

    points = [maximum.at + 2.0 * cov @ sums[half::2].sum(axis=0) for half in (0, 1)]
    gains = []
    for group in groups:
        resets = [point.copy() for point in points]
        for reset in resets:
            reset[list(group)] = start[list(group)]
        for exact in (False, True):
            first, second = (change_of_blocks(*pair, exact) for pair in zip(points, resets, strict=True))
            changes = np.where(np.arange(len(sums)) % 2 == 1, first, second)
            gain, error = float(changes.sum()), float(np.sqrt(len(changes)) * changes.std(ddof=1))
            if gain <= error:
                points = resets
                break
        gains.append((gain, error))
    return gains
