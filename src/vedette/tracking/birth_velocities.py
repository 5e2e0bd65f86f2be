"""Velocities of births from range rates, and positions of births at the scan time of a turning radar."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.densities import LMB
from vedette.kernels.base.types import VELOCITY, VX, VY, Floats
from vedette.kernels.gaussian.innovation import FOLDED_STDS
from vedette.kernels.gaussian.scratch import FULL_TURN
from vedette.models import SensorModel
from vedette.models.arguments import pose_vector
from vedette.models.functions import write_rows
from vedette.models.measurement import wrap_periodic
from vedette.models.scan_rows import ScanLike, as_scan, noise_of_rows, values_of
from vedette.models.turns import is_turn, lags


def with_velocities(births: LMB, std: Floats, sensors: Sequence[SensorModel], scans: Sequence[Any], poses: Any) -> LMB:
    """Condition the velocities of births on the components of measurements that depend on them.

    For each birth and sensor, the nearest measurement is attributed to the birth if it lies within `std` along each
    axis. At its position a component z_c is linear in the velocity v: with h(x) and its slope H at rest, the prior
    N(v; m, P) becomes the posterior of z_c = h_c + H v + noise. Along the line of sight the uncertainty becomes that of
    a range rate. Across it the prior remains.

    Args:
        births: births of one component each, at rest.
        std: (state_dim,) standard deviation of a birth.
        sensors, scans, poses: one per sensor. A scan is None if the sensor did not scan.
    """
    informative = [
        (sensor, as_scan(scan), pose_vector("pose", pose))
        for sensor, scan, pose in zip(sensors, scans, poses, strict=True)
        if sensor.meas_dim > 2 and sensor.measurement.jacobian is not None and scan is not None and len(scan)
    ]
    if not informative or len(std) <= VY or not births.tracks.num_tracks:
        return births
    lmb = births.to_kernel()
    components = lmb.tracks.components
    means, covs = components.means.copy(), components.covs.copy()
    for scan_of_sensor in informative:
        _condition(means, covs, std, *scan_of_sensor)
    updated = components._replace(means=means, covs=covs)
    return LMB.from_kernel(lmb._replace(tracks=lmb.tracks._replace(components=updated)))


def at_scan_time(births: LMB, poses: Sequence[Floats]) -> LMB:
    """Move births from the time when the beam passed them to the scan time: p -> p - lag v.

    Args:
        births: births of one component each.
        poses: poses of the sensors that scanned. Of several turning sensors the mean lag is used, because the position
            of a birth is the mean of their measurements.
    """
    turning = [pose for pose in poses if is_turn(pose)]
    if not turning or not births.tracks.num_tracks:
        return births
    lmb = births.to_kernel()
    components = lmb.tracks.components
    num, dim = components.means.shape
    if dim <= VY:
        return births
    offsets = [components.means[:, :2] - pose[:2] for pose in turning]
    lag = sum(
        lags(np.arctan2(offset[:, 1], offset[:, 0]), pose) for offset, pose in zip(offsets, turning, strict=True)
    ) / len(poses)
    transforms = np.tile(np.eye(dim), (num, 1, 1))
    transforms[:, 0, VX] = transforms[:, 1, VY] = -lag
    means = (transforms @ components.means[:, :, np.newaxis])[..., 0]
    moved = components._replace(means=means, covs=transforms @ components.covs @ transforms.swapaxes(1, 2))
    return LMB.from_kernel(lmb._replace(tracks=lmb.tracks._replace(components=moved)))


def _condition(means: Floats, covs: Floats, std: Floats, sensor: SensorModel, scan: ScanLike, pose: Floats) -> None:
    """Update means (num, state_dim) and covariances (num, state_dim, state_dim) by a scan, in place."""
    model = sensor.measurement
    measured = values_of(scan)
    states_at_rest = model.states_at(measured, pose, len(std))
    slopes = np.empty((len(scan), sensor.meas_dim, len(std)))
    assert model.jacobian is not None
    write_rows(model.jacobian, states_at_rest, pose, model.params, slopes)
    rows = np.flatnonzero(slopes[:, :, VELOCITY].any(axis=(0, 2)))
    gaps = np.abs(means[:, np.newaxis, :2] - states_at_rest[:, :2]) / std[:2]
    all_births, nearest = np.arange(len(means)), gaps.max(axis=2).argmin(axis=1)
    births = np.flatnonzero(gaps.max(axis=2)[all_births, nearest] <= 1.0)
    if not len(rows) or not len(births):
        return
    matched = nearest[births]
    covs_of_noise = noise_of_rows(scan, sensor.noise.covs(states_at_rest, pose, sensor.meas_dim))
    slope, noise = slopes[matched][:, rows, VELOCITY], covs_of_noise[matched][:, rows][:, :, rows]
    off = measured - model.measure(states_at_rest, pose)
    prior, periods = covs[births, VELOCITY, VELOCITY], model.periods[rows]
    residual = wrap_periodic(off[matched][:, rows] - (slope @ means[births, VELOCITY, np.newaxis])[..., 0], periods)
    spread = slope @ prior @ slope.swapaxes(1, 2)
    # A folded component that may be one of several periods has no effect.
    reach = np.where(periods == FULL_TURN, 0.0, FOLDED_STDS * np.sqrt(np.diagonal(spread, axis1=1, axis2=2)))
    slope = np.where((reach > 0.5 * periods)[..., np.newaxis], 0.0, slope)
    innovation = slope @ prior @ slope.swapaxes(1, 2) + noise
    gain = np.linalg.solve(innovation, slope @ prior).swapaxes(1, 2)
    means[births, VELOCITY] += (gain @ residual[..., np.newaxis])[..., 0]
    posterior = prior - gain @ innovation @ gain.swapaxes(1, 2)
    covs[births, VELOCITY, VELOCITY] = 0.5 * (posterior + posterior.swapaxes(1, 2))
