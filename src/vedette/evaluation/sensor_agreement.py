"""Warnings of sensors that agree on no target, because of wrong units, north or places."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from vedette.evaluation.innovations import Compared
from vedette.internal.quantities import HEIGHT_DEPENDENT, PLACED
from vedette.kernels.base.types import Floats, Ints

_MIN_ESTIMATES = 10  # estimates of a track, at least, for it to count
_MIN_SCANS, _MIN_SHARE = 3, 0.25  # scans, and their share, at which a sensor must have measured a track
_MIN_PAIRS, _MAX_CHANCE_SHARE = 10, 0.1  # fewest pairs for a result, and the largest share that agrees by chance
_MAX_OFFSET_VARIATION = 0.25  # largest variation of an offset between two tracks, as a share of it
_MAX_OFFSET_SHARE = 0.1  # largest offset that a bias explains, as a share of the distance from a sensor
_MORE = 0.3  # by which the share of one sensor is larger for a track of it alone
_MANY = 0.3  # share of the tracks of one sensor that have one of the other near them; a convoy has fewer


class _Track(NamedTuple):
    """A track: mean positions by instant, and for each sensor its scans with a measurement of it, and in view of it."""

    means: dict[int, Floats]
    measured: Ints
    seen: Ints

    def is_measured_by(self, sensor: int) -> bool:
        return bool(self.measured[sensor] >= max(_MIN_SCANS, _MIN_SHARE * self.seen[sensor]))

    def share(self, sensor: int) -> float:
        """Return the share of a sensor's scans in view of the track that have a measurement of it."""
        return float(self.measured[sensor] / max(self.seen[sensor], 1))


def disagreement_warnings(instants: Sequence[Compared], names: Sequence[str], kinds: Sequence[str]) -> tuple[str, ...]:
    """Return warnings of sensors that agree on no target, and of tracks that run side by side.

    A pair is a track that one of two sensors measures and a scan of the other that should contain it. Sensors whose
    measurements give no positions are left out.
    """
    tracks, warnings = _long_tracks(instants), list[str]()
    for first, second in combinations([s for s, kind in enumerate(kinds) if kind in PLACED], 2):
        pairs = [
            (track.measured[other], track.seen[other])
            for track in tracks.values()
            for measuring, other in ((first, second), (second, first))
            if track.is_measured_by(measuring)
        ]
        agreeing, num = np.sum(pairs or [(0, 0)], axis=0).tolist()
        share_a_track = any(track.is_measured_by(first) and track.is_measured_by(second) for track in tracks.values())
        pair, of_pair = (names[first], names[second]), {kinds[first], kinds[second]}
        if num >= _MIN_PAIRS and not share_a_track and agreeing <= _MAX_CHANCE_SHARE * num:
            counts = f"{agreeing} of {num} pairs of a track of one and a scan of the other"
            checks = "check units, north (compass or east) and places"
            if "bearing_range" in of_pair and of_pair & set(HEIGHT_DEPENDENT):
                checks += ", and whether ranges are slant ranges (`kind: bearing_slant_range`)"
            warnings.append(f"{pair[0]} and {pair[1]} agree on no target ({counts}): {checks}")
        warnings += _parallel_tracks(tracks, (first, second), pair, instants[0].own[[first, second]])
    return tuple(warnings)


def _long_tracks(instants: Sequence[Compared]) -> dict[tuple[int, ...], _Track]:
    """Return the tracks with at least `_MIN_ESTIMATES` estimates, by label."""
    tracks: dict[tuple[int, ...], _Track] = {}
    for k, instant in enumerate(instants):
        for label, mean, detected in zip(instant.labels.tolist(), instant.means, instant.detected, strict=True):
            before = tracks.get(tuple(label), _Track({}, np.zeros_like(detected), np.zeros_like(detected)))
            before.means[k] = mean
            tracks[tuple(label)] = _Track(before.means, before.measured + (detected > 0), before.seen + (detected >= 0))
    return {label: track for label, track in tracks.items() if len(track.means) >= _MIN_ESTIMATES}


def _parallel_tracks(
    tracks: Mapping[tuple[int, ...], _Track], pair: tuple[int, int], names: tuple[str, str], sensor_positions: Floats
) -> Iterator[str]:
    """Yield a warning if tracks of one sensor keep a small offset from tracks of the other, as two of one target do.

    sensor_positions: (2, 2), m.
    """
    first, second = (
        [each for each in tracks.values() if each.is_measured_by(one) and each.share(one) > each.share(other) + _MORE]
        for one, other in (pair, pair[::-1])
    )
    offsets = [offset for track in first if (offset := _nearest_offset(track, second, sensor_positions)) is not None]
    if len(offsets) > _MANY * len(first):
        distance = f"{np.median(offsets):.0f} m from one of {names[1]}"
        finding = f"{len(offsets)} of {len(first)} tracks of {names[0]} keep {distance}, as two tracks of one target do"
        yield f"{finding}: `vedette track --calibrate` finds biases of range, bearing and clock"


def _nearest_offset(track: _Track, others: list[_Track], sensor_positions: Floats) -> float | None:
    """Return the distance to the nearest other track with a constant offset, m, or None if none is near enough."""
    nearest: float | None = None
    mean = np.mean(list(track.means.values()), axis=0)
    largest = _MAX_OFFSET_SHARE * float(np.hypot(*(mean - sensor_positions).T).min())
    for other in others:
        common = sorted(track.means.keys() & other.means.keys())
        if len(common) < _MIN_ESTIMATES:
            continue
        offsets = np.array([other.means[k] - track.means[k] for k in common])
        variation, size = float(np.sqrt(offsets.var(axis=0).sum())), float(np.hypot(*offsets.mean(axis=0)))
        if variation <= _MAX_OFFSET_VARIATION * size and size <= (largest if nearest is None else nearest):
            nearest = size
    return nearest
