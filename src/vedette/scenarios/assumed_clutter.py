"""The clutter of sensors whose file gives none, estimated from the recording."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from vedette.internal.quantities import COMPONENTS, PLACED
from vedette.kernels.base.types import Floats
from vedette.models.scan_rows import values_of
from vedette.recorded import RecordedScans
from vedette.recorded.extents import place_stds, places_of
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.sensing import Measurement

_SPEED_FACTOR = 1.5  # a neighbour may move at up to this number of times the speed that targets hardly exceed
_NOISE_RADIUS = 2.5 * math.sqrt(2.0)  # noise stds between two measurements of a target that stands still
_RING_FACTOR = 3.0  # radius of the ring in which chance neighbours are counted, in radii of a neighbourhood
_MAX_STANDARD_ERROR = 0.25  # standard error of the share of measurements that are of targets, at most
_ESTIMATED = "estimated from the measurements without a neighbour in the scans before and after"
_HALF = "half of the measurements, as the recording is too short, or has no positions, to estimate it"
_MIN_RATE = 0.1  # per scan; the lowest rate that is assumed


class PlacedScan(NamedTuple):
    """A scan as places."""

    time: float  # s
    places: Floats  # (num, 2) m
    stds: Floats  # (num,) noise of each place, m
    detection: Floats  # (num,) probability of detection there


def target_share(scans: Sequence[PlacedScan], speed: float) -> float:
    """Return the share of a sensor's measurements that come from targets; NaN if the recording has too little evidence.

    A target that is detected at one scan has a neighbour at the next with the probability of detection; a false
    measurement has one only by chance. Let h_i be 1 if measurement i has a neighbour in an adjacent scan, else 0, and
    let q_i be the probability that it has no chance neighbour. The mean of a_i = h_i - 1 + q_i over measurements and
    adjacent scans, divided by the mean of q_i, is the share times P_D. The product of a_i for the scan before and that
    for the scan after gives the share times P_D^2 in the same way, and so P_D itself, which is used if it exceeds the
    given one. Each q_i is estimated from the ring around the neighbourhood as (1 - 1/8)^n with n measurements in the
    ring, which is unbiased for a Poisson number of uniform density there. Measurements are left out if their ring is
    wider than the area of all measurements.

    Args:
        scans: the sensor's scans, in order of time.
        speed: m/s that targets hardly exceed.
    """
    from scipy.spatial import KDTree

    trees, max_radius = [KDTree(scan.places.reshape(-1, 2)) for scan in scans], _half_extent(scans)
    single, double = np.zeros(2), np.zeros(2)  # sums of a_i and q_i; of their products over both sides
    num, expected = 0, 0.0
    for k, scan_k in enumerate(scans):
        sides = [j for j in (k - 1, k + 1) if 0 <= j < len(scans)] if len(scan_k.places) else []
        terms = [_terms(scan_k, trees[j], speed * abs(scans[j].time - scan_k.time), max_radius) for j in sides]
        single += sum(each.sum(axis=1) for each in terms)
        if len(terms) == 2:
            double += (terms[0] * terms[1]).sum(axis=1)
        expected += sum(float((each[1] * scan_k.detection).sum()) for each in terms)
        num += sum(int(np.count_nonzero(each[1])) for each in terms)
    if expected <= 0.0 or 0.5 * math.sqrt(num) > _MAX_STANDARD_ERROR * expected:
        return math.nan
    repeated = max(single[0] / single[1], 0.0)
    detection = expected / single[1]
    if repeated > 0.0 and double[1] > 0.0:
        detection = max(detection, min(double[0] / double[1] / repeated, 1.0))
    return float(min(repeated / detection, 1.0))


def _half_extent(scans: Sequence[PlacedScan]) -> float:
    """Half the side of the square that is as large as the box around all places, m."""
    places = np.concatenate([np.empty((0, 2)), *(scan.places.reshape(-1, 2) for scan in scans)])
    return 0.5 * math.sqrt(np.prod(np.ptp(places, axis=0))) if len(places) else 0.0


def _terms(scan: PlacedScan, tree: Any, max_motion: float, max_radius: float) -> Floats:
    """Return a_i and q_i of each measurement, shape (2, num), with the places of an adjacent scan.

    Zeros if the ring is wider than `max_radius`, m. max_motion: how far targets move between the two scans, m.
    """
    radii = _NOISE_RADIUS * scan.stds + _SPEED_FACTOR * max_motion
    num_near, num_in_ring = (
        tree.query_ball_point(scan.places, scale * radii, return_length=True) for scale in (1.0, _RING_FACTOR)
    )
    prob_alone = (1.0 - 1.0 / (_RING_FACTOR**2 - 1.0)) ** (num_in_ring - num_near)
    return np.array([(num_near > 0) - 1.0 + prob_alone, prob_alone]) * (_RING_FACTOR * radii <= max_radius)


def assumed_clutter(
    given: Mapping[str, Any],
    model: ScenarioModel,
    recording: RecordedScans,
    folder: FilePath,
    speed: float,
    descriptions: dict[str, str],
) -> dict[str, Any]:
    """Return the section `sensors`, with a clutter rate where none is given; adds its origin to `descriptions`."""
    defaults = given.get("sensor_defaults")
    shared = isinstance(defaults, Mapping) and "clutter" in defaults
    sensors, rates = [], dict[str, list[str]]()
    for s, sensor in enumerate(given["sensors"]):
        if shared or "clutter" in sensor:
            sensors.append(sensor)
            continue
        rate, method = _rate(model, recording, s, folder, speed)
        clutter = {"kind": "region", "rate": rate, **_clutter_limit(model.sensors[s].measurement, recording, s)}
        sensors.append({**sensor, "clutter": clutter})
        rates.setdefault(method, []).append(f"{model.sensor_names[s]} {rate:g}")
    if rates:
        descriptions["clutter"] = "; ".join(f"{', '.join(each)} per scan ({method})" for method, each in rates.items())
    return {"sensors": sensors}


def _clutter_limit(measurement: Measurement, recording: RecordedScans, s: int) -> dict[str, float]:
    """Return the limit of range rate or height of clutter: a tenth above the largest value in the recording.

    Without an entry folded range rates are uniform over their interval.
    """
    names = COMPONENTS[measurement.kind]
    component = next((name for name in names if name in ("range_rate", "altitude")), None)
    if component is None or getattr(measurement, "max_unambiguous_range_rate", None) is not None:
        return {}
    place = names.index(component)
    values = [np.empty(0), *(measured[:, place] for measured in recording.measured(s))]
    largest = float(f"{1.1 * np.abs(np.concatenate(values)).max(initial=0.0):.3g}")
    return {"max_range_rate" if component == "range_rate" else "max_height": max(1.0, largest)}


def _rate(model: ScenarioModel, recording: RecordedScans, s: int, folder: FilePath, speed: float) -> tuple[float, str]:
    """Return the clutter rate of a sensor, per scan, and how it was estimated."""
    counts = list(map(len, recording.measured(s)))
    if not counts:
        return 1.0, "no scan in the recording"
    share, method = target_share(_placed_scans(model, recording, s, folder), speed), _ESTIMATED
    if math.isnan(share):
        share, method = 0.5, _HALF
    return max(_MIN_RATE, round((1.0 - share) * float(np.mean(counts)), 2)), method


def _placed_scans(model: ScenarioModel, recording: RecordedScans, s: int, folder: FilePath) -> list[PlacedScan]:
    """Return the scans of a sensor as places; none if it measures no places or its noise is unknown."""
    section = model.sensors[s]
    sensor = section.build(model.region.build(), model.filter.gaussian_method, folder, model.motion.components)
    kind, stds, placed = section.measurement.kind, sensor.noise.least_stds, list[PlacedScan]()
    if kind not in PLACED or stds is None:
        return placed
    for time, scans, poses in zip(recording.times.tolist(), recording.scans, recording.poses, strict=True):
        if (scan := scans[s]) is None:
            continue
        places = places_of(scan, poses[s], kind)
        states = np.zeros((len(places), len(model.motion.components)))
        states[:, :2] = places
        detection = sensor.detection.prob(states, poses[s]) if len(places) else np.empty(0)
        placed.append(PlacedScan(time, places, place_stds(kind, stds, values_of(scan)), detection))
    return placed
