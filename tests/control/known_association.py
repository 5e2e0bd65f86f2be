"""Pseudo-updates with known association in plain NumPy: one label, one measurement, one line each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from control.plain_loop import scans_then
from vedette.control import MobileSensor, PlanningSettings


def followed(
    logit: float, mean: Any, cov: Any, target: Any, sensor: MobileSensor, course: Any, settings: PlanningSettings
) -> tuple[float, Any, Any, float]:
    """Logit, mean, covariance at the end of a course, and the probability of never being detected.

    target: (horizon_steps, state_dim) states of the sampled target, or None where it is not there. "ideal" measurements
    of sensors with method "ekf" or "auto".
    """
    own, motion = sensor.filter.sensor, sensor.filter.targets.motion
    assert motion.transition_jacobian is not None
    missed = 1.0
    for h, pose in enumerate(course):
        jacobian, noise = np.empty((len(mean), len(mean))), np.empty((len(mean), len(mean)))
        motion.transition_jacobian(mean, settings.horizon_period, motion.transition_params, jacobian)
        motion.process_noise_cov(mean, settings.horizon_period, motion.noise_params, noise)
        mean = motion.propagate(mean[None], settings.horizon_period)[0]
        cov = jacobian @ cov @ jacobian.T + noise
        if not scans_then(sensor, h, settings):
            continue
        detection = float(own.detection.prob(mean[None], pose)[0])
        missed *= 1.0 - detection
        if target is None or own.detection.prob(target[h][None], pose)[0] < settings.detection_threshold:
            logit += math.log(1.0 - detection)
            continue
        measured = own.measurement.measure(target[h][None], pose)[0]
        found, spread, log_likelihood = updated(mean, cov, measured, pose, sensor)
        clutter = own.clutter.log_intensity(measured, pose, own.clutter.params)
        logit += math.log(1.0 - detection + detection * math.exp(log_likelihood - clutter))
        mean, cov = found, spread
    return logit, mean, cov, missed


def updated(
    mean: Any, cov: Any, measured: Any, pose: Any, sensor: MobileSensor, start: Any = None
) -> tuple[Any, Any, float]:
    """Mean, covariance and log likelihood of a measurement, by "ekf", or "auto" of a bearing and range.

    "auto" is the extended filter unless the second-order error of the bearing or range is above 0.3 standard deviations
    of its noise. Then: Gauss-Newton steps from the unscented update, or from a start, to the peak, away from the sensor
    along its ray, and a regression over the posterior there.
    """
    own = sensor.filter.sensor
    assert own.method in ("ekf", "auto")
    noise, square = own.noise.covs(mean[None], pose, own.meas_dim)[0], float(np.sum((mean[:2] - pose[:2]) ** 2))
    slope, variance = jacobian_at(mean, pose, sensor), cov[0, 0] + cov[1, 1]
    errors = np.hypot(slope[:, 0], slope[:, 1]) * variance / (2.0 * np.sqrt(square))
    if own.method == "ekf" or (errors <= 0.3 * np.sqrt(np.diag(noise))).all():
        expected = own.measurement.measure(mean[None], pose)[0]
        return linear_update(mean, cov, mean, unwrapped(measured - expected, sensor), slope, noise)
    expected, slope, left = regression(mean, cov, pose, sensor)
    state, _, _ = linear_update(mean, cov, mean, unwrapped(measured - expected, sensor), slope, noise + left)
    state, spread = climbed(state if start is None else start.copy(), mean, cov, measured, pose, sensor)
    ray = state[:2] - pose[:2]
    ratio = ray @ spread[:2, :2] @ ray / (ray @ ray) ** 2
    state[:2] = pose[:2] + (0.5 + 0.5 * np.sqrt(1.0 + 4.0 * ratio)) * ray
    _, spread, _ = update_at(state, mean, cov, measured, pose, sensor)
    expected, slope, left = regression(state, spread, pose, sensor)
    return linear_update(mean, cov, state, unwrapped(measured - expected, sensor), slope, noise + left)


def linear_update(mean: Any, cov: Any, state: Any, off: Any, slope: Any, noise: Any) -> tuple[Any, Any, float]:
    """Kalman update by a measurement that is linear, of which `off` is left over at a state."""
    innovation, off = slope @ cov @ slope.T + noise, off + slope @ (state - mean)
    gain = cov @ slope.T @ np.linalg.inv(innovation)
    distance, log_det = off @ np.linalg.solve(innovation, off), np.linalg.slogdet(2.0 * np.pi * innovation)[1]
    return mean + gain @ off, cov - gain @ innovation @ gain.T, float(-0.5 * (distance + log_det))


def update_at(
    state: Any, mean: Any, cov: Any, measured: Any, pose: Any, sensor: MobileSensor
) -> tuple[Any, Any, float]:
    """Update by the Jacobian at a state."""
    own = sensor.filter.sensor
    off = unwrapped(measured - own.measurement.measure(state[None], pose)[0], sensor)
    noise = own.noise.covs(mean[None], pose, own.meas_dim)[0]
    return linear_update(mean, cov, state, off, jacobian_at(state, pose, sensor), noise)


def climbed(state: Any, mean: Any, cov: Any, measured: Any, pose: Any, sensor: MobileSensor) -> tuple[Any, Any]:
    """The peak of prior times likelihood, from a state on, and the posterior covariance at the last step."""
    own = sensor.filter.sensor
    noise = own.noise.covs(mean[None], pose, own.meas_dim)[0]

    def distance(at: Any) -> float:
        off = unwrapped(measured - own.measurement.measure(at[None], pose)[0], sensor)
        return float(off @ np.linalg.solve(noise, off) + (at - mean) @ np.linalg.solve(cov, at - mean))

    while True:
        goal, spread, _ = update_at(state, mean, cov, measured, pose, sensor)
        least = distance(state)
        trials = [state + 0.5**k * (goal - state) for k in range(8)]
        state = next((trial for trial in trials if distance(trial) < least), state)
        if least - distance(state) <= 1e-3:
            return state, spread


def regression(mean: Any, cov: Any, pose: Any, sensor: MobileSensor) -> tuple[Any, Any, Any]:
    """Mean of a measurement over a Gaussian, its slope, and the covariance that a line leaves over.

    By the 2 n + 1 points of Julier and Uhlmann with kappa = 1.
    """
    own, n = sensor.filter.sensor, len(mean)
    root = np.sqrt(n + 1.0) * np.linalg.cholesky(cov).T
    points = np.concatenate([[mean], mean + root, mean - root])
    weights = np.array([1.0, *[0.5] * (2 * n)]) / (n + 1.0)
    images = own.measurement.measure(points, pose)
    base = images[0]
    expected = unwrapped(base + weights @ unwrapped(images - base, sensor), sensor)
    off = unwrapped(images - expected, sensor)
    slope = np.linalg.solve(cov, (weights * (points - mean).T) @ off).T
    return expected, slope, (weights * off.T) @ off - slope @ cov @ slope.T


def jacobian_at(state: Any, pose: Any, sensor: MobileSensor) -> Any:
    """(meas_dim, state_dim) derivatives of the measurement."""
    measurement = sensor.filter.sensor.measurement
    assert measurement.jacobian is not None
    slope = np.zeros((measurement.meas_dim, len(state)))
    measurement.jacobian(state, pose, measurement.params, slope)
    return slope


def unwrapped(difference: Any, sensor: MobileSensor) -> Any:
    """With angles between -pi and pi."""
    wrapped = np.arctan2(np.sin(difference), np.cos(difference))
    return np.where(sensor.filter.sensor.measurement.angular, wrapped, difference)
