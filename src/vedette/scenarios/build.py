"""What a scenario describes, as the objects that filters, planners and simulations take.

Each section builds its own part (`vedette.scenarios.sections`); here they are put together.
"""

from __future__ import annotations

import numpy as np

from vedette.control import FixedPlanner, IndependentPlanner, JointPlanner, MobileSensor, Planner, RandomPlanner
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import Filter, labels_targets, shared_targets
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.models import TargetModel
from vedette.platforms import Actions
from vedette.scenarios.loading import Scenario
from vedette.simulation.experiment import Experiment
from vedette.simulation.truth import TargetSource

PLANNERS = ("jdm", "idm", "random", "fixed")


def build_experiment(scenario: Scenario) -> Experiment:
    """Everything a run needs but a planner and a seed.

    Raises:
        InputError: a custom model or a recorded file that cannot be had, or parts that do not fit together.
    """
    model = scenario.model
    sensors = build_sensors(scenario)
    motion = shared_targets([sensor.filter for sensor in sensors]).motion
    return Experiment(
        name=model.name,
        times=model.time.build(),
        targets=model.targets.build(model, motion, scenario.folder),
        sensors=sensors,
        poses=np.array([sensor.pose for sensor in model.sensors]),
        first_actions=tuple(
            np.array([sensor.heading_deg]) if sensor.moves_from == "start" else None for sensor in model.sensors
        ),
        fusion=model.fusion.build(len(sensors)),
        feedback=model.fusion.feedback,
        estimate=model.estimator.build(),
        decision_steps=model.decision_steps,
    )


def build_sensors(scenario: Scenario) -> tuple[MobileSensor, ...]:
    """The sensors as planners steer them, each with its filter; the filters share the models of the targets.

    Raises:
        InputError: a custom model that cannot be had, or parts that do not fit together.
    """
    model, folder = scenario.model, scenario.folder
    method, region = model.filter.gaussian_method, model.region.build()
    targets = TargetModel(
        model.motion.build(method, folder), model.survival.build(folder), model.birth.build(model.motion)
    )
    return tuple(
        MobileSensor(
            model.filter.build(targets, sensor.build(region, method, folder)),
            model.control.build_platform(sensor),
        )
        for sensor in model.sensors
    )


def build_targets(scenario: Scenario) -> TargetSource:
    """The true targets. Raises `InputError` for a custom motion or a recorded file that cannot be had."""
    model, folder = scenario.model, scenario.folder
    return model.targets.build(model, model.motion.build("auto", folder), folder)


def build_planner(scenario: Scenario, name: str) -> Planner:
    """The planner called `jdm` (joint), `idm` (independent), `random`, or `fixed` (sensors keep their first heading).

    Raises:
        InputError: another name, or `jdm` or `idm` with filters that have no labels.
    """
    model, sensors = scenario.model, build_sensors(scenario)
    if name == "random":
        return RandomPlanner(sensors, model.control.build())
    if name == "fixed":
        return FixedPlanner(tuple(Actions.of(heading_deg=sensor.heading_deg) for sensor in model.sensors))
    if name not in PLANNERS:
        raise InputError(f"planner: expected one of {', '.join(PLANNERS)}; got {name!r}")
    planner = JointPlanner if name == "jdm" else IndependentPlanner
    if not labels_targets(sensors[0].filter):
        kinds = "delta_glmb, m_delta_glmb or lmb"
        raise InputError(f"filter.kind: expected {kinds}, as planner {name} needs labels; got {model.filter.kind}")
    fusion = model.fusion.build(len(sensors)) or _of_one(sensors[0].filter)
    return planner(sensors, fusion, model.control.build(), model.control.reward.build())


def _of_one(local: Filter) -> CmDeltaGlmb | Clmb:
    """A single sensor is fused with nobody."""
    return Clmb((1.0,)) if isinstance(local.initial(), LMB) else CmDeltaGlmb((1.0,))
