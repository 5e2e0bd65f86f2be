"""Recorded scans with their truth, and the models that they were made with.

Those in `recordings/` are of this project's own generator. Scans of the same families that other programs made are
used too where they are at hand: in the folder that `VEDETTE_RECORDED_SCANS` names, or in `shared/reference` beside the
checkout.
The states in the files are [px vx py vy (omega)], those of three sensors [px py vx vy]; bearings are measured from +y.
"""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vedette import models
from vedette.densities import GLMB, LMB, Estimate, map_estimate
from vedette.evaluation.metrics.point_ospa import ospa
from vedette.filters import Filter, LmbFilter
from vedette.fusion import Fusion

POSE = np.zeros(3)
PERIOD = 1.0
CUTOFF, ORDER = 100.0, 1.0

# The order of the state's components, as places in the file.
STATE_ORDER = {4: [0, 2, 1, 3], 5: [0, 2, 1, 3, 4]}


OWN = Path(__file__).with_name("recordings")


def others() -> Path:
    """Where the files of other programs would be."""
    named = os.environ.get("VEDETTE_RECORDED_SCANS")
    return Path(named) if named else Path(__file__).resolve().parents[3] / "shared" / "reference"


def sources() -> dict[str, Path]:
    """The folders that hold files: this project's own, and that of other programs where it is at hand."""
    return {"own": OWN} | ({"others": others()} if any(others().glob("meas_*_s*.npz")) else {})


def seeds(family: str, folder: Path = OWN) -> list[int]:
    """Seeds for which there is a file of this family."""
    return sorted(int(path.stem.rsplit("_s", 1)[1]) for path in folder.glob(f"meas_{family}_s*.npz"))


@dataclass(frozen=True)
class Recording:
    """One file: its scans, the true positions at each, and the models' parameters as `numpy.load` gives them."""

    scans: tuple[Any, ...]
    positions: tuple[Any, ...]
    parameters: dict[str, Any]


def load(family: str, seed: int, folder: Path = OWN) -> Recording:
    """The scans of a file; of several sensors, one after another within each scan (`scans_of` takes them apart)."""
    with np.load(folder / f"meas_{family}_s{seed}.npz") as archive:
        parameters = {name: archive[name] for name in archive}
    for name in ("Z", "X_true"):
        parameters[name] = parameters[name].astype(np.float64)
    numbers = range(1, int(parameters["K"]) + 1)
    scans = tuple(np.ascontiguousarray(parameters["Z"][:, parameters["Zk"] == k].T) for k in numbers)
    states = parameters["X_true"][[0, 1] if "n_sensors" in parameters else [0, 2]]
    positions = tuple(np.ascontiguousarray(states[:, parameters["Xk_true"] == k].T) for k in numbers)
    return Recording(scans, positions, parameters)


def scans_of(recording: Recording, sensor: int) -> list[Any]:
    """The scans of one of several sensors, counted from 0."""
    parameters = recording.parameters
    own = parameters["Zs"] == sensor + 1
    numbers = range(1, int(parameters["K"]) + 1)
    return [np.ascontiguousarray(parameters["Z"][:, own & (parameters["Zk"] == k)].T) for k in numbers]


def redraw(recording: Recording, *, rng: np.random.Generator) -> Recording:
    """The same targets seen anew: detections, noise and clutter drawn by the parameters of the file."""
    parameters = recording.parameters
    scans, numbers = [], []
    for number, positions in enumerate(recording.positions, start=1):
        of_sensors = [_seen_anew(parameters, sensor, positions, rng) for sensor in range(len(parameters["P_D"]))]
        scans.append(np.concatenate(of_sensors))
        numbers += [(number, sensor) for sensor, scan in enumerate(of_sensors, start=1) for _ in scan]
    steps, sensors = np.array(numbers).T
    drawn = {"Z": np.concatenate(scans).T, "Zk": steps} | ({"Zs": sensors} if "n_sensors" in parameters else {})
    return replace(recording, scans=tuple(scans), parameters={**parameters, **drawn})


def _seen_anew(parameters: dict[str, Any], sensor: int, positions: Any, rng: np.random.Generator) -> Any:
    """One scan of a sensor, counted from 0."""
    several = "n_sensors" in parameters
    seen = positions[rng.random(len(positions)) < parameters["P_D"][sensor]]
    if len(parameters["X_true"]) == 5:
        seen = np.column_stack([np.arctan2(seen[:, 0], seen[:, 1]), np.hypot(seen[:, 0], seen[:, 1])])
    cov = parameters["R_sensor"][:, :, sensor] if several else parameters["R"]
    seen = seen + rng.normal(size=seen.shape) * np.sqrt(np.diagonal(cov))
    low, high = parameters["region" if several else "range_c"].T
    clutter = rng.uniform(low, high, (rng.poisson(parameters["lambda_c"][sensor]), 2))
    return rng.permutation(np.concatenate([seen, clutter]))


@models.model_function("measurement")
def bearing_from_north_and_range(state, pose, params, out):
    dx = state[0] - pose[0]
    dy = state[1] - pose[1]
    out[0] = math.atan2(dx, dy)
    out[1] = math.sqrt(dx * dx + dy * dy)


@models.model_function("measurement_jacobian")
def bearing_from_north_and_range_jacobian(state, pose, params, out):
    dx = state[0] - pose[0]
    dy = state[1] - pose[1]
    square = dx * dx + dy * dy
    distance = math.sqrt(square)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    out[0, 0] = dy / square
    out[0, 1] = -dx / square
    out[1, 0] = dx / distance
    out[1, 1] = dy / distance


@models.model_function("process_noise_cov")
def white_acceleration(state, dt, params, out):
    for i in range(4):
        for j in range(4):
            out[i, j] = 0.0
    for i in range(2):
        out[i, i] = dt**3 / 3.0
        out[i, i + 2] = out[i + 2, i] = dt**2 / 2.0
        out[i + 2, i + 2] = dt


def birth_model(parameters: dict[str, Any]) -> models.BirthModel:
    existence = parameters["r_birth"] if "r_birth" in parameters else parameters["w_birth"]
    order = list(range(4)) if "n_sensors" in parameters else STATE_ORDER[len(parameters["m_birth"])]
    covs = np.moveaxis(parameters["P_birth"], 2, 0)[:, order][:, :, order]
    return models.BirthModel(existence, parameters["m_birth"][order].T, covs)


def sensor_models(parameters: dict[str, Any], method: str) -> tuple[models.SensorModel, ...]:
    """The sensors of a file: three in `mslin3`, else one."""
    low, high = parameters["region" if "n_sensors" in parameters else "range_c"].T
    measurement = models.position()
    if "sigma_turn" in parameters:
        measurement = models.MeasurementModel(
            2,
            bearing_from_north_and_range,
            jacobian=bearing_from_north_and_range_jacobian,
            angular=np.array([True, False]),
        )
    covs = np.moveaxis(parameters["R_sensor"], 2, 0) if "n_sensors" in parameters else [parameters["R"]]
    return tuple(
        models.SensorModel(
            measurement,
            models.constant_noise(np.sqrt(np.diagonal(cov))),
            models.constant_detection(float(probability)),
            models.measurement_space_clutter(float(rate), low, high),
            method=method,
        )
        for cov, probability, rate in zip(covs, parameters["P_D"], parameters["lambda_c"], strict=True)
    )


def motion_model(parameters: dict[str, Any], method: str) -> models.MotionModel:
    if "sigma_turn" in parameters:
        return models.coordinated_turn(float(parameters["sigma_vel"]), float(parameters["sigma_turn"]), method=method)
    if "Qproc" in parameters:
        return replace(models.constant_velocity(0.0), process_noise_cov=white_acceleration)
    return models.constant_velocity(math.sqrt(float(parameters["Q"][1, 1])))


def make_filter(kind: type, recording: Recording, method: str = "ekf", **options: Any) -> Filter:
    """A filter of this kind with the recording's models; `method` for the motion and the measurement."""
    return make_filters(kind, recording, method, **options)[0]


def make_filters(kind: type, recording: Recording, method: str = "ekf", **options: Any) -> list[Filter]:
    """The same, one for each sensor of the recording."""
    parameters = recording.parameters
    survival = models.constant_survival(float(parameters["P_S"]))
    targets = models.TargetModel(motion_model(parameters, method), survival, birth_model(parameters))
    return [kind(targets, sensor, **options) for sensor in sensor_models(parameters, method)]


def run(tracker: Filter, recording: Recording, *, seed: int = 0) -> tuple[list[Estimate], list[float]]:
    """Estimates at every scan (most probable number of targets, then the most probable of that number), and the CPU
    seconds of each step.
    """
    rng = np.random.default_rng(seed)
    belief: GLMB | LMB = tracker.initial()
    estimates, seconds = [], []
    for step, scan in enumerate(recording.scans):
        start = time.process_time()
        belief, _ = tracker.step(belief, scan, POSE, PERIOD, step + 1, rng=rng)
        seconds.append(time.process_time() - start)
        estimates.append(map_estimate(belief))
    return estimates, seconds


def make_central(kind: type, recording: Recording, method: str = "auto", **options: Any) -> Any:
    """A filter of all sensors of the recording."""
    trackers = make_filters(LmbFilter, recording, method)
    return kind(trackers[0].targets, [tracker.sensor for tracker in trackers], **options)


def run_central(tracker: Any, recording: Recording, *, seed: int = 0) -> tuple[list[Estimate], list[float]]:
    """As `run`, of a filter of all sensors of the recording."""
    rng, num = np.random.default_rng(seed), len(tracker.sensors)
    belief, estimates, seconds = tracker.initial(), [], []
    for step, scans in enumerate(zip(*(scans_of(recording, s) for s in range(num)), strict=True), start=1):
        start = time.process_time()
        belief, _ = tracker.step(belief, scans, [POSE] * num, PERIOD, step, rng=rng)
        seconds.append(time.process_time() - start)
        estimates.append(map_estimate(belief))
    return estimates, seconds


def run_fused(trackers: list[Filter], fusion: Fusion, recording: Recording, *, seed: int = 0) -> list[Estimate]:
    """Estimates at every scan from the fusion of all sensors' beliefs, which is fed back: with births at every scan
    sensors would else give one target different labels.
    """
    rng = np.random.default_rng(seed)
    beliefs: list[Any] = [tracker.initial() for tracker in trackers]
    estimates = []
    for step, scans in enumerate(zip(*(scans_of(recording, s) for s in range(len(trackers))), strict=True), start=1):
        for s, (tracker, scan) in enumerate(zip(trackers, scans, strict=True)):
            beliefs[s], _ = tracker.step(beliefs[s], scan, POSE, PERIOD, step, rng=rng)
        fused, _ = fusion.fuse(beliefs)
        beliefs = [fused] * len(trackers)
        estimates.append(map_estimate(fused))
    return estimates


def mean_ospa(estimates: list[Estimate], recording: Recording) -> float:
    """Mean over the scans of the OSPA distance of positions, c = 100 m, p = 1."""
    distances = [
        ospa(estimate.means[:, :2], positions, cutoff=CUTOFF, order=ORDER).total
        for estimate, positions in zip(estimates, recording.positions, strict=True)
    ]
    return float(np.mean(distances))
