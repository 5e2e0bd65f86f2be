"""Metrics of tracked targets: the fraction of targets in view that are tracked, and the time until they are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.evaluation.metrics.assignment import check_parameters
from vedette.evaluation.metrics.matching import Matching, match_run
from vedette.kernels.base.types import Bools, Floats
from vedette.models import SensorModel
from vedette.models.arguments import probability, reject
from vedette.models.fields import Count, Probability, check_fields
from vedette.simulation.records import RunRecord
from vedette.simulation.truth import Truth


def targets_in_view(
    truth: Truth, poses: Floats, sensors: Sequence[SensorModel], *, min_detection_probability: float
) -> Bools:
    """Return True for each row of `Truth.states` that some sensor detects with at least this probability, (total,).

    Args:
        truth: the targets at every scan.
        poses: (num_scans, num_sensors, pose_dim) poses of the sensors.
        sensors: model of each sensor, in the order of the poses.
        min_detection_probability: probability of detection, 0 to 1. It counts even if the sensor does not scan at that
            time.

    Raises `InputError` for an argument out of range, or another number of sensors than the poses have.
    """
    probability("min_detection_probability", min_detection_probability)
    if poses.shape[:2] != (truth.num_scans, len(sensors)):
        raise reject("sensors", f"one for each of {poses.shape[1]} sensors", f"{len(sensors)}")
    in_view = np.zeros(len(truth.states), np.bool_)
    for scan in range(truth.num_scans):
        rows, factors = slice(truth.offsets[scan], truth.offsets[scan + 1]), truth.detection_factors_at(scan)
        for pose, sensor in zip(poses[scan], sensors, strict=True):
            in_view[rows] |= factors * sensor.detection.prob(truth.states[rows], pose) >= min_detection_probability
    return in_view


@dataclass(frozen=True, slots=True, eq=False)
class TrackedFraction:
    """Metric: share of the targets visible to some sensor at a scan that have an estimate within c.

    Estimates are matched with all targets, each at most once, as for OSPA. NaN at scans without visible targets.

    Attributes:
        sensors: true model of each sensor.
        cutoff: c > 0, m, finite.
        order: order p >= 1 of the matching, finite.
        min_detection_probability: smallest probability of detection of a visible target.
    """

    sensors: tuple[SensorModel, ...]
    cutoff: float
    order: float
    min_detection_probability: Probability = 0.5

    def __post_init__(self) -> None:
        check_parameters(self.cutoff, self.order, finite=True)
        probability("min_detection_probability", self.min_detection_probability)

    def __call__(self, record: RunRecord) -> Floats:
        """Return the share, (num_scans,). Raise `InputError` as `match_run` does, and for another number of sensors."""
        truth = record.truth
        in_view = targets_in_view(
            truth, record.poses, self.sensors, min_detection_probability=self.min_detection_probability
        )
        matching = match_run(truth, record.estimates, cutoff=self.cutoff, order=self.order)
        tracked = np.zeros(len(in_view), np.bool_)
        tracked[matching.truth_rows] = True
        scans = truth.scans
        num_in_view = np.bincount(scans[in_view], minlength=truth.num_scans)
        num_tracked = np.bincount(scans[in_view & tracked], minlength=truth.num_scans)
        return np.where(num_in_view > 0, num_tracked / np.maximum(num_in_view, 1), np.nan)


@dataclass(frozen=True, slots=True)
class TimeToTrack:
    """Metric: mean time in s until the targets that appear at a scan first have an estimate.

    An estimate of a target is one that is matched with it and closer than c. A target without any estimate counts with
    the time from its first scan to its last. NaN at scans without new targets.

    Attributes:
        cutoff: c > 0, m, finite.
        order: order p >= 1 of the matching, finite.
        first_scan: targets that appear before this scan do not count. With 2, those present at the first scan.
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
