"""What is made with numbers that cannot be is refused by the name of the field; all else is as in `fuzz.objects`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fuzz.objects import Made, everything, sensor
from vedette import models
from vedette.control import planning_limits
from vedette.errors import InputError
from vedette.evaluation import TimeToTrack, TrackedFraction
from vedette.filters import Limits
from vedette.recorded import Cleaning
from vedette.scenarios import GeneratedCrowd
from vedette.scenarios.generated import GeneratedScene
from vedette.simulation import ScriptedTargets

GOOD = everything() | {  # and what is made of files and settings
    "Cleaning": Made(Cleaning, {}),
    "GeneratedCrowd": Made(GeneratedCrowd, {}),
    "GeneratedScene": Made(GeneratedScene, {"num_sensors": 2}),
    "ScriptedTargets": Made(
        ScriptedTargets, {"motion": models.constant_velocity(5.0), "initial_states": np.ones((3, 4))}
    ),
    "TrackedFraction": Made(TrackedFraction, {"sensors": (sensor(),) * 2, "cutoff": 2.0, "order": 1.0}),
    "TimeToTrack": Made(TimeToTrack, {"cutoff": 2.0, "order": 1.0}),
}
NAN, INF = math.nan, math.inf
MEANS = np.array([[1.0, 2.0, 0.0, 0.0], [3.0, 4.0, 0.0, 0.0]])
COVS = np.array([np.diag([50.0, 50.0, 25.0, 25.0]) ** 2] * 2)
SITES = {"existence": [0.1, 0.1], "means": MEANS, "covs": COVS, "steps": None}
CORNERS = np.zeros((2, 2))
Case = tuple[str, dict[str, Any], str]


def each(name: str, field: str, *values: Any, words: str = "") -> list[Case]:
    """One field out of range, and how the message goes on."""
    return [(name, {field: value}, rf"\b{field}: expected {words}") for value in values]


REFUSED: list[Case] = [
    *each("Region", "x_max", 0.0, INF),
    *each("Region", "y_max", -2.0),
    *each("region_clutter", "rate", -1.0),
    *each("region_clutter", "kind", "doppler"),
    *each("region_clutter", "region", (0, 1, 0, 1)),
    *each("measurement_space_clutter", "high", [1.0], [-3.0, 100.0], [4.0, 100.0]),
    *each("measurement_space_clutter", "angular", [True]),
    ("measurement_space_clutter", {"low": [], "high": [], "angular": None}, "high"),
    ("around_sensor", {"kind": "bearing_only"}, "kind"),
    ("around_sensor", {"radius": None}, "radius, half_side"),
    ("around_sensor", {"half_side": 1.0}, "radius, half_side"),
    ("around_sensor", {"radius": None, "half_side": 0.0}, "half_side"),
    *each("around_sensor", "radius", -1.0),
    *each("around_sensor", "half_width_rad", 4.0),
    *each("around_sensor", "rate", -1.0),
    *each("constant_velocity", "sigma_v", -1.0, NAN, "5"),
    *each("constant_velocity", "noise_model", "jerk"),
    *each("constant_velocity", "method", "kalman"),
    *each("coordinated_turn", "sigma_turn_rate", -0.1),
    *each("constant_survival", "prob_survival", 1.2),
    ("range_dependent_noise", {"sigma_range": None, "sigma_bearing": None}, "sigma_range, sigma_bearing"),
    ("range_dependent_noise", {"sigma_bearing": None, "eta_bearing": 1.0}, "eta_bearing"),
    *each("range_dependent_noise", "sigma_range", 0.0),
    *each("range_dependent_noise", "eta_range", -1.0),
    *each("constant_noise", "stds", [], [1.0, 0.0], [[1.0]]),
    *each("axis_noise", "std", [1.0], [1.0, 0.0]),
    *each("axis_noise", "quadratic_growth", [0.0, -1.0]),
    *each("constant_detection", "prob_detection", 1.5),
    *each("gaussian_detection", "sigma", 0.0),
    *each("limited_range", "max_range", -1.0),
    *each("limited_range", "outside", 1.1),
    *each("limited_sector", "half_width_rad", 0.0, 3.2),
    *each("limited_sector", "outside", -0.1),
    *each("soft_sector", "half_width_rad", 4.0),
    *each("soft_sector", "range_slope", 0.0),
    *each("soft_sector", "angle_slope", -1.0),
    *each("soft_sector", "hard_limit", "yes"),
    *each("camera", "reference_half_width_rad", -1.0, words="a number above 0"),
    ("BirthModel", SITES | {"existence": [0.1]}, r"BirthModel.existence: expected an array of shape \(2,\); got shape"),
    ("BirthModel", SITES | {"existence": [0.1, 1.0]}, "BirthModel.existence: expected probabilities"),
    ("BirthModel", SITES | {"existence": [0.1, 0.0]}, "BirthModel.existence"),
    ("BirthModel", SITES | {"means": MEANS[0]}, "BirthModel.means"),
    ("BirthModel", SITES | {"means": MEANS[:, :1], "covs": COVS[:, :1, :1]}, "means: expected states of at least 2"),
    ("BirthModel", SITES | {"covs": COVS[:1]}, "BirthModel.covs"),
    ("BirthModel", SITES | {"covs": COVS * [[[1.0]], [[-1.0]]]}, r"BirthModel.covs\[1\]: expected a positive definite"),
    ("BirthModel", SITES | {"covs": COVS + np.eye(4, k=1)}, r"BirthModel.covs\[0\]: expected a symmetric"),
    *(("BirthModel", SITES | {"steps": steps}, "BirthModel.steps") for steps in ([1.5], 3, "all")),
    *each("HeadingPlatform", "speed", -1.0, NAN, INF, "fast", (), (1.0, -1.0), None),
    *each("HeadingPlatform", "headings_deg", (), (NAN,), (0.0, INF), ("north",), None, 3.0),
    *each("GridPlatform", "length", 0.0, words="a number above 0"),
    *each("GridPlatform", "speed", -1.0, words="a number above 0"),
    *each("GridPlatform", "directions_deg", (), words="at least one angle"),
    *each("Waypoints", "points", []),
    *each("Waypoints", "points", [[0.0, NAN]], words="finite"),
    *each("Waypoints", "speed", -1.0, words="a number of at least 0"),
    *each("Pointing", "pointings_deg", [], words="at least one"),
    *each("Pointing", "pointings_deg", [NAN], words="finite"),
    *each("Pointing", "half_widths_deg", [0.0], words="angles in"),
    *each("Pointing", "turn_rate_deg", 0.0, words="a number above 0"),
    (
        "MountedPlatform",
        {"platform": GOOD["MountedPlatform"].arguments["pointing"]},
        "pointing: expected columns other than",
    ),
    *each("Sequences", "platform", None, words="a platform"),
    *each("Sequences", "period", 0.0),
    *each("Sequences", "depth", 0),
    *each("Cleaning", "max_gap", 0.0),
    *each("Cleaning", "min_speed", -1.0),
    *each("Cleaning", "max_speed", 0.0),
    *each("Cleaning", "region", 3),
    *each("GeneratedScene", "num_sensors", 0, 2.0, words="a whole number from 1 to 1000; got "),
    *each("GeneratedScene", "num_targets", 0, words="a whole number from 1 to 2000; got 0"),
    *each("GeneratedScene", "decide_every", 60, words="a whole number from 1 to 59; got 60"),
    *each("GeneratedScene", "seed", -1, words="a whole number from 0 to"),
    *each("GeneratedScene", "pattern", "swarm", words="one of spread, crowd; got 'swarm'"),
    *each("GeneratedScene", "view", "none", words="one of full, limited; got 'none'"),
    *each("GeneratedCrowd", "num_targets", 0, 2.0, words="a whole number from 1 to 100000; got "),
    *each("GeneratedCrowd", "num_steps", True, words="a whole number from 1 to 10000; got True"),
    *each("GeneratedCrowd", "density", 0, NAN, words=r"a number from 0.001 to 1e\+06; got "),
    *each("GeneratedCrowd", "clutter", -1.0, words="a number from 0 to 100; got -1.0"),
    *each("GeneratedCrowd", "measured", "range", words="one of position, bearing_range; got 'range'"),
    *each("ScriptedTargets", "initial_states", np.ones((3, 3)), np.full((3, 4), NAN)),
    *each("ScriptedTargets", "start_times", [1.0], [1.0, 2.0, NAN]),
    ("ScriptedTargets", {"start_times": [1.0, 2.0, 3.0], "end_times": [9.0, 9.0, 2.0]}, "ScriptedTargets.end_times"),
    *each("ScriptedTargets", "process_noise", [True], 3),
    *each("ScriptedTargets", "initial_stds", np.ones((2, 4)), -np.ones((3, 4))),
    *each("TrackedFraction", "cutoff", 0.0, INF),
    *each("TrackedFraction", "order", 0.5),
    *each("TrackedFraction", "min_detection_probability", 1.5),
    *each("TimeToTrack", "cutoff", 0.0, INF),
    *each("TimeToTrack", "first_scan", 0),
    *each("HorizonPlanner", "depth", 0),
    *each("HorizonPlanner", "budget", 0),
    *each("HorizonPlanner", "discount", 1.5),
    *each("HorizonPlanner", "period", -1.0),
    *each("MountedPlatform", "platform", 5, words="a platform"),
    *each("PlanningSettings", "horizon_steps", 0, words="a whole number of at least 1; got 0"),
    *each("PlanningSettings", "horizon_steps", 2.5, words="a whole number"),
    *each("PlanningSettings", "num_samples", 0, "40", words="a whole number"),
    *each("PlanningSettings", "max_prior_hypotheses", -1, words="a whole number"),
    *each("PlanningSettings", "horizon_period", 0.0, words="a number above 0; got 0.0"),
    *each("PlanningSettings", "horizon_period", INF, NAN, words="a finite number"),
    *each("PlanningSettings", "detection_threshold", 1.5, words="a probability"),
    *each("PlanningSettings", "ideal_measurements", "perfect", words="one of ideal, expected, sampled"),
    *each("PlanningSettings", "num_threads", -1, 1.5, words="a whole number"),
    *each("PlanningSettings", "limits", Limits(), words="max_components 1, min_existence 0 and min_track_weight 1"),
    *each("PlanningSettings", "limits", replace(planning_limits(), max_components=2), words="max_components 1"),
    *each("PlanningSettings", "limits", replace(planning_limits(), min_track_weight=0.1), words="max_components 1"),
    *each("PlanningSettings", "confidence", 1.0, 0, words=".*above 0 and below 1"),
    *each("PlanningSettings", "confidence", "high", words=".*finite number"),
    *each("PlanningSettings", "indifference", -0.1, 1.0, words=r".*in \[0, 1\)"),
    *each("PlanningSettings", "max_samples", 23, words=".*at least 24"),
    *each("PlanningSettings", "max_samples", 100.5, words=".*whole number"),
    *each("PlanningSettings", "max_seconds", 0.0, words=".*above 0"),
    *each("PlanningSettings", "end", NAN, words=".*; got nan"),
    *each("Limits", "max_hypotheses", 0, -1, 2.5, "many", 2**62 + 1, 10**30, words=".*; got "),
    *(case for name in ("max_search_nodes", "max_components", "max_labels") for case in each("Limits", name, 0)),
    *each("Limits", "max_intensity_components", 0, 1.5),
    *each("Limits", "max_existence", 0.0, 1.0, -0.1, NAN),
    *each("Limits", "min_relative_weight", -0.1, 1.0, NAN),
    *each("Limits", "min_component_weight", -0.1, 1.0, NAN),
    *each("Limits", "min_existence", -0.1, 1.0, NAN),
    *each("Limits", "min_track_weight", -0.1, 1.1, NAN),
    *each("Limits", "gate_probability", 0.0, 1.1, NAN),
    *each("Limits", "merge_distance", -1.0, NAN),
    *each("Limits", "min_log_clutter", -INF, INF, NAN),
    *each("Limits", "max_position_std", NAN),
    *each("CrossEntropy", "num_samples", 0, words="a whole number"),
    *each("CrossEntropy", "max_rounds", 1.5, words="a whole number"),
    *each("CrossEntropy", "elite_fraction", 0.0, words="a probability above 0 and below 1; got 0.0"),
    *each("CrossEntropy", "smoothing", 1.5, words="a number above 0, up to 1; got 1.5"),
    *each("SequentialGreedy", "order", "worst", words="one of sensor_order, best_first; got worst"),
    *each("AutomaticSearch", "max_joint_actions", 0, words="a whole number"),
    *each("ExhaustiveSearch", "max_joint_actions", 0, -1, 1.5, True, "many", words="a whole number"),
    *each("CoordinateAscent", "num_restarts", -1, 1.5, True, "many", words="a whole number"),
    *each("TreeSearch", "exploration", -0.1),
    *each("TreeSearch", "rollout", "greedy", words="one of random, repeat_last"),
    *each("TreeSearch", "batch", 0),
    *each("CauchySchwarzReward", "unit_volume", 0.0, -1.0, NAN, INF, "unit", True, words="a finite number above 0 or"),
    *each("Separation", "distance", 0.0, words="a number above 0; got 0"),
    *each("StayInside", "region", (0, 1, 0, 1), words="a Region"),
    *each("KeepOut", "area", CORNERS, words="a Region, or a polygon of at least 3 corners; got 2 corners"),
    *each("KeepOut", "area", np.zeros((1, 3)), words="an array of shape"),
    *each("KeepOut", "area", "here"),
    *each("VoidProbability", "radius", 0.0, words="a number above 0"),
    *each("VoidProbability", "probability", 1.5, words="a probability"),
]


@pytest.mark.parametrize(("name", "changes", "message"), REFUSED, ids=[f"{name}-{words}" for name, _, words in REFUSED])
def test_what_cannot_be_is_named(name: str, changes: dict[str, Any], message: str) -> None:
    made = GOOD[name]
    made.make(**made.arguments)
    with pytest.raises(InputError, match=message):
        made.make(**made.arguments | changes)


def test_a_box_beyond_a_turn_is_one_of_lengths() -> None:
    """Only angles are held to a turn."""
    models.measurement_space_clutter(1.0, [0.0], [7.0], angular=[False])
    with pytest.raises(InputError, match="high"):
        models.measurement_space_clutter(1.0, [0.0], [7.0], angular=[True])
