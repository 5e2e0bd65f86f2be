"""A whole scenario as the experiment that the simulation loop runs."""

from __future__ import annotations

from vedette.scenarios.build.planning import build_first_actions, build_mobile_sensors
from vedette.scenarios.build.sensors import build_poses
from vedette.scenarios.build.tracking import build_estimator, build_filters, build_fusion
from vedette.scenarios.build.world import build_times, build_truth_source
from vedette.scenarios.checks import decision_steps
from vedette.scenarios.loading import Scenario
from vedette.simulation.experiment import Experiment


def build_experiment(scenario: Scenario) -> Experiment:
    """Everything a run needs but a planner and a seed.

    Raises:
        InputError: a custom model or a recorded file that cannot be had, or parts that do not fit together.
    """
    model = scenario.model
    filters = build_filters(scenario)
    return Experiment(
        name=model.name,
        times=build_times(model.time),
        targets=build_truth_source(model, filters[0].motion, scenario.folder),
        sensors=build_mobile_sensors(model, filters),
        poses=build_poses(model),
        first_actions=build_first_actions(model),
        fusion=build_fusion(model.fusion, len(filters)),
        feedback=model.fusion.feedback,
        estimate=build_estimator(model.estimator),
        decision_steps=decision_steps(model),
    )
