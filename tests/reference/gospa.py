"""GOSPA by trying everything (Rahmathullah, Garcia-Fernandez and Svensson 2017)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from reference import Floats


def gospa(first: Floats, second: Floats, cutoff: float, order: float, alpha: float) -> float:
    """Definition 1: every way of giving each point of the smaller set a partner of its own."""
    fewer, more = sorted((list(first), list(second)), key=len)
    least = min(
        sum(min(cutoff, float(np.linalg.norm(a - b))) ** order for a, b in zip(fewer, chosen, strict=True))
        for chosen in itertools.permutations(more, len(fewer))
    )
    return (least + cutoff**order / alpha * (len(more) - len(fewer))) ** (1.0 / order)


def gospa_parts(estimates: Floats, truths: Floats, cutoff: float, order: float) -> tuple[float, float, int, int]:
    """Proposition 1 (alpha = 2): every set of pairs. Total, localisation cost, and numbers of missed and false."""
    price = cutoff**order / 2.0
    best = (float("inf"), 0.0, 0, 0)
    for pairs in _pairings(len(estimates), len(truths)):
        localisation = sum(float(np.linalg.norm(estimates[i] - truths[j])) ** order for i, j in pairs)
        missed, false = len(truths) - len(pairs), len(estimates) - len(pairs)
        best = min(best, (localisation + price * (missed + false), localisation, missed, false))
    return best[0] ** (1.0 / order), *best[1:]


def _pairings(num_first: int, num_second: int) -> Iterator[list[tuple[int, int]]]:
    for size in range(min(num_first, num_second) + 1):
        for rows in itertools.combinations(range(num_first), size):
            for columns in itertools.permutations(range(num_second), size):
                yield list(zip(rows, columns, strict=True))
