"""Measures of tracks by plain loops over time: OSPA(2), label switches and fragmentations.

A track is a dict from scan to position; a set of tracks is a dict from a name to a track.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Mapping

import numpy as np

from reference import Floats

Track = dict[int, Floats]
TrackSet = Mapping[Hashable, Track]


def track_distance(first: Track, second: Track, scans: range, cutoff: float) -> float:
    """Mean over the scans at which either exists; c where one of them does not (Beard, Vo and Vo 2020)."""
    costs = []
    for scan in scans:
        if scan in first and scan in second:
            costs.append(min(cutoff, float(np.linalg.norm(first[scan] - second[scan]))))
        elif scan in first or scan in second:
            costs.append(cutoff)
    return sum(costs) / len(costs)


def ospa2(first: TrackSet, second: TrackSet, scan: int, window: int, cutoff: float, order: float) -> float:
    """OSPA(2) over the window that ends at `scan`."""
    scans = range(max(0, scan - window + 1), scan + 1)
    sides = [[track for track in side.values() if any(k in track for k in scans)] for side in (first, second)]
    fewer, more = sorted(sides, key=len)
    if not more:
        return 0.0
    least = min(
        sum(track_distance(a, b, scans, cutoff) ** order for a, b in zip(fewer, chosen, strict=True))
        for chosen in itertools.permutations(more, len(fewer))
    )
    return float(((least + cutoff**order * (len(more) - len(fewer))) / len(more)) ** (1.0 / order))


def match(estimates: TrackSet, truths: TrackSet, scan: int, cutoff: float) -> dict[Hashable, Hashable]:
    """Target to label at one scan: the pairs nearer than c of the assignment with the least sum of cut distances."""
    labels = [name for name, track in estimates.items() if scan in track]
    targets = [name for name, track in truths.items() if scan in track]
    best, best_cost = {}, float("inf")
    slots: list[Hashable | None] = [*labels, *[None] * len(targets)]
    for chosen in itertools.permutations(slots, len(targets)):
        cost, pairs = 0.0, {}
        for target, label in zip(targets, chosen, strict=True):
            apart = cutoff
            if label is not None:
                apart = float(np.linalg.norm(truths[target][scan] - estimates[label][scan]))
            if label is not None and apart < cutoff:
                pairs[target] = label
            cost += min(apart, cutoff)
        if cost < best_cost:
            best, best_cost = pairs, cost
    return best


def continuity(estimates: TrackSet, truths: TrackSet, num_scans: int, cutoff: float) -> tuple[list[int], list[int]]:
    """Label switches and fragmentations at each scan."""
    last_label: dict[Hashable, Hashable] = {}
    lost: set[Hashable] = set()
    switches, fragments = [0] * num_scans, [0] * num_scans
    for scan in range(num_scans):
        pairs = match(estimates, truths, scan, cutoff)
        for target, track in truths.items():
            if scan not in track:
                continue
            if target not in pairs:
                if target in last_label:
                    lost.add(target)
                continue
            if last_label.get(target, pairs[target]) != pairs[target]:
                switches[scan] += 1
            if target in lost:
                fragments[scan] += 1
                lost.remove(target)
            last_label[target] = pairs[target]
    return switches, fragments
