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
        expected, spread, cross = measurement_moments(mean, cov, pose, sensor)
        off = unwrapped(measured - expected, sensor)
        innovation = spread + own.noise.covs(mean[None], pose, own.meas_dim)[0]
        gain = cross @ np.linalg.inv(innovation)
        log_likelihood = -0.5 * (off @ np.linalg.solve(innovation, off) + np.linalg.slogdet(2 * np.pi * innovation)[1])
        clutter = own.clutter.log_intensity(measured, pose, own.clutter.params)
        logit += math.log(1.0 - detection + detection * math.exp(log_likelihood - clutter))
        mean, cov = mean + gain @ off, cov - gain @ innovation @ gain.T
    return logit, mean, cov, missed


def measurement_moments(mean: Any, cov: Any, pose: Any, sensor: MobileSensor) -> tuple[Any, Any, Any]:
    """Mean and covariance of a measurement without noise, and its covariance with the state, by "ekf" or "auto".

    Linearised, but with "auto" for places that are a fifth of their distance uncertain: there by the 2 n + 1 points of
    Julier and Uhlmann with kappa = 1.
    """
    own, n = sensor.filter.sensor, len(mean)
    assert own.method in ("ekf", "auto")
    if own.method == "ekf" or np.sqrt(cov[0, 0] + cov[1, 1]) <= 0.2 * np.hypot(*(mean[:2] - pose[:2])):
        assert own.measurement.jacobian is not None
        slope = np.empty((own.meas_dim, n))
        own.measurement.jacobian(mean, pose, own.measurement.params, slope)
        return own.measurement.measure(mean[None], pose)[0], slope @ cov @ slope.T, cov @ slope.T
    root = np.sqrt(n + 1.0) * np.linalg.cholesky(cov).T
    points = np.concatenate([[mean], mean + root, mean - root])
    weights = np.array([1.0, *[0.5] * (2 * n)]) / (n + 1.0)
    images = own.measurement.measure(points, pose)
    base = images[0]
    expected = unwrapped(base + weights @ unwrapped(images - base, sensor), sensor)
    off = unwrapped(images - expected, sensor)
    return expected, (weights * off.T) @ off, (weights * (points - mean).T) @ off


def unwrapped(difference: Any, sensor: MobileSensor) -> Any:
    """With angles between -pi and pi."""
    wrapped = np.arctan2(np.sin(difference), np.cos(difference))
    return np.where(sensor.filter.sensor.measurement.angular, wrapped, difference)
