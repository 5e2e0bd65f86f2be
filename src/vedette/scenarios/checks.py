"""Checks across the parts of a scenario: what each part alone cannot know."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.covariances import SMALLEST_VARIANCE, covariance_fault
from vedette.scenarios.faults import Finding, Path, describe
from vedette.scenarios.file_checks import recorded_findings, reference_findings
from vedette.scenarios.parts import Parts
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.scoring import MarginalEstimator
from vedette.scenarios.sections.targets import ScriptedTarget
from vedette.scenarios.sections.tracking import UNLABELLED, GibbsAssignment
from vedette.scenarios.sections.world import BirthSite, Time
from vedette.scenarios.sensor_checks import sensor_findings

# How far a decision time may be from the time of a scan, in scans: rounding of sums of decimal fractions.
_TIME_TOLERANCE = 1e-6
_WEIGHT_TOLERANCE = 1e-6


def step_of_time(time: float, start: float, step_period: float) -> int | None:
    """The scan at `time`, or None where there is none."""
    position = (time - start) / step_period + 1.0
    return round(position) if abs(position - round(position)) <= _TIME_TOLERANCE else None


def decision_steps(model: ScenarioModel) -> tuple[int, ...]:
    """The scans after which the sensors decide, however a valid scenario says it."""
    control, time = model.control, model.time
    if control.decision_times is None:
        return control.decision_steps or ()
    steps = (step_of_time(moment, time.start, time.step_period) for moment in control.decision_times)
    return tuple(step for step in steps if step is not None)


def _schedule(parts: Parts) -> Iterator[Finding]:
    control, time = parts.control, parts.time
    if control is None or time is None:
        return
    for i, step in enumerate(control.decision_steps or ()):
        if step > time.num_steps:
            yield ("control", "decision_steps", i), f"a step up to the last, {time.num_steps}", describe(step)
    if control.decision_times and not _faulty(time.start, time.step_period):
        yield from _decision_times(control.decision_times, time)


def _faulty(*fields: Any) -> bool:
    # Parts of a faulty file have None where the schema promises a value.
    return any(field is None for field in fields)


def _decision_times(moments: Sequence[float], time: Time) -> Iterator[Finding]:
    end = time.start + (time.num_steps - 1) * time.step_period
    for i, moment in enumerate(moments):
        if not time.start <= moment <= end + _TIME_TOLERANCE:
            yield ("control", "decision_times", i), f"a time from {time.start:g} to {end:g} s", describe(moment)
        elif step_of_time(moment, time.start, time.step_period) is None:
            wanted = f"the time of a scan: {time.start:g} s and every {time.step_period:g} s after it"
            yield ("control", "decision_times", i), wanted, describe(moment)


def _clock(parts: Parts) -> Iterator[Finding]:
    time = parts.time
    if time is None or _faulty(time.num_steps, time.start, time.step_period):
        return
    latest = abs(time.start) + time.num_steps * time.step_period
    if time.step_period < 1e6 * math.ulp(latest):
        yield ("time", "step_period"), f"a period that can be told apart at {latest:g} s", describe(time.step_period)


def _schedule_order(parts: Parts) -> Iterator[Finding]:
    if parts.control is None:
        return
    for name in ("decision_steps", "decision_times"):
        for i, (before, after) in enumerate(pairwise(getattr(parts.control, name) or ())):
            if after <= before:
                yield ("control", name, i + 1), f"more than the one before it, {before:g}", describe(after)


def _weights(parts: Parts) -> Iterator[Finding]:
    weights = None if parts.fusion is None else parts.fusion.weights
    if weights is None:
        return
    if parts.sensors and len(weights) != len(parts.sensors):
        yield ("fusion", "weights"), f"as many weights as sensors, {len(parts.sensors)}", describe(weights)
    if abs(math.fsum(weights) - 1.0) > _WEIGHT_TOLERANCE:
        yield ("fusion", "weights"), "weights with sum 1", f"a sum of {math.fsum(weights):g}"


def _fusion(parts: Parts) -> Iterator[Finding]:
    if parts.fusion is None or parts.filter is None:
        return
    if parts.filter.kind in UNLABELLED:
        yield from _without_labels(parts.filter.kind, parts.fusion.kind, len(parts.sensors))
        return
    if parts.fusion.kind == "none" and len(parts.sensors) > 1:
        yield ("fusion", "kind"), f"a fusion, as there are {len(parts.sensors)} sensors", '"none"'
    if parts.fusion.kind == "cm_delta_glmb" and parts.filter.kind == "lmb":
        yield ("fusion", "kind"), "clmb or none, as the filters are lmb", '"cm_delta_glmb"'
    if parts.fusion.kind == "clmb" and parts.fusion.feedback and parts.filter.kind not in ("lmb", None):
        yield ("fusion", "feedback"), f"false, as {parts.filter.kind} filters cannot go on from an LMB", "true"


def _without_labels(filter_kind: str, fusion_kind: str | None, num_sensors: int) -> Iterator[Finding]:
    if num_sensors > 1:
        wanted = f"a filter with labels by which to fuse, as there are {num_sensors} sensors"
        yield ("filter", "kind"), wanted, describe(filter_kind)
    elif fusion_kind not in ("none", None):
        yield (
            ("fusion", "kind"),
            f"none, as {filter_kind} filters have no labels by which to fuse",
            describe(fusion_kind),
        )


def _filter(parts: Parts) -> Iterator[Finding]:
    if parts.filter is None:
        return
    kind = parts.filter.kind
    if kind in ("lmb", *UNLABELLED) and isinstance(parts.filter.assignment, GibbsAssignment):
        yield ("filter", "assignment", "kind"), f"ranked, as the filter is {kind}", '"gibbs"'
    if kind in UNLABELLED and isinstance(parts.estimator, MarginalEstimator):
        yield ("estimator", "kind"), f"map, as {kind} filters have no labels", '"marginal"'


def _combinations(parts: Parts) -> Iterator[Finding]:
    fusion = parts.fusion
    if fusion is None or fusion.mixture_power == "moment_matched" or _faulty(fusion.mixture_power, fusion.limits):
        return
    limits, num_sensors = fusion.limits, len(parts.sensors)
    if limits.max_components**num_sensors > limits.max_combinations:
        wanted = f"a number whose power by {num_sensors} sensors is at most max_combinations, {limits.max_combinations}"
        yield ("fusion", "limits", "max_components"), wanted, describe(limits.max_components)


def _state_length(path: Path, values: Sequence[float] | None, dim: int | None) -> Iterator[Finding]:
    if values is not None and dim is not None and len(values) != dim:
        yield path, f"{dim} numbers, as a state under motion has", describe(values)


def _covariance(path: Path, rows: Sequence[Sequence[float]], dim: int) -> Iterator[Finding]:
    if len(rows) != dim or any(len(row) != dim for row in rows):
        shape = f"rows of {', '.join(str(len(row)) for row in rows)}" if len(rows) == dim else describe(rows)
        yield path, f"{dim} rows of {dim} numbers", shape
        return
    fault = covariance_fault(np.array(rows))
    if fault is not None:
        yield path, *fault


def _births(parts: Parts) -> Iterator[Finding]:
    seen: set[int] = set()
    for i, step in enumerate(parts.birth_steps):
        if step in seen:
            yield ("birth", "steps", i), "each step once", f"{step} again"
        elif parts.num_steps is not None and step > parts.num_steps:
            yield ("birth", "steps", i), f"a step up to the last, {parts.num_steps}", describe(step)
        seen.add(step)
    for i, site in enumerate(parts.sites):
        if site is not None:
            yield from _birth_site(("birth", "sites", i), site, parts)


def _birth_site(path: Path, site: BirthSite, parts: Parts) -> Iterator[Finding]:
    yield from _state_length((*path, "mean"), site.mean, parts.state_dim)
    yield from _state_length((*path, "std"), site.std, parts.state_dim)
    for j, std in enumerate(site.std or ()):
        if std <= 0.0:
            yield (*path, "std", j), "a number above 0", describe(std)
        elif std * std < SMALLEST_VARIANCE:
            yield (*path, "std", j), f"a number of at least {math.sqrt(SMALLEST_VARIANCE):g}", describe(std)
    if site.cov is not None:
        yield from _covariance((*path, "cov"), site.cov, parts.state_dim or len(site.mean))


def _targets(parts: Parts) -> Iterator[Finding]:
    for i, target in enumerate(parts.tracks):
        if target is not None:
            path: Path = ("targets", "tracks", i)
            yield from _state_length((*path, "state"), target.state, parts.state_dim)
            yield from _lifetime(path, target, parts.num_steps)


def _lifetime(path: Path, target: ScriptedTarget, last: int | None) -> Iterator[Finding]:
    if last is not None:
        for name in ("start_step", "end_step"):
            step = getattr(target, name)
            if step is not None and step > last:
                yield (*path, name), f"a step up to the last, {last}", describe(step)
    if not _faulty(target.start_step, target.end_step) and target.end_step < target.start_step:  # type: ignore[operator]
        yield (*path, "end_step"), f"a step from start_step, {target.start_step}, on", describe(target.end_step)


def _score(parts: Parts) -> Iterator[Finding]:
    ospa, last = parts.ospa, parts.num_steps
    if ospa is None:
        return
    for name in ("from_step", "to_step"):
        step = getattr(ospa, name)
        if step is not None and last is not None and step > last:
            yield ("ospa", name), f"a step up to the last, {last}", describe(step)
    if ospa.from_step is not None and ospa.to_step is not None and ospa.to_step < ospa.from_step:
        yield ("ospa", "to_step"), f"a step from from_step, {ospa.from_step}, on", describe(ospa.to_step)


_CHECKS: tuple[Callable[[Parts], Iterator[Finding]], ...] = (
    _clock,
    _schedule,
    _schedule_order,
    _weights,
    _fusion,
    _filter,
    _combinations,
    _births,
    _targets,
    recorded_findings,
    lambda parts: sensor_findings(parts.sensors),
    _score,
    reference_findings,
)


def findings(parts: Parts) -> list[Finding]:
    """Everything wrong across the parts. No user code is imported or run."""
    return [finding for check in _CHECKS for finding in check(parts)]
