"""Initial guess for calibration: biases and noise that fit the matched measurements of tracks."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vedette.calibration.parameters import Problem
from vedette.calibration.registration import (
    BIASES,
    MOST_FITTED,
    SCANS_A_PIECE,
    MatchedMeasurements,
    Registration,
    fitted,
    groups_with_common_targets,
    is_one_place,
    match_measurements,
    register,
)
from vedette.internal.quantities import COMPONENTS, QUANTITIES
from vedette.kernels.base.types import Floats

_LONG = 10  # scans of a track whose share of detections counts
_UNEVEN = 4.0  # dispersion above which targets are not detected equally often
_NEARER = 3.0  # multiple of the estimated noise, in the next round
_MANY_SCANS = 20  # of a long straight piece
_LASTING = 2.0  # ratio of errors about long and short pieces above which errors last; of white noise 1.1 to 1.7
_CHANGES = 10.0  # of a mode in a recording, for a first standard deviation of its parameters
_BIRTHS = 0.5, 5.0  # births and scans that the gamma prior of their rate counts for, as in tracking
NO_SHARED = "no other sensor observes enough of the same targets"
_OTHER_MOTION = "another motion of the targets than assumed"
_BY_MOTION = {  # biases that need a second sensor at another place: effect that looks the same without one
    ("bearing",): "a rotation of all targets",
    ("range",): _OTHER_MOTION,
    ("elevation", "altitude"): _OTHER_MOTION,
}


class Guess(NamedTuple):
    """Initial guess.

    free, stds: values of all parameters on their scales, and expected standard deviations. apart: sensors that share no
    targets with the others. held: parameters that stay at their start values, and why they are not identifiable.
    births: expected births per scan.
    """

    free: Floats
    stds: Floats
    apart: list[int]
    held: dict[int, str]
    births: float


def initial_guess(problem: Problem, said: Floats, asked: Sequence[int], progress: Callable[[], None]) -> Guess:
    """Return an initial guess of the parameters, and of the biases among `asked`.

    The recording is tracked with noise as wide as the biases may be, then with narrower noise. Biases are fitted each
    time, except those that the measurements matched this time leave to the assumed motion.
    """
    values, sites = problem.values(said), problem.sites
    # The initial guess leaves out range rates: their noise is as wide as their bias may be.
    places, wide, unknown = {}, QUANTITIES["range_rate"].far, np.ones((len(sites), len(BIASES)))
    for i in asked:
        each = problem.parameters[i]
        if each.kind == "bias" and each.component in BIASES:
            places[i] = at = each.sensor, BIASES.index(each.component)
            unknown[at] = each.unknown / abs(each.per_si)
    stds, births = _widest(problem, values, asked), problem.births
    for _ in range(3):
        recording = problem.without_biases(values)
        progress()
        tracker, _ = problem.tracker(_with_noise(problem, values, stds, wide), births)
        pairs = match_measurements(tracker, recording, sites, stds)
        groups = groups_with_common_targets(pairs, len(sites))
        by_motion = _biases_by_motion(problem, pairs, groups)
        fitting = np.zeros(unknown.shape, bool)
        for i, at in places.items():
            fitting[at] = i not in by_motion
        found = register(pairs, sites, fitting, unknown, stds, _period(problem))
        for i, at in places.items():
            each = problem.parameters[i]
            values[i] = each.start if i in by_motion else values[i] + each.per_si * found.biases[at]
        stds = np.minimum(stds, _NEARER * found.stds)
        births = (_BIRTHS[0] + pairs.in_view.shape[1]) / (_BIRTHS[1] + len(recording.times))
    values = _with_counts(problem, _with_noise(problem, values, found.stds, None), pairs)
    expected = _expected_stds(problem, values, pairs)
    for i, at in places.items():
        expected[i] = abs(problem.parameters[i].per_si) * found.bias_stds[at]
    apart = [s for group in groups if group != groups[0] or len(group) == 1 for s in group]
    reasons = by_motion | _uneven_detection(problem, pairs) | _lasting(problem, pairs, apart, found)
    held = {i: why for i, why in reasons.items() if i in asked}
    return Guess(problem.free(values.tolist()), expected, apart, held, births)


def _widest(problem: Problem, values: Floats, asked: Sequence[int]) -> Floats:
    """(num_sensors, MOST_FITTED) standard deviations of measurements with biases as large as they may be, in SI."""
    names = [(MOST_FITTED * COMPONENTS[site.kind])[:MOST_FITTED] for site in problem.sites]
    stds = np.array([[QUANTITIES[name].far for name in own] for own in names])
    for i, each in enumerate(problem.parameters):
        if each.kind == "noise" and each.component in names[each.sensor]:
            stds[each.sensor, names[each.sensor].index(each.component)] = _NEARER * abs(values[i] / each.per_si)
    for i in asked:
        each = problem.parameters[i]
        if each.kind == "bias" and each.component in names[each.sensor]:
            at = each.sensor, names[each.sensor].index(each.component)
            stds[at] = math.hypot(stds[at], _NEARER * each.usual / each.per_si)
    return stds


def _expected_stds(problem: Problem, values: Floats, pairs: MatchedMeasurements) -> Floats:
    """(num_parameters,) standard deviations on the scales, from the numbers of measurements, or the prior of a bias."""
    hits = np.maximum(np.bincount(pairs.sensors, minlength=len(problem.sites)), 1)
    stds = np.array([each.unknown for each in problem.parameters])
    for i, each in enumerate(problem.parameters):
        num = {"noise": 2.0 * hits[each.sensor], "detection": hits[each.sensor] * (1.0 - values[i])}
        num |= {"clutter": values[i] * pairs.scans[each.sensor], "motion": _CHANGES}
        if each.kind in num:
            stds[i] = 1.0 / math.sqrt(max(float(num[each.kind]), 1.0))
    return stds


def _period(problem: Problem) -> float:
    """Return the mean period of the slowest sensor, s."""
    recording = problem.recording
    nums = [sum(scans[s] is not None for scans in recording.scans) for s in range(len(problem.sites))]
    return max(1e-3, float(recording.times[-1])) / max(1, min(num for num in nums if num))


def _with_noise(problem: Problem, values: Floats, stds: Floats, rates: float | None) -> Floats:
    """Return the values with noise of these standard deviations, (num_sensors, MOST_FITTED).

    rates: the same for range rates, m/s. None: as assumed.
    """
    values = values.copy()
    for i, each in enumerate(problem.parameters):
        if each.kind == "noise" and each.component != "extent":
            names = fitted(problem.sites[each.sensor].kind)
            own = stds[each.sensor, names.index(each.component)] if each.component in names else rates
            values[i] = each.start if own is None else abs(each.per_si) * own
    return values


def _with_counts(problem: Problem, values: Floats, pairs: MatchedMeasurements) -> Floats:
    """Return the values with detection probabilities and clutter rates from the matched tracks and measurements."""
    values, hits = values.copy(), np.bincount(pairs.sensors, minlength=len(problem.sites))
    in_view = np.maximum(pairs.in_view.sum(axis=1), hits)
    for i, each in enumerate(problem.parameters):
        s = each.sensor
        if each.kind == "detection" and hits[s]:
            values[i] = min(max(hits[s] / in_view[s], 0.05), 0.98)
        elif each.kind == "clutter" and pairs.scans[s]:
            values[i] = max(pairs.false[s] / pairs.scans[s], 0.01)
    return values


def _biases_by_motion(problem: Problem, pairs: MatchedMeasurements, groups: Sequence[Sequence[int]]) -> dict[int, str]:
    """Return the biases that would follow from the assumed motion of the targets alone, and what looks the same.

    They are those of a sensor that shares no targets with a sensor at another place. Of several sensors at one place
    they are those of the first, which the others are compared with. A sensor that measures positions suffices anywhere.

    groups: of sensors that share targets.
    """
    kinds, found = [COMPONENTS[site.kind] for site in problem.sites], dict[int, str]()
    alone = len(problem.sites) == 1
    lacking = "there is no other sensor" if alone else f"{NO_SHARED} from another place"
    for group in groups:
        if any("x" in kinds[s] for s in group) or not is_one_place(pairs, group):
            continue
        for names, effect in _BY_MOTION.items():
            first = next((s for s in group if {*names} & {*kinds[s]}), None)
            for i, each in enumerate(problem.parameters):
                if each.sensor == first and each.kind == "bias" and each.component in names:
                    found[i] = f"{lacking} to separate it from {effect}"
    return found


def _uneven_detection(problem: Problem, pairs: MatchedMeasurements) -> dict[int, str]:
    """Return the probabilities of detection that differ from target to target, and by how much."""
    found = dict[int, str]()
    for i, each in enumerate(problem.parameters):
        if each.kind == "detection" and (ratio := dispersion(pairs, each.sensor)) > _UNEVEN:
            found[i] = (
                f"targets are not detected equally often (their numbers vary {ratio:.0f} times as much as with one "
                "probability), as with objects at rest and echoes that come and go"
            )
    return found


def _lasting(problem: Problem, pairs: MatchedMeasurements, apart: Sequence[int], short: Registration) -> dict[int, str]:
    """Return the noise of sensors that share no targets, where errors last for several scans, and by how much.

    Motion of the targets explains all but the part that changes from scan to scan. short: fit of short straight pieces.
    """
    none, period = np.zeros(short.biases.shape, bool), _MANY_SCANS / SCANS_A_PIECE * _period(problem)
    ratios = register(pairs, problem.sites, none, np.ones(none.shape), _NEARER * short.stds, period).stds / short.stds
    held = dict[int, str]()
    for i, each in enumerate(problem.parameters):
        ratio = ratios[each.sensor, : len(fitted(problem.sites[each.sensor].kind))].max()
        if each.kind == "noise" and each.sensor in apart and ratio > _LASTING:
            held[i] = (
                f"errors about straight lines through {_MANY_SCANS} scans are {ratio:.1f} times those through "
                f"{SCANS_A_PIECE}, and one sensor cannot separate errors that last from turns of the targets"
            )
    return held


def dispersion(pairs: MatchedMeasurements, s: int) -> float:
    """Return the variance between tracks of their numbers of detections, in units of that of one probability.

    Uses tracks in the view of sensor `s` for `_LONG` scans or more. The result is 1 for fewer than three of them.
    """
    in_view = pairs.in_view[s]
    hits = np.bincount(pairs.tracks[pairs.sensors == s], minlength=len(in_view))
    long = in_view >= _LONG
    if long.sum() < 3:
        return 1.0
    share = hits[long].sum() / in_view[long].sum()
    variances = in_view[long] * max(share * (1.0 - share), 1e-9)
    return float(((hits[long] - share * in_view[long]) ** 2 / variances).sum() / (long.sum() - 1))
