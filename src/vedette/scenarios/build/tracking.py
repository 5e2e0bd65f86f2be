"""The local filters of a scenario, their fusion, and the estimates."""

from __future__ import annotations

import math
from collections.abc import Callable

from vedette.densities import GLMB, LMB, Estimate, map_estimate, marginal_estimate, unlabelled_estimate
from vedette.filters import (
    Belief,
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    Filter,
    Limits,
    LmbFilter,
    PhdFilter,
)
from vedette.fusion import Clmb, CmDeltaGlmb, FusionLimits
from vedette.models import SensorModel, TargetModel
from vedette.scenarios.build.sensors import build_sensor
from vedette.scenarios.build.world import build_region, build_targets
from vedette.scenarios.loading import Scenario
from vedette.scenarios.schema.tracking import Estimator, FilterLimits, Fusion, GibbsAssignment, MapEstimator
from vedette.scenarios.schema.tracking import Filter as FilterSection

_WITHOUT_ASSIGNMENT: dict[str, type[LmbFilter | PhdFilter | CphdFilter | CbMemberFilter]] = {
    "lmb": LmbFilter,
    "phd": PhdFilter,
    "cphd": CphdFilter,
    "cb_member": CbMemberFilter,
}


def build_limits(section: FilterLimits) -> Limits:
    """Caps and thresholds of the filters."""
    return Limits(**section.model_dump())


def build_filter(section: FilterSection, targets: TargetModel, sensor: SensorModel) -> Filter:
    """The filter of one sensor."""
    limits = build_limits(section.limits)
    if section.kind in _WITHOUT_ASSIGNMENT:
        return _WITHOUT_ASSIGNMENT[section.kind](targets, sensor, limits)
    gibbs = section.assignment if isinstance(section.assignment, GibbsAssignment) else GibbsAssignment()
    return DeltaGlmbFilter(
        targets,
        sensor,
        limits,
        assignment=section.assignment.kind,
        num_gibbs_samples=gibbs.num_samples,
        marginalised=section.kind == "m_delta_glmb",
    )


def build_filters(scenario: Scenario) -> tuple[Filter, ...]:
    """The filter of each sensor; they share the models of the targets.

    Raises:
        InputError: a custom model that cannot be had, or parts that do not fit together.
    """
    model, folder = scenario.model, scenario.folder
    targets, region = build_targets(model, folder), build_region(model.region)
    sensors = (build_sensor(sensor, region, model.filter.gaussian_method, folder) for sensor in model.sensors)
    return tuple(build_filter(model.filter, targets, sensor) for sensor in sensors)


def fusion_weights(section: Fusion, num_sensors: int) -> tuple[float, ...]:
    """Weight of each sensor: equal where none are given; scaled to sum to one beyond the rounding of the file."""
    given = section.weights or (1.0,) * num_sensors
    return tuple(weight / math.fsum(given) for weight in given)


def build_fusion(section: Fusion, num_sensors: int) -> CmDeltaGlmb | Clmb | None:
    """The fusion of the sensors' densities; None where there is none."""
    if section.kind == "none":
        return None
    weights, limits = fusion_weights(section, num_sensors), section.limits
    fusion_limits = FusionLimits(
        math.log(limits.min_component_weight),
        limits.merge_distance,
        limits.max_components,
        limits.max_combinations,
        limits.max_hypotheses,
    )
    if section.kind == "clmb":
        return Clmb(weights, section.mixture_power, section.missing_existence, fusion_limits)
    return CmDeltaGlmb(weights, section.mixture_power, math.log(section.missing_weight), fusion_limits)


def build_estimator(section: Estimator) -> Callable[[Belief, int], Estimate]:
    """How estimates are read off a density after a scan, given the number of the scan.

    Only densities without labels need the number: their estimates are labelled by it.
    """

    def estimate(density: Belief, step: int) -> Estimate:
        if not isinstance(density, GLMB | LMB):
            return unlabelled_estimate(density, step)
        if isinstance(section, MapEstimator):
            return map_estimate(density)
        return marginal_estimate(density, section.threshold)

    return estimate
