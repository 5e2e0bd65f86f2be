"""Times of the scans of each sensor: gaps, a sensor that starts late or ends early, and two periods."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats

_RARE = 1e-6  # probability that independent random times have so long a gap
_FEWEST = 40  # scans
_REGULAR, _WIDTH = 0.6, 0.1  # share of intervals that differ from the period by at most this share, if there is one
_RATIO = 1.3  # of two periods


def period_findings(times: Sequence[ArrayLike], names: Sequence[str], *, from_start: bool) -> Iterator[tuple[str, str]]:
    """Yield the sensor and the words of gaps in the scans of a sensor, and of two periods.

    times: of the scans of each sensor, increasing, s. from_start: True to test whether one starts after the others.
    """
    scanned = [np.asarray(own, float) for own in times]
    firsts, lasts = ([own[end] for own in scanned if len(own)] for end in (0, -1))
    for own, name in zip(scanned, names, strict=True):
        if len(own) < _FEWEST:
            continue
        gaps = np.diff(own, prepend=min(firsts) if from_start else own[0], append=max(lasts))
        k, usual = int(np.argmax(gaps)), float(np.median(gaps))
        if gaps[k] > (gaps.sum() - gaps[k]) / (len(own) - 1) * math.log(len(own) / _RARE):
            words = f"has no scan from {own[k - 1]:.0f} to {own[k % len(own)]:.0f} s"
            if k in (0, len(own)):
                words = f"{'ends' if k else 'starts'} {gaps[k]:.0f} s {'before' if k else 'after'} the others"
            yield name, f"{name} {words}, where its scans come every {usual:.2g} s: check its rows and its clock"
        begin, end = _period(gaps[1 : len(own) // 4]), _period(gaps[-(len(own) // 4) : -1])
        if begin and end and max(begin, end) > _RATIO * min(begin, end):
            words = f"scans come every {begin:.2g} s at first and every {end:.2g} s at last"
            yield name, f"{name}: {words}: if these are two sensors, give each its own name"


def _period(intervals: Floats) -> float:
    """Return the period of regular scans from the intervals between them, s, or 0 if there is none."""
    median = float(np.median(intervals))
    return median if np.mean(abs(intervals - median) <= _WIDTH * median) >= _REGULAR else 0.0
