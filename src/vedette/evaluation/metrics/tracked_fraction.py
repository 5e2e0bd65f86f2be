"""Share of visible targets that are tracked, the metric for fusion of different fields of view."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.evaluation.metrics.assignment import check_parameters
from vedette.evaluation.metrics.matching import match_run
from vedette.kernels.base.types import Bools, Floats
from vedette.models import SensorModel
from vedette.models.arguments import probability, reject
from vedette.models.fields import Probability
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

    Raises:
        InputError: an argument out of range.
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
