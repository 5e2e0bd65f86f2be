"""Velocities of births from range rates, and positions of births at the scan time of a turning radar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.densities import LMB
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel
from vedette.models.arguments import pose_vector
from vedette.models.functions import write_rows
from vedette.models.row_noise import measured_part, noise_of_rows
from vedette.models.turns import is_turn, lags


def with_velocities(born: LMB, std: Floats, sensors: Sequence[SensorModel], scans: Sequence[Any], poses: Any) -> LMB:
    """Condition the velocities of births on the components of measurements that depend on them.

    For each birth and sensor, the nearest measurement is attributed to the birth if it lies within `std` along each
    axis. At its position a component z_c is linear in the velocity v: with h(x) and its slope H at rest, the prior
    N(v; m, P) becomes the posterior of z_c = h_c + H v + noise. Along the line of sight the uncertainty becomes that of
    a range rate; across it the prior remains.

    Args:
        born: births of one component each, at rest.
        std: (state_dim,) standard deviation of a birth.
        sensors, scans, poses: one per sensor; a scan is None if the sensor did not scan.
    """
    said = [
        (sensor, np.ascontiguousarray(scan, np.float64), pose_vector("pose", pose))
        for sensor, scan, pose in zip(sensors, scans, poses, strict=True)
        if sensor.meas_dim > 2 and sensor.measurement.jacobian is not None and scan is not None and len(scan)
    ]
    if not said or len(std) < 4 or not born.tracks.num_tracks:
        return born
    lmb = born.to_kernel()
    components = lmb.tracks.components
    means, covs = components.means.copy(), components.covs.copy()
    for own in said:
        _condition(means, covs, std, *own)
    moved = components._replace(means=means, covs=covs)
    return LMB.from_kernel(lmb._replace(tracks=lmb.tracks._replace(components=moved)))


def at_scan_time(born: LMB, poses: Sequence[Floats]) -> LMB:
    """Move births from the time when the beam passed them to the scan time: p -> p - lag v.

    Args:
        born: births of one component each.
        poses: poses of the sensors that scanned. Of several turning sensors the mean lag is used, because the position
            of a birth is the mean of their measurements.
    """
    turning = [pose for pose in poses if is_turn(pose)]
    if not turning or not born.tracks.num_tracks:
        return born
    lmb = born.to_kernel()
    components = lmb.tracks.components
    num, dim = components.means.shape
    if dim < 4:
        return born
    off = [components.means[:, :2] - pose[:2] for pose in turning]
    lag = sum(lags(np.arctan2(at[:, 1], at[:, 0]), pose) for at, pose in zip(off, turning, strict=True)) / len(poses)
    back = np.tile(np.eye(dim), (num, 1, 1))
    back[:, 0, 2] = back[:, 1, 3] = -lag
    means = (back @ components.means[:, :, np.newaxis])[..., 0]
    moved = components._replace(means=means, covs=back @ components.covs @ back.swapaxes(1, 2))
    return LMB.from_kernel(lmb._replace(tracks=lmb.tracks._replace(components=moved)))


def _condition(means: Floats, covs: Floats, std: Floats, sensor: SensorModel, scan: Floats, pose: Floats) -> None:
    """Update means (num, state_dim) and covariances (num, state_dim, state_dim) by a scan, in place."""
    model = sensor.measurement
    rest = model.states_at(scan, pose, len(std))
    slopes = np.empty((len(scan), sensor.meas_dim, len(std)))
    assert model.jacobian is not None
    write_rows(model.jacobian, rest, pose, model.params, slopes)
    rows = np.flatnonzero(slopes[:, :, 2:4].any(axis=(0, 2)))
    gaps = np.abs(means[:, np.newaxis, :2] - rest[:, :2]) / std[:2]
    own, nearest = np.arange(len(means)), gaps.max(axis=2).argmin(axis=1)
    births = np.flatnonzero(gaps.max(axis=2)[own, nearest] <= 1.0)
    if not len(rows) or not len(births):
        return
    of = nearest[births]
    covs_of_noise = noise_of_rows(scan, sensor.noise.covs(rest, pose, sensor.meas_dim))
    slope, noise = slopes[of][:, rows, 2:4], covs_of_noise[of][:, rows][:, :, rows]
    off = measured_part(scan, sensor.meas_dim) - model.measure(rest, pose)
    residual = off[of][:, rows] - (slope @ means[births, 2:4, np.newaxis])[..., 0]
    prior = covs[births, 2:4, 2:4]
    innovation = slope @ prior @ slope.swapaxes(1, 2) + noise
    gain = np.linalg.solve(innovation, slope @ prior).swapaxes(1, 2)
    means[births, 2:4] += (gain @ residual[..., np.newaxis])[..., 0]
    after = prior - gain @ innovation @ gain.swapaxes(1, 2)
    covs[births, 2:4, 2:4] = 0.5 * (after + after.swapaxes(1, 2))
