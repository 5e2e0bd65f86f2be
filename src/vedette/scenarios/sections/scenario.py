"""The whole scenario, with the checks across its sections, which no single section can make.

Each is written as for a valid scenario. In a faulty one, a check ends at the first value that could not be read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vedette.internal.covariances import covariance_fault
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT
from vedette.kernels.base.types import HEIGHT, PLANE
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.sections.base import check, readable_findings
from vedette.scenarios.sections.birth import BirthSite
from vedette.scenarios.sections.birth_labels import births_cut
from vedette.scenarios.sections.consistency import CONSISTENCY_CHECKS, incompatibility
from vedette.scenarios.sections.fields import ScenarioFields
from vedette.scenarios.sections.fusion import LMB_FUSIONS, SCAN_FUSIONS
from vedette.scenarios.sections.places import misplaced_findings
from vedette.scenarios.sections.tracking import LABELLING, UNLABELLED
from vedette.scenarios.sections.undetected_intensity import cells_of_undetected, learnt_births
from vedette.scenarios.sections.world import TIME_TOLERANCE

if TYPE_CHECKING:
    from vedette.scenarios.sections.sensors import Sensor


class ScenarioModel(ScenarioFields):
    """A scenario: a world, the sensors in it, and how they track and decide."""

    @check
    def _decision_steps(self) -> Iterator[Finding]:
        for i, step in enumerate(self.control.decision_steps or ()):
            yield from _up_to_last(("control", "decision_steps", i), step, self.time.num_steps)

    @check
    def _decision_times(self) -> Iterator[Finding]:
        time = self.time
        end = time.start + (time.num_steps - 1) * time.step_period
        for i, moment in enumerate(self.control.decision_times or ()):
            if not time.start <= moment <= end + TIME_TOLERANCE:
                yield ("control", "decision_times", i), f"a time from {time.start:g} to {end:g} s", describe(moment)
            elif time.step_at(moment) is None:
                wanted = f"the time of a scan: {time.start:g} s and every {time.step_period:g} s after it"
                yield ("control", "decision_times", i), wanted, describe(moment)

    @check
    def _weights(self) -> Iterator[Finding]:
        weights = None if self.fusion.kind == "custom" else self.fusion.weights
        if weights is not None and len(weights) != len(self.sensors):
            yield ("fusion", "weights"), f"as many weights as sensors, {len(self.sensors)}", describe(weights)

    @check
    def _fusion_of_labels(self) -> Iterator[Finding]:
        kind, num_sensors = self.filter.kind, len(self.sensors)
        if kind not in UNLABELLED:
            return
        if num_sensors > 1:
            wanted = f"a filter with labels by which to fuse, as there are {num_sensors} sensors"
            yield ("filter", "kind"), wanted, describe(kind)
        elif self.fusion.kind != "none":
            wanted = f"none, as {kind} filters have no labels by which to fuse"
            yield ("fusion", "kind"), wanted, describe(self.fusion.kind)

    @check
    def _fusion_of_several(self) -> Iterator[Finding]:
        if self.filter.kind not in UNLABELLED and self.fusion.kind == "none" and len(self.sensors) > 1:
            yield ("fusion", "kind"), f"a fusion, as there are {len(self.sensors)} sensors", '"none"'

    @check
    def _fusion_of_kind(self) -> Iterator[Finding]:
        kind, filters = self.fusion.kind, self.filter.built_kind
        if kind == "cm_delta_glmb" and filters == "lmb":
            wanted = "sequential, parallel, clmb, arithmetic_average, central or none, as the filters are lmb"
            yield ("fusion", "kind"), wanted, describe(kind)
        if filters in ("lmb", "factored_glmb", "custom", *UNLABELLED):
            return
        if kind == "parallel":
            wanted = f"sequential or another, as parallel is of lmb or factored_glmb filters, and these are {filters}"
            yield ("fusion", "kind"), wanted, describe(kind)
        if kind in LMB_FUSIONS and self.fusion.feedback:
            yield ("fusion", "feedback"), f"false, as {filters} filters cannot go on from an LMB", "true"

    @check
    def _one_belief(self) -> Iterator[Finding]:
        if self.fusion.kind in SCAN_FUSIONS and self.fusion.feedback:
            yield ("fusion", "feedback"), "false, as nothing is fused while tracking", "true"

    @check
    def _central(self) -> Iterator[Finding]:
        if self.filter.kind == "custom":
            if self.fusion.kind in SCAN_FUSIONS:
                wanted = "a fusion of densities, as each sensor has a filter of your own"
                yield ("fusion", "kind"), wanted, describe(self.fusion.kind)
        elif self.fusion.kind == "central" and self.filter.assignment.kind != "ranked":
            wanted = "ranked, as one filter takes the scans of all sensors"
            yield ("filter", "assignment", "kind"), wanted, describe(self.filter.assignment.kind)

    @check
    def _estimator(self) -> Iterator[Finding]:
        kind = self.estimates_by.kind
        if self.filter.kind in UNLABELLED and kind in ("least_ospa", "least_gospa", "marginal"):
            yield ("estimator", "kind"), f"map, as {self.filter.kind} filters have no labels", f'"{kind}"'

    @check
    def _combinations(self) -> Iterator[Finding]:
        if self.fusion.kind == "custom" or self.fusion.mixture_power in ("auto", "moment_matched"):
            return
        limits, num_sensors = self.fusion.limits, len(self.sensors)
        if limits.max_components**num_sensors > limits.max_combinations:
            power = f"a number whose power by {num_sensors} sensors"
            wanted = f"{power} is at most max_combinations, {limits.max_combinations}"
            yield ("fusion", "limits", "max_components"), wanted, describe(limits.max_components)

    @check
    def _modes(self) -> Iterator[Finding]:
        if self.mode_names and self.fusion.kind == "parallel" and len(self.sensors) > 1:
            wanted = "sequential, central or another fusion that keeps the modes of motion"
            yield ("fusion", "kind"), wanted, describe(self.fusion.kind)
        if self.mode_names and self.filter.kind != "custom" and self.filter.limits.max_components < 2:
            wanted = "at least 2 for a motion with modes"
            yield ("filter", "limits", "max_components"), wanted, describe(self.filter.limits.max_components)

    @check
    def _heights(self) -> Iterator[Finding]:
        """Yield faults if measurements depend on a height but states of the filters or the true targets have none."""
        others = ", ".join(each for each in COMPONENTS if each not in HEIGHT_DEPENDENT)
        wanted = f"one of {others}, or a motion with {HEIGHT} (as targets have {', '.join(self.motion.components)})"
        for i, kind in enumerate([sensor.measurement.kind for sensor in self.sensors]):
            if kind in HEIGHT_DEPENDENT and HEIGHT not in self.motion.components:
                yield ("sensors", i, "measurement", "kind"), wanted, describe(kind)

    @check
    def _birth_steps(self) -> Iterator[Finding]:
        for i, step in enumerate(() if self.birth.steps == "every" else self.birth.steps):
            yield from _up_to_last(("birth", "steps", i), step, self.time.num_steps)

    @check
    def _birth_sites(self) -> Iterator[Finding]:
        for i, site in enumerate(self.birth.sites):
            path: Path = ("birth", "sites", i)
            yield from readable_findings(_state_length, (*path, "mean"), site, "mean", self)
            yield from readable_findings(_state_length, (*path, "std"), site, "std", self)
            yield from readable_findings(_covariance, (*path, "cov"), site, self)

    _births_cut = check(births_cut)

    @check
    def _targets(self) -> Iterator[Finding]:
        if self.targets.kind == "poisson":
            for name in ("mean", "std"):
                yield from readable_findings(_state_length, ("targets", name), self.targets, name, self)
        if self.targets.kind == "uniform" and len(self.targets.std) != (rest := len(self.motion.components) - 2):
            wanted = f"{rest} numbers, as a state under motion has but the position"
            yield ("targets", "std"), wanted, describe(self.targets.std)
        if self.targets.kind != "scripted":
            return
        for i, target in enumerate(self.targets.tracks):
            path: Path = ("targets", "tracks", i)
            for name in ("state", "std"):
                yield from readable_findings(_state_length, (*path, name), target, name, self)
            for name in ("start_step", "end_step"):
                yield from readable_findings(_last_step, (*path, name), target, name, self)

    @check
    def _unknown_targets(self) -> Iterator[Finding]:
        if self.targets.kind == "unknown" and self.recording is None:
            yield ("targets", "kind"), "targets to simulate scans of, or a recording of scans", '"unknown"'

    @check
    def _sensor_names(self) -> Iterator[Finding]:
        names: set[str] = set()
        for i, sensor in enumerate(self.sensors):
            yield from readable_findings(_name_once, ("sensors", i, "name"), sensor, names)

    @check
    def _scan_steps(self) -> Iterator[Finding]:
        for i, sensor in enumerate(self.sensors):
            yield from readable_findings(_first_scan, ("sensors", i, "scans"), sensor, self)

    @check
    def _scans_of_unlabelled(self) -> Iterator[Finding]:
        kind = self.filter.kind
        for i, sensor in enumerate(self.sensors if kind in UNLABELLED else ()):
            if sensor.scans.late is not None:
                wanted = f"none, as {kind} filters cannot predict without a scan ({LABELLING} can)"
                yield ("sensors", i, "scans", "late"), wanted, "late scans"
            if sensor.scans.scan_loss_probability or not sensor.scans.build(self.time).all():
                yield ("sensors", i, "scans"), f"every step, as {kind} filters go on from each scan", "only some"
            if sensor.switchable:
                yield ("sensors", i, "switchable"), f"false, as {kind} filters go on from each scan", "true"

    @check
    def _planners_fit(self) -> Iterator[Finding]:
        for name, planner in self.planners.items():
            if fault := incompatibility(self, planner):
                yield ("planners", name, "kind"), fault, describe(planner.kind)

    @check
    def _score(self) -> Iterator[Finding]:
        for name in ("first_scan", "last_scan"):
            yield from readable_findings(_last_step, ("ospa", name), self.ospa, name, self)
        components, motion = self.ospa.components, self.motion
        if components == "state" and self.targets.kind == "recorded" and len(motion.components) != len(PLANE):
            wanted = f"position, as states have {len(motion.components)} components and recorded targets {len(PLANE)}"
            yield ("ospa", "components"), wanted, '"state"'
        if components == "position_and_height" and HEIGHT not in motion.components:
            yield ("ospa", "components"), "position, as targets have no height", '"position_and_height"'

    @check
    def _checks_of_other_files(self) -> Iterator[Finding]:
        for findings in (cells_of_undetected, learnt_births, *CONSISTENCY_CHECKS):
            yield from readable_findings(findings, self)

    _places = check(lambda self: misplaced_findings(self, self.origin))


def _up_to_last(path: Path, step: int | None, last: int) -> Iterator[Finding]:
    if step is not None and step > last:
        yield path, f"a step up to the last, {last}", describe(step)


def _state_length(path: Path, holder: Any, field: str, model: ScenarioFields) -> Iterator[Finding]:
    values, dim = getattr(holder, field), len(model.motion.components)
    if values is not None and len(values) != dim:
        yield path, f"{dim} numbers, as a state under motion has", describe(values)


def _covariance(path: Path, site: BirthSite, model: ScenarioFields) -> Iterator[Finding]:
    if site.cov is None:
        return
    rows: Sequence[Sequence[float]] = site.cov
    dim = len(model.motion.components)
    if len(rows) != dim or any(len(row) != dim for row in rows):
        shape = f"rows of {', '.join(str(len(row)) for row in rows)}" if len(rows) == dim else describe(rows)
        yield path, f"{dim} rows of {dim} numbers", shape
    elif fault := covariance_fault(np.array(rows)):
        yield path, *fault


def _last_step(path: Path, holder: Any, name: str, model: ScenarioFields) -> Iterator[Finding]:
    yield from _up_to_last(path, getattr(holder, name), model.time.num_steps)


def _name_once(path: Path, sensor: Sensor, names: set[str]) -> Iterator[Finding]:
    if sensor.name in names:
        yield path, "each name once", f"{describe(sensor.name)} again"
    elif sensor.name is not None:
        names.add(sensor.name)


def _first_scan(path: Path, sensor: Sensor, model: ScenarioFields) -> Iterator[Finding]:
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
