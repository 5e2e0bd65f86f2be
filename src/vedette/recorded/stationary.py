"""Places that give measurements all through a recording, such as land, buoys and anchored ships."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from vedette.internal.text import pluralise
from vedette.kernels.base.types import Bools, Floats
from vedette.recorded.returns import ReturnsModel, groups, placed_scans
from vedette.recorded.scan_times import RecordedScans, RecordedSensor

_REACH = 3.0  # standard deviations of a measurement of a place around it
_PARTS = 10  # of a recording, or more; a stationary place is measured in nearly all
_SCANS_A_PART = (8, 20)  # at least, as a shorter recording shows nothing; at most, as lanes of traffic come and go
_PRESENT = 0.8  # share of the parts, with the first two and the last two
_DENSER = 3.0  # times as many measurements in each half as in the ring up to three times as far, for the same area
_SURE = 6.0  # standard deviations of this number above it
_MOST = 5000  # measurements that are searched


def stationary_places(
    recording: RecordedScans, s: int, site: RecordedSensor, model: ReturnsModel
) -> tuple[Floats, list[Bools]]:
    """Return the (num, 2) places that a sensor measures all through a recording, and the measurements of them.

    The latter are (num_measurements,) for each scan of the sensor. Places are on the ground, also of a sensor that
    moves. Ships that arrive and anchor are no such place, as they miss in the first part of the recording.
    """
    scans = placed_scans(recording, s, site, model)
    none = np.empty((0, 2)), [np.zeros(len(scan.places), np.bool_) for scan in scans]
    places = np.concatenate([np.empty((0, 2)), *(scan.places for scan in scans)])
    if model.stds is None or len(scans) < _PARTS * _SCANS_A_PART[0] or not len(places):
        return none
    reach = _REACH * np.concatenate([scan.stds for scan in scans])
    num = max(_PARTS, len(scans) // _SCANS_A_PART[1])
    part = np.repeat(np.arange(len(scans)) * num // len(scans), [len(scan.places) for scan in scans])
    tree, found = cKDTree(places), list[int]()
    mean = math.pi * len(places) / max(float(np.prod(np.ptp(places, axis=0))), 1e-300)
    for i in np.unique(np.linspace(0, len(places) - 1, min(len(places), _MOST)).astype(np.int64)).tolist():
        near = tree.query_ball_point(places[i], reach[i])
        parts = np.unique(part[near])
        if len(parts) < _PRESENT * num or parts[0] > 1 or parts[-1] < num - 2:
            continue
        ring = tree.query_ball_point(places[i], _REACH * reach[i], return_length=True) - len(near)
        expected = max(ring / (_REACH**2 - 1.0), mean * reach[i] ** 2)  # the ring may be cut at an edge
        in_half = int(np.bincount(2 * part[near] // num, minlength=2).min())
        if in_half > _DENSER * 0.5 * expected + _SURE * math.sqrt(0.5 * expected):
            found.append(i)
    if not found:
        return none
    clusters = groups(places[found], float(np.median(reach[found])))
    centres = np.array([places[found][clusters == each].mean(axis=0) for each in np.unique(clusters)])
    is_near = cKDTree(centres).query(places)[0] <= reach
    return centres, np.split(is_near, np.cumsum([len(scan.places) for scan in scans])[:-1])


def without_stationary(
    recording: RecordedScans, sites: Sequence[RecordedSensor], models: Sequence[ReturnsModel]
) -> RecordedScans:
    """Return a recording without the measurements of stationary places, and with a note of their number."""
    scans, accuracy = [list(own) for own in recording.scans], [list(own) for own in recording.accuracy]
    texts = list[str]()
    for s, (site, model) in enumerate(zip(sites, models, strict=True)):
        centres, masks = stationary_places(recording, s, site, model)
        own = [k for k, instant in enumerate(recording.scans) if instant[s] is not None]
        for k, mask in zip(own, masks, strict=False):
            scan, columns = scans[k][s], accuracy[k][s] if accuracy else None
            assert scan is not None
            scans[k][s] = scan[~mask]
            if columns is not None:
                accuracy[k][s] = columns[~mask]
        if len(centres):
            num = sum(int(mask.sum()) for mask in masks)
            where = f"{pluralise(len(centres), 'place')} that {'is' if len(centres) == 1 else 'are'} measured"
            texts.append(f"{site.name}: {pluralise(num, 'measurement')} at {where} all through are left out")
    notes = (*recording.notes, *texts)
    return replace(recording, scans=tuple(map(tuple, scans)), accuracy=tuple(map(tuple, accuracy)), notes=notes)
