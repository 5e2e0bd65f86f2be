"""Matching of a run's estimates with targets at each scan, the basis of all metrics of pairs and of labels."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.assignment import assign_points, check_parameters, point_set
from vedette.evaluation.metrics.point_ospa import check_scans
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.truth import Truth


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """Pairs of an estimate and a target closer than the cutoff, in order of scans.

    Attributes:
        num_targets: (num_scans,) number of targets alive at each scan.
        num_estimates: (num_scans,) number of estimated targets at each scan.
        scans: (num_pairs,) scan of each pair, counted from 0.
        truth_rows: (num_pairs,) row of the pair's target in `Truth.ids` and `Truth.states`.
        distances: (num_pairs,) distance of the two positions, m, below the cutoff.
        labels: (num_pairs, 2) label of the estimate.
        means: (num_pairs, state_dim) estimated states.
        covs: (num_pairs, state_dim, state_dim) covariances of the estimates.
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
        """Number of pairs at each scan, (num_scans,)."""
        return np.bincount(self.scans, minlength=self.num_scans)

    @property
    def num_missed(self) -> Ints:
        """Number of targets without a partner at each scan, (num_scans,)."""
        return self.num_targets - self.num_matched

    @property
    def num_false(self) -> Ints:
        """Number of estimates without a partner at each scan, (num_scans,)."""
        return self.num_estimates - self.num_matched

    def mean_by_scan(self, values: Floats) -> Floats:
        """Return the mean of (num_pairs,) values over the pairs of each scan, (num_scans,), or NaN without pairs."""
        counts, means = self.num_matched, np.full(self.num_scans, np.nan)
        np.divide(sum_by_scan(self.scans, values, self.num_scans), counts, out=means, where=counts > 0)
        return means

    def max_by_scan(self, values: Floats) -> Floats:
        """Return the largest of (num_pairs,) values over the pairs of each scan, (num_scans,), or NaN without pairs."""
        largest = np.full(self.num_scans, np.nan)
        np.fmax.at(largest, self.scans, values)
        return largest


def sum_by_scan(scans: Ints, values: Floats, num_scans: int) -> Floats:
    """Return the sum of (num,) values over the entries of each scan, (num_scans,)."""
    return np.asarray(np.bincount(scans, weights=values, minlength=num_scans), np.float64)  # no entries give integers


def match_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float) -> Matching:
    """Match estimated with true positions, separately at every scan, by the assignment of OSPA and GOSPA.

    The assignment minimises the sum of min(distance, cutoff) ** order. Only pairs closer than the cutoff count. Among
    equally good assignments, always the same one is used.

    Args:
        truth: the targets at every scan.
        estimates: one per scan.
        cutoff: c > 0, m, finite.
        order: p >= 1, finite.

    Raises `InputError` for a cutoff or order out of range, unless there is one estimate per scan, or for positions that
    are not finite.
    """
    check_parameters(cutoff, order, finite=True)
    check_scans(truth, estimates)
    num_estimates = np.array([estimate.num_targets for estimate in estimates], np.int64)
    labels, means, covs = _stacked(estimates)
    estimated, true = point_set(means[:, :2], "estimates"), point_set(truth.states[:, :2], "truth")
    starts = np.concatenate([[0], np.cumsum(num_estimates)]).tolist()
    offsets = truth.offsets.tolist()
    scans, rows, truth_rows, distances = [], [], [], []
    for scan in range(truth.num_scans):
        start, offset = starts[scan], offsets[scan]
        first, second, pair_distances = assign_points(
            estimated[start : starts[scan + 1]], true[offset : offsets[scan + 1]], cutoff, order
        )
        scans.append(np.full(len(first), scan))
        rows.append(first + start)
        truth_rows.append(second + offset)
        distances.append(pair_distances)
    in_cutoff = np.concatenate(distances) < cutoff
    estimate_rows = np.concatenate(rows)[in_cutoff]
    return Matching(
        num_targets=np.diff(truth.offsets),
        num_estimates=num_estimates,
        scans=np.concatenate(scans)[in_cutoff],
        truth_rows=np.concatenate(truth_rows)[in_cutoff],
        distances=np.concatenate(distances)[in_cutoff],
        labels=labels[estimate_rows],
        means=means[estimate_rows],
        covs=covs[estimate_rows],
    )


def near_targets(truth: Truth, estimates: Sequence[Estimate], cutoff: float) -> list[Estimate]:
    """Return the estimates without those as far as the cutoff, m, from every target: of targets without truth.

    Raises `InputError` unless there is one estimate per scan.
    """
    check_scans(truth, estimates)
    kept = list[Estimate]()
    for scan, estimate in enumerate(estimates):
        offsets = estimate.means[:, np.newaxis, :2] - truth.at(scan)[1][np.newaxis, :, :2]
        near = (np.hypot(offsets[..., 0], offsets[..., 1]) < cutoff).any(axis=1)
        kept.append(Estimate(*(getattr(estimate, each.name)[near] for each in fields(Estimate))))
    return kept


def _stacked(estimates: Sequence[Estimate]) -> tuple[Ints, Floats, Floats]:
    """Return the labels, means and covariances of all scans. Empty scans may have any state dimension."""
    non_empty = [estimate for estimate in estimates if estimate.num_targets] or [Estimate.empty(2)]
    dims = {estimate.means.shape[1] for estimate in non_empty}
    if len(dims) > 1:
        raise InputError(f"estimates: expected states of one dimension; got {sorted(dims)}")
    return (
        np.concatenate([estimate.labels for estimate in non_empty]),
        np.concatenate([estimate.means for estimate in non_empty]),
        np.concatenate([estimate.covs for estimate in non_empty]),
    )
