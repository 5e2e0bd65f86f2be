"""What a scenario describes, as the objects that filters, planners and simulations take.

Each section builds its own part (`vedette.scenarios.sections`); here they are put together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vedette.control import MobileSensor, Planner
from vedette.densities import Labelled
from vedette.errors import InputError
from vedette.filters import Filter, TwoStepFilter, labels_targets, shared_targets
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion, Matched, ParallelUpdate
from vedette.kernels.base.types import Bools, Floats
from vedette.models import SensorModel, TargetModel
from vedette.platforms import Actions, ByCompass, Operated, Patrolling, Platform
from vedette.platforms.base import SWITCH, actions_at
from vedette.platforms.patrolling import CLOCKS
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.control import revisited
from vedette.scenarios.sections.courses import in_courses
from vedette.scenarios.sections.custom import Custom, NotGiven
from vedette.scenarios.sections.deciding import Lookahead
from vedette.scenarios.sections.fusion import IN_FULL, OF_SCANS, ONE_BELIEF, CustomFusion
from vedette.scenarios.sections.planners import STRATEGIES, Named, NamedIndependent, strategy_of
from vedette.scenarios.sections.platforms import CustomPlatform
from vedette.scenarios.sections.scenario import ScenarioModel
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.strategies import Parts, Strategy
from vedette.scenarios.sections.tracking import CustomFilter
from vedette.scenarios.sections.tracking import Filter as FilterSection
from vedette.scenarios.sections.undetected import undetected_anywhere
from vedette.simulation.experiment import Experiment
from vedette.simulation.oracle import Timetable
from vedette.simulation.true_sensors import TrueSensor
from vedette.simulation.truth import TargetSource
from vedette.tracking import (
    BeliefNetwork,
    Central,
    CentralFilter,
    Delayed,
    Distributed,
    Network,
    ScanNetwork,
    Searching,
    Tracker,
)


def build_experiment(scenario: Scenario) -> Experiment:
    """Everything a run needs but a planner and a seed.

    Raises:
        InputError: a custom model or a recorded file that cannot be had, or parts that do not fit together.
    """
    model = scenario.model
    sensors = build_sensors(scenario)
    tracker, times = _tracker(scenario, tuple(sensor.filter for sensor in sensors)), build_scan_times(scenario)
    known = tuple(sensor.filter.sensor for sensor in sensors)
    recording = None if model.recording is None else model.recording.build(model, scenario.folder)
    return Experiment(
        name=model.name,
        times=model.time.build() if recording is None else recording.times,
        targets=model.targets.build(model, tracker.targets.motion, scenario.folder),
        tracker=tracker,
        platforms=tuple(sensor.platform for sensor in sensors),
        poses=build_poses(scenario),
        first_actions=tuple(
            own.values[0] if section.moves_from == "start" else None
            for own, section in zip(_first_actions(scenario, sensors), model.sensors, strict=True)
        ),
        estimate=model.estimates_by.build(scenario.folder),
        decision_steps=model.decision_steps,
        explain=model.control.explain,
        # Where they are what the tracker takes them for, a tracker of other sensors may stand in for this one.
        true_sensors=build_true_sensors(scenario, known) if any(sensor.truth for sensor in model.sensors) else (),
        scans_at=None if times.all() or recording is not None else times,
        recording=recording,
        drop_out=drop_outs(scenario),
    )


def build_sensors(scenario: Scenario) -> tuple[MobileSensor, ...]:
    """The sensors as planners steer them, each with its filter; the filters share the models of the targets.

    Raises:
        InputError: a custom model that cannot be had, or parts that do not fit together.
    """
    model, folder = scenario.model, scenario.folder
    method, region = model.filter.gaussian_method, model.region.build()
    birth = model.birth.build(model.motion, model.region)
    targets = TargetModel(
        model.motion.build(folder, method=method),
        model.survival.build(folder),
        replace(birth, anywhere=undetected_anywhere(model, birth)),
    )
    found = []
    for sensor in model.sensors:
        known = sensor.build(region, method, folder, model.filter.detection_taken_at)
        local = model.filter.build(targets, known, folder)
        _check_own(scenario, sensor, known, local)
        found.append(MobileSensor(local, _platform(model, sensor, folder), _scan_times(model, sensor)))
    return tuple(found)


def _platform(model: ScenarioModel, sensor: Sensor, folder: Path) -> Platform:
    """What carries a sensor, with its prices and switch; with an origin or a compass its actions are courses."""
    section, price = sensor.platform, sensor.price
    platform: Platform = section.build(folder)
    if model.by_compass and platform.columns:
        platform = ByCompass(platform, model.north())
    if isinstance(section, CustomPlatform) and isinstance(price, str) and price not in platform.columns:
        wanted = f"{section.function} to have a column {price}, as its price"
        raise NotGiven(section, "function", wanted, ", ".join(platform.columns) or "no columns")
    if isinstance(section, CustomPlatform) and sensor.switchable and SWITCH in platform.columns:
        wanted = f"{section.function} to have no column {SWITCH}, as the sensor is switchable"
        raise NotGiven(section, "function", wanted, ", ".join(platform.columns))
    visits = revisited(model)
    if visits is not None and section.top_speed > 0.0:
        platform = Patrolling(platform, visits.places, visits.radius)
    if price is None and sensor.budget is None and not sensor.switchable:
        return platform
    if sensor.budget is None:
        return Operated(platform, price, sensor.switchable)
    return Operated(platform, price, sensor.switchable, sensor.budget.seconds, sensor.budget.refill)


def _scan_times(model: ScenarioModel, sensor: Sensor) -> Floats | None:
    """s of the scans of a sensor, as far as decisions look ahead, past the last step too; None: at every step."""
    if sensor.scans.steps(model.time.step_period)[0] == 1:
        return None
    lookahead, horizon = model.control.lookahead or Lookahead(), math.prod(model.horizon)
    ahead = horizon + (lookahead.depth - 1) * (lookahead.period or horizon)
    num = model.time.num_steps + math.ceil(ahead / model.time.step_period)
    time = model.time.model_copy(update={"num_steps": num})
    found: Floats = time.build()[sensor.scans.build(time)]
    return found


def _check_own(scenario: Scenario, section: Sensor, sensor: SensorModel, local: Filter) -> None:
    """`NotGiven` where the user's own measurement or filter has less than the scenario asks of it."""
    model, measured = scenario.model, section.measurement
    born = model.birth.from_measurements is not None
    if born and sensor.measurement.places is None and isinstance(measured, Custom):
        wanted = f"{measured.function} to give a measurement with `places`, as targets are born of measurements"
        raise NotGiven(measured, "function", wanted, "one without")
    waits = section.scans.drop_out or section.scans.late or not section.scans.build(model.time).all()
    waits = waits or section.switchable or (model.network is not None and model.network.delay)
    if isinstance(model.filter, CustomFilter) and (born or waits) and not isinstance(local, TwoStepFilter):
        why = "targets are born of measurements" if born else "it must predict without a scan"
        wanted = f"{model.filter.function} to give a TwoStepFilter, with predict() and update(), as {why}"
        raise NotGiven(model.filter, "function", wanted, f"a {type(local).__name__}")


def build_true_sensors(scenario: Scenario, known: Sequence[SensorModel]) -> tuple[TrueSensor, ...]:
    """The sensors as they are, beside what the filters know of them; errors as of `build_sensors`."""
    model = scenario.model
    region = model.region.build()
    places = zip(model.sensors, known, strict=True)
    return tuple(section.build_true(sensor, region, scenario.folder) for section, sensor in places)


def drop_outs(scenario: Scenario) -> tuple[float, ...]:
    """Probability of each sensor that a scan does not take place; () where all do."""
    found = tuple(sensor.scans.drop_out or 0.0 for sensor in scenario.model.sensors)
    return found if any(found) else ()


def build_scan_times(scenario: Scenario) -> Bools:
    """(num_sensors, num_steps) whether each sensor scans then."""
    model = scenario.model
    return np.array([sensor.scans.build(model.time) for sensor in model.sensors])


def _tracker(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """What follows the targets that are found, and those that are not where the filter's belief does not have them."""
    section, found = scenario.model.undetected, _tracker_of_found(scenario, filters)
    lates = {s: sensor.scans.late.build() for s, sensor in enumerate(scenario.model.sensors) if sensor.scans.late}
    if lates:
        found = Delayed(found, lates)
    if section is None or found.initial().undetected is not None:
        return found
    return Searching(found, section.build(scenario.model.region))


def _tracker_of_found(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """The filters and their fusion, or one filter for all sensors; over a network, where there is one."""
    model, fusion = scenario.model, scenario.model.fusion.build(len(filters), scenario.folder)
    central = _central_filter(scenario, filters)
    if model.network is None:
        return Distributed(filters, fusion, model.fusion.feeds_back) if central is None else Central(central)
    of_lmbs = _keeps_lmbs(filters[0])
    own_labels = model.birth.from_measurements is not None
    merging = _merging(len(filters), of_lmbs=of_lmbs, own_labels=own_labels)
    if central is not None:
        return ScanNetwork(central, model.network.build(), merging)
    assert fusion is not None  # a single sensor has no network
    return BeliefNetwork(filters, fusion, model.network.build(), merging)


def _keeps_lmbs(local: Filter) -> bool:
    initial = local.initial()
    return isinstance(initial, Labelled) and initial.is_lmb


def _merging(num_sensors: int, *, of_lmbs: bool, own_labels: bool) -> Fusion:
    """The fusion of what sensors of a network believe after different pasts: covariance intersection.

    of_lmbs: whether the filters keep LMBs, of which those count at a label that see it, and labels are matched.
    own_labels: whether sensors make labels of their own, so that those of GLMBs are matched as well.
    """
    equal = (1.0 / num_sensors,) * num_sensors
    if of_lmbs:
        return Matched(Clmb(equal, by_views=True))
    return Matched(CmDeltaGlmb(equal)) if own_labels else CmDeltaGlmb(equal)


def _central_filter(scenario: Scenario, filters: tuple[Filter, ...]) -> CentralFilter | None:
    """The filter of all sensors' scans; None where each has its own."""
    model = scenario.model
    if model.fusion.kind not in OF_SCANS or not isinstance(model.filter, FilterSection):
        return None
    targets, sensors, own = shared_targets(filters), tuple(local.sensor for local in filters), model.fusion.filter
    if own is not None:
        made: CentralFilter = own.made(
            scenario.folder, targets=targets, sensors=sensors, scene=partial(told_of, scenario)
        )
        return made
    in_turn = model.fusion.kind == "sequential"
    return model.filter.build_central(targets, sensors, scenario.folder, in_turn=in_turn)


def build_poses(scenario: Scenario) -> Floats:
    """(num_sensors, pose_dim) where they start, all as long as the longest; what is not a sensor's own is 0."""
    sensors, visits = scenario.model.sensors, revisited(scenario.model)
    poses = [sensor.pose for sensor in sensors]
    longest = max(map(len, poses)) if visits is None else CLOCKS
    found = np.array([(*pose, *(0.0,) * (longest - len(pose))) for pose in poses])
    if visits is None:
        return found
    patrols = [[0.0 if sensor.platform.top_speed > 0.0 else -1.0] * len(visits.places) for sensor in sensors]
    return np.hstack([found, patrols])


def _first_actions(scenario: Scenario, sensors: tuple[MobileSensor, ...]) -> tuple[Actions, ...]:
    """What each sensor does where nothing decides: its course at the start, or the first of its actions."""
    found = []
    places = zip(scenario.model.sensors, sensors, build_poses(scenario), strict=True)
    for s, (section, sensor, pose) in enumerate(places):
        row = section.platform.first_action(section.heading_deg)
        own = actions_at(f"sensors[{s}].platform", sensor.platform, pose)
        rows = own.values[:1] if row is None else np.array([row])
        platform: Any = sensor.platform
        while isinstance(platform, Operated | Patrolling):
            platform = platform.platform
        if row is not None and isinstance(platform, ByCompass):
            rows = platform.of_plane(rows, pose)
        if row is not None and isinstance(sensor.platform, Operated):
            rows = sensor.platform.switched_on_and_off(rows)[:1]
        found.append(Actions(own.columns, rows))
    return tuple(found)


def build_targets(scenario: Scenario) -> TargetSource:
    """The true targets. Raises `InputError` for a custom motion or a recorded file that cannot be had."""
    model, folder = scenario.model, scenario.folder
    return model.targets.build(model, model.motion.build(folder), folder)


def build_planner(scenario: Scenario, name: str, num_threads: int = 0) -> Planner | None:
    """The planner of a strategy: `jdm` (joint), `idm` (independent), `lookahead` (joint, over several decisions),
    `nearest`, `assigned`, `centroid` (rules of thumb), `oracle` and `told` (which know the targets), `random`,
    `fixed` (sensors keep their first course), or one of the scenario's own; None for `still`, where the sensors are
    never under way.

    Args:
        scenario: with the sensors that it steers.
        name: of the strategy.
        num_threads: share a decision; 0: one a processor.

    Raises:
        InputError: another name, joint or independent decisions with filters that have no labels, planners that
            know the targets where these are unknown or lack components of the motion's states, or a custom part that
            cannot be had.
    """
    model, folder = scenario.model, scenario.folder
    if name not in (*STRATEGIES, *model.planners):
        raise InputError(f"planner: expected one of {', '.join((*STRATEGIES, *model.planners))}; got {name!r}")
    sensors = build_sensors(scenario)
    strategy = strategy_of(model, name)
    if wanted := strategy.misfit(model, labels=labels_targets(sensors[0].filter)):
        raise InputError(f"planner {name}: expected {wanted}; got {name}")
    parts = build_parts(scenario, sensors, strategy, num_threads)
    if name in model.planners:
        return Named(name, model.planners[name].planner(parts, folder))
    try:
        return strategy.planner(parts, folder)
    except InputError as error:
        raise InputError(f"planner {name}: {error}") from error


def build_parts(
    scenario: Scenario, sensors: tuple[MobileSensor, ...], strategy: Strategy, num_threads: int = 0
) -> Parts:
    """What the planner of a strategy is made of, the sensors as of `build_sensors`. Raises `InputError` as
    `build_planner`.
    """
    model, folder = scenario.model, scenario.folder
    control, fusion = model.control, _fusion_of_decisions(scenario, sensors[0].filter)
    return Parts(
        sensors,
        fusion,
        replace(control.build(model.horizon, num_threads), end=float(model.time.build()[-1])),
        control.reward.build(folder),
        control.search.build(folder),
        control.others,
        _first_actions(scenario, sensors),
        control.build_constraints(folder),
        _notes_of_decisions(scenario, fusion, strategy),
        (control.lookahead or Lookahead()).build(),
        model.estimates_by.build(folder),
        {"timetable": _timetable(scenario), "cutoff": model.ospa.cutoff},
        partial(told_of, scenario),
    )


# What programs are told; the true targets, and what sensors are in truth, are not among it.
_TOLD = {"name", "time", "region", "motion", "survival", "birth", "control", "ospa"}


def told_of(scenario: Scenario) -> dict[str, Any]:
    """What a program is told of a scenario: its sections as plain data, and the horizon."""
    model, (horizon_steps, horizon_period) = scenario.model, scenario.model.horizon
    told = model.model_dump(mode="json", include=_TOLD)
    told["sensors"] = [sensor.model_dump(mode="json", exclude={"truth"}) for sensor in model.sensors]
    if model.by_compass:
        told["sensors"] = [
            in_courses(data, sensor, model.north()) for data, sensor in zip(told["sensors"], model.sensors, strict=True)
        ]
    return told | {"decision_steps": list(model.decision_steps), "horizon": [horizon_steps, horizon_period]}


def _timetable(scenario: Scenario) -> Timetable:
    """When the sensors scan and decide, and how what they say becomes one, for an oracle."""
    model, num = scenario.model, len(scenario.model.sensors)
    section, powers = model.fusion, (1.0,) * num
    shared = section.kind in ONE_BELIEF or isinstance(section, CustomFusion) or section.feeds_back
    if not isinstance(section, CustomFusion) and section.kind in ("clmb", "cm_delta_glmb") and not section.by_views:
        powers = section.scaled_weights(num)
    born, scans = model.birth, build_scan_times(scenario)
    rebirths = born.from_measurements is not None or born.steps == "every"
    return Timetable(
        model.time.build(), model.decision_steps, powers, shared or model.network is not None, rebirths, scans
    )


def _notes_of_decisions(scenario: Scenario, fusion: Fusion, strategy: Strategy) -> tuple[str, ...]:
    """What the decisions of a strategy say of their fusion, where the tracks are fused in another way, and of radio."""
    model, section = scenario.model, scenario.model.fusion
    reward = getattr(strategy, "reward", None) or model.control.reward
    alone = isinstance(strategy, NamedIndependent) and (strategy.others or model.control.others) == "absent"
    found = []
    in_full = isinstance(fusion, ParallelUpdate) or reward.kind == "expected_loss"
    if in_full and not alone and section.kind not in (*IN_FULL, "none"):
        own = f"{section.kind} by views" if section.kind != "custom" and section.by_views else section.kind
        found.append(f"joint rewards take all scans in full; tracks are fused by another rule ({own})")
    if model.network is not None and model.network.build() != Network():
        found.append("decided by one who hears every sensor at once, whatever the network lets through")
    return tuple(found)


def _fusion_of_decisions(scenario: Scenario, local: Filter) -> Fusion:
    """A user's own; otherwise as the section says."""
    section, num_sensors = scenario.model.fusion, len(scenario.model.sensors)
    if isinstance(section, CustomFusion):
        return section.build(num_sensors, scenario.folder)
    return section.build_of_decisions(num_sensors, of_lmbs=_keeps_lmbs(local))
