"""Observation of targets: models, times and poses, and the births that may begin the labels of a record."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vedette.densities import FactoredGLMB, TrackHistory, UndetectedTargets, as_lmb
from vedette.errors import InputError
from vedette.filters import FactoredGlmbFilter
from vedette.kernels.base.types import Bools, Floats, Mixture
from vedette.kernels.gaussian.components import components_of, joined_components
from vedette.kernels.gaussian.modes import predicted_intensity
from vedette.kernels.steps.undetected import WIDE
from vedette.models import SensorModel, TargetModel
from vedette.models.arguments import probability
from vedette.models.motion import kernel_motion

# Number of estimates at which a label counts as a birth, and the shape of the prior of the number of births.
_MIN_ESTIMATES, _SHAPE = 3, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ObservationHistory:
    """Models of the targets, and the scans that observed them.

    Raises:
        InputError: arrays of other shapes, no probability, or births from measurements without a region.
    """

    targets: TargetModel  # motion, survival and births, as in the filters, with births at sites or anywhere in a region
    sensors: tuple[SensorModel, ...]  # model of each sensor
    times: Floats  # (num_scans,) of the scans, s
    poses: Floats  # (num_scans, num_sensors, 3 or more) of the sensors
    scanned: Bools  # (num_scans, num_sensors) True if the sensor scanned
    # probability that an existing target that is not detected for a while is out of sight, although the detection
    # models do not include it: behind an island, or silent. After n scans it then reappears with probability 1 / n. 0:
    # scans miss a target independently, as filters assume, and 12 misses at a probability of detection of .95 are next
    # to impossible
    prob_hidden: float

    def __post_init__(self) -> None:
        shape = len(self.times), len(self.sensors)
        if self.poses.shape[:2] != shape or self.scanned.shape != shape:
            got = f"{self.poses.shape[:2]}, {self.scanned.shape}"
            raise InputError(f"poses, scanned: expected entries for each scan and sensor, {shape}; got {got}")
        probability("prob_hidden", self.prob_hidden)
        measured = self.targets.birth.from_measurements
        if measured is not None and measured.region is None and self.targets.birth.anywhere is None:
            raise InputError("targets.birth.from_measurements: expected births in a region; got none")

    def scan_interval(self, scan: int) -> float:
        """Return the seconds since the previous scan, or 1 for the first."""
        return float(self.times[scan] - self.times[scan - 1]) if scan else 1.0

    def predict(self, mixture: Mixture, first: int, last: int) -> Mixture:
        """Return a mixture at scan `first`, after survival and motion to scan `last`, of modes their mixed motion."""
        motion = kernel_motion(self.targets.motion, self.targets.survival)
        for scan in range(first + 1, last + 1):
            mixture = predicted_intensity(mixture, motion, self.scan_interval(scan))
        return mixture


def birth_count_ratio(histories: Sequence[TrackHistory], observations: ObservationHistory) -> float:
    """Return the number of births that a record shows, divided by the number that the models expect.

    It is the posterior mean for a gamma prior of shape 1/2, as for a learnt birth rate: (1/2 + number of labels with
    three or more estimates) / (1/2 + expected number). It is 1 if the rate of births anywhere is learnt or given
    separately.
    """
    birth = observations.targets.birth
    measured = birth.from_measurements
    if birth.anywhere is not None or (measured is not None and measured.is_learnt):
        return 1.0
    expected = 0.0
    for scan in range(len(observations.times)):
        per_scan = float(birth.existence.sum()) if birth.is_active(scan + 1) else 0.0
        per_scan += 0.0 if measured is None else float(measured.expected)
        expected += per_scan if birth.period is None else per_scan * observations.scan_interval(scan) / birth.period
    number = sum(len(history.steps) >= _MIN_ESTIMATES for history in histories)
    return (_SHAPE + number) / (_SHAPE + expected)


def undetected_priors(observations: ObservationHistory, first_scans: Sequence[int]) -> Iterator[FactoredGLMB]:
    """Yield at each scan the prior of a filter without detections: its undetected targets are those of any filter.

    first_scans: scan of each label's first estimate, from which a birth rate is learnt.
    """
    filters = [FactoredGlmbFilter(observations.targets, sensor) for sensor in observations.sensors]
    belief, rng = filters[0].initial(), np.random.default_rng(0)
    ordered = sorted(first_scan for first_scan in first_scans if first_scan > 0)
    for scan in range(len(observations.times)):
        undetected = belief.undetected
        if undetected is not None and undetected.birth_rate is not None:
            number = float(bisect_left(ordered, scan))
            learnt = replace(undetected.birth_rate, past=number)
            belief = belief.with_fields(undetected=replace(undetected, birth_rate=learnt))
        belief, _ = filters[0].predict(belief, observations.scan_interval(scan), scan + 1)
        yield belief
        for s in np.flatnonzero(observations.scanned[scan]).tolist():
            no_measurements = np.empty((0, observations.sensors[s].meas_dim))
            belief, _ = filters[s].update(belief, no_measurements, observations.poses[scan, s], rng=rng)


def birth_intensity(belief: FactoredGLMB, history: TrackHistory, observations: ObservationHistory) -> Mixture:
    """Return the intensity of undetected targets where a label began. Births anywhere are one wide Gaussian."""
    undetected, labels, birth = belief.undetected, as_lmb(belief), observations.targets.birth
    assert isinstance(undetected, UndetectedTargets)
    at_sites = labels.tracks.to_kernel().components._replace(log_weights=np.log(labels.existence))
    parts = [components_of(*mixture[:3]) for mixture in (undetected.intensity.to_kernel(), at_sites)]
    if undetected.cells is not None and birth.from_measurements is not None:
        grid, in_plane = undetected.cells.grid, np.arange(birth.state_dim) < 2
        std = birth.from_measurements.std * np.where(in_plane, WIDE, 1.0)
        state = history.means[:1] * in_plane
        nearest = np.argmin(((grid.centres - state[0, :2]) ** 2).sum(axis=1))  # also of a state outside the region
        density = undetected.cells.expected[nearest] / np.prod(grid.cell_size)
        with np.errstate(divide="ignore"):
            weight = np.log(density * 2.0 * np.pi * std[0] * std[1])
        parts.append(components_of(np.array([weight]), state, np.diag(std**2)[np.newaxis]))
    return joined_components(parts)
