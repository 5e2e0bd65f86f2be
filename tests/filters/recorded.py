"""Recorded scans that other programs made, with their truth, and the models that their authors state.

The files lie outside the repository: in the folder that `VEDETTE_RECORDED_SCANS` names, or in `shared/reference` beside
the checkout. Their states are [px vx py vy (omega)], their bearings are measured from +y.
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
from vedette.evaluation.metrics import ospa
from vedette.filters import LabelledFilter

POSE = np.zeros(3)
PERIOD = 1.0
CUTOFF, ORDER = 100.0, 1.0

# Their order of the state's components, as places in the file.
_ORDER = {4: [0, 2, 1, 3], 5: [0, 2, 1, 3, 4]}


def folder() -> Path:
    """Where the files should be."""
    named = os.environ.get("VEDETTE_RECORDED_SCANS")
    return Path(named) if named else Path(__file__).resolve().parents[3] / "shared" / "reference"


def seeds(family: str) -> list[int]:
    """Seeds for which there is a file of this family."""
    return sorted(int(path.stem.rsplit("_s", 1)[1]) for path in folder().glob(f"meas_{family}_s*.npz"))


@dataclass(frozen=True)
class Recording:
    """One file: its scans, the true positions at each, and the models' parameters as `numpy.load` gives them."""

    scans: tuple[Any, ...]
    positions: tuple[Any, ...]
    parameters: dict[str, Any]


def load(family: str, seed: int) -> Recording:
    with np.load(folder() / f"meas_{family}_s{seed}.npz") as archive:
        parameters = {name: archive[name] for name in archive}
    numbers = range(1, int(parameters["K"]) + 1)
    scans = tuple(np.ascontiguousarray(parameters["Z"][:, parameters["Zk"] == k].T) for k in numbers)
    states = parameters["X_true"][[0, 2]]
    positions = tuple(np.ascontiguousarray(states[:, parameters["Xk_true"] == k].T) for k in numbers)
    return Recording(scans, positions, parameters)


def redraw(recording: Recording, *, rng: np.random.Generator) -> Recording:
    """The same targets seen anew: detections, noise and clutter drawn by the parameters of the file."""
    parameters = recording.parameters
    scans = []
    for positions in recording.positions:
        seen = positions[rng.random(len(positions)) < parameters["P_D"][0]]
        if len(parameters["X_true"]) == 5:
            seen = np.column_stack([np.arctan2(seen[:, 0], seen[:, 1]), np.hypot(seen[:, 0], seen[:, 1])])
        seen = seen + rng.normal(size=seen.shape) * np.sqrt(np.diagonal(parameters["R"]))
        low, high = parameters["range_c"].T
        clutter = rng.uniform(low, high, (rng.poisson(parameters["lambda_c"][0]), 2))
        scans.append(rng.permutation(np.concatenate([seen, clutter])))
    return replace(recording, scans=tuple(scans))


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


def birth_model(parameters: dict[str, Any]) -> models.BirthModel:
    existence = parameters["r_birth"] if "r_birth" in parameters else parameters["w_birth"]
    order = _ORDER[len(parameters["m_birth"])]
    covs = np.moveaxis(parameters["P_birth"], 2, 0)[:, order][:, :, order]
    return models.BirthModel(existence, parameters["m_birth"][order].T, covs)


def sensor_model(parameters: dict[str, Any], method: str) -> models.SensorModel:
    low, high = parameters["range_c"].T
    stds = np.sqrt(np.diagonal(parameters["R"]))
    polar = len(parameters["X_true"]) == 5
    measurement = models.position()
    if polar:
        measurement = models.MeasurementModel(
            2,
            bearing_from_north_and_range,
            jacobian=bearing_from_north_and_range_jacobian,
            angular=np.array([True, False]),
        )
    return models.SensorModel(
        measurement,
        models.constant_noise(stds),
        models.constant_detection(float(parameters["P_D"][0])),
        models.measurement_space_clutter(float(parameters["lambda_c"][0]), low, high),
        method=method,
    )


def motion_model(parameters: dict[str, Any], method: str) -> models.MotionModel:
    if "sigma_turn" in parameters:
        return models.coordinated_turn(float(parameters["sigma_vel"]), float(parameters["sigma_turn"]), method=method)
    return models.constant_velocity(math.sqrt(float(parameters["Q"][1, 1])))


def make_filter(kind: type, recording: Recording, method: str = "ekf", **options: Any) -> LabelledFilter:
    """A filter of this kind with the recording's models; `method` for the motion and the measurement."""
    parameters = recording.parameters
    tracker: LabelledFilter = kind(
        motion_model(parameters, method),
        models.constant_survival(float(parameters["P_S"])),
        birth_model(parameters),
        sensor_model(parameters, method),
        **options,
    )
    return tracker


def run(tracker: LabelledFilter, recording: Recording, *, seed: int = 0) -> tuple[list[Estimate], list[float]]:
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


def mean_ospa(estimates: list[Estimate], recording: Recording) -> float:
    """Mean over the scans of the OSPA distance of positions, c = 100 m, p = 1."""
    distances = [
        ospa(estimate.means[:, :2], positions, cutoff=CUTOFF, order=ORDER).total
        for estimate, positions in zip(estimates, recording.positions, strict=True)
    ]
    return float(np.mean(distances))
