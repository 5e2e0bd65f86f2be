"""What a scenario describes, as the objects that filters, planners and simulations take; one function a section."""

from vedette.scenarios.build.custom import build_custom
from vedette.scenarios.build.experiment import build_experiment
from vedette.scenarios.build.planning import (
    PLANNERS,
    build_first_actions,
    build_mobile_sensors,
    build_planner,
    build_planning_settings,
    build_platform,
    build_reward,
    planning_fusion,
)
from vedette.scenarios.build.sensors import build_poses, build_sensor
from vedette.scenarios.build.tracking import (
    build_estimator,
    build_filter,
    build_filters,
    build_fusion,
    build_limits,
    fusion_weights,
)
from vedette.scenarios.build.world import (
    build_birth,
    build_motion,
    build_region,
    build_survival,
    build_times,
    build_truth_source,
)

__all__ = [
    "PLANNERS",
    "build_birth",
    "build_custom",
    "build_estimator",
    "build_experiment",
    "build_filter",
    "build_filters",
    "build_first_actions",
    "build_fusion",
    "build_limits",
    "build_mobile_sensors",
    "build_motion",
    "build_planner",
    "build_planning_settings",
    "build_platform",
    "build_poses",
    "build_region",
    "build_reward",
    "build_sensor",
    "build_survival",
    "build_times",
    "build_truth_source",
    "fusion_weights",
    "planning_fusion",
]
