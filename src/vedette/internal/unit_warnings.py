"""Numbers that are valid but can hardly be meant: angles in degrees, places in degrees."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

from vedette.errors import ImplausibleWarning

LARGE_ANGLE = 0.5  # rad; a bearing with a larger standard deviation says little
# An area of less than a metre, so many times as far from the origin as it is wide, where degrees may be.
_SMALL, _FAR, _MOST_DEGREES = 1.0, 20.0, np.array([180.0, 90.0])


_told = ContextVar("told", default=False)


@contextmanager
def suppress_unit_warnings() -> Iterator[None]:
    """Without these warnings: of a scenario the check gives them, and of scans that are drawn nobody wants them."""
    before = _told.set(True)
    try:
        yield
    finally:
        _told.reset(before)


def warn_implausible(field: str, expected: str, got: str, meant: str) -> None:
    """Warn of a value that is valid, and say what was probably meant."""
    if not _told.get():
        warnings.warn(f"{field}: expected {expected}; got {got} ({meant}?)", ImplausibleWarning, stacklevel=3)


def look_like_degrees(corners: NDArray[np.float64]) -> bool:
    """Whether (n, 2) corners of an area are rather longitudes and latitudes than metres."""
    extent = float(np.ptp(corners, axis=0).max())
    could_be = bool((np.abs(corners) <= _MOST_DEGREES).all())
    return could_be and extent < _SMALL and float(np.hypot(*corners.T).min()) > _FAR * extent
