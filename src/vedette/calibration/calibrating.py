"""Maximum likelihood calibration of the sensors of a recording: initial guess, maximum, identifiability."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from vedette.calibration.held_back import blocks_of_time, held_back_gains
from vedette.calibration.initial_guess import NO_SHARED, Guess, initial_guess
from vedette.calibration.maximum_likelihood import (
    Maximum,
    Terms,
    conditional_maximum,
    covariance,
    maximise,
    stds_from_blocks,
)
from vedette.calibration.parameters import TARGETS, Parameter, Problem
from vedette.kernels.base.types import Floats, Ints

_QUANTILE = 1.959964  # of the normal distribution, 97.5 %
_COMPARED = ("clock", "x", "y")  # components that are relative to those of the first sensor
_NO_BETTER = "held-back scans fit no better with the estimate"
_PART = 0.1  # share of a parameter in undetermined directions above which it is not identifiable
_MOST_PRIORS = 5.0  # prior standard deviations within which an estimate is plausible
# In the order of their tests. Those of a sensor or of the motion are a group.
_KINDS = ("clutter", "detection", "noise", "motion", "bias")


class ParameterEstimate(NamedTuple):
    """Estimate of a parameter.

    value, ci_low, ci_high: estimate and its 95 % confidence interval, with NaN limits if the search did not converge.
    reason: why there is no estimate, as "not identifiable: ..." or "implausible: ...", empty if there is one. kept:
    reason to keep the assumed value although there is an estimate, empty if there is none.
    """

    parameter: Parameter
    value: float
    ci_low: float
    ci_high: float
    reason: str
    kept: str = ""

    @property
    def is_better(self) -> bool:
        """True if the estimate replaces the assumed value."""
        return not self.reason and not self.kept

    @property
    def std(self) -> float:
        """Standard deviation of a parameter on a plain scale, or NaN if there is no interval."""
        return (self.ci_high - self.ci_low) / (2.0 * _QUANTILE)


class Calibration(NamedTuple):
    """Estimates of all parameters.

    log_likelihood, initial_log_likelihood: of the recording, with the better values and with the assumed ones.
    converged: True if the search converged. rank: rank of the information matrix, the number of directions in
    parameter space that the recording determines.
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
        only: the parameters to estimate, with the others fixed at their start values. None: all.

    Raises:
        VedetteError: a filter cannot process the recording.
    """
    given = problem.free([each.start for each in problem.parameters])
    asked = [i for i, each in enumerate(problem.parameters) if only is None or each in only]
    guess = initial_guess(problem, given, asked, progress)
    problem = replace(problem, births=guess.births)

    @cache
    def terms(free: bytes) -> Floats:
        progress()
        return problem.log_likelihoods(np.frombuffer(free))

    before, converged, rank = float(terms(given.tobytes()).sum()), True, 0
    found = {i: _without(problem.parameters[i], f"not identifiable: {why}") for i, why in guess.held.items()}
    free = [i for i in asked if i not in found]
    if free:
        estimates, converged, rank = _estimated(problem, terms, guess, given, free)
        found |= estimates
    kept, better = tuple(found[i] for i in asked), given.copy()
    if converged:
        better[asked] = [
            each.parameter.to_free(each.value if each.is_better else each.parameter.start) for each in kept
        ]
    else:  # second derivatives away from a maximum are not the information
        kept = tuple(each._replace(ci_low=math.nan, ci_high=math.nan) for each in kept)
    return Calibration(kept, float(terms(better.tobytes()).sum()), before, converged, rank)


def _estimated(
    problem: Problem, terms: Callable[[bytes], Floats], guess: Guess, given: Floats, free: list[int]
) -> tuple[dict[int, ParameterEstimate], bool, int]:
    """Return the estimates of the free parameters, whether the search converged, and the rank of the information.

    terms: of the bytes of all parameters. given: (num_parameters,) their assumed values on their scales.
    """
    start, blocks, found = given.copy(), blocks_of_time(problem.term_times()), dict[int, ParameterEstimate]()
    start[free] = guess.free[free]
    own, ranks = free, list[int]()

    def of_own(at: Floats) -> Floats:
        whole = given.copy()
        whole[own] = at
        return terms(whole.tobytes())

    while True:
        part = replace(problem, parameters=tuple(problem.parameters[i] for i in own))
        unknown = np.array([each.unknown for each in part.parameters])
        if of_own(start[own]).sum() < of_own(given[own]).sum():
            start[own] = given[own]
        maximum = maximise(of_own, start[own], unknown, _correlated(part.parameters), blocks, guess.stds[own])
        cov, lost = covariance(maximum.information, unknown)
        judged = _judged(part, maximum, cov, lost, guess.apart, guess.stds[own], blocks)
        found |= zip(own, judged, strict=True)
        ranks.append(len(own) - round(float(np.trace(lost))))
        told = [i for i in own if not found[i].reason]
        if told == own or not told:
            break
        # Fix parameters that are not identifiable at the assumed values, and maximise over the others.
        start[own] = conditional_maximum(maximum, unknown, [i not in told for i in own], given[own])
        own = told
    if told and maximum.converged:
        found |= zip(own, _compared_with_given(part, judged, of_own, maximum, cov, blocks), strict=True)
    return found, maximum.converged, ranks[0]


def _compared_with_given(
    problem: Problem,
    estimates: Sequence[ParameterEstimate],
    terms: Terms,
    maximum: Maximum,
    cov: Floats,
    blocks: Ints,
) -> list[ParameterEstimate]:
    """Return the estimates with the reason to keep the given values of those that fit held-back scans no better."""
    parameters, kept = problem.parameters, list(estimates)
    keys = [(_KINDS.index(each.kind), each.sensor, each.component == "clock") for each in parameters]
    groups = [[i for i, key in enumerate(keys) if key == own] for own in sorted(set(keys))]
    given = problem.free([each.start for each in parameters])
    for group, (gain, error) in zip(groups, held_back_gains(terms, maximum, cov, given, groups, blocks), strict=True):
        if gain <= error:
            for i in group:
                kept[i] = kept[i]._replace(kept=f"{_NO_BETTER} (log likelihood {gain:+.1f} ± {error:.1f})")
    # The others are estimated given the values that stay.
    unknown = np.array([each.unknown for each in parameters])
    moved = conditional_maximum(maximum, unknown, [not each.is_better for each in kept], given) - maximum.at
    return [_moved(each, by) if each.is_better else each for each, by in zip(kept, moved.tolist(), strict=True)]


def _moved(estimate: ParameterEstimate, by: float) -> ParameterEstimate:
    """Return an estimate and its interval moved on the parameter's scale."""
    own = estimate.parameter
    value, low, high = (own.from_free(own.to_free(each) + by) for each in estimate[1:4])
    return estimate._replace(value=value, ci_low=low, ci_high=high)


def _without(parameter: Parameter, reason: str) -> ParameterEstimate:
    """Return a parameter at its assumed value, without an estimate."""
    return ParameterEstimate(parameter, parameter.start, math.nan, math.nan, reason)


def _correlated(parameters: tuple[Parameter, ...]) -> list[list[int]]:
    """Return the groups of parameters that may be correlated: all biases, and per sensor noise, detection and clutter.

    Those of the motion may be correlated with all but biases. The information between biases and the rest is 0 if
    measurements are Gaussian.
    """
    groups = [[i for i, each in enumerate(parameters) if each.kind == "bias"]]
    for s in sorted({each.sensor for each in parameters}):
        groups.append([i for i, each in enumerate(parameters) if each.kind != "bias" and each.sensor in (s, TARGETS)])
    return groups


def _judged(
    problem: Problem, maximum: Maximum, cov: Floats, lost: Floats, apart: Sequence[int], least: Floats, blocks: Ints
) -> tuple[ParameterEstimate, ...]:
    """Return the estimate of each parameter with its interval, or with the reason why there is none.

    cov, lost: results of `covariance`. apart: sensors that share no targets with the others. least: standard deviations
    of all but biases with known associations, which second derivatives miss where the likelihood jumps. blocks: of the
    terms.
    """
    found, stds = [], np.maximum(np.sqrt(np.diag(cov)), stds_from_blocks(maximum.scores, cov, blocks))
    stds = np.where([each.kind == "bias" for each in problem.parameters], stds, np.maximum(stds, least))
    for i, (each, free) in enumerate(zip(problem.parameters, maximum.at.tolist(), strict=True)):
        partners = [j for j in np.flatnonzero(np.abs(lost[i]) > _PART).tolist() if j != i]
        compared = each.kind == "bias" and each.sensor in apart and each.component in _COMPARED
        if compared or lost[i, i] > _PART:
            why = _why(problem, i, [] if compared else partners, each.sensor in apart)
            found.append(_without(each, why))
            continue
        reach = _QUANTILE * float(stds[i])
        value, low, high = (each.from_free(x) for x in (free, free - reach, free + reach))
        if maximum.converged and abs(free - each.to_free(each.start)) > _MOST_PRIORS * each.usual:
            why = f"implausible: {value:.3g} {each.unit} is estimated, far from {each.start:.3g} {each.unit}"
            found.append(_without(each, why))
            continue
        found.append(ParameterEstimate(each, value, low, high, ""))
    if far := [each.parameter for each in found if each.parameter.kind == "bias" and each.reason.startswith("impl")]:
        # Biases are of one fit: the others would make up for one that is held.
        why = f"implausible: fitted together with the {far[0].label} of {problem.sites[far[0].sensor].name}"
        found = [
            _without(each.parameter, why) if each.parameter.kind == "bias" and not each.reason else each
            for each in found
        ]
    return tuple(found)


def _why(problem: Problem, i: int, partners: list[int], is_apart: bool) -> str:
    """Return why a parameter is not identifiable. partners: the parameters that it cannot be separated from."""
    own, alone = problem.parameters[i], len(problem.sites) == 1
    owners = [*(site.name for site in problem.sites), "targets"]
    names = [f"{problem.parameters[j].label} of {owners[problem.parameters[j].sensor]}" for j in partners]
    if own.kind != "bias":
        return "not identifiable: the recording contains almost no information about this parameter"
    if alone or is_apart:
        what = {"bearing": "a rotation", "clock": "a shift in time"}.get(own.component, "a shift")
        lacking = "there is no other sensor" if alone else NO_SHARED
        beside = f" (with {', '.join(names)})" if names else ""
        return f"not identifiable: {lacking} to separate it{beside} from {what} of all targets"
    if names:
        return f"not identifiable separately from {', '.join(names)}: together they shift all measurements alike"
    if own.component == "clock":
        return "not identifiable: the targets that other sensors observe too hardly move in so short a time"
    return "not identifiable: the targets that other sensors observe too contain almost no information about it"
