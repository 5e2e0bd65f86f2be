"""Control in a scenario: the steerable sensors, what a planner is told, and the planners by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vedette.control import (
    CauchySchwarzReward,
    FixedPlanner,
    IndependentPlanner,
    JointPlanner,
    MobileSensor,
    Planner,
    PlanningSettings,
    RandomPlanner,
    planning_limits,
)
from vedette.errors import InputError
from vedette.filters import DeltaGlmbFilter, LabelledFilter, LocalFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.base.types import Floats
from vedette.platforms import Actions, Courses
from vedette.scenarios.build.tracking import build_fusion
from vedette.scenarios.schema.planning import CauchySchwarzReward as RewardSection
from vedette.scenarios.schema.planning import Control
from vedette.scenarios.schema.scenario import ScenarioModel
from vedette.scenarios.schema.sensors import Sensor

PLANNERS = ("jdm", "idm", "random", "fixed")


def build_platform(control: Control, sensor: Sensor) -> Courses:
    """What carries one sensor, with its own actions or those of all."""
    headings = sensor.headings or control.headings
    return Courses(sensor.speed, sensor.actions_deg or control.actions_deg, relative=headings == "relative")


def build_first_actions(model: ScenarioModel) -> tuple[Floats | None, ...]:
    """What each sensor is under from the start; None: it lies still until the first decision."""
    return tuple(np.array([sensor.heading_deg]) if sensor.moves_from == "start" else None for sensor in model.sensors)


def build_mobile_sensors(model: ScenarioModel, filters: Sequence[LocalFilter]) -> tuple[MobileSensor, ...]:
    """The sensors as planners steer them, with the filter of each."""
    return tuple(
        MobileSensor(local, build_platform(model.control, sensor))
        for local, sensor in zip(filters, model.sensors, strict=True)
    )


def build_planning_settings(section: Control) -> PlanningSettings:
    """Horizon, samples and caps of a decision."""
    limits = section.limits
    return PlanningSettings(
        horizon_steps=section.horizon_steps,
        horizon_period=section.horizon_period,
        num_samples=section.num_samples,
        ideal_measurements=section.ideal_measurements,
        detection_threshold=section.detection_threshold,
        max_prior_hypotheses=limits.max_prior_hypotheses,
        limits=replace(
            planning_limits(),
            max_hypotheses=limits.max_hypotheses,
            min_relative_weight=limits.min_relative_weight,
        ),
    )


def build_reward(section: RewardSection) -> CauchySchwarzReward:
    """The value of an updated density."""
    return CauchySchwarzReward(section.unit_volume)


def planning_fusion(model: ScenarioModel, filters: Sequence[LocalFilter]) -> CmDeltaGlmb | Clmb:
    """The fusion that joint decisions use; a single sensor is fused with nobody."""
    fusion = build_fusion(model.fusion, len(filters))
    if fusion is not None:
        return fusion
    return CmDeltaGlmb((1.0,)) if isinstance(filters[0], DeltaGlmbFilter) else Clmb((1.0,))


def build_planner(model: ScenarioModel, filters: Sequence[LocalFilter], name: str) -> Planner:
    """The planner called `jdm` (joint), `idm` (independent), `random`, or `fixed` (sensors keep their first heading).

    Raises:
        InputError: another name, or `jdm` or `idm` with filters that have no labels.
    """
    sensors = build_mobile_sensors(model, filters)
    if name == "random":
        return RandomPlanner(sensors, build_planning_settings(model.control))
    if name == "fixed":
        return FixedPlanner(tuple(Actions.of(heading_deg=sensor.heading_deg) for sensor in model.sensors))
    if name not in PLANNERS:
        raise InputError(f"planner: expected one of {', '.join(PLANNERS)}; got {name!r}")
    planner = JointPlanner if name == "jdm" else IndependentPlanner
    if not isinstance(filters[0], LabelledFilter):
        kinds = "delta_glmb, m_delta_glmb or lmb"
        raise InputError(f"filter.kind: expected {kinds}, as planner {name} needs labels; got {model.filter.kind}")
    settings, reward = build_planning_settings(model.control), build_reward(model.control.reward)
    return planner(sensors, planning_fusion(model, filters), settings, reward)
