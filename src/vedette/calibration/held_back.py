"""Fit of estimates to scans that they were not made from, by blocks of time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.calibration.maximum_likelihood import Maximum, Terms, block_scores
from vedette.kernels.base.types import Floats, Ints

_SCANS_A_BLOCK = 10
_BLOCKS = 8, 30  # least and largest number of blocks


def blocks_of_time(times: Floats) -> Ints:
    """(num_terms,) numbers of the blocks of terms at these times; blocks have about as many terms each."""
    instants, places = np.unique(times, return_inverse=True)
    num = min(max(len(instants) // _SCANS_A_BLOCK, _BLOCKS[0]), _BLOCKS[1], len(instants))
    return np.asarray(places.ravel() * num // len(instants), np.int64)


def held_back_gains(
    terms: Terms, maximum: Maximum, cov: Floats, start: Floats, groups: Sequence[Sequence[int]], blocks: Ints
) -> list[tuple[float, float]]:
    """Return for each group of parameters the log likelihood of held-back blocks that it gains, and its standard error.

    Every second block is held back, then the others. The estimates from a half are a Newton step from the maximum. A
    group that gains no more than its error is at the start for the groups after it.

    Args:
        terms, maximum: of `maximise`.
        cov: (p, p) covariance of its parameters.
        start: (p,) values to compare with.
        groups: of parameters.
        blocks: (num_terms,) number of the block of each term.
    """
    sums = block_scores(maximum.scores, blocks)
    points = [maximum.at + 2.0 * cov @ sums[half::2].sum(axis=0) for half in (0, 1)]
    values = [terms(point) for point in points]
    gains = []
    for group in groups:
        resets = [point.copy() for point in points]
        for reset in resets:
            reset[list(group)] = start[list(group)]
        others = [terms(reset) for reset in resets]
        changes = np.where(blocks % 2 == 1, values[0] - others[0], values[1] - others[1])
        by_block = np.bincount(blocks, changes)
        gains.append((float(by_block.sum()), float(np.sqrt(len(by_block)) * by_block.std(ddof=1))))
        if gains[-1][0] <= gains[-1][1]:
            points, values = resets, others
    return gains
