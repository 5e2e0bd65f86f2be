"""Continuation of courses beyond the horizon: straight on, or along a path."""

from __future__ import annotations

import math

import numpy as np

from vedette.control.camera_turning import turned_on
from vedette.kernels.base.types import Floats
from vedette.platforms import Options
from vedette.platforms.camera import POINTING, is_camera


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


def write_path(course: Floats, corners: Floats, run: Floats, end: Floats, step: Floats) -> Floats:
    """Write poses along a path into a course (num_times, pose_dim); returns the fraction travelled at each such time.

    corners: (num_corners, 2) m, corners of the path.
    run: (num_times,) m, distance travelled from the end of the horizon on; 0 before.
    end: the pose (pose_dim,) at the end of the horizon.
    step: (2,) m, from the present pose to it. A sensor that heads in its direction of motion does so on the path.
    """
    legs = np.diff(corners, axis=0)
    passed = np.concatenate([[0.0], np.cumsum(np.hypot(legs[:, 0], legs[:, 1]))])
    after = run > 0.0
    run = np.minimum(run[after], passed[-1])
    course[after, 0], course[after, 1] = (np.interp(run, passed, corners[:, axis]) for axis in (0, 1))
    if abs(math.remainder(end[2] - math.atan2(step[1], step[0]), 2.0 * math.pi)) < 1e-6:
        leg = np.searchsorted(passed, run).clip(1, len(legs)) - 1
        course[after, 2] = np.arctan2(legs[leg, 1], legs[leg, 0])
    return np.asarray(run / max(passed[-1], 1e-9))
