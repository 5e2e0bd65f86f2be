"""OSPA distance between sets of tracks over a sliding window, OSPA(2), because its base distance is itself an OSPA.

M. Beard, B.-T. Vo and B.-N. Vo, "A Solution for Large-Scale Multi-Object Tracking", IEEE Trans. Signal Processing 68,
2020: the time-averaged OSPA as distance between tracks, and the OSPA between sets of tracks with this base distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.assignment import check_parameters
from vedette.evaluation.metrics.point_ospa import check_scans, ospa_of_distances
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import dimension
from vedette.simulation.truth import Truth

# Largest product of pairs of tracks and scans of a window for which several windows share their distances.
_MAX_SHARED_DISTANCES = 2**18


@dataclass(frozen=True, slots=True, eq=False)
class TrackSet:
    """Tracks over the same scans. Each may begin late, end early and have gaps.

    Attributes:
        alive: (num_tracks, num_scans) True if the track exists at the scan.
        positions: (num_tracks, num_scans, dim) in m, finite, without meaning where the track does not exist.
    """

    alive: Bools
    positions: Floats

    @property
    def num_scans(self) -> int:
        """Number of scans."""
        return int(self.alive.shape[1])

    def validate(self, name: str) -> None:
        """Raise `InputError`, with `name`, unless the shapes match and the positions are finite."""
        if self.alive.ndim != 2 or self.positions.shape[:-1] != self.alive.shape:
            raise InputError(
                f"{name}: expected one position a track and scan; got {self.positions.shape} for {self.alive.shape}"
            )
        if not np.isfinite(self.positions).all():
            raise InputError(f"{name}: expected finite positions")

    @classmethod
    def from_truth(cls, truth: Truth) -> "TrackSet":
        """Return one track per target, by its id."""
        tracks = np.unique(truth.ids, return_inverse=True)[1].reshape(-1)
        return cls._from_rows(tracks, np.diff(truth.offsets), truth.states)

    @classmethod
    def from_estimates(cls, estimates: Sequence[Estimate]) -> "TrackSet":
        """Return one track per label. estimates: one per scan."""
        counts = np.array([estimate.num_targets for estimate in estimates], np.int64)
        if not counts.any():
            return cls(np.empty((0, len(counts)), np.bool_), np.empty((0, len(counts), 2)))
        labels = np.concatenate([estimate.labels for estimate in estimates])
        tracks = np.unique(labels, axis=0, return_inverse=True)[1].reshape(-1)
        return cls._from_rows(tracks, counts, np.concatenate([estimate.means[:, :2] for estimate in estimates]))

    @classmethod
    def _from_rows(cls, tracks: Ints, counts: Ints, states: Floats) -> "TrackSet":
        scans = np.repeat(np.arange(len(counts)), counts)
        alive = np.zeros((tracks.max(initial=-1) + 1, len(counts)), np.bool_)
        positions = np.zeros((*alive.shape, 2))
        alive[tracks, scans] = True
        positions[tracks, scans] = states[:, :2]
        return cls(alive, positions)

    def within(self, start: int, stop: int) -> "TrackSet":
        """Return the tracks that exist at any of the scans `start` to `stop - 1`, over these scans."""
        present = self.alive[:, start:stop].any(axis=1)
        return TrackSet(self.alive[present, start:stop], self.positions[present, start:stop])


def ospa2(estimates: TrackSet, truths: TrackSet, *, cutoff: float, order: float, window: int) -> Floats:
    """Return the OSPA(2) over the window that ends at each scan.

    The distance of two tracks is an average over the scans of the window at which either exists: of their distance cut
    off at c, or of c if only one exists. The sets consist of the tracks that exist in the window, and their distance is
    the OSPA with the same cutoff and order. It therefore includes the cost of wrong labels, late starts and gaps.

    Args:
        estimates: the estimated tracks.
        truths: the true ones, over the same scans.
        cutoff: c > 0, m, finite.
        order: exponent p >= 1 of the OSPA between the sets. May be infinite. (The average over time is of order 1.)
        window: number of scans, at least 1. The first windows are shorter, from the first scan on.

    Returns (num_scans, 3): total, and the parts from matched tracks and from extra or missing tracks, m.
    Raises `InputError` for arguments out of range, positions that are not finite, or unequal numbers of scans.
    """
    check_parameters(cutoff, order)
    check_parameters(cutoff, 1.0, finite=True)
    dimension("window", window)
    estimates.validate("estimates")
    truths.validate("truths")
    if estimates.num_scans != truths.num_scans:
        raise InputError(f"estimates: expected {truths.num_scans} scans; got {estimates.num_scans}")
    parts = np.empty((truths.num_scans, 3))
    is_small = len(estimates.alive) * len(truths.alive) * window <= _MAX_SHARED_DISTANCES
    block = window if is_small else 1
    for first in range(0, truths.num_scans, block):
        start, stop = max(0, first + 1 - window), min(first + block, truths.num_scans)
        estimated, true = estimates.within(start, stop), truths.within(start, stop)
        costs, either = _costs(estimated, true, cutoff)
        for scan in range(first, stop):
            window_scans = slice(max(0, scan + 1 - window) - start, scan + 1 - start)
            present = np.ix_(estimated.alive[:, window_scans].any(axis=1), true.alive[:, window_scans].any(axis=1))
            distances = _averages(costs[:, :, window_scans], either[:, :, window_scans])[present]
            result = ospa_of_distances(distances, cutoff, order)
            parts[scan] = result.total, result.localisation, result.cardinality
    return parts


def ospa2_of_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float, window: int) -> Floats:
    """Return the OSPA(2) of the estimated positions, with tracks by label, with values and errors as in `ospa2`."""
    check_scans(truth, estimates)
    return ospa2(
        TrackSet.from_estimates(estimates), TrackSet.from_truth(truth), cutoff=cutoff, order=order, window=window
    )


def _costs(first: TrackSet, second: TrackSet, cutoff: float) -> tuple[Floats, Bools]:
    """Return cut-off distances (0 if neither exists) and flags if either exists, (num_first, num_second, num_scans)."""
    either_alive = first.alive[:, None] | second.alive[None]
    both_alive = first.alive[:, None] & second.alive[None]
    distances = np.sqrt(((first.positions[:, None] - second.positions[None]) ** 2).sum(axis=3))
    return np.where(both_alive, np.minimum(distances, cutoff), cutoff) * either_alive, either_alive


def _averages(costs: Floats, either: Bools) -> Floats:
    """Return the averages of the results of `_costs` over the scans at which either track exists."""
    return np.asarray(costs.sum(axis=2) / np.maximum(either.sum(axis=2), 1))
