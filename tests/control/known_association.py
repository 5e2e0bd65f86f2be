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
    of linearised sensors.
    """
    own, motion = sensor.filter.sensor, sensor.filter.targets.motion
    assert motion.transition_jacobian is not None
    assert own.measurement.jacobian is not None
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
        expected = own.measurement.measure(mean[None], pose)[0]
        slope = np.empty((own.meas_dim, len(mean)))
        own.measurement.jacobian(mean, pose, own.measurement.params, slope)
        off = measured - expected
        off = np.where(own.measurement.angular, np.arctan2(np.sin(off), np.cos(off)), off)
        innovation = slope @ cov @ slope.T + own.noise.covs(mean[None], pose, own.meas_dim)[0]
        gain = cov @ slope.T @ np.linalg.inv(innovation)
        log_likelihood = -0.5 * (off @ np.linalg.solve(innovation, off) + np.linalg.slogdet(2 * np.pi * innovation)[1])
        clutter = own.clutter.log_intensity(measured, pose, own.clutter.params)
        logit += math.log(1.0 - detection + detection * math.exp(log_likelihood - clutter))
        mean, cov = mean + gain @ off, cov - gain @ slope @ cov
    return logit, mean, cov, missed
