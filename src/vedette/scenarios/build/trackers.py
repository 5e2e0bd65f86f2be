"""The tracker of a scenario: the filters of its sensors, their fusion, and the network between them."""

from __future__ import annotations

from functools import partial
from typing import Any

from vedette.densities import LabelledDensity
from vedette.filters import Filter, common_target_model
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion, LabelMatchedFusion
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.courses import in_courses
from vedette.scenarios.sections.fusion import OF_SCANS
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
)


def build_tracker(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """Return the tracker of detected targets, and of undetected ones if the filter's belief does not include them."""
    section, found = scenario.model.undetected, _tracker_of_found(scenario, filters)
    lates = {s: sensor.scans.late.build() for s, sensor in enumerate(scenario.model.sensors) if sensor.scans.late}
    if lates:
        found = DelayedScanTracker(found, lates)
    if section is None or found.initial().undetected is not None:
        return found
    return UndetectedTargetTracker(found, section.build(scenario.model.region))


def _tracker_of_found(scenario: Scenario, filters: tuple[Filter, ...]) -> Tracker:
    """Return the filters and their fusion, or one filter for all sensors, with the network if there is one."""
    model, fusion = scenario.model, scenario.model.fusion.build(len(filters), scenario.folder)
    central = _central_filter(scenario, filters)
    if model.network is None:
        return Distributed(filters, fusion, model.fusion.feeds_back) if central is None else Central(central)
    of_lmbs = keeps_lmbs(filters[0])
    own_labels = model.birth.from_measurements is not None
    merging = _merging(len(filters), of_lmbs=of_lmbs, own_labels=own_labels)
    if central is not None:
        return ScanNetwork(central, model.network.build(), merging)
    assert fusion is not None  # a single sensor has no network
    return BeliefNetwork(filters, fusion, model.network.build(), merging)


def keeps_lmbs(local: Filter) -> bool:
    """Return True if the beliefs of a filter are labelled multi-Bernoulli densities."""
    initial = local.initial()
    return isinstance(initial, LabelledDensity) and initial.is_lmb


def _merging(num_sensors: int, *, of_lmbs: bool, own_labels: bool) -> Fusion:
    """Return the fusion of beliefs of a network's sensors that have received different scans: covariance intersection.

    of_lmbs: True if the filters keep LMBs; then a label is fused by the sensors that see it, and labels are matched.
    own_labels: True if sensors create their own labels, so that those of GLMBs are matched as well.
    """
    equal = (1.0 / num_sensors,) * num_sensors
    if of_lmbs:
        return LabelMatchedFusion(Clmb(equal, by_views=True))
    return LabelMatchedFusion(CmDeltaGlmb(equal)) if own_labels else CmDeltaGlmb(equal)


def _central_filter(scenario: Scenario, filters: tuple[Filter, ...]) -> CentralFilter | None:
    """Return the filter of all sensors' scans; None if each sensor has its own."""
    model = scenario.model
    if model.fusion.kind not in OF_SCANS or not isinstance(model.filter, FilterSection):
        return None
    targets, sensors, own = common_target_model(filters), tuple(local.sensor for local in filters), model.fusion.filter
    if own is not None:
        made: CentralFilter = own.made(
            scenario.folder, targets=targets, sensors=sensors, scene=partial(told_of, scenario)
        )
        return made
    in_turn = model.fusion.kind == "sequential"
    return model.filter.build_central(targets, sensors, scenario.folder, in_turn=in_turn)


# Sections that programs receive; they exclude the true targets and the sensors' true models.
_TOLD = {"name", "time", "region", "motion", "survival", "birth", "control", "ospa"}


def told_of(scenario: Scenario) -> dict[str, Any]:
    """Return the data of a scenario that a program receives: its sections as plain data, and the horizon."""
    model, (horizon_steps, horizon_period) = scenario.model, scenario.model.horizon
    told = model.model_dump(mode="json", include=_TOLD)
    told["sensors"] = [sensor.model_dump(mode="json", exclude={"truth"}) for sensor in model.sensors]
    if model.by_compass:
        told["sensors"] = [
            in_courses(data, sensor, model.north()) for data, sensor in zip(told["sensors"], model.sensors, strict=True)
        ]
    return told | {"decision_steps": list(model.decision_steps), "horizon": [horizon_steps, horizon_period]}
