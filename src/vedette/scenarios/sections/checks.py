"""Checks across the sections of a scenario, which no single section can make.

Each is written as for a valid scenario. In a faulty one, a check ends at the first value that could not be read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vedette.internal.covariances import covariance_fault
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT
from vedette.kernels.base.types import HEIGHT
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.sections.base import readable_findings
from vedette.scenarios.sections.birth import BirthSite
from vedette.scenarios.sections.birth_labels import births_cut
from vedette.scenarios.sections.control import DECISION_CHECKS
from vedette.scenarios.sections.fusion import LMB_FUSIONS, SCAN_FUSIONS
from vedette.scenarios.sections.network import NETWORK_CHECKS
from vedette.scenarios.sections.targets import RECORDED_DIM
from vedette.scenarios.sections.tracking import LABELLING, UNLABELLED
from vedette.scenarios.sections.undetected import cells_of_undetected, learnt_births

if TYPE_CHECKING:
    from vedette.scenarios.sections.scenario import ScenarioModel
    from vedette.scenarios.sections.sensors import Sensor

# Largest distance of a decision time from a scan, in scans: rounding of sums of decimal fractions.
_TIME_TOLERANCE = 1e-6


def step_of_time(time: float, start: float, step_period: float) -> int | None:
    """Return the scan at `time`, or None if there is none."""
    position = (time - start) / step_period + 1.0
    return round(position) if abs(position - round(position)) <= _TIME_TOLERANCE else None


def _unknown_targets(model: ScenarioModel) -> Iterator[Finding]:
    if model.targets.kind == "unknown" and model.recording is None:
        yield ("targets", "kind"), "targets to simulate scans of, or a recording of scans", '"unknown"'


def _up_to_last(path: Path, step: int | None, last: int) -> Iterator[Finding]:
    if step is not None and step > last:
        yield path, f"a step up to the last, {last}", describe(step)


def _decision_steps(model: ScenarioModel) -> Iterator[Finding]:
    for i, step in enumerate(model.control.decision_steps or ()):
        yield from _up_to_last(("control", "decision_steps", i), step, model.time.num_steps)


def _decision_times(model: ScenarioModel) -> Iterator[Finding]:
    time = model.time
    end = time.start + (time.num_steps - 1) * time.step_period
    for i, moment in enumerate(model.control.decision_times or ()):
        if not time.start <= moment <= end + _TIME_TOLERANCE:
            yield ("control", "decision_times", i), f"a time from {time.start:g} to {end:g} s", describe(moment)
        elif step_of_time(moment, time.start, time.step_period) is None:
            wanted = f"the time of a scan: {time.start:g} s and every {time.step_period:g} s after it"
            yield ("control", "decision_times", i), wanted, describe(moment)


def _weights(model: ScenarioModel) -> Iterator[Finding]:
    weights = None if model.fusion.kind == "custom" else model.fusion.weights
    if weights is not None and len(weights) != len(model.sensors):
        yield ("fusion", "weights"), f"as many weights as sensors, {len(model.sensors)}", describe(weights)


def _fusion_of_labels(model: ScenarioModel) -> Iterator[Finding]:
    kind, num_sensors = model.filter.kind, len(model.sensors)
    if kind not in UNLABELLED:
        return
    if num_sensors > 1:
        wanted = f"a filter with labels by which to fuse, as there are {num_sensors} sensors"
        yield ("filter", "kind"), wanted, describe(kind)
    elif model.fusion.kind != "none":
        wanted = f"none, as {kind} filters have no labels by which to fuse"
        yield ("fusion", "kind"), wanted, describe(model.fusion.kind)


def _fusion_of_several(model: ScenarioModel) -> Iterator[Finding]:
    if model.filter.kind not in UNLABELLED and model.fusion.kind == "none" and len(model.sensors) > 1:
        yield ("fusion", "kind"), f"a fusion, as there are {len(model.sensors)} sensors", '"none"'


def _fusion_of_kind(model: ScenarioModel) -> Iterator[Finding]:
    kind, filters = model.fusion.kind, model.filter.built_kind
    if kind == "cm_delta_glmb" and filters == "lmb":
        wanted = "sequential, parallel, clmb, arithmetic_average, central or none, as the filters are lmb"
        yield ("fusion", "kind"), wanted, describe(kind)
    if filters in ("lmb", "factored_glmb", "custom", *UNLABELLED):
        return
    if kind == "parallel":
        wanted = f"sequential or another, as parallel is of lmb or factored_glmb filters, and these are {filters}"
        yield ("fusion", "kind"), wanted, describe(kind)
    if kind in LMB_FUSIONS and model.fusion.feedback:
        yield ("fusion", "feedback"), f"false, as {filters} filters cannot go on from an LMB", "true"


def _one_belief(model: ScenarioModel) -> Iterator[Finding]:
    if model.fusion.kind in SCAN_FUSIONS and model.fusion.feedback:
        yield ("fusion", "feedback"), "false, as nothing is fused while tracking", "true"


def _central(model: ScenarioModel) -> Iterator[Finding]:
    if model.filter.kind == "custom":
        if model.fusion.kind in SCAN_FUSIONS:
            wanted = "a fusion of densities, as each sensor has a filter of your own"
            yield ("fusion", "kind"), wanted, describe(model.fusion.kind)
    elif model.fusion.kind == "central" and model.filter.assignment.kind != "ranked":
        wanted = "ranked, as one filter takes the scans of all sensors"
        yield ("filter", "assignment", "kind"), wanted, describe(model.filter.assignment.kind)


def _estimator(model: ScenarioModel) -> Iterator[Finding]:
    kind = model.estimates_by.kind
    if model.filter.kind in UNLABELLED and kind in ("least_ospa", "least_gospa", "marginal"):
        yield ("estimator", "kind"), f"map, as {model.filter.kind} filters have no labels", f'"{kind}"'


def _combinations(model: ScenarioModel) -> Iterator[Finding]:
    if model.fusion.kind == "custom" or model.fusion.mixture_power in ("auto", "moment_matched"):
        return
    limits, num_sensors = model.fusion.limits, len(model.sensors)
    if limits.max_components**num_sensors > limits.max_combinations:
        wanted = f"a number whose power by {num_sensors} sensors is at most max_combinations, {limits.max_combinations}"
        yield ("fusion", "limits", "max_components"), wanted, describe(limits.max_components)


def _heights(model: ScenarioModel) -> Iterator[Finding]:
    """Yield faults if measurements depend on a height but states of the filters or the simulated truth have none."""
    kinds = [(i, sensor.measurement.kind) for i, sensor in enumerate(model.sensors)]
    for i, kind in ((i, kind) for i, kind in kinds if kind in HEIGHT_DEPENDENT):
        path: Path = ("sensors", i, "measurement", "kind")
        motion = model.motion.kind
        if motion not in ("constant_velocity_height", "custom"):
            others = ", ".join(each for each in COMPONENTS if each not in HEIGHT_DEPENDENT)
            wanted = f"one of {others}, or motion: constant_velocity_height"
            yield path, f"{wanted} (as targets have no height)", describe(kind)


def _birth_steps(model: ScenarioModel) -> Iterator[Finding]:
    for i, step in enumerate(() if model.birth.steps == "every" else model.birth.steps):
        yield from _up_to_last(("birth", "steps", i), step, model.time.num_steps)


def _birth_sites(model: ScenarioModel) -> Iterator[Finding]:
    for i, site in enumerate(model.birth.sites):
        path: Path = ("birth", "sites", i)
        yield from readable_findings(_state_length((*path, "mean"), site, "mean", model))
        yield from readable_findings(_state_length((*path, "std"), site, "std", model))
        yield from readable_findings(_covariance((*path, "cov"), site, model))


def _state_length(path: Path, holder: Any, field: str, model: ScenarioModel) -> Iterator[Finding]:
    values, dim = getattr(holder, field), model.motion.state_dim
    if values is not None and len(values) != dim:
        yield path, f"{dim} numbers, as a state under motion has", describe(values)


def _covariance(path: Path, site: BirthSite, model: ScenarioModel) -> Iterator[Finding]:
    if site.cov is None:
        return
    rows: Sequence[Sequence[float]] = site.cov
    dim = model.motion.state_dim
    if len(rows) != dim or any(len(row) != dim for row in rows):
        shape = f"rows of {', '.join(str(len(row)) for row in rows)}" if len(rows) == dim else describe(rows)
        yield path, f"{dim} rows of {dim} numbers", shape
    elif fault := covariance_fault(np.array(rows)):
        yield path, *fault


def _targets(model: ScenarioModel) -> Iterator[Finding]:
    if model.targets.kind == "poisson":
        for name in ("mean", "std"):
            yield from readable_findings(_state_length(("targets", name), model.targets, name, model))
    if model.targets.kind == "uniform" and len(model.targets.std) != (rest := model.motion.state_dim - 2):
        wanted = f"{rest} numbers, as a state under motion has but the position"
        yield ("targets", "std"), wanted, describe(model.targets.std)
    if model.targets.kind != "scripted":
        return
    for i, target in enumerate(model.targets.tracks):
        path: Path = ("targets", "tracks", i)
        for name in ("state", "std"):
            yield from readable_findings(_state_length((*path, name), target, name, model))
        for name in ("start_step", "end_step"):
            yield from readable_findings(_last_step((*path, name), target, name, model))


def _last_step(path: Path, holder: Any, name: str, model: ScenarioModel) -> Iterator[Finding]:
    yield from _up_to_last(path, getattr(holder, name), model.time.num_steps)


def _sensor_names(model: ScenarioModel) -> Iterator[Finding]:
    names: set[str] = set()
    for i, sensor in enumerate(model.sensors):
        yield from readable_findings(_name_once(("sensors", i, "name"), sensor, names))


def _name_once(path: Path, sensor: Sensor, names: set[str]) -> Iterator[Finding]:
    if sensor.name in names:
        yield path, "each name once", f"{describe(sensor.name)} again"
    elif sensor.name is not None:
        names.add(sensor.name)


def _scan_steps(model: ScenarioModel) -> Iterator[Finding]:
    for i, sensor in enumerate(model.sensors):
        yield from readable_findings(_first_scan(("sensors", i, "scans"), sensor, model))


def _scans_of_unlabelled(model: ScenarioModel) -> Iterator[Finding]:
    kind = model.filter.kind
    for i, sensor in enumerate(model.sensors):
        if kind not in UNLABELLED:
            continue
        if sensor.scans.late is not None:
            wanted = f"none, as {kind} filters cannot predict without a scan ({LABELLING} can)"
            yield ("sensors", i, "scans", "late"), wanted, "late scans"
        if sensor.scans.scan_loss_probability or not sensor.scans.build(model.time).all():
            yield ("sensors", i, "scans"), f"every step, as {kind} filters go on from each scan", "only some"
        if sensor.switchable:
            yield ("sensors", i, "switchable"), f"false, as {kind} filters go on from each scan", "true"


def _planners_fit(model: ScenarioModel) -> Iterator[Finding]:
    for name, planner in model.planners.items():
        if fault := planner.incompatibility(model):
            yield ("planners", name, "kind"), fault, describe(planner.kind)


def _first_scan(path: Path, sensor: Sensor, model: ScenarioModel) -> Iterator[Finding]:
    scans, period = sensor.scans, model.time.step_period
    for inside, wanted, got in scans.findings_beside(period):
        yield (*path, *inside), wanted, got
    interval = scans.steps(period)[0] * period
    # Sensors files have no targets to simulate, and their scans have separate times.
    simulates = model.recording is None and (model.targets.kind != "scripted" or model.targets.tracks)
    if sensor.turn is not None and simulates and sensor.turn.period > interval * (1.0 + 1e-9):
        wanted = f"at most the time from one scan to the next, {interval:g} s"
        yield (*path[:-1], "turn", "period"), wanted, describe(sensor.turn.period)
    name = "first" if scans.period is None else "offset"
    yield from _up_to_last((*path, name), scans.steps(period)[1], model.time.num_steps)


def _score(model: ScenarioModel) -> Iterator[Finding]:
    for name in ("first_scan", "last_scan"):
        yield from readable_findings(_last_step(("ospa", name), model.ospa, name, model))
    if model.ospa.components == "state" and model.targets.kind == "recorded" and model.motion.state_dim != RECORDED_DIM:
        wanted = f"position, as states have {model.motion.state_dim} components and recorded targets {RECORDED_DIM}"
        yield ("ospa", "components"), wanted, '"state"'
    if model.ospa.components == "position_and_height" and model.motion.state_dim <= HEIGHT + 1:
        yield ("ospa", "components"), "position, as targets have no height", '"position_and_height"'


CHECKS = (
    _decision_steps,
    _decision_times,
    _weights,
    _fusion_of_labels,
    _fusion_of_several,
    _fusion_of_kind,
    _one_belief,
    _central,
    _estimator,
    _combinations,
    _heights,
    _birth_steps,
    _birth_sites,
    births_cut,
    _targets,
    _unknown_targets,
    _sensor_names,
    _scan_steps,
    _scans_of_unlabelled,
    _planners_fit,
    _score,
    cells_of_undetected,
    learnt_births,
    *NETWORK_CHECKS,
    *DECISION_CHECKS,
)
