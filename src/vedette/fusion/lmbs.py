"""Several LMBs on the union of their labels, and the weights that sensors have at each label."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.densities import TrackTable
from vedette.densities.label_sets import take_tracks
from vedette.errors import InputError
from vedette.fusion.views import Views
from vedette.kernels.base.types import Bools, Floats, Ints, Lmb, Tracks
from vedette.kernels.labelled.stacking import stack_tracks
from vedette.models.arguments import instance

# At which existence a scan's information is taken: at 1 that of a sensor which misses nothing is infinite.
SURE_EXISTENCE = 0.999


class AlignedLmbs(NamedTuple):
    """All sensors on the union of their labels of positive existence."""

    labels: Ints  # (num_labels, 2) increasing
    chosen: Ints  # (num_labels, num_sensors) place in `tracks`, -1 where the sensor lacks the label
    tracks: Tracks  # of all sensors
    logits: Floats  # (num_labels, num_sensors) of existence; a floor where the sensor lacks the label

    @property
    def held(self) -> Bools:
        """(num_labels, num_sensors) whether the sensor has the label."""
        return np.asarray(self.chosen >= 0)


def align_lmbs(sensors: Sequence[Lmb], missing_existence: float) -> AlignedLmbs:
    """Sensors' LMBs on the union of their labels.

    Where a sensor lacks a label, its existence there is the least of `missing_existence`, in [0, 1), and of those that
    it has.
    """
    floor = math.log(missing_existence) - math.log1p(-missing_existence) if missing_existence > 0.0 else -math.inf
    places = [_places(sensor) for sensor in sensors]
    labels = sorted(set().union(*places))
    chosen, logits = np.full((len(labels), len(sensors)), -1), np.empty((len(labels), len(sensors)))
    start = 0
    for s, sensor in enumerate(sensors):
        own = np.array([place for place, label in enumerate(labels) if label in places[s]], np.int64)
        tracks = np.array([places[s][labels[place]] for place in own.tolist()], np.int64)
        logits[:, s] = min(floor, float(sensor.existence_logit[tracks].min(initial=math.inf)))
        logits[own, s] = sensor.existence_logit[tracks]
        chosen[own, s] = start + tracks
        start += len(sensor.existence_logit)
    table = stack_tracks([sensor.tracks for sensor in sensors])
    return AlignedLmbs(np.array(labels, np.int64).reshape(-1, 2), chosen, table, logits)


def _places(lmb: Lmb) -> dict[tuple[int, int], int]:
    """Place of each label of positive existence."""
    labels = lmb.tracks.labels.tolist()
    return {(labels[i][0], labels[i][1]): i for i in np.flatnonzero(lmb.existence_logit > -math.inf).tolist()}


def weights_by_view(aligned: AlignedLmbs, weights: Floats, views: Views, active: Sequence[int]) -> Floats:
    """(num_labels, len(active)) weights that each sensor has at each label, made to sum to one.

    In proportion to w_s P / (1 - .999 P), P = E[P_D^s(l)]. P / (1 - r P) is, up to a factor, the information (Fisher's)
    that a scan has of an existence r: where a target is there, a sensor that detects it in .98 of its scans says 190
    times as much by detecting it or not as one that does in .2, so that many of these do not outvote it. 0 for a sensor
    that cannot see the label. The mean is over the density of the sensor that is surest of the label, among those that
    see it where they have it (of all that have it, where none does; of equals the first), so that what a blind sensor
    believes changes nothing. Where nobody who scanned sees a label, sensors count by how well they would see it if they
    scanned; where nobody would, those that have it keep their plain weights.
    weights: (len(active),) of the sensors `active`, positive.
    """
    detection = _detection(aligned, views, active)
    unseen = ~(detection > 0.0).any(axis=1, keepdims=True)
    if unseen.any() and not all(views.scanned):
        detection = np.where(unseen, _detection(aligned, views.if_all_scanned(), active), detection)
        unseen = ~(detection > 0.0).any(axis=1, keepdims=True)
    shares = weights * np.where(unseen, aligned.held, detection / (1.0 - SURE_EXISTENCE * detection))
    return np.asarray(shares / sum_over_sensors(shares)[:, None])


def _detection(aligned: AlignedLmbs, views: Views, active: Sequence[int]) -> Floats:
    """(num_labels, len(active)) E[P_D^s(l)] over the density of the surest that sees the label."""
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
    """(num_labels,) sums of (num_labels, num_sensors) values, one sensor after the other.

    NumPy's own sums add in another order where there are more terms: a sensor of nothing but zeros would change them.
    """
    total = np.zeros(len(values))
    for column in values.T:
        total += column
    return total


def require_views(by_views: bool, views: Views | None, num_sensors: int) -> Views | None:
    """The views that a fusion goes by, None where it goes by none. Raises `InputError` where they are missing."""
    if not by_views:
        return None
    if views is None:
        raise InputError(
            "views: expected the views of the sensors, as the fusion weights labels by_views; got None (a tracker "
            "knows them; decisions do not, and go by a fusion of plain weights)"
        )
    instance("views", views, Views)
    if len(views.sensors) != num_sensors:
        raise InputError(f"views.sensors: expected {num_sensors}, one for each fusion weight; got {len(views.sensors)}")
    return views
