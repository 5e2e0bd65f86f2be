"""The cubature rule integrates every monomial of degree 5 and less exactly."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from vedette.fusion.powers import MAX_DIM, fifth_degree_rule

_NORMAL_MOMENTS = [1.0, 0.0, 1.0, 0.0, 3.0, 0.0]


@pytest.mark.parametrize("dim", range(1, MAX_DIM + 1))
def test_exact_to_degree_five(dim):
    points, weights = fifth_degree_rule(dim)
    assert len(points) == dim**2 + 3 * dim + 3
    assert np.all(weights >= -1e-18)
    for degree in range(6):
        for axes in itertools.combinations_with_replacement(range(dim), degree):
            powers = np.bincount(np.array(axes, int), minlength=dim)
            expected = np.prod([_NORMAL_MOMENTS[power] for power in powers])
            assert weights @ np.prod(points**powers, axis=1) == pytest.approx(expected, abs=1e-12)
