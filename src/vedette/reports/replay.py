"""A run as the plain data for the replay on the page, scan by scan."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.plan import Plan
from vedette.densities import Estimate, UndetectedIntensity
from vedette.evaluation import match_run
from vedette.evaluation.actions import action_axis, describe_choice
from vedette.evaluation.ensembles import rounded_choice
from vedette.evaluation.figures.rewards import best_over_others, best_over_pair, first_pair
from vedette.evaluation.recording_metadata import recording_metadata
from vedette.evaluation.scans import PLANE_SHAPES, available_scans, plane_coordinates
from vedette.kernels.base.types import HEADING, HEIGHT, VELOCITY, VY, Floats, place_of
from vedette.reports.decision_explanations import explanation_data
from vedette.reports.groups import Strategy
from vedette.scenarios import Scenario
from vedette.scenarios.sections.field_of_view import field_of_view
from vedette.scenarios.sections.sensors import Sensor as SensorSection
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.scans import Scan

_DIGITS = 4  # significant digits of positions relative to the extent: well under a pixel
_ANGLE_DIGITS = 4
_SIGMAS = 2.0
_ROOM = 0.08  # margin around the scene, relative to the extent
_LEAST_EXTENT = 1.0  # m


def replay_data(strategy: Strategy, record: RunRecord, group: str, *, trust: bool) -> dict[str, Any]:
    """Return the data of a run for the page, as plain JSON types. Positions are rounded to what is visible.

    Measurements are those of the recording, or drawn again by the sensor models. They are left out if a sensor gives no
    position in the plane, or if they cannot be drawn, or without `trust` also if drawing them would run code that the
    scenario names. Without known targets there are no errors.
    """
    scenario = strategy.cell.scenario
    extent = _extent(record, scenario)
    decimals = decimals_for(extent)
    scene, names, sections = strategy.scene, scenario.model.sensor_names, scenario.model.sensors
    sensors = [sensor_data(name, section) for name, section in zip(names, sections, strict=True)]
    components = scenario.model.motion.components
    is_known, origin = scenario.model.targets.kind != "unknown", scenario.model.origin
    metadata = recording_metadata(record, scenario)
    errors = record.ospa[strategy.counted[: record.num_scans], 0]
    axes = dict[str, dict[str, Any]]()
    decisions = [decision_data(decision, axes, names) for decision in record.decisions]
    return {
        "cell": strategy.cell.name,
        "group": group,
        "strategy": strategy.name,
        "words": strategy.words,
        "mean": round(float(errors.mean()), 2) if is_known and len(errors) else None,
        "run": record.run,
        "labelled": strategy.has_labels,
        "extent": rounded_list(extent, decimals),
        "zones": [[zone.kind, [rounded_list(corner, decimals) for corner in zone.corners]] for zone in scene.zones],
        "sensors": sensors,
        "times": rounded_list(record.times, 6),
        "truth": [_targets(record, scan, decimals, len(components) > VY) for scan in range(record.num_scans)],
        "estimates": _estimates(record, scenario, decimals),
        **({"heights": _heights(record, components)} if HEIGHT in components else {}),
        **({"classes": _likeliest(record, scenario)} if scenario.model.classes or scenario.model.mode_names else {}),
        **({"modes": _mode_numbers(record), "mode_names": names} if (names := scenario.model.mode_names) else {}),
        "poses": [
            [pose_data(pose, section, decimals) for pose, section in zip(poses, sections, strict=True)]
            for poses in record.poses
        ],
        "scans": _scans(record, scenario, decimals, trust),
        "recorded": scenario.model.recording is not None,
        "known": is_known,
        "names": metadata.names,
        "utc": metadata.start if metadata.is_utc else None,
        "origin": None if origin is None else [origin.lon, origin.lat],
        **({"compass": True} if scenario.model.by_compass else {}),
        "ospa": [rounded_list(parts, 2) for parts in record.ospa] if is_known else [],
        "ospa_unit": scenario.model.ospa.unit,
        "axes": list(axes.values()),
        "reward": scene.reward,
        "decisions": decisions,
    }


def rounded_list(values: Any, decimals: int) -> list[float]:
    """Return rounded numbers as a list."""
    return [round(float(value), decimals) for value in values]


def decimals_for(extent: Sequence[float]) -> int:
    """Return the number of decimals that a pixel can show."""
    return max(0, _DIGITS - math.floor(math.log10(max(extent[1] - extent[0], extent[3] - extent[2]))))


def _extent(record: RunRecord, scenario: Scenario) -> tuple[float, float, float, float]:
    """Return x_min, x_max, y_min, y_max of sensors and targets with a margin, m (of estimates if targets are unknown).

    A scene without extent, such as one sensor without measurements, gets that of the region.
    """
    means = [estimate.means[:, :2] for estimate in record.estimates]
    targets = record.truth.states[:, :2] if len(record.truth.states) else np.concatenate([np.empty((0, 2)), *means])
    points = np.concatenate([targets, record.poses[:, :, :2].reshape(-1, 2)])
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    if size < _LEAST_EXTENT:
        region = scenario.model.region
        return region.x_min, region.x_max, region.y_min, region.y_max
    (x_min, y_min), (x_max, y_max) = (low - _ROOM * size).tolist(), (high + _ROOM * size).tolist()
    return x_min, x_max, y_min, y_max


def sensor_data(name: str, section: SensorSection) -> dict[str, Any]:
    """Return drawing data of a sensor: the shape of its measurements in the plane, and its field of view if bounded.

    `unturned` is the heading (rad) of a stationary sensor with a uniform view, which has no meaning.
    """
    data: dict[str, Any] = {"name": name, "kind": PLANE_SHAPES.get(section.measurement.kind, "none")}
    if section.platform.kind == "stationary" and section.detection.kind in ("constant", "gaussian", "limited_range"):
        data["unturned"] = round(math.radians(section.heading_deg), 4)
    if section.detection.kind in ("limited_range", "limited_sector", "soft_sector"):
        data["range"] = section.detection.max_range
    if section.detection.kind in ("limited_sector", "soft_sector"):
        data["half_width"] = round(math.radians(section.detection.half_width_deg), 4)
    return data


def pose_data(pose: Floats, section: SensorSection, decimals: int) -> list[float]:
    """Return position and heading, for a camera also its field of view: middle and half width in rad, reach in m."""
    pose_numbers = [*rounded_list(pose[:2], decimals), round(float(pose[HEADING]), 4)]
    if section.detection.kind == "camera":
        field = field_of_view(section, pose.tolist())
        pose_numbers += [] if field is None else [*rounded_list(field[:2], 4), round(field.reach, decimals)]
    return pose_numbers


def _targets(record: RunRecord, scan: int, decimals: int, has_velocity: bool) -> list[list[float]]:
    """Return number (from 1) and position of each target, and its velocity if states have one."""
    ids, states = record.truth.at(scan)
    return [
        [target + 1, *rounded_list(state[:2], decimals), *(rounded_list(state[VELOCITY], 2) if has_velocity else [])]
        for target, state in zip(ids.tolist(), states, strict=True)
    ]


def _estimates(record: RunRecord, scenario: Scenario, decimals: int) -> list[list[list[Any]]]:
    """Return the estimates of each scan with the matched targets.

    Each has label, position, existence, ellipse (semi-axes in m, angle in rad), matched target, and error. Target and
    error are those of the assignment in OSPA, and 0 and 0 for an unmatched estimate.
    """
    score = scenario.model.ospa
    matching = match_run(record.truth, record.estimates, cutoff=score.cutoff, order=score.order)
    partners = {
        (scan, *label, *mean): (int(record.truth.ids[row]) + 1, round(distance, decimals))
        for scan, label, mean, row, distance in zip(
            matching.scans.tolist(),
            matching.labels.tolist(),
            matching.means[:, :2].tolist(),
            matching.truth_rows.tolist(),
            matching.distances.tolist(),
            strict=True,
        )
    }
    estimates = []
    for scan, estimate in enumerate(record.estimates):
        rows: list[list[Any]] = []
        for index, label in enumerate(estimate.labels.tolist()):
            partner = partners.get((scan, *label, *estimate.means[index, :2].tolist()), (0, 0.0))
            rows.append([*estimate_data(estimate, index, decimals), *partner])
        estimates.append(rows)
    return estimates


def _heights(record: RunRecord, components: Sequence[str]) -> dict[str, Any]:
    """Return for each scan the heights of the estimates with their standard deviations, and those of the targets, m.

    True targets without heights, such as those of a recording, have none.
    """
    heights: dict[str, Any] = {"estimates": [], "truth": []}
    place = place_of(HEIGHT, components)
    for scan, estimate in enumerate(record.estimates):
        heights["estimates"].append(height_data(estimate, place))
        _, states = record.truth.at(scan)
        heights["truth"].append(rounded_list(states[:, place], 0) if states.shape[1] == len(components) else [])
    return heights


def _likeliest(record: RunRecord, scenario: Scenario) -> list[list[list[Any]]]:
    """Return for each estimate of each scan its most probable class, or else mode of motion, with the probability."""
    names = tuple(scenario.model.classes) or scenario.model.mode_names
    field = "class_probs" if scenario.model.classes else "mode_probs"
    return [
        [[names[probs.argmax()], round(float(probs.max()), 3)] if probs.any() else ["new", 1.0] for probs in each]
        for each in (getattr(estimate, field) for estimate in record.estimates)
    ]


def _mode_numbers(record: RunRecord) -> list[list[int]]:
    """Return for each estimate of each scan the number of its most probable mode of motion, -1 if not drawn yet."""
    probs = (estimate.mode_probs for estimate in record.estimates)
    return [[int(own.argmax()) if own.any() else -1 for own in each] for each in probs]


def height_data(estimate: Estimate, place: int) -> list[list[float]]:
    """Return the height of each target of an estimate with its standard deviation, m. place: of heights in states."""
    stds = np.sqrt(estimate.covs[:, place, place])
    return [rounded_list(pair, 0) for pair in zip(estimate.means[:, place], stds, strict=True)]


def estimate_data(estimate: Estimate, index: int, decimals: int) -> list[Any]:
    """Return label, position, existence and ellipse (semi-axes in m, angle in rad) of one target of an estimate."""
    born, number = estimate.labels[index].tolist()
    position, existence = rounded_list(estimate.means[index, :2], decimals), round(float(estimate.existence[index]), 4)
    return [f"{born}.{number}", *position, existence, *_ellipse(estimate.covs[index, :2, :2], decimals)]


def _ellipse(cov: Floats, decimals: int) -> list[float]:
    variances, axes = np.linalg.eigh(cov)
    semi = _SIGMAS * np.sqrt(np.maximum(variances, 0.0))
    return [*rounded_list(semi[::-1], decimals), round(math.atan2(axes[1, 1], axes[0, 1]), 3)]


def _scans(record: RunRecord, scenario: Scenario, decimals: int, trust: bool) -> list[list[list[list[float]]]]:
    """Return for each scan and sensor its measurements, see `measurement_data`.

    Empty if the models of the scenario, or its recording, are not available.
    """
    kinds = [sensor.measurement.kind for sensor in scenario.model.sensors]
    scans = available_scans(record, scenario, trust) if PLANE_SHAPES.keys() & set(kinds) else ()
    return [
        [measurement_data(scan, kind, pose, decimals) for scan, kind, pose in zip(sensors, kinds, poses, strict=True)]
        for sensors, poses in zip(scans, record.poses, strict=False)
    ]


def measurement_data(scan: Scan | None, kind: str, pose: Floats, decimals: int) -> list[list[float]]:
    """Return for each measurement of a scan its target (0: clutter, -1: unknown), and its position in the plane."""
    if scan is None or kind not in PLANE_SHAPES:
        return []
    digits = _ANGLE_DIGITS if PLANE_SHAPES[kind] == "ray" else decimals
    points = plane_coordinates(scan.measurements, kind, pose)
    return [
        [origin + 1, *rounded_list(point, digits)] for origin, point in zip(scan.origins.tolist(), points, strict=True)
    ]


def decision_data(decision: Decision, axes: dict[str, dict[str, Any]], names: Sequence[str]) -> dict[str, Any]:
    """Return a decision with its rewards, whose axes are added to `axes`, and its explanation."""
    plan = decision.plan
    return {
        "scan": decision.step - 1,
        "actions": describe_choice(rounded_choice(plan)),
        "notes": plan.notes,
        "curves": _curves(plan, axes),
        "map": _map(plan),
        "why": explanation_data(plan, names),
        **({} if decision.undetected is None else {"undetected": _shades(decision.undetected)}),
    }


def _shades(intensity: UndetectedIntensity) -> dict[str, Any]:
    """Return the cells of a map as percent of the largest, and the expected number of undetected targets."""
    grid, largest = intensity.grid, float(intensity.expected.max())
    shares = np.zeros(grid.num_cells) if largest <= 0.0 else np.rint(100.0 * intensity.expected / largest)
    region = grid.region
    return {
        "columns": grid.columns,
        "rows": grid.rows,
        "extent": [region.x_min, region.x_max, region.y_min, region.y_max],
        "shares": shares.astype(int).tolist(),
        "total": _number(intensity.total),
    }


def _curves(plan: Plan, axes: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the reward per action, one curve per sensor with a choice.

    A joint table gives the maximum over the other sensors' actions. Names and positions of the actions are in `axes`,
    each once, with the index `along`.
    """
    curves = []
    for table in plan.tables:
        for position, sensor in enumerate(table.sensors):
            if len(plan.actions[sensor]) == 1:
                continue
            along = action_axis(plan.actions[sensor])
            order = np.argsort(along.places, kind="stable")
            mean, error = best_over_others(table, position)
            axis = {
                "axis": along.title(),
                "numeric": along.is_numeric,
                "places": rounded_list(along.places[order], 1),
                "labels": [along.labels[i] for i in order],
                "ticks": [along.ticks[i] for i in order],
            }
            name = repr(axis)
            axes.setdefault(name, axis)
            curves.append(
                {
                    "sensor": sensor,
                    "along": list(axes).index(name),
                    "mean": [_number(value) for value in mean[order]],
                    "error": [_number(value) for value in error[order]],
                    "chosen": int(np.flatnonzero(order == plan.chosen[sensor])[0]),
                }
            )
    return curves


def _map(plan: Plan) -> dict[str, Any] | None:
    """Return the joint rewards of the first two sensors with a choice, maximised over the other sensors."""
    joint = next((table for table in plan.tables if len(table.sensors) > 1), None)
    pair = first_pair(plan.tables, plan.actions)
    if joint is None or pair is None:
        return None
    axes = [action_axis(plan.actions[sensor]) for sensor in pair]
    orders = [np.argsort(along.places, kind="stable") for along in axes]
    reward = best_over_pair(joint, pair)[np.ix_(*orders)]
    return {
        "sensors": pair,
        "labels": [[along.labels[i] for i in order] for along, order in zip(axes, orders, strict=True)],
        "ticks": [[along.ticks[i] for i in order] for along, order in zip(axes, orders, strict=True)],
        "mean": [[_number(value) for value in row] for row in reward],
        "chosen": [
            int(np.flatnonzero(order == plan.chosen[sensor])[0]) for sensor, order in zip(pair, orders, strict=True)
        ],
    }


def _number(value: float) -> float | None:
    return float(f"{value:.5g}") if math.isfinite(value) else None
