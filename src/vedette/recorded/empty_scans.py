"""Scans without a row, from the period of a sensor where its rows have a regular one."""

import math

import numpy as np

from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats, Ints

_FEWEST = 20  # scans with rows; with fewer, no period is found
_TRIED = (0.5, 0.25, 0.1, 0.05)  # quantiles of the times between scans with rows: one is near the period
_SHORT = 5  # periods; longer gaps do not count for the period, because its error grows in them
_REGULAR = 0.6  # length of the mean unit vector of the phases of scans: 1 without jitter, 0.67 with a tenth of a period
_RARE = 0.01  # a gap is an outage if independent empty scans give one so long in this share of recordings
_MOST_OUTAGES = 0.1  # share of the gaps; with more, the period is none
_ROWS, _AHEAD = 10_000, 200  # rows that are searched for the next row at their place, and how many rows ahead
_SAME_PLACE = 2.0  # times the median distance to the nearest of the rows ahead


def empty_scans(times: Floats, rows: Floats, scan_of_rows: Ints) -> tuple[Floats, Ints, str] | None:
    """Return times of scans without a row, s, the numbers of the scans with rows before them, and a description.

    None if the scans of the sensor have no regular period, or none is empty. A gap longer than independent empty
    scans explain is an outage, in which the sensor did not scan. A sensor whose rows at one place do not follow
    each other by one period most often reports by target, and has no period.

    Args:
        times: (num_scans,) s, increasing, of the scans with rows.
        rows: (num_rows, dim) places or other values by which rows of a target are neighbours, in order of time.
        scan_of_rows: (num_rows,) the scan of each row.
    """
    gaps = np.diff(times)
    period = _period(gaps)
    if period is None:
        return None
    counts = np.maximum(np.round(gaps / period).astype(np.int64), 1) - 1
    outages = counts > _longest(counts)
    counts[outages] = 0
    if not counts.any() or not _repeats(rows, np.concatenate([[0], np.cumsum(counts + 1)])[scan_of_rows]):
        return None
    before = np.repeat(np.arange(len(gaps)), counts)
    parts = np.concatenate([np.arange(1, count + 1) / (count + 1) for count in counts[counts > 0].tolist()])
    found = times[before] + parts * gaps[before]
    sizes = f"{pluralise(len(times) + len(found), 'scan')}, of them {len(found)} without a row"
    paused = f"; not in {pluralise(int(outages.sum()), 'longer gap')}, taken for outages" if outages.any() else ""
    return found, before, f"{sizes} (one each {period:.4g} s{paused})"


def _period(gaps: Floats) -> float | None:
    """Return the time, s, whose multiples the times between scans with rows are, or None without one."""
    if len(gaps) < _FEWEST - 1:
        return None
    for start in np.quantile(gaps, _TRIED).tolist():
        period = start
        for _ in range(3):
            counts = np.round(gaps / period)
            short = (counts >= 1.0) & (counts <= _SHORT)
            period = float(gaps[short].sum() / counts[short].sum()) if short.any() else start
        near = gaps[gaps < (_SHORT + 0.5) * period] / period
        if 2 * len(near) >= len(gaps) and abs(np.exp(2j * math.pi * near).mean()) >= _REGULAR and near.min() > 0.5:
            return float(period)
    return None


def _longest(counts: Ints) -> int:
    """Return the largest number of empty scans in a gap that is no outage, or 0 if there are too many outages.

    Each gap is compared with the share of empty scans in all shorter ones.
    """
    order, num = np.sort(counts), len(counts)
    for kept in range(num, num - max(1, round(_MOST_OUTAGES * num)) - 1, -1):
        others, longest = int(order[: kept - 1].sum()), int(order[kept - 1])
        share = (others + 1.0) / (others + kept + 1.0)
        if longest <= math.log(_RARE / num) / math.log(share):
            return longest
    return 0


def _repeats(rows: Floats, scan_of_rows: Ints) -> bool:
    """Return True if rows near one place follow each other by one scan more often than by any other number."""
    rows, scans = rows[:_ROWS], scan_of_rows[:_ROWS]
    own = np.arange(len(rows))
    others = np.minimum(own + np.arange(1, min(_AHEAD, len(rows) - 1) + 1)[:, np.newaxis], len(rows) - 1)
    lags = scans[others] - scans
    distances = np.where(lags > 0, np.linalg.norm(rows[others] - rows, axis=2), math.inf)
    nearest = distances.min(axis=0)
    limit = _SAME_PLACE * float(np.median(nearest[np.isfinite(nearest)]))
    near = distances <= limit
    first = lags[near.argmax(axis=0), own][near.any(axis=0)]
    numbers = np.bincount(first, minlength=2)
    return bool(2 * numbers[1] >= numbers.max())
