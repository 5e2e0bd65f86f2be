"""Control in a scenario: the steerable sensors, what a planner is told, and the planners by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from vedette.control import (
    CauchySchwarzReward,
    FixedPlanner,
    HeadingActions,
    IndependentPlanner,
    JointPlanner,
    MobileSensor,
    Planner,
    PlanningSettings,
    RandomPlanner,
    planning_limits,
)
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import Filter, labels_targets
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.scenarios.build.tracking import build_fusion
from vedette.scenarios.schema.planning import CauchySchwarzReward as RewardSection
from vedette.scenarios.schema.planning import Control
from vedette.scenarios.schema.scenario import ScenarioModel
from vedette.scenarios.schema.sensors import Sensor

PLANNERS = ("jdm", "idm", "random", "fixed")


def build_actions(control: Control, sensor: Sensor) -> HeadingActions:
    """The actions of one sensor: its own, or those of all."""
    headings = sensor.headings or control.headings
    return HeadingActions(sensor.actions_deg or control.actions_deg, relative=headings == "relative")


def build_mobile_sensors(model: ScenarioModel, filters: Sequence[Filter]) -> tuple[MobileSensor, ...]:
    """The sensors as planners steer them, with the filter of each."""
    return tuple(
        MobileSensor(local, sensor.speed, build_actions(model.control, sensor))
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


def planning_fusion(model: ScenarioModel, filters: Sequence[Filter]) -> CmDeltaGlmb | Clmb:
    """The fusion that joint decisions use; a single sensor is fused with nobody."""
    fusion = build_fusion(model.fusion, len(filters))
    if fusion is not None:
        return fusion
    return Clmb((1.0,)) if isinstance(filters[0].initial(), LMB) else CmDeltaGlmb((1.0,))


def build_planner(model: ScenarioModel, filters: Sequence[Filter], name: str) -> Planner:
    """The planner called `jdm` (joint), `idm` (independent), `random`, or `fixed` (sensors keep their first heading).

    Raises:
        InputError: another name, or `jdm` or `idm` with filters that have no labels.
    """
    sensors = build_mobile_sensors(model, filters)
    if name == "random":
        return RandomPlanner(sensors)
    if name == "fixed":
        return FixedPlanner(tuple(sensor.heading_deg for sensor in model.sensors))
    if name not in PLANNERS:
        raise InputError(f"planner: expected one of {', '.join(PLANNERS)}; got {name!r}")
    planner = JointPlanner if name == "jdm" else IndependentPlanner
    if not labels_targets(filters[0]):
        kinds = "delta_glmb, m_delta_glmb or lmb"
        raise InputError(f"filter.kind: expected {kinds}, as planner {name} needs labels; got {model.filter.kind}")
    settings, reward = build_planning_settings(model.control), build_reward(model.control.reward)
    return planner(sensors, planning_fusion(model, filters), settings, reward)
