"""Estimates of a run paired with targets, scan by scan: what all measures of pairs and of labels start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.assignment import assign_points, check_parameters, point_set
from vedette.evaluation.metrics.point_ospa import check_scans
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.truth import Truth


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """Pairs of an estimate and a target nearer than the cutoff, in order of scans.

    Attributes:
        num_targets: (num_scans,) targets alive at each scan.
        num_estimates: (num_scans,) targets estimated at each scan.
        scans: (num_pairs,) the scan of each pair, counted from 0.
        truth_rows: (num_pairs,) row of the pair's target in `Truth.ids` and `Truth.states`.
        distances: (num_pairs,) distance of the two positions, m; below the cutoff.
        labels: (num_pairs, 2) label of the estimate.
        means: (num_pairs, state_dim) estimated states.
        covs: (num_pairs, state_dim, state_dim) their covariances.
    """

    num_targets: Ints
    num_estimates: Ints
    scans: Ints
    truth_rows: Ints
    distances: Floats
    labels: Ints
    means: Floats
    covs: Floats

    @property
    def num_scans(self) -> int:
        """Number of scans."""
        return len(self.num_targets)

    @property
    def num_matched(self) -> Ints:
        """(num_scans,) pairs at each scan."""
        return np.bincount(self.scans, minlength=self.num_scans)

    @property
    def num_missed(self) -> Ints:
        """(num_scans,) targets without a partner."""
        return self.num_targets - self.num_matched

    @property
    def num_false(self) -> Ints:
        """(num_scans,) estimates without a partner."""
        return self.num_estimates - self.num_matched

    def mean_by_scan(self, values: Floats) -> Floats:
        """(num_scans,) mean of (num_pairs,) values over the pairs of each scan; NaN where there is none."""
        counts, means = self.num_matched, np.full(self.num_scans, np.nan)
        np.divide(sum_by_scan(self.scans, values, self.num_scans), counts, out=means, where=counts > 0)
        return means

    def max_by_scan(self, values: Floats) -> Floats:
        """(num_scans,) largest of (num_pairs,) values over the pairs of each scan; NaN where there is none."""
        largest = np.full(self.num_scans, np.nan)
        np.fmax.at(largest, self.scans, values)
        return largest


def sum_by_scan(scans: Ints, values: Floats, num_scans: int) -> Floats:
    """(num_scans,) sum of (num,) values over the entries of each scan."""
    return np.asarray(np.bincount(scans, weights=values, minlength=num_scans), np.float64)  # integers if there is none


def match_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float) -> Matching:
    """Match estimated with true positions at every scan, each scan by itself, by the assignment of OSPA and GOSPA.

    The assignment makes the sum of min(distance, cutoff) ** order least; those of its pairs count that are nearer than
    the cutoff. Where several assignments are equally good, one of them is taken, always the same.

    Args:
        truth: the targets at every scan.
        estimates: one a scan.
        cutoff: c > 0, m, finite.
        order: p >= 1, finite.

    Raises `InputError` for a cutoff or order out of range, if there is not one estimate a scan, or for positions that
    are not finite.
    """
    check_parameters(cutoff, order, finite=True)
    check_scans(truth, estimates)
    num_estimates = np.array([estimate.num_targets for estimate in estimates], np.int64)
    labels, means, covs = _stacked(estimates)
    found, true = point_set(means[:, :2], "estimates"), point_set(truth.states[:, :2], "truth")
    starts = np.concatenate([[0], np.cumsum(num_estimates)]).tolist()
    offsets = truth.offsets.tolist()
    scans, rows, truth_rows, distances = [], [], [], []
    for scan in range(truth.num_scans):
        start, offset = starts[scan], offsets[scan]
        first, second, apart = assign_points(
            found[start : starts[scan + 1]], true[offset : offsets[scan + 1]], cutoff, order
        )
        scans.append(np.full(len(first), scan))
        rows.append(first + start)
        truth_rows.append(second + offset)
        distances.append(apart)
    near = np.concatenate(distances) < cutoff
    row = np.concatenate(rows)[near]
    return Matching(
        num_targets=np.diff(truth.offsets),
        num_estimates=num_estimates,
        scans=np.concatenate(scans)[near],
        truth_rows=np.concatenate(truth_rows)[near],
        distances=np.concatenate(distances)[near],
        labels=labels[row],
        means=means[row],
        covs=covs[row],
    )


def _stacked(estimates: Sequence[Estimate]) -> tuple[Ints, Floats, Floats]:
    """Labels, means and covariances of all scans; those of an empty scan say nothing about the dimension."""
    some = [estimate for estimate in estimates if estimate.num_targets] or [Estimate.empty(2)]
    dims = {estimate.means.shape[1] for estimate in some}
    if len(dims) > 1:
        raise InputError(f"estimates: expected states of one dimension; got {sorted(dims)}")
    return (
        np.concatenate([estimate.labels for estimate in some]),
        np.concatenate([estimate.means for estimate in some]),
        np.concatenate([estimate.covs for estimate in some]),
    )
