"""Continuation of courses beyond the horizon: straight on, or along a path."""

import numpy as np

from vedette.control.camera_turning import turned_on
from vedette.kernels.base.types import POINTING, Floats
from vedette.platforms import Options
from vedette.platforms.camera import is_camera


def extrapolated(own: Options, horizon: Floats, times: Floats) -> Options:
    """Return the options with courses (num_courses, num_times, pose_dim) at other times, s, from now on.

    horizon: (num_steps,) s, times of the given poses. Between them a sensor moves straight. After the last pose its
    displacement over the whole horizon is repeated, a camera turns on as in `turned_on`, the other components of its
    pose stay, and it scans, even if its action kept it from scanning before.
    """
    start = np.broadcast_to(own.pose, (len(own.courses), 1, len(own.pose)))
    poses = np.concatenate([start, own.courses], axis=1)
    ends = np.concatenate([[0.0], horizon])
    rounds = np.maximum(np.ceil(times / ends[-1] - 1e-9) - 1.0, 0.0)
    within = times - rounds * ends[-1]
    after = np.searchsorted(ends, within - 1e-9).clip(1, len(horizon))
    share = ((within - ends[after - 1]) / (ends[after] - ends[after - 1]))[:, np.newaxis]
    courses = np.where(rounds[:, np.newaxis] > 0.0, poses[:, -1:], poses[:, after])
    moved = poses[:, -1:, :2] - poses[:, :1, :2]
    straight = poses[:, after - 1, :2] * (1.0 - share) + poses[:, after, :2] * share
    courses[:, :, :2] = straight + rounds[:, np.newaxis] * moved
    later = rounds > 0.0
    scans = later | own.scans[:, after - 1]
    if is_camera(own.pose):
        courses[:, later, POINTING], scans[:, later] = turned_on(own, horizon, times[later])
    return own._replace(courses=np.ascontiguousarray(courses), scans=scans)


def walked(corners: Floats, distances: Floats) -> tuple[Floats, Floats, Floats]:
    """Return places (num, num_times, 2) on polylines, headings there, rad, and the fraction of the line up to them.

    corners: (num, num_corners, 2) m. distances: (num, num_times) m from the first corner; beyond the last one, at it.
    """
    legs = np.diff(corners, axis=1)
    lengths = np.hypot(legs[..., 0], legs[..., 1])
    passed = np.concatenate([np.zeros((len(legs), 1)), np.cumsum(lengths, axis=1)], axis=1)
    along, row = np.minimum(distances, passed[:, -1:]), np.arange(len(legs))[:, np.newaxis]
    leg = (along[..., np.newaxis] > passed[:, np.newaxis, 1:-1]).sum(axis=2)
    share = ((along - passed[row, leg]) / np.maximum(lengths[row, leg], 1e-9))[..., np.newaxis]
    headings = np.arctan2(legs[..., 1], legs[..., 0])[row, leg]
    return corners[row, leg] + share * legs[row, leg], headings, along / np.maximum(passed[:, -1:], 1e-9)
