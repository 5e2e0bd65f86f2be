"""The OSPA oracle against a case worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from reference.ospa import ospa


def test_by_hand():
    first = np.array([[0.0, 0.0], [10.0, 0.0]])
    second = np.array([[10.0, 3.0], [0.0, 4.0], [500.0, 0.0]])
    assert ospa(first, second, 100.0, 1.0) == pytest.approx((107.0 / 3.0, 7.0 / 3.0, 100.0 / 3.0))
    assert ospa(second, first, 100.0, 2.0) == pytest.approx(
        (np.sqrt(10025.0 / 3.0), np.sqrt(25.0 / 3.0), np.sqrt(10000.0 / 3.0))
    )


def test_empty_sets():
    nothing, one = np.empty((0, 2)), np.zeros((1, 2))
    assert ospa(nothing, nothing, 50.0, 1.0) == (0.0, 0.0, 0.0)
    assert ospa(nothing, one, 50.0, 1.0) == pytest.approx((50.0, 0.0, 50.0))
