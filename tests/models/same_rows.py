"""Comparison of scans whose rows bring their noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.models import ScanRows


def assert_same_rows(found: Any, expected: ScanRows, rtol: float = 1e-7) -> None:
    """Fail unless two scans have the same effect in every filter. A field of zeros is the same as one not given."""
    assert isinstance(found, ScanRows)
    assert found.values.shape == expected.values.shape
    np.testing.assert_array_equal(found.missing, expected.missing)
    measured = ~expected.missing
    np.testing.assert_allclose(found.values[measured], expected.values[measured], rtol=rtol)
    num, dim = expected.values.shape
    model = np.tile(np.eye(dim) + 0.1, (num, 1, 1))
    np.testing.assert_allclose(found.covs(model), expected.covs(model), rtol=rtol)
    for name in ("log_ratios", "class_ratios"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one if one.size else np.zeros(other.shape), other, rtol=rtol, atol=1e-300)
        assert other.size or not one.any()
