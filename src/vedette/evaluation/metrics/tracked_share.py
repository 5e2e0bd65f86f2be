"""Share of the targets that a sensor can see that are tracked: what a fusion of different views must keep."""

from __future__ import annotations

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


def seen_targets(truth: Truth, poses: Floats, sensors: Sequence[SensorModel], *, min_detection: float) -> Bools:
    """(total,) for each row of `Truth.states`, whether some sensor detects it with at least that probability.

    Args:
        truth: the targets at every scan.
        poses: (num_scans, num_sensors, pose_dim) of the sensors.
        sensors: what each sensor sees, one a column of the poses.
        min_detection: probability of detection, 0 to 1. Whether the sensor scans at that time does not matter.

    Raises `InputError` for an argument out of range, or another number of sensors than the poses have.
    """
    probability("min_detection", min_detection)
    if poses.shape[:2] != (truth.num_scans, len(sensors)):
        raise reject("sensors", f"one for each of {poses.shape[1]} sensors", f"{len(sensors)}")
    seen = np.zeros(len(truth.states), np.bool_)
    for scan in range(truth.num_scans):
        rows = slice(truth.offsets[scan], truth.offsets[scan + 1])
        for pose, sensor in zip(poses[scan], sensors, strict=True):
            seen[rows] |= sensor.detection.prob(truth.states[rows], pose) >= min_detection
    return seen


@dataclass(frozen=True, slots=True, eq=False)
class TrackedShare:
    """A measure of runs: at each scan, the share of the targets seen by some sensor that have an estimate within c.

    Estimates are matched with all targets, each at most once, as for OSPA. NaN at a scan at which none is seen.

    Attributes:
        sensors: what each sensor sees in truth.
        cutoff: c > 0, m, finite.
        order: p >= 1 of the matching, finite.
        min_detection: probability of detection from which on a sensor sees a target.

    Raises:
        InputError: an argument out of range.
    """

    sensors: tuple[SensorModel, ...]
    cutoff: float
    order: float
    min_detection: Probability = 0.5

    def __post_init__(self) -> None:
        check_parameters(self.cutoff, self.order, finite=True)
        probability("min_detection", self.min_detection)

    def __call__(self, record: RunRecord) -> Floats:
        """(num_scans,) the share. Raises `InputError` for a run of other sensors, and as `match_run` does."""
        truth = record.truth
        seen = seen_targets(truth, record.poses, self.sensors, min_detection=self.min_detection)
        matching = match_run(truth, record.estimates, cutoff=self.cutoff, order=self.order)
        tracked = np.zeros(len(seen), np.bool_)
        tracked[matching.truth_rows] = True
        scans = truth.scans
        number = np.bincount(scans[seen], minlength=truth.num_scans)
        kept = np.bincount(scans[seen & tracked], minlength=truth.num_scans)
        return np.where(number > 0, kept / np.maximum(number, 1), np.nan)
