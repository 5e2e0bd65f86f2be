"""Builders of the filters, planners and simulations that a scenario describes.

Each section builds its own part (`vedette.scenarios.sections`); here they are put together.
"""

from vedette.scenarios.build.experiments import build_experiment, build_targets, build_tracking
from vedette.scenarios.build.planners import build_parts, build_planner
from vedette.scenarios.build.sensors import (
    build_motion,
    build_poses,
    build_scan_times,
    build_sensor_models,
    build_sensors,
    build_true_sensors,
    scan_loss_probabilities,
)
from vedette.scenarios.build.trackers import scene_for_program

__all__ = [
    "build_experiment",
    "build_motion",
    "build_parts",
    "build_planner",
    "build_poses",
    "build_scan_times",
    "build_sensor_models",
    "build_sensors",
    "build_targets",
    "build_tracking",
    "build_true_sensors",
    "scan_loss_probabilities",
    "scene_for_program",
]
