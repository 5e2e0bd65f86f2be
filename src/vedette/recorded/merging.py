"""Merging of several returns of one target in a scan, as filters assume points with one measurement each."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vedette.internal.quantities import is_position
from vedette.kernels.base.types import Floats, Ints
from vedette.models.scan_rows import ScanLike, ScanRows, values_of, with_added_noise
from vedette.recorded.extents import places_of
from vedette.recorded.returns import Extent, groups
from vedette.recorded.scan_times import RecordedScans, RecordedSensor, with_wrapped_angles


class Spread(NamedTuple):
    """Number of returns, and the sum of their squared distances from the mean of their target, m^2."""

    num: int = 0
    squares: float = 0.0

    def __add__(self, other: Any) -> "Spread":
        return Spread(self.num + other.num, self.squares + other.squares)

    @property
    def std(self) -> float:
        """Standard deviation of a return on each axis, m, or 0 without returns."""
        return math.sqrt(self.squares / (2 * max(self.num, 1)))

    def added_to(self, scan: ScanLike, kind: str) -> ScanRows:
        """Return the scan with noise that has grown by that of a single return."""
        return with_added_noise(scan, _spread_covs(values_of(scan), kind, self.std))


def merged(
    recording: RecordedScans, sites: Sequence[RecordedSensor], extents: Sequence[Extent | None]
) -> RecordedScans:
    """Return the recording with the returns of one target in a scan replaced by their mean.

    Returns within the extent of each other, directly or through others, are of one target. As a single return may lie
    anywhere on it, the noise of all measurements of the sensor grows by the mean square distance of a return from its
    mean, for each axis. The result has a note for each sensor with merged measurements.
    """
    scans, texts = [list(own) for own in recording.scans], list[str]()
    accuracy = [list(own) for own in recording.accuracy]
    for s, (site, extent) in enumerate(zip(sites, extents, strict=True)):
        if extent is None:
            continue
        spread, after = Spread(), 0
        for k, instant in enumerate(scans):
            if (scan := instant[s]) is None:
                continue
            means, clusters, own_spread = merged_scan(scan, recording.poses[k, s], site.kind, extent.distance)
            instant[s], spread, after = means, spread + own_spread, after + len(means)
            if accuracy and (columns := accuracy[k][s]) is not None:
                accuracy[k][s] = _mean_accuracy(columns, recording.accuracy_columns[s], clusters)
        if after == spread.num:
            continue
        for instant in scans:
            if (scan := instant[s]) is not None:
                instant[s] = spread.added_to(scan, site.kind)
        texts.append(
            f"{site.name}: returns of a scan within {extent.distance:.3g} m of each other are taken for one target "
            f"({extent.evidence}): {spread.num} measurements became {after}, their noise grew by {spread.std:.2g} m "
            "(`extent: 0` for the sensor keeps them apart)"
        )
    notes = (*recording.notes, *texts)
    return replace(recording, scans=tuple(map(tuple, scans)), accuracy=tuple(map(tuple, accuracy)), notes=notes)


def merged_scan(scan: ScanLike, pose: Floats, kind: str, distance: float) -> tuple[ScanLike, Ints, Spread]:
    """Return the means of the returns of each target in a scan, the target of each return, and their spread."""
    places = places_of(scan, pose, kind)
    clusters = groups(places, distance)
    means = _means(scan, kind, clusters)
    offsets = places - places_of(means, pose, kind)[clusters]
    return means, clusters, Spread(len(scan), float((offsets**2).sum()))


def _spread_covs(scan: Floats, kind: str, spread: float) -> Floats:
    """Return the covariance of a place with a standard deviation in m, in the components of measurements."""
    covs = np.zeros((*scan.shape, scan.shape[1]))
    covs[:, 1, 1] = spread**2
    covs[:, 0, 0] = spread**2 if is_position(kind) else (spread / np.maximum(scan[:, 1], spread)) ** 2
    return covs


def _mean_accuracy(accuracy: Floats, columns: Sequence[str], clusters: Ints) -> Floats:
    """Return the columns of accuracy of each cluster.

    They are root mean squares of standard deviations, means of others, and a class if all agree.
    """
    is_std = np.array([name.endswith("_std") for name in columns])
    powers = np.where(is_std, accuracy**2, accuracy)
    means = np.array([powers[clusters == cluster].mean(axis=0) for cluster in range(int(clusters.max(initial=-1)) + 1)])
    means = means.reshape(-1, len(columns))
    if "class" in columns:  # an index, of no class where they differ
        k = columns.index("class")
        for cluster, mean in enumerate(means):
            own = accuracy[clusters == cluster, k]
            mean[k] = own[0] if (own == own[0]).all() else np.nan
    return np.where(is_std, np.sqrt(np.where(is_std, means, 1.0)), means)


def _means(scan: ScanLike, kind: str, clusters: Ints) -> ScanLike:
    """Return the mean of each cluster of a scan.

    What rows bring is averaged, too: the measurements of an extended target are not independent.
    """
    values, members = values_of(scan), [clusters == cluster for cluster in range(int(clusters.max(initial=-1)) + 1)]
    means = np.empty((len(members), values.shape[1]))
    for mean, own in zip(means, (values[each] for each in members), strict=True):
        mean[:] = with_wrapped_angles(own[0] + with_wrapped_angles(own - own[0], kind).mean(axis=0), kind)
    if not isinstance(scan, ScanRows):
        return means
    brought = scan.to_kernel()[1:]
    return ScanRows(means, *(np.array([x[own].mean(axis=0) for own in members]) if len(x) else None for x in brought))
