"""Derivatives by central differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def central_differences(function: Callable[[Floats], Floats], point: Floats, step: float = 1e-5) -> Floats:
    """(len(function(point)), len(point)) slopes of a vector function."""
    columns = []
    for j in range(len(point)):
        offset = np.zeros(len(point))
        offset[j] = step
        columns.append((function(point + offset) - function(point - offset)) / (2.0 * step))
    return np.stack(columns, axis=1)
