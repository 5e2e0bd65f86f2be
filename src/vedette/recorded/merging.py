"""Merging of several measurements of one target in a scan, as filters assume points with one measurement each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, QUANTITIES
from vedette.internal.text import pluralise, shown
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.row_noise import measured_part
from vedette.recorded.scan_times import RecordedScans, RecordedSensor, with_wrapped_angles

_CLOSE = 3.0  # noise standard deviations between two measurements of one target
_FEWEST = 10  # fewest scans for a result


def merged(
    recording: RecordedScans, sites: Sequence[RecordedSensor], stds: Sequence[Sequence[float] | None], distance: float
) -> RecordedScans:
    """Return the recording with the measurements of each cluster of a scan replaced by their mean.

    Args:
        recording: the result has notes with the numbers of measurements and their spread, for each sensor.
        sites: the sensors.
        stds: for each sensor the standard deviation of each component, rad and m; None: unknown.
        distance: largest between two measurements of one cluster, in standard deviations; clusters are chains of them.

    Raises:
        InputError: a sensor whose standard deviations are unknown.
    """
    scans, texts = [list(own) for own in recording.scans], list[str]()
    accuracy = [list(own) for own in recording.accuracy]
    for s, (site, own) in enumerate(zip(sites, stds, strict=True)):
        if own is None:
            expected = (
                f"range_dependent, constant or by_axis noise of {shown(site.name)}, whose standard deviations count"
            )
            raise InputError(f"merge: expected {expected}; got custom noise")
        before, after, offsets = 0, 0, [np.empty((0, len(own)))]
        for k, instant in enumerate(scans):
            if (scan := instant[s]) is None:
                continue
            clusters = _clusters(scan, site.kind, np.array(own), distance)
            means, off = _means(scan, site.kind, clusters, len(own))
            if accuracy and (columns := accuracy[k][s]) is not None:
                accuracy[k][s] = _mean_accuracy(columns, recording.accuracy_columns[s], clusters)
            before, after = before + len(scan), after + len(means)
            offsets.append(off)
            instant[s] = means
        if after < before:
            texts.append(_told(site, before, after, np.concatenate(offsets)))
    notes = (*recording.notes, *texts)
    return replace(recording, scans=tuple(map(tuple, scans)), accuracy=tuple(map(tuple, accuracy)), notes=notes)


def _told(site: RecordedSensor, before: int, after: int, offsets: Floats) -> str:
    """Describe the numbers before and after merging, and the root mean square of the offsets from the means."""
    units = [(QUANTITIES[name].per_si, QUANTITIES[name].unit) for name in COMPONENTS[site.kind]]
    spread = np.sqrt((offsets**2).mean(axis=0)) if len(offsets) else np.zeros(len(units))
    parts = [
        f"{name} {unit * value:.3g} {word}"
        for name, (unit, word), value in zip(COMPONENTS[site.kind], units, spread.tolist(), strict=True)
    ]
    spread_of = f"spread {', '.join(parts)}; its noise should cover that"
    return f"{site.name}: {pluralise(before, 'measurement')} merged into {after}, {spread_of}"


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


def _means(scan: Floats, kind: str, clusters: Ints, meas_dim: int) -> tuple[Floats, Floats]:
    """Return the mean of each cluster of a scan, and offsets from it in clusters of several measurements.

    Noise that rows bring is averaged, too: the measurements of an extended target are not independent.
    """
    means, offsets = list[Floats](), [np.empty((0, meas_dim))]
    for cluster in range(int(clusters.max(initial=-1)) + 1):
        own = scan[clusters == cluster]
        off = with_wrapped_angles(own - own[0], kind)
        means.append(with_wrapped_angles(own[:1] + off.mean(axis=0), kind)[0])
        if len(own) > 1:
            offsets.append(measured_part(off - off.mean(axis=0), meas_dim))
    return np.array(means).reshape(-1, scan.shape[1]), np.concatenate(offsets)


def _clusters(scan: Floats, kind: str, stds: Floats, distance: float) -> Ints:
    """Return the index of the cluster of each measurement, (num,)."""
    from scipy.sparse.csgraph import connected_components

    if not len(scan):
        return np.empty(0, np.int64)
    return np.asarray(connected_components(_close(scan, kind, stds, distance), directed=False)[1], np.int64)


def _close(scan: Floats, kind: str, stds: Floats, distance: float) -> Bools:
    """Return True for each pair of measurements within a number of standard deviations, (num, num)."""
    measured = measured_part(scan, len(stds))
    gaps = with_wrapped_angles(measured[:, None] - measured[None], kind) / stds
    return np.asarray((gaps**2).sum(axis=2) <= distance**2)


def crowded(
    recording: RecordedScans, sites: Sequence[RecordedSensor], stds: Sequence[Sequence[float] | None]
) -> Iterator[tuple[RecordedSensor, int, int]]:
    """Yield sensors with two measurements within three standard deviations in most scans: number of these, and of all.

    The arguments are those of `merged`. Sensors with unknown noise, or fewer than ten scans, are left out.
    """
    for s, (site, own) in enumerate(zip(sites, stds, strict=True)):
        scans = [scan for instant in recording.scans if (scan := instant[s]) is not None]
        if own is None or len(scans) < _FEWEST:
            continue
        pairs = [bool(_close(scan, site.kind, np.array(own), _CLOSE).sum() > len(scan)) for scan in scans]
        if 2 * sum(pairs) > len(pairs):
            yield site, sum(pairs), len(pairs)
