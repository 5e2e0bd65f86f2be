"""Warnings about values that are valid but probably in the wrong unit: angles or positions in degrees."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

from vedette.errors import ImplausibleWarning

LARGE_ANGLE = 0.5  # rad; a bearing with a larger standard deviation carries little information
# An area is in degrees if it is smaller than 1 m, its distance from the origin exceeds 20 times its width, and its
# corners are valid longitudes and latitudes.
_SMALL, _FAR, _MOST_DEGREES = 1.0, 20.0, np.array([180.0, 90.0])


_told = ContextVar("told", default=False)


@contextmanager
def suppress_unit_warnings() -> Iterator[None]:
    """Context manager that suppresses these warnings, for checked scenarios and simulated scans."""
    before = _told.set(True)
    try:
        yield
    finally:
        _told.reset(before)


def warn_implausible(field: str, expected: str, got: str, meant: str) -> None:
    """Warn about a valid value that is probably a mistake, and suggest what was meant."""
    if not _told.get():
        warnings.warn(f"{field}: expected {expected}; got {got} ({meant}?)", ImplausibleWarning, stacklevel=3)


def look_like_degrees(corners: NDArray[np.float64]) -> bool:
    """Return True if (n, 2) corners of an area are probably longitudes and latitudes rather than metres."""
    extent = float(np.ptp(corners, axis=0).max())
    could_be = bool((np.abs(corners) <= _MOST_DEGREES).all())
    return could_be and extent < _SMALL and float(np.hypot(*corners.T).min()) > _FAR * extent
