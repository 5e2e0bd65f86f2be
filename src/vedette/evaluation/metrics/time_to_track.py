"""Time until a target that appears is first tracked: what search is for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.evaluation.metrics.assignment import check_parameters
from vedette.evaluation.metrics.matching import match_run
from vedette.kernels.base.types import Floats
from vedette.models.fields import Count, check_fields
from vedette.simulation.records import RunRecord


@dataclass(frozen=True, slots=True)
class TimeToTrack:
    """A measure of runs: at each scan, the mean time until the targets that appear at it first have an estimate.

    An estimate of a target is one that is matched with it and nearer than c. A target that never has one counts with
    the time from its first scan to its last. NaN at a scan at which none appears.

    Attributes:
        cutoff: c > 0, m, finite.
        order: p >= 1 of the matching, finite.
        from_step: targets that appear at an earlier scan do not count; with 2, those that are there at first.

    Raises:
        InputError: an argument out of range.
    """

    cutoff: float
    order: float
    from_step: Count = 2

    def __post_init__(self) -> None:
        check_parameters(self.cutoff, self.order, finite=True)
        check_fields(self)

    def __call__(self, record: RunRecord) -> Floats:
        """(num_scans,) s. Raises `InputError` as `match_run` does."""
        truth = record.truth
        _, first, of_row = np.unique(truth.ids, return_index=True, return_inverse=True)
        until = len(truth.ids) - 1 - np.unique(truth.ids[::-1], return_index=True)[1]
        tracked = np.sort(match_run(truth, record.estimates, cutoff=self.cutoff, order=self.order).truth_rows)[::-1]
        until[of_row[tracked]] = tracked  # of a target's rows the first one stays, as it comes last
        appears, waits = truth.scans[first], truth.times[truth.scans[until]] - truth.times[truth.scans[first]]
        counts = appears + 1 >= self.from_step
        number = np.bincount(appears[counts], minlength=truth.num_scans)
        total = np.bincount(appears[counts], waits[counts], truth.num_scans)
        return np.where(number > 0, total / np.maximum(number, 1), np.nan)
