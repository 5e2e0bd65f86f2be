"""A scenario as an experiment that can be run."""

from __future__ import annotations

import numpy as np

from vedette.scenarios.build.planning import build_mobile_sensors
from vedette.scenarios.build.sensors import build_poses
from vedette.scenarios.build.tracking import build_estimator, build_filters, build_fusion
from vedette.scenarios.build.world import build_motion, build_times, build_truth_source
from vedette.scenarios.loading import Scenario
from vedette.scenarios.schema.planning import Control
from vedette.simulation.experiment import Experiment


def decision_steps(control: Control, times: np.ndarray) -> tuple[int, ...]:
    """Scans, counted from 1, after which the sensors decide."""
    if control.decision_steps is not None:
        return tuple(control.decision_steps)
    wanted = np.array(control.decision_times or (), dtype=np.float64)
    return tuple(int(np.abs(times - moment).argmin()) + 1 for moment in wanted)


def build_experiment(scenario: Scenario) -> Experiment:
    """Everything a run of the scenario needs but a planner and a seed.

    Raises:
        InputError: a custom model or recorded file that cannot be had, or parts that do not fit together.
    """
    model, times = scenario.model, build_times(scenario.model.time)
    motion = build_motion(model.motion, model.filter.gaussian_method, scenario.folder)
    return Experiment(
        name=scenario.name,
        times=times,
        targets=build_truth_source(model, motion, scenario.folder),
        sensors=build_mobile_sensors(model, build_filters(scenario)),
        poses=build_poses(model),
        moving=np.array([sensor.moves_from == "start" for sensor in model.sensors]),
        fusion=build_fusion(model.fusion, len(model.sensors)),
        feedback=model.fusion.feedback,
        estimate=build_estimator(model.estimator),
        decision_steps=decision_steps(model.control, times),
    )
