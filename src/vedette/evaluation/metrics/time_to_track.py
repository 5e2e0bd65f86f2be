"""Time until a new target is first tracked, the metric for search."""

from dataclasses import dataclass

import numpy as np

from vedette.evaluation.metrics.assignment import check_parameters
from vedette.evaluation.metrics.matching import Matching, match_run
from vedette.kernels.base.types import Floats
from vedette.models.fields import Count, check_fields
from vedette.simulation.records import RunRecord
from vedette.simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class TimeToTrack:
    """Metric: mean time in s until the targets that appear at a scan first have an estimate.

    An estimate of a target is one that is matched with it and closer than c. A target without any estimate counts with
    the time from its first scan to its last. NaN at scans without new targets.

    Attributes:
        cutoff: c > 0, m, finite.
        order: order p >= 1 of the matching, finite.
        first_scan: targets that appear before this scan do not count. With 2, those present at the first scan.

    Raises:
        InputError: an argument out of range.
    """

    cutoff: float
    order: float
    first_scan: Count = 2

    def __post_init__(self) -> None:
        check_parameters(self.cutoff, self.order, finite=True)
        check_fields(self)

    def __call__(self, record: RunRecord) -> Floats:
        """Return the metric of a run, (num_scans,), s. Raise `InputError` as `match_run` does."""
        matching = match_run(record.truth, record.estimates, cutoff=self.cutoff, order=self.order)
        return waiting_times(record.truth, matching, self.first_scan)


def waiting_times(truth: Truth, matching: Matching, first_scan: int = 2) -> Floats:
    """Return the metric `TimeToTrack` (num_scans,), s, from the pairs of estimates and targets."""
    _, first, target_of_row = np.unique(truth.ids, return_index=True, return_inverse=True)
    last_rows = len(truth.ids) - 1 - np.unique(truth.ids[::-1], return_index=True)[1]
    tracked = np.sort(matching.truth_rows)[::-1]
    last_rows[target_of_row[tracked]] = tracked  # the first of a target's rows is assigned last, and remains
    first_scans, last_scans = truth.scans[first], truth.scans[last_rows]
    counts = first_scans + 1 >= first_scan
    waited = (truth.times[last_scans] - truth.times[first_scans])[counts]
    number = np.bincount(first_scans[counts], minlength=truth.num_scans)
    total = np.bincount(first_scans[counts], waited, truth.num_scans)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
