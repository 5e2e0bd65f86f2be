"""Assignment of large sets by their near pairs, against the assignment of all distances."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.evaluation import ospa
from vedette.evaluation.metrics.assignment import assign, assign_points, cut_distances


def crowds(num_first: int, num_second: int, side: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of which many of the second are near some of the first."""
    rng = np.random.default_rng(seed)
    first = rng.uniform(0.0, side, (num_first, 2))
    near = first[rng.permutation(num_first)[: num_second // 2]] + rng.normal(0.0, 3.0, (num_second // 2, 2))
    return first, np.vstack([near, rng.uniform(0.0, side, (num_second - len(near), 2))])


@pytest.mark.parametrize(("num_first", "num_second"), [(1100, 1000), (900, 1300)])
@pytest.mark.parametrize("side", [500.0, 3000.0])
@pytest.mark.parametrize("order", [1.0, 2.0])
def test_near_pairs_are_those_of_the_assignment_of_all(
    num_first: int, num_second: int, side: float, order: float
) -> None:
    first, second = crowds(num_first, num_second, side, round(side))
    rows, columns, distances = assign_points(first, second, 20.0, order)
    apart = cut_distances(first, second, 20.0)
    every = apart[assign(apart, order)]
    assert len(np.unique(rows)) == len(np.unique(columns)) == len(rows) < len(every)
    np.testing.assert_array_equal(rows, np.sort(rows))
    np.testing.assert_allclose(distances, np.linalg.norm(first[rows] - second[columns], axis=1), rtol=1e-12)
    np.testing.assert_allclose(np.sort(distances), np.sort(every[every < 20.0]), rtol=1e-12)
    larger, smaller = max(num_first, num_second), min(num_first, num_second)
    total = ((every**order).sum() + 20.0**order * (larger - smaller)) / larger
    assert ospa(first, second, cutoff=20.0, order=order).total == pytest.approx(total ** (1.0 / order), rel=1e-12)


def test_large_sets_that_are_far_apart() -> None:
    first, second = crowds(1100, 1000, 500.0, 1)
    assert len(assign_points(first, second + 1e6, 20.0, 1.0)[0]) == 0
    assert ospa(first, second + 1e6, cutoff=20.0, order=1.0).total == pytest.approx(20.0)
