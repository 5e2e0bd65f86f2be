"""Fields of view of the sensors at their scans, and the fusion weights that follow for each label of their LMBs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vedette.densities import LabelledDensity, TrackTable
from vedette.densities.checks import distinct_labels
from vedette.densities.labelled import LABELLED
from vedette.densities.tracks import take_tracks
from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb, Tracks
from vedette.kernels.labelled.stacking import stack_tracks
from vedette.models import SensorModel
from vedette.models.arguments import float_array, instance, one_a_sensor, reject, sequence

# Existence at which the information of a scan is evaluated: at 1 it is infinite for a sensor that never misses.
NEAR_CERTAIN_EXISTENCE = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class FieldsOfView:
    """Fields of view of all sensors at one time, each at the pose of its scan.

    Attributes:
        sensors: sensor models, in the order of the beliefs.
        poses: (num_sensors, pose_dim) pose of each sensor.
        scanned: whether each sensor scanned at this time. A sensor that did not scan detected nothing.
        prediction: the belief that all sensors' beliefs were updated from, each by its own scan alone. None if there is
            no such belief.

    Raises:
        InputError: no sensor, a number of poses or scans other than of sensors, or poses that are not finite.
    """

    sensors: tuple[SensorModel, ...]
    poses: Floats
    scanned: tuple[bool, ...]
    prediction: LabelledDensity | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensors", sequence("views.sensors", self.sensors, "at least one SensorModel"))
        num = len(self.sensors)
        if num == 0 or not all(isinstance(sensor, SensorModel) for sensor in self.sensors):
            raise reject("views.sensors", "at least one SensorModel", self.sensors)
        object.__setattr__(self, "poses", float_array("views.poses", self.poses, (num, None)))
        one_a_sensor(num, **{"views.scanned": self.scanned})
        if not isinstance(self.prediction, LabelledDensity | None):
            raise reject("views.prediction", f"{LABELLED}, or None", type(self.prediction).__name__)

    def if_all_scanned(self) -> "FieldsOfView":
        """Return the fields of view as if each sensor had scanned."""
        return replace(self, scanned=(True,) * len(self.sensors))

    def detection(self, tracks: TrackTable) -> Floats:
        """Mean probability of detection over each track's density, (num_tracks, num_sensors), or 0 without a scan."""
        return np.stack([self.detection_by(sensor, tracks) for sensor in range(len(self.sensors))], axis=1)

    def detection_by(self, sensor: int, tracks: TrackTable) -> Floats:
        """Mean probability of detection by one sensor over each track's density, (num_tracks,), or 0 without a scan."""
        if not self.scanned[sensor] or tracks.num_tracks == 0:
            return np.zeros(tracks.num_tracks)
        chances = self.sensors[sensor].mean_detection(tracks.means, tracks.covs, self.poses[sensor])
        if len(chances) == tracks.num_tracks:
            return chances
        return np.asarray(np.add.reduceat(np.exp(tracks.log_weights) * chances, tracks.offsets[:-1]))


class AlignedLmbs(NamedTuple):
    """LMBs of all sensors on the union of their labels of positive existence."""

    labels: Ints  # (num_labels, 2) increasing
    chosen: Ints  # (num_labels, num_sensors) place in `tracks`, -1 if the sensor lacks the label
    tracks: Tracks  # of all sensors
    logits: Floats  # (num_labels, num_sensors) of existence; a floor if the sensor lacks the label

    @property
    def held(self) -> Bools:
        """True if the sensor has the label, shape (num_labels, num_sensors)."""
        return np.asarray(self.chosen >= 0)


def align_lmbs(sensors: Sequence[Lmb], missing_existence: float) -> AlignedLmbs:
    """Return the sensors' LMBs on the union of their labels.

    If a sensor lacks a label, its existence there is the least of `missing_existence`, in [0, 1), and of the existences
    that it has.
    """
    floor = math.log(missing_existence) - math.log1p(-missing_existence) if missing_existence > 0.0 else -math.inf
    table = stack_tracks([sensor.tracks for sensor in sensors])
    own_logits = np.concatenate([sensor.existence_logit for sensor in sensors])
    known = np.flatnonzero(own_logits > -math.inf)
    labels, row = distinct_labels(table.labels[known])
    owner = np.repeat(np.arange(len(sensors)), [len(sensor.existence_logit) for sensor in sensors])[known]
    chosen, floors = np.full((len(labels), len(sensors)), -1), np.full(len(sensors), floor)
    chosen[row, owner] = known
    np.minimum.at(floors, owner, own_logits[known])
    return AlignedLmbs(labels, chosen, table, np.where(chosen >= 0, own_logits[chosen], floors))


def view_weights(aligned: AlignedLmbs, weights: Floats, views: FieldsOfView, active: Sequence[int]) -> Floats:
    """Return the normalised weight of each sensor at each label, shape (num_labels, len(active)).

    In proportion to w_s P / (1 - .999 P), P = E[P_D^s(l)]. Up to a factor, P / (1 - r P) is the (Fisher) information
    that a scan has about an existence r. For a present target, a sensor that detects it in .98 of its scans has 190
    times the weight of one that detects it in .2, so that many of the latter do not outvote it. The weight is 0 for a
    sensor that cannot observe the label. The mean is over the density of the sensor with the largest existence among
    those that observe the label at their own density (if none does, among all that have it, the first on a tie), so
    that the belief of a blind sensor has no influence. If no sensor that scanned observes a label, sensors are weighted
    by how well they would observe it if they scanned. If none would, those that have the label keep their plain
    weights. weights: (len(active),) of the sensors `active`, positive.
    """
    detection = _detection(aligned, views, active)
    unseen = ~(detection > 0.0).any(axis=1, keepdims=True)
    if unseen.any() and not all(views.scanned):
        detection = np.where(unseen, _detection(aligned, views.if_all_scanned(), active), detection)
        unseen = ~(detection > 0.0).any(axis=1, keepdims=True)
    shares = weights * np.where(unseen, aligned.held, detection / (1.0 - NEAR_CERTAIN_EXISTENCE * detection))
    return np.asarray(shares / sum_over_sensors(shares)[:, None])


def _detection(aligned: AlignedLmbs, views: FieldsOfView, active: Sequence[int]) -> Floats:
    """E[P_D^s(l)] over the density of the surest sensor that observes the label, shape (num_labels, len(active))."""
    table, held = TrackTable.from_kernel(aligned.tracks), aligned.held
    existence = np.where(held, aligned.logits, -math.inf)
    sure = np.full(held.shape, -math.inf)
    for s, sensor in enumerate(active):
        own = held[:, s]
        seen = views.detection_by(sensor, take_tracks(table, aligned.chosen[own, s])) > 0.0
        sure[own, s] = np.where(seen, existence[own, s], -math.inf)
    unseen = (sure == -math.inf).all(axis=1)
    surest = np.where(unseen[:, None], existence, sure).argmax(axis=1)
    return views.detection(take_tracks(table, aligned.chosen[np.arange(len(held)), surest]))[:, list(active)]


def sum_over_sensors(values: Floats) -> Floats:
    """Sums of (num_labels, num_sensors) values over the sensors, added in sensor order, shape (num_labels,).

    NumPy's own sums change the order of addition with the number of terms, so a sensor of zeros would change the
    result.
    """
    total = np.zeros(len(values))
    for column in values.T:
        total += column
    return total


def require_views(field_of_view_weighting: bool, views: FieldsOfView | None, num_sensors: int) -> FieldsOfView | None:
    """Return the fields of view that a fusion uses, None if it uses none. Raises `InputError` if they are missing."""
    if not field_of_view_weighting:
        return None
    if views is None:
        raise InputError(
            "views: expected the fields of view of the sensors, for field_of_view_weighting; got None (trackers "
            "provide them; decisions do not, and use a fusion with plain weights)"
        )
    instance("views", views, FieldsOfView)
    if len(views.sensors) != num_sensors:
        raise InputError(f"views.sensors: expected {num_sensors}, one for each fusion weight; got {len(views.sensors)}")
    return views
