"""OSPA by trying every assignment (Schuhmacher, Vo and Vo 2008)."""

from __future__ import annotations

import itertools

import numpy as np

from reference import Floats


def ospa(first: Floats, second: Floats, cutoff: float, order: float) -> tuple[float, float, float]:
    """Total, localisation and cardinality parts for two sets of points, (num, dim) each."""
    fewer, more = sorted((list(first), list(second)), key=len)
    if not more:
        return 0.0, 0.0, 0.0
    least = min(
        sum(min(cutoff, float(np.linalg.norm(a - b))) ** order for a, b in zip(fewer, chosen, strict=True))
        for chosen in itertools.permutations(more, len(fewer))
    )
    localisation = least / len(more)
    cardinality = cutoff**order * (len(more) - len(fewer)) / len(more)
    root = 1.0 / order
    return (localisation + cardinality) ** root, localisation**root, cardinality**root
