"""A scan in plain NumPy, one line after the other: the numbers of a seed are these to the last bit."""

from __future__ import annotations

import math

import numpy as np

from vedette.models.bias import LEAST_RANGE
from vedette.simulation import CLUTTER, TrueSensor


def on_circle(angles):
    """The same directions in (-pi, pi]."""
    away = (angles > math.pi) | (angles <= -math.pi)
    return np.where(away, math.pi - np.remainder(math.pi - angles, 2.0 * math.pi), angles)


def noisy(model, states, pose, normals):
    """(n, meas_dim) h(x) + L z with L L' = R(x)."""
    factors = np.linalg.cholesky(model.noise.covs(states, pose, model.meas_dim))
    noise = (factors @ normals[:, :, np.newaxis])[:, :, 0]
    measured = model.measurement.measure(states, pose) + noise
    return np.where(model.measurement.angular, on_circle(measured), measured)


def said(true, measured):
    """With the bias added; as it was where there is none."""
    model = true.model.measurement
    offsets = [getattr(true.bias, name) for name in model.components]
    if not any(offsets):
        return measured
    found = np.where(model.angular, on_circle(measured + offsets), measured + offsets)
    for i, name in enumerate(model.components):
        if name == "range":
            found[:, i] = np.maximum(found[:, i], LEAST_RANGE)
    return found


def scan(states, pose, true: TrueSensor, ids, rng):
    """Measurements and origins of one scan."""
    model, bias = true.model, true.bias
    states, pose = np.array(states), np.array(pose)
    luck = rng.uniform(size=len(states))
    if bias.clock:
        states[:, :2] -= bias.clock * states[:, 2:4]
    if "x" not in model.measurement.components:
        pose[:2] -= bias.x, bias.y
    measured = noisy(model, states, pose, rng.standard_normal((len(states), model.meas_dim)))
    asked = states.copy()
    if true.detection_of == "measurement":
        asked[:, :2] = model.measurement.positions(measured, pose)
    seen = luck < model.detection.prob(asked, pose)
    clutter = model.clutter.sample(pose, model.measurement, state_dim=states.shape[1], rng=rng)
    rows = said(true, np.concatenate([measured, clutter]))
    origins = np.concatenate([ids, np.full(len(clutter), CLUTTER)]).astype(np.int64)
    order = np.argsort(rng.uniform(size=len(rows)))
    kept = [place for place in order if place >= len(states) or seen[place]]
    return rows[kept], origins[kept]


def region_clutter(rate, region, measurement, pose, state_dim, rng):
    """Clutter that is uniform over a region, as measured from a pose."""
    num = int(rng.poisson(rate))
    states = np.zeros((num, state_dim))
    states[:, :2] = rng.uniform([region.x_min, region.y_min], [region.x_max, region.y_max], size=(num, 2))
    return measurement.measure(states, pose)
