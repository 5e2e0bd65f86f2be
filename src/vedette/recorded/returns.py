"""Extent of targets that give several returns in a scan, learnt from the scans of a recording."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import cdist, pdist
from scipy.special import gammaln, xlogy

from vedette.internal.quantities import PLACED
from vedette.kernels.base.types import Floats, Ints
from vedette.models.scan_rows import values_of
from vedette.recorded.extents import place_stds, places_of
from vedette.recorded.scan_times import RecordedScans, RecordedSensor

_SURE = 20.0  # log likelihood ratio of a learnt extent; independent chance values reach about 10
_MOST_OF = 0.75  # of the largest ratio; the middle of the distances with it is taken
_FEWEST = 10  # groups with evidence
_RUN = 10  # successive scans in which groups are followed
_LOWER = (0.0, 0.1)  # by how much the probability of detection may be below the assumed one
_MOST_SCANS = 100  # that are searched of a sensor
_MOST_RETURNS = 300  # of a scan that is searched
_CANDIDATES = 16  # distances from the 5 % to the 95 % quantile of those at which returns join
_LARGEST = 0.25  # extent, as a share of the longer side of the box around all measurements
_LARGEST_ALONE = 0.05  # the same without another sensor, where groups may be of targets that meet
_DENSER = 2.0  # times as many pairs within an extent as a uniform density has
_FLOOR = 0.02  # least probability of any number at another sensor, of clutter and other targets
_RARE = 0.002  # the same from scan to scan
_GATE = 3.0  # standard deviations of a sensor around the returns of another
_RESOLVED = 2.0  # standard deviations; another sensor tells returns apart that are farther from each other


class ReturnsModel(NamedTuple):
    """Assumed parameters of a sensor that extents are learnt from.

    extent: m, if it is given. stds: noise of each component, rad and m. None: unknown. probability: of detection.
    """

    extent: float | None
    stds: tuple[float, ...] | None
    probability: float


class Extent(NamedTuple):
    """Largest distance between neighbouring returns of one target, m, and the evidence for it, as the end of a note."""

    distance: float
    evidence: str


class PlacedScan(NamedTuple):
    """Places of a scan, (num, 2) m, their standard deviations, m, and the place of the sensor."""

    time: float
    places: Floats
    stds: Floats
    own: Floats


def extents_of(
    recording: RecordedScans, sites: Sequence[RecordedSensor], models: Sequence[ReturnsModel]
) -> list[Extent | None]:
    """Return the extent of targets for each sensor, or None where its measurements are of a target each.

    Returns within a distance of each other are of targets with one return each that are detected independently, or of
    one target. The second holds at the distance with the largest log likelihood ratio, if that is 20 or more. It is
    that of the numbers of returns of another sensor there at the time: one of one target, a binomial number of n
    targets. And of the sensor itself in its next scans: Poisson numbers of one target, binomial numbers of n targets.

    Returns must be twice as dense there as around it, or the groups are those of clutter.
    """
    scans: list[list[PlacedScan]] = []
    if any(model.extent is None for model in models):
        both = enumerate(zip(sites, models, strict=True))
        scans = [placed_scans(recording, s, site, model) for s, (site, model) in both]
    found: list[Extent | None] = []
    for s, model in enumerate(models):
        if model.extent is not None:
            found.append(Extent(model.extent, "as given") if model.extent > 0.0 else None)
            continue
        others = [o for o in range(len(models)) if o != s and models[o].stds is not None and scans[o]]
        tested = list(_tested(scans, s, sites, models, others))
        most = max((ratio for ratio, _ in tested), default=0.0)
        best = [each for ratio, each in tested if ratio >= _MOST_OF * most]
        middle = math.sqrt(best[0].distance * best[-1].distance) if best else 0.0
        found.append(Extent(middle, best[0].evidence) if most >= _SURE else None)
    return found


def _tested(
    scans: Sequence[Sequence[PlacedScan]],
    s: int,
    sites: Sequence[RecordedSensor],
    models: Sequence[ReturnsModel],
    others: Sequence[int],
) -> Iterator[tuple[float, Extent]]:
    """Yield log likelihood ratios and extents of a sensor, in order of distance. others: indices of further sensors."""
    own = _searched(scans[s])
    joins = [linkage(x.places, "single") if 1 < len(x.places) <= _MOST_RETURNS else np.empty((0, 4)) for x in own]
    heights = np.concatenate([each[:, 2] for each in joins] or [np.empty(0)])
    if len(heights) < _FEWEST:
        return
    size = float(np.ptp(np.concatenate([scan.places for scan in own]), axis=0).max())
    gaps = np.concatenate([pdist(scan.places) for scan, each in zip(own, joins, strict=True) if len(each)])
    low, high = np.maximum(np.quantile(heights, [0.05, 0.95]), 1e-9).tolist()
    for distance in np.unique(np.geomspace(low, high, _CANDIDATES)).tolist():
        if distance > _LARGEST * size or not _is_dense(gaps, distance):
            continue
        clusters = [_cut(each, distance, len(scan.places)) for scan, each in zip(own, joins, strict=True)]
        if distance <= _LARGEST_ALONE * size:
            ratio = _by_next_scans(own, clusters, models[s].probability)
            yield ratio, Extent(distance, "their number varies like that of an extended target")
        for o in others:
            ratio = _by_other(own, clusters, scans[o], sites[o].reach, models[o].probability)
            yield ratio, Extent(distance, f"{sites[o].name} has one there")


def groups(places: Floats, distance: float) -> Ints:
    """Return the index of the group of each place, (num,). Neighbours in a group are at most a distance apart."""
    return _cut(linkage(places, "single") if len(places) > 1 else np.empty((0, 4)), distance, len(places))


def _cut(joins: Floats, distance: float, num: int) -> Ints:
    return np.asarray(fcluster(joins, distance, "distance"), np.int64) - 1 if len(joins) else np.arange(num)


def placed_scans(recording: RecordedScans, s: int, site: RecordedSensor, model: ReturnsModel) -> list[PlacedScan]:
    """Return the scans of a sensor in order of time, or none if it measures no places."""
    if site.kind not in PLACED:
        return []
    found = []
    for k, (time, instant) in enumerate(zip(recording.times.tolist(), recording.scans, strict=True)):
        if (scan := instant[s]) is None:
            continue
        places = places_of(scan, recording.poses[k, s], site.kind)
        stds = np.zeros(len(scan)) if model.stds is None else place_stds(site.kind, model.stds, values_of(scan))
        found.append(PlacedScan(time, places, stds, recording.poses[k, s, :2]))
    return found


def _searched(scans: Sequence[PlacedScan]) -> list[PlacedScan]:
    """Return at most a hundred scans, in runs of successive ones that are spread over the recording."""
    if len(scans) <= _MOST_SCANS:
        return list(scans)
    starts = np.linspace(0, len(scans) - _RUN, _MOST_SCANS // _RUN).astype(np.int64)
    return [scans[start + i] for start in starts.tolist() for i in range(_RUN)]


def _is_dense(gaps: Floats, distance: float) -> bool:
    """Return True if pairs within a distance are denser than those up to twice as far. gaps: of all pairs."""
    near, around = int((gaps <= distance).sum()), int(((gaps > distance) & (gaps <= 2.0 * distance)).sum())
    return 3.0 * near >= _DENSER * around


def _centres(scan: PlacedScan, groups: Ints) -> tuple[Floats, Ints]:
    """Return the centres (num, 2) and sizes (num,) of groups."""
    sizes = np.bincount(groups)
    sums = np.column_stack([np.bincount(groups, scan.places[:, axis], len(sizes)) for axis in (0, 1)])
    return sums / np.maximum(sizes, 1)[:, np.newaxis], sizes


def _by_next_scans(scans: Sequence[PlacedScan], groups: Sequence[Ints], probability: float) -> float:
    """Return the log likelihood ratio of one target to several from the sizes of groups in successive scans."""
    chains = [np.array(chain, np.float64) for chain in _chains(scans, groups) if max(chain) > 1 and len(chain) > 1]
    if sum(map(len, chains)) < _FEWEST:
        return 0.0
    one, several = 0.0, np.zeros(len(_LOWER))
    for sizes in chains:
        mean = float(sizes.mean())
        poisson = xlogy(sizes, mean) - mean - gammaln(sizes + 1.0) - math.log(-math.expm1(-mean))
        one += float(np.maximum(poisson, math.log(_RARE)).sum())
        num = np.arange(1.0, sizes.max() + 3.0)
        several += [
            _log_binomial(sizes[:, np.newaxis], num, probability - low, _RARE).sum(axis=0).max() for low in _LOWER
        ]
    return one - float(several.max())


def _chains(scans: Sequence[PlacedScan], groups: Sequence[Ints]) -> list[list[int]]:
    """Return the sizes of groups over at most ten successive scans as long as they stay nearest to each other."""
    ended, open_chains, before = list[list[int]](), list[list[int]](), np.empty((0, 2))
    for k, (scan, own) in enumerate(zip(scans, groups, strict=True)):
        centres, sizes = _centres(scan, own)
        chains = [[size] for size in sizes.tolist()]
        if len(before) and len(centres) and k % _RUN:
            gaps = cdist(before, centres)
            nearest, back = gaps.argmin(axis=1), gaps.argmin(axis=0)
            for j, i in enumerate(back.tolist()):
                if nearest[i] == j:
                    chains[j] = [*open_chains[i], *chains[j]]
                    open_chains[i] = []
        ended += [chain for chain in open_chains if chain]
        open_chains, before = chains, centres
    return ended + open_chains


def _by_other(
    scans: Sequence[PlacedScan], groups: Sequence[Ints], others: Sequence[PlacedScan], reach: float, probability: float
) -> float:
    """Return the log likelihood ratio of one target to several from the numbers of returns of another sensor."""
    times = np.array([scan.time for scan in others])
    tolerance = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    numbers = list[tuple[int, int]]()
    for scan, own in zip(scans, groups, strict=True):
        other = others[int(np.abs(times - scan.time).argmin())]
        if not len(other.places) or abs(other.time - scan.time) > tolerance:
            continue
        centres, sizes = _centres(scan, own)
        for group in np.flatnonzero(sizes >= 2).tolist():
            places = scan.places[own == group]
            radius = float(np.linalg.norm(places - centres[group], axis=1).max())
            if np.linalg.norm(places - other.own, axis=1).max() > reach:
                continue
            gaps = np.linalg.norm(other.places - centres[group], axis=1)
            inside = gaps <= radius + _GATE * other.stds
            if inside.any() and 2.0 * radius > _RESOLVED * other.stds[inside].min():
                numbers.append((int(sizes[group]), int(inside.sum())))
    if len(numbers) < _FEWEST:
        return 0.0
    size, seen = np.array(numbers, np.float64).T
    one = np.where(seen == 1.0, math.log1p(-_FLOOR), math.log(_FLOOR))
    return float((one - _log_binomial(seen, size, probability, _FLOOR)).sum())


def _log_binomial(seen: Floats, num: Floats, probability: float, least: float) -> Floats:
    """Return the log probability to see this number of some targets, given that any is seen, at least `least`."""
    p = min(max(probability, 1e-3), 1.0 - 1e-3)
    choose = gammaln(num + 1.0) - gammaln(seen + 1.0) - gammaln(np.maximum(num - seen, 0.0) + 1.0)
    value = choose + seen * math.log(p) + (num - seen) * math.log1p(-p) - np.log(-np.expm1(num * math.log1p(-p)))
    return np.maximum(np.where(seen > num, -math.inf, value), math.log(least))
