"""Simulated scans: detections with noise and bias, and clutter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import ModelError
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import VELOCITY, VY, Bools, Floats, Ints
from vedette.kernels.gaussian.scans import add_noise, mixed_scan, seen_with
from vedette.models import SensorModel
from vedette.models.arguments import float_array, generator, pose_vector, reject
from vedette.models.bias import NO_BIAS, with_offsets
from vedette.models.functions import numbers_at, write_rows
from vedette.models.measurement import wrap_periodic
from vedette.simulation.true_sensors import ErrorMemory, TrueSensor
from vedette.tracking import StageTimer


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Scan(SummaryRepr):
    """One scan, in random order.

    Attributes:
        measurements: (num_measurements, meas_dim) the input of the filters.
        origins: (num_measurements,) id of the target behind each measurement, or `CLUTTER`, for evaluation only.
    """

    measurements: Floats
    origins: Ints


def simulate_scan(
    truth_states: ArrayLike,
    pose: ArrayLike,
    sensor: SensorModel | TrueSensor,
    *,
    ids: ArrayLike | None = None,
    detection_factors: ArrayLike | None = None,
    rng: np.random.Generator,
) -> Scan:
    """Return detections of the targets, each with additive Gaussian noise, and clutter (paper section IV).

    The number of draws from `rng` depends on the number of targets and on the clutter, never on the pose. Sensors on
    different courses therefore use the same random numbers.

    Args:
        truth_states: (num_targets, state_dim).
        pose: (3 or more,) px, py, heading_rad, ... of the sensor.
        sensor: the sensor model of the filter, or a true sensor that differs from it.
        ids: (num_targets,) ids for `Scan.origins`. None: the row in `truth_states`.
        detection_factors: (num_targets,) factor on the probability of detection of each, in [0, 1]. None: 1.
        rng: generator of all random numbers.

    Raises:
        InputError: invalid states, pose, ids or factors.
        ModelError: a model function raised or returned an invalid value at a target's state.
    """
    states, pose = float_array("truth_states", truth_states, (None, None)), pose_vector("pose", pose)
    factors = _factors(detection_factors, len(states))
    return _drawn(states, _named(ids, len(states)), factors, pose, sensor, generator(rng), ErrorMemory(), 0.0)


def _named(ids: ArrayLike | None, num: int) -> Ints:
    """(num,) ids of the targets. None: their row numbers."""
    names = np.arange(num) if ids is None else np.array(ids)
    if names.shape != (num,):
        raise reject("ids", f"{num} ids, one a target", names.tolist())
    return names.astype(np.int64, copy=False)


def _factors(given: ArrayLike | None, num: int) -> Floats:
    """(num,) factors on the probabilities of detection."""
    factors = float_array("detection_factors", np.ones(num) if given is None else given, (num,))
    if (factors < 0.0).any() or (factors > 1.0).any():
        raise reject("detection_factors", "numbers in [0, 1]", factors.tolist())
    return factors


def _drawn(
    states: Floats,
    names: Ints,
    factors: Floats,
    pose: Floats,
    sensor: SensorModel | TrueSensor,
    rng: np.random.Generator,
    memory: ErrorMemory,
    time: float,
) -> Scan:
    """Return one scan from checked arguments."""
    true = sensor if isinstance(sensor, TrueSensor) else TrueSensor(sensor)
    num, model = len(states), true.model
    uniforms = rng.random(num)
    states, true_pose = (states, pose) if true.bias is NO_BIAS else _shown(true, states, pose)
    normals = rng.standard_normal((num, model.meas_dim))
    luck = np.zeros(num) if true.stays_s is None else rng.random(num)
    factors = factors * memory.lasting(true, time, names, normals, luck)
    measured = _noisy_measurements(model, states, true_pose, normals)
    detected = _seen(model, _detected_at(true, states, true_pose, measured), true_pose, factors, uniforms)
    clutter = model.clutter.sample(true_pose, model.measurement, state_dim=states.shape[1], rng=rng)
    order = rng.random(num + len(clutter)).argsort()
    if true.bias is not NO_BIAS:
        measured, clutter = _biased(true, measured), _biased(true, clutter)
    return Scan(*mixed_scan(measured, names, detected, clutter, order))


@overload
def simulate_scans(
    truth_states: ArrayLike,
    poses: Floats,
    sensors: Sequence[SensorModel | TrueSensor],
    *,
    ids: ArrayLike | None = None,
    detection_factors: ArrayLike | None = None,
    rngs: Sequence[np.random.Generator],
    memories: Sequence[ErrorMemory] | None = None,
    time: float = 0.0,
) -> tuple[Scan, ...]:
    """Return one scan per sensor if all scan."""


@overload
def simulate_scans(
    truth_states: ArrayLike,
    poses: Floats,
    sensors: Sequence[SensorModel | TrueSensor | None],
    *,
    ids: ArrayLike | None = None,
    detection_factors: ArrayLike | None = None,
    rngs: Sequence[np.random.Generator],
    memories: Sequence[ErrorMemory] | None = None,
    time: float = 0.0,
) -> tuple[Scan | None, ...]:
    """Return one scan per sensor, None for those that do not scan."""


def simulate_scans(
    truth_states: ArrayLike,
    poses: Floats,
    sensors: Sequence[SensorModel | TrueSensor | None],
    *,
    ids: ArrayLike | None = None,
    detection_factors: ArrayLike | None = None,
    rngs: Sequence[np.random.Generator],
    memories: Sequence[ErrorMemory] | None = None,
    time: float = 0.0,
) -> tuple[Scan | None, ...]:
    """Return one scan per sensor, each with its own pose and random numbers. See `simulate_scan`.

    A sensor that is None does not scan and draws nothing. Its entry is None.

    memories: of the errors of each sensor, which this changes. None: they do not last. time: of the scans, s.
    """
    states, stages, scans = float_array("truth_states", truth_states, (None, None)), StageTimer(), list[Scan | None]()
    names, factors = _named(ids, len(states)), _factors(detection_factors, len(states))
    kept = [ErrorMemory() for _ in sensors] if memories is None else memories
    for s, (pose, sensor, rng, memory) in enumerate(zip(poses, sensors, rngs, kept, strict=True)):
        with stages.timing("scans", s):
            drawn = None
            if sensor is not None:
                at = pose_vector("pose", pose)
                drawn = _drawn(states, names, factors, at, sensor, generator(rng), memory, time)
            scans.append(drawn)
    return tuple(scans)


def active_scans(scans: Sequence[Scan | None], off: Bools) -> tuple[Scan | None, ...]:
    """Return the scans of one time, with None for sensors that are off (num_sensors,).

    All scans are drawn first, so that random numbers do not depend on whether a sensor was off before.
    """
    return tuple([None if is_off else scan for scan, is_off in zip(scans, off.tolist(), strict=True)])


def _shown(sensor: TrueSensor, states: Floats, pose: Floats) -> tuple[Floats, Floats]:
    """Return the targets' states at the true time of the scan, and the true pose of the sensor."""
    bias = sensor.bias
    if bias.clock and states.shape[1] > VY:
        states = states.copy()
        states[:, :2] -= bias.clock * states[:, VELOCITY]
    if "x" not in sensor.model.measurement.components and (bias.x or bias.y):
        pose = pose.copy()
        pose[:2] -= bias.x, bias.y
    return states, pose


def _biased(sensor: TrueSensor, measured: Floats) -> Floats:
    """Return the measurements with the bias of the sensor."""
    names = sensor.model.measurement.components
    offsets = np.array([getattr(sensor.bias, name) for name in names])
    if not offsets.any():
        return measured
    return wrap_periodic(with_offsets(measured, offsets, names), sensor.model.measurement.periods)


def _detected_at(sensor: TrueSensor, states: Floats, pose: Floats, measured: Floats) -> Floats:
    """Return the states for the detection probability: the true ones, or with the measured positions."""
    if sensor.detection_of == "state":
        return states
    measured_states = states.copy()
    measured_states[:, :2] = sensor.model.measurement.positions(measured, pose)
    return measured_states


def _seen(sensor: SensorModel, states: Floats, pose: Floats, factors: Floats, uniforms: Floats) -> Bools:
    chances = factors * numbers_at(sensor.detection.function, states, pose, sensor.detection.params)
    detected, bad = seen_with(chances, uniforms)
    if bad >= 0:
        state, got = states[bad], chances[bad]
        raise ModelError(f"detection model at state {state}, pose {pose}: expected a probability; got {got}")
    return detected


def _noisy_measurements(sensor: SensorModel, states: Floats, pose: Floats, normals: Floats) -> Floats:
    factors = _noise_factors(sensor, states, pose)
    noise = (factors @ normals[:, :, np.newaxis])[:, :, 0]
    measured = np.empty(normals.shape)
    write_rows(sensor.measurement.function, states, pose, sensor.measurement.params, measured)
    bad = add_noise(measured, noise, sensor.measurement.periods)
    if bad >= 0:
        state, got = states[bad], measured[bad]
        raise ModelError(f"sensor model at state {state}, pose {pose}: expected a finite measurement; got {got}")
    return measured


def _noise_factors(sensor: SensorModel, states: Floats, pose: Floats) -> Floats:
    """(num_targets, meas_dim, meas_dim) lower Cholesky factors of the noise covariances."""
    covs = np.empty((len(states), sensor.meas_dim, sensor.meas_dim))
    write_rows(sensor.noise.function, states, pose, sensor.noise.params, covs)
    try:
        return np.asarray(np.linalg.cholesky(covs), dtype=np.float64)
    except np.linalg.LinAlgError:
        bad = np.linalg.eigvalsh(covs)[:, 0].argmin()
        message = f"expected a positive definite covariance; got {covs[bad].tolist()}"
        raise ModelError(f"noise model at state {states[bad]}, pose {pose}: {message}") from None
