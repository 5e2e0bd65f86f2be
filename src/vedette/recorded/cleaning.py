"""Tracks from recorded reports: removal of jumps, silences, moored ships and reports outside the region."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats, Ints
from vedette.models import Region
from vedette.models.fields import Checked, NonNegative, Positive
from vedette.recorded.reports import Reports


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTrack:
    """One uninterrupted track of a recorded target.

    Attributes:
        name: the record's own name of the target. Several tracks may share it.
        times: (n,) s, increasing, at least two.
        positions: (n, 2) m.
        velocities: (n, 2) m/s, as recorded or from finite differences.
        altitudes: (n,) m, or None if they are not recorded.
    """

    name: str
    times: Floats
    positions: Floats
    velocities: Floats
    altitudes: Floats | None = None


@dataclass(frozen=True, slots=True)
class CleaningCounts:
    """Numbers of reports: all, jumps, outside the region. Numbers of tracks: too short, too slow, and retained."""

    reports: int
    jumps: int
    outside: int
    short_tracks: int
    slow_tracks: int
    tracks: int

    def in_words(self) -> str:
        """Return the numbers of reports and of removed ones, for messages."""
        removed = {
            "jumps": self.jumps,
            "outside the region": self.outside,
            "tracks of a single report": self.short_tracks,
            "slow tracks": self.slow_tracks,
        }
        removed_text = ", ".join(f"{number} {what}" for what, number in removed.items() if number)
        return f"{pluralise(self.reports, 'report')} ({removed_text or 'none removed'})"


@dataclass(frozen=True, slots=True)
class Cleaning(Checked):
    """Settings of the steps from reports to tracks, in this order.

    Attributes:
        max_speed: as few reports as possible are dropped so that no two successive ones need a higher speed (jumps).
            none: no limit [m/s].
        region: reports outside it are removed, and a track ends where it leaves. None: everywhere.
        max_gap: a longer silence ends a track, and the next report begins another [s].
        min_speed: a track slower than this on average (path length over duration) is left out, such as a moored ship
            [m/s].

    A track left with one report is dropped.
    """

    max_gap: Positive = 60.0
    min_speed: NonNegative = 0.0
    max_speed: Positive | None = None
    region: Region | None = None

    def apply(self, reports: Reports) -> tuple[tuple[RecordedTrack, ...], CleaningCounts]:
        """Return the tracks in order of their first report, and the counts of what was left out."""
        jumps = outside = short = slow = 0
        tracks: list[RecordedTrack] = []
        for target in range(len(reports.names)):
            rows = np.flatnonzero(reports.tracks == target)
            reachable = self._without_jumps(reports, rows)
            jumps += len(rows) - len(reachable)
            runs = list(self._runs(reports, reachable))
            outside += len(reachable) - sum(map(len, runs))
            for run in runs:
                if len(run) < 2:
                    short += 1
                elif _mean_speed(reports, run) < self.min_speed:
                    slow += 1
                else:
                    tracks.append(_track(reports, run))
        tracks.sort(key=lambda track: (track.times[0], track.name))
        counts = CleaningCounts(len(reports.times), jumps, outside, short, slow, len(tracks))
        return tuple(tracks), counts

    def _without_jumps(self, reports: Reports, rows: Ints) -> Ints:
        if self.max_speed is None:
            return rows
        return rows[longest_reachable(reports.times[rows], reports.positions[rows], self.max_speed)]

    def _runs(self, reports: Reports, rows: Ints) -> Iterator[Ints]:
        """Yield runs of reports without a silence and without a report outside the region."""
        inside = np.ones(len(rows), np.bool_) if self.region is None else self.region.contains(reports.positions[rows])
        inside_rows = np.flatnonzero(inside)
        left_region = np.diff(inside_rows) > 1
        silent = np.diff(reports.times[rows[inside_rows]]) > self.max_gap
        for run in np.split(inside_rows, np.flatnonzero(left_region | silent) + 1):
            if len(run):
                yield rows[run]


def longest_reachable(times: Floats, positions: Floats, max_speed: float) -> Ints:
    """Return indices of the most reports of one target that are possible at `max_speed`, in order of time.

    Reachability is transitive, so the longest chain over pairs in order is exact. A bad first report cannot remove the
    good ones.
    """
    num_reports = len(times)
    length, previous = np.ones(num_reports, np.int64), np.full(num_reports, -1)
    for i in range(1, num_reports):
        distances = np.hypot(*(positions[:i] - positions[i]).T)
        # The last of the longest: without jumps this is the previous report.
        lengths = np.where(distances <= max_speed * (times[i] - times[:i]), length[:i], 0)
        best = i - 1 - int(np.argmax(lengths[::-1]))
        if lengths[best] > 0:
            length[i], previous[i] = lengths[best] + 1, best
    chain = [int(np.argmax(length))]
    while previous[chain[-1]] >= 0:
        chain.append(int(previous[chain[-1]]))
    return np.array(chain[::-1], dtype=np.int64)


def _mean_speed(reports: Reports, run: Ints) -> float:
    steps = np.diff(reports.positions[run], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum() / (reports.times[run[-1]] - reports.times[run[0]]))


def _track(reports: Reports, run: Ints) -> RecordedTrack:
    times, positions = reports.times[run], reports.positions[run]
    if reports.velocities is not None:
        velocities = reports.velocities[run]
    else:
        before, after = np.maximum(np.arange(len(run)) - 1, 0), np.minimum(np.arange(len(run)) + 1, len(run) - 1)
        velocities = (positions[after] - positions[before]) / (times[after] - times[before])[:, None]
    altitudes = None if reports.altitudes is None else reports.altitudes[run]
    return RecordedTrack(reports.names[reports.tracks[run[0]]], times, positions, velocities, altitudes)
