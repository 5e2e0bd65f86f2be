"""The tracker of a scenario: the filters of its sensors, their fusion, and the network between them."""

from functools import partial
from typing import Any

from vedette.densities import LabelledDensity
from vedette.filters import Filter, common_target_model
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion, LabelMatchedFusion
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.courses import sensor_as_courses
from vedette.scenarios.sections.fusion import SCAN_FUSIONS
from vedette.scenarios.sections.tracking import Filter as FilterSection
from vedette.tracking import (
    BeliefNetwork,
    Central,
    CentralFilter,
    DelayedScanTracker,
    Distributed,
    ScanNetwork,
    Tracker,
    UndetectedTargetTracker,
    ViewTracker,
)


def build_tracker(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """Return the tracker of detected targets, and of undetected ones if the filter's belief does not include them."""
    section, tracker = scenario.model.undetected, _detection_tracker(scenario, filters)
    delays = {s: sensor.scans.late.build() for s, sensor in enumerate(scenario.model.sensors) if sensor.scans.late}
    if delays:
        tracker = DelayedScanTracker(tracker, delays)
    if section is not None and tracker.initial().undetected is None:
        tracker = UndetectedTargetTracker(tracker, section.build(scenario.model.region))
    revisit = scenario.model.control.revisit(of_targets=True)
    return tracker if revisit is None else ViewTracker(tracker, revisit.radius)


def _detection_tracker(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """Return the filters and their fusion, or one filter for all sensors, with the network if there is one."""
    model, fusion = scenario.model, scenario.model.fusion.build(len(filters), scenario.folder)
    central = _central_filter(scenario, filters)
    if model.network is None:
        return Distributed(filters, fusion, model.fusion.feeds_back) if central is None else Central(central)
    of_lmbs = has_lmb_beliefs(filters[0])
    own_labels = model.birth.from_measurements is not None
    merging = _network_merging(len(filters), of_lmbs=of_lmbs, own_labels=own_labels)
    if central is not None:
        return ScanNetwork(central, model.network.build(), merging)
    assert fusion is not None  # a single sensor has no network
    return BeliefNetwork(filters, fusion, model.network.build(), merging)


def has_lmb_beliefs(local: Filter) -> bool:
    """Return True if the beliefs of a filter are labelled multi-Bernoulli densities."""
    initial = local.initial()
    return isinstance(initial, LabelledDensity) and initial.is_lmb


def _network_merging(num_sensors: int, *, of_lmbs: bool, own_labels: bool) -> Fusion:
    """Return the fusion of beliefs of a network's sensors that have received different scans: covariance intersection.

    of_lmbs: True if the filters keep LMBs; then a label is fused by the sensors that see it, and labels are matched.
    own_labels: True if sensors create their own labels, so that those of GLMBs are matched as well.
    """
    equal = (1.0 / num_sensors,) * num_sensors
    if of_lmbs:
        return LabelMatchedFusion(Clmb(equal, field_of_view_weighting=True))
    return LabelMatchedFusion(CmDeltaGlmb(equal)) if own_labels else CmDeltaGlmb(equal)


def _central_filter(scenario: Scenario, filters: tuple[Filter, ...]) -> CentralFilter | None:
    """Return the filter of all sensors' scans; None if each sensor has its own."""
    model = scenario.model
    if model.fusion.kind not in SCAN_FUSIONS or not isinstance(model.filter, FilterSection):
        return None
    targets = common_target_model(filters)
    sensors = tuple(local.sensor for local in filters)
    section = model.fusion.filter
    if section is not None:
        central: CentralFilter = section.instantiate(
            scenario.folder, targets=targets, sensors=sensors, scene=partial(scene_for_program, scenario)
        )
        return central
    is_sequential = model.fusion.kind == "sequential"
    return model.filter.build_central(targets, sensors, scenario.folder, in_turn=is_sequential)


# Sections that programs receive; they exclude the true targets and the sensors' true models.
_SCENE_SECTIONS = {"name", "time", "region", "motion", "survival", "birth", "control", "ospa"}


def scene_for_program(scenario: Scenario) -> dict[str, Any]:
    """Return the data of a scenario that a program receives: its sections as plain data, and the horizon."""
    model, (horizon_steps, horizon_period) = scenario.model, scenario.model.horizon
    scene = model.model_dump(mode="json", include=_SCENE_SECTIONS)
    scene["sensors"] = [sensor.model_dump(mode="json", exclude={"true_parameters"}) for sensor in model.sensors]
    if model.by_compass:
        scene["sensors"] = [
            sensor_as_courses(data, sensor, model.north())
            for data, sensor in zip(scene["sensors"], model.sensors, strict=True)
        ]
    return scene | {"decision_steps": list(model.decision_steps), "horizon": [horizon_steps, horizon_period]}
