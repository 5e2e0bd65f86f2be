"""Maximum likelihood calibration of the sensors of a recording: initial guess, maximum, identifiability."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from vedette.calibration.maximum_likelihood import Maximum, Terms, conditional_maximum, covariance, maximise
from vedette.calibration.parameters import Parameter, Problem
from vedette.calibration.registration import (
    BIASES,
    MOST_FITTED,
    MatchedMeasurements,
    fitted,
    groups_with_common_targets,
    is_one_place,
    match_measurements,
    register,
)
from vedette.internal.quantities import COMPONENTS, QUANTITIES
from vedette.kernels.base.types import Floats

_NEARER = 3.0  # multiple of the estimated noise, in the next round
_QUANTILE = 1.959964  # of the normal distribution, 97.5 %
_COMPARED = ("clock", "x", "y")  # components that are relative to those of the first sensor
_OTHER_MOTION = "another motion of the targets than assumed"
_BY_MOTION = {  # biases that need a second sensor at another place: effect that looks the same without one
    ("bearing",): "a rotation of all targets",
    ("range",): _OTHER_MOTION,
    ("elevation", "altitude"): _OTHER_MOTION,
}
_NO_SHARED = "no other sensor observes enough of the same targets"
_SHORT = 1.0  # log likelihood by which a search with fixed parameters may exceed the full search
_PART = 0.1  # share of a parameter in undetermined directions above which it is not identifiable


class ParameterEstimate(NamedTuple):
    """Estimate of a parameter.

    value, ci_low, ci_high: estimate and its 95 % confidence interval; NaN limits if the search did not converge.
    reason: why the parameter is not identifiable; empty if it is.
    """

    parameter: Parameter
    value: float
    ci_low: float
    ci_high: float
    reason: str

    @property
    def std(self) -> float:
        """Standard deviation of a parameter on a plain scale; NaN if there is no interval."""
        return (self.ci_high - self.ci_low) / (2.0 * _QUANTILE)


class Calibration(NamedTuple):
    """Estimates of all parameters.

    log_likelihood, initial_log_likelihood: of the recording, with the estimates and with the assumed values. converged:
    whether the search converged. rank: rank of the information matrix, the number of directions in parameter space that
    the recording determines.
    """

    estimates: tuple[ParameterEstimate, ...]
    log_likelihood: float
    initial_log_likelihood: float
    converged: bool
    rank: int


def calibrate(
    problem: Problem, progress: Callable[[], None] = lambda: None, only: Sequence[Parameter] | None = None
) -> Calibration:
    """Return the parameters that maximise the likelihood of a recording.

    Args:
        problem: the recording and the parameters.
        progress: called after each tracking of the recording.
        only: the parameters to estimate, with the others fixed at their start values; None: all.

    Raises:
        VedetteError: a filter cannot process the recording.
    """

    said = problem.free([each.start for each in problem.parameters])
    asked = [i for i, each in enumerate(problem.parameters) if only is None or each in only]

    def terms(free: Floats, own: Sequence[int]) -> Floats:
        progress()
        whole = said.copy()
        whole[own] = free
        return problem.log_likelihoods(whole)

    before = float(terms(said[asked], asked).sum())
    guessed, groups, by_motion = _guess(problem, said, asked, progress)
    apart = [s for group in groups if group != groups[0] or len(group) == 1 for s in group]
    held = {i: _unknown(problem, i, why) for i, why in by_motion.items()}
    free = [i for i in asked if i not in held]
    if not free:
        return Calibration(tuple(held[i] for i in asked), before, before, True, 0)
    start = guessed if float(terms(guessed[free], free).sum()) > before else said.copy()
    found, directions, own = held, list[int](), free
    highest, again = math.inf, False
    while True:
        maximum, judged, rank = _found(problem, own, partial(terms, own=own), start[own], apart)
        if not again and maximum.log_likelihood > highest + _SHORT:
            # Higher with fixed parameters: the full search stopped short of its maximum; restart it from here, once.
            start[own], own, again = maximum.at, free, True
            directions.clear()
            continue
        highest = maximum.log_likelihood
        found |= zip(own, judged, strict=True)
        directions.append(rank)
        told = [i for i in own if not found[i].reason]
        if told == own or not told:
            break
        # Fix parameters that are not identifiable at the assumed values, and maximise over the others.
        unknown = np.array([problem.parameters[i].unknown for i in own])
        start[own] = conditional_maximum(maximum, unknown, [i not in told for i in own], said[own])
        own = told
    log_likelihood = maximum.log_likelihood if told else before
    kept = tuple(found[i] for i in asked)
    if not maximum.converged:  # second derivatives away from a maximum are not the information
        kept = tuple(each._replace(ci_low=math.nan, ci_high=math.nan) for each in kept)
    return Calibration(kept, log_likelihood, before, maximum.converged, directions[0])


def _biases_by_motion(problem: Problem, pairs: MatchedMeasurements, groups: Sequence[Sequence[int]]) -> dict[int, str]:
    """Return the biases that would follow from the assumed motion of the targets alone, and what looks the same.

    They are those of a sensor that shares no targets with a sensor at another place. Of several sensors at one place
    they are those of the first, which the others are compared with. A sensor that measures positions suffices anywhere.

    groups: of sensors that share targets.
    """
    kinds, found = [COMPONENTS[site.kind] for site in problem.sites], dict[int, str]()
    for group in groups:
        if any("x" in kinds[s] for s in group) or not is_one_place(pairs, group):
            continue
        for names, effect in _BY_MOTION.items():
            first = next((s for s in group if {*names} & {*kinds[s]}), None)
            for i, each in enumerate(problem.parameters):
                if each.sensor == first and each.kind == "bias" and each.component in names:
                    found[i] = effect
    return found


def _unknown(problem: Problem, i: int, effect: str) -> ParameterEstimate:
    """Return a bias that would follow from the assumed motion alone, as not identifiable. effect: looks the same."""
    own, alone = problem.parameters[i], len(problem.sites) == 1
    lacking = "there is no other sensor" if alone else f"{_NO_SHARED} from another place"
    reason = f"not identifiable: {lacking} to separate it from {effect}"
    return ParameterEstimate(own, own.start, math.nan, math.nan, reason)


def _found(
    problem: Problem, own: Sequence[int], terms: Terms, start: Floats, apart: Sequence[int]
) -> tuple[Maximum, tuple[ParameterEstimate, ...], int]:
    """Return the maximum over some of the parameters, their estimates, and the number of determined directions."""
    parameters = tuple(problem.parameters[i] for i in own)
    unknown = np.array([each.unknown for each in parameters])
    maximum = maximise(terms, start, unknown, _blocks(parameters))
    cov, lost = covariance(maximum.information, unknown)
    judged = _judged(replace(problem, parameters=parameters), maximum.at, cov, lost, apart)
    return maximum, judged, len(own) - round(float(np.trace(lost)))


def _blocks(parameters: tuple[Parameter, ...]) -> list[list[int]]:
    """Return the groups of parameters that may be correlated: all biases; and per sensor noise, detection and clutter.

    The information between biases and the rest is 0 if measurements are Gaussian.
    """
    blocks = [[i for i, each in enumerate(parameters) if each.kind == "bias"]]
    for s in sorted({each.sensor for each in parameters}):
        blocks.append([i for i, each in enumerate(parameters) if each.kind != "bias" and each.sensor == s])
    return blocks


class _Guess(NamedTuple):
    """Initial guess.

    free: values of all parameters on their scales. groups: of sensors that share targets. by_motion: biases that would
    follow from the assumed motion alone, which stay at their start values; and what looks the same.
    """

    free: Floats
    groups: list[list[int]]
    by_motion: dict[int, str]


def _guess(problem: Problem, said: Floats, asked: Sequence[int], progress: Callable[[], None]) -> _Guess:
    """Return an initial guess of the parameters, and of the biases among `asked`.

    The recording is tracked with noise as wide as the biases may be, then with narrower noise; biases are fitted each
    time, except those that the measurements matched this time leave to the assumed motion.
    """
    values, sites = problem.values(said), problem.sites
    names = [(MOST_FITTED * COMPONENTS[site.kind])[:MOST_FITTED] for site in sites]
    stds = np.array([[QUANTITIES[name].far for name in own] for own in names])
    # The initial guess leaves out range rates: their noise is as wide as their bias may be.
    places, wide, unknown = {}, QUANTITIES["range_rate"].far, np.ones((len(sites), len(BIASES)))
    for i in asked:
        each = problem.parameters[i]
        if each.kind == "bias" and each.component in BIASES:
            places[i] = at = each.sensor, BIASES.index(each.component)
            unknown[at] = each.unknown / abs(each.per_si)
    for _ in range(3):
        recording = problem.without_biases(values)
        progress()
        pairs = match_measurements(problem.tracker(_with_noise(problem, values, stds, wide))[0], recording, sites, stds)
        groups = groups_with_common_targets(pairs, len(sites))
        by_motion = {i: why for i, why in _biases_by_motion(problem, pairs, groups).items() if i in asked}
        fitting = np.zeros(unknown.shape, bool)
        for i, at in places.items():
            fitting[at] = i not in by_motion
        found = register(pairs, sites, fitting, unknown, stds, _period(problem))
        for i, at in places.items():
            each = problem.parameters[i]
            values[i] = each.start if i in by_motion else values[i] + each.per_si * found.biases[at]
        stds = np.minimum(stds, _NEARER * found.stds)
    values = _with_noise(problem, values, found.stds, None)
    return _Guess(problem.free(_with_counts(problem, values, pairs).tolist()), groups, by_motion)


def _period(problem: Problem) -> float:
    """Return the mean period of the slowest sensor, s."""
    recording = problem.recording
    nums = [sum(scans[s] is not None for scans in recording.scans) for s in range(len(problem.sites))]
    return max(1e-3, float(recording.times[-1])) / max(1, min(num for num in nums if num))


def _with_noise(problem: Problem, values: Floats, stds: Floats, rates: float | None) -> Floats:
    """Return the values with noise of these standard deviations, (num_sensors, MOST_FITTED).

    rates: the same for range rates, m/s; None: as assumed.
    """
    values = values.copy()
    for i, each in enumerate(problem.parameters):
        if each.kind == "noise":
            names = fitted(problem.sites[each.sensor].kind)
            own = stds[each.sensor, names.index(each.component)] if each.component in names else rates
            values[i] = each.start if own is None else abs(each.per_si) * own
    return values


def _with_counts(problem: Problem, values: Floats, pairs: MatchedMeasurements) -> Floats:
    """Return the values with detection probabilities and clutter rates from the matched tracks and measurements."""
    values, hits = values.copy(), np.bincount(pairs.sensors, minlength=len(problem.sites))
    for i, each in enumerate(problem.parameters):
        s = each.sensor
        if each.kind == "detection" and hits[s]:
            values[i] = min(max(hits[s] / (hits[s] + pairs.missed[s]), 0.05), 0.98)
        elif each.kind == "clutter" and pairs.scans[s]:
            values[i] = max(pairs.false[s] / pairs.scans[s], 0.01)
    return values


def _judged(
    problem: Problem, at: Floats, cov: Floats, lost: Floats, apart: Sequence[int]
) -> tuple[ParameterEstimate, ...]:
    """Return the estimate of each parameter with its interval, or with the reason why it is not identifiable.

    cov, lost: results of `covariance`. apart: sensors that share no targets with the others.
    """
    found = []
    for i, (each, free) in enumerate(zip(problem.parameters, at.tolist(), strict=True)):
        partners = [j for j in np.flatnonzero(np.abs(lost[i]) > _PART).tolist() if j != i]
        compared = each.kind == "bias" and each.sensor in apart and each.component in _COMPARED
        if compared or lost[i, i] > _PART:
            why = _why(problem, i, [] if compared else partners, each.sensor in apart)
            found.append(ParameterEstimate(each, each.start, math.nan, math.nan, why))
            continue
        reach = _QUANTILE * math.sqrt(cov[i, i])
        value, low, high = (each.from_free(x) for x in (free, free - reach, free + reach))
        found.append(ParameterEstimate(each, value, low, high, ""))
    return tuple(found)


def _why(problem: Problem, i: int, partners: list[int], is_apart: bool) -> str:
    """Return why a parameter is not identifiable; partners: the parameters that it cannot be separated from."""
    own, alone = problem.parameters[i], len(problem.sites) == 1
    names = [f"{problem.parameters[j].label} of {problem.sites[problem.parameters[j].sensor].name}" for j in partners]
    if own.kind != "bias":
        return "not identifiable: the recording contains almost no information about this parameter"
    if alone or is_apart:
        what = {"bearing": "a rotation", "clock": "a shift in time"}.get(own.component, "a shift")
        lacking = "there is no other sensor" if alone else _NO_SHARED
        beside = f" (with {', '.join(names)})" if names else ""
        return f"not identifiable: {lacking} to separate it{beside} from {what} of all targets"
    if names:
        return f"not identifiable separately from {', '.join(names)}: together they shift all measurements alike"
    if own.component == "clock":
        return "not identifiable: the targets that other sensors observe too hardly move in so short a time"
    return "not identifiable: the targets that other sensors observe too contain almost no information about it"
