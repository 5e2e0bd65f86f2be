"""Continuation of courses beyond the horizon: straight on, along a path, and by the turns of cameras."""

from collections.abc import Sequence

import numpy as np

from vedette.densities import UndetectedIntensity
from vedette.kernels.base.types import HALF_WIDTH, POINTING, Bools, Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Options
from vedette.platforms.base import SWITCH
from vedette.platforms.camera import angle_beyond_view, is_camera


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


POINTS = "pointing_deg"  # the column of actions with the pointing of a camera
_ARRIVED = 1e-9  # s


def turn_rate(own: Options, horizon: float) -> float:
    """Return the turn rate of a camera [rad/s]: that of the course with the largest turn; 0 for other sensors."""
    if not is_camera(own.pose):
        return 0.0
    return float(np.abs(wrap_angles(own.courses[:, -1, POINTING] - own.pose[POINTING])).max()) / horizon


def seconds_to_turn(own: Options, rate: float, places: Floats) -> Floats:
    """Return the seconds from the end of the best course until a camera has each place in its field of view.

    Shape (num_places,); all 0 for a `rate` of 0. rate: of turning, rad/s. places: (num_places, 2) m.
    """
    if rate == 0.0:
        return np.zeros(len(places))
    return np.asarray(angle_beyond_view(own.courses[:, np.newaxis, -1], places).min(axis=0) / rate)


def seconds_to_search(
    options: Sequence[Options], rates: Sequence[float], reaches: Floats, undetected: UndetectedIntensity, least: float
) -> float:
    """Return the seconds from the end of the best courses until all directions with undetected targets are searched.

    Fewer than `least` of the undetected targets within reach of a sensor may then be left in directions not searched.
    rates: turn rates of the sensors, rad/s. reaches: ranges of the sensors, m.
    """
    seconds = np.full(undetected.num_cells, np.inf)
    for own, rate, reach in zip(options, rates, reaches.tolist(), strict=True):
        near = np.hypot(*(undetected.centres - own.pose[:2]).T) <= reach
        seconds[near] = np.minimum(seconds[near], seconds_to_turn(own, rate, undetected.centres[near]))
    order = np.argsort(-seconds)
    order = order[np.isfinite(seconds[order])]
    last = int(np.searchsorted(np.cumsum(undetected.expected[order]), least))
    return float(seconds[order[last]]) if last < len(order) else 0.0


def turned_on(own: Options, horizon: Floats, times: Floats) -> tuple[Floats, Bools]:
    """Return the pointings of a camera after its horizon, rad, and whether it scans, both (num_courses, num_times).

    The camera continues at the turn rate of its last step, so one that has reached its pointing stays there. One that
    is blind while it turns goes on to where its action points it; from there on it scans and turns as slowly as one
    that stays a step at each field of view, so that courses that arrive earlier search more. horizon: (num_steps,) s,
    times of the poses in `own`. times: (num_times,) s, after the horizon.
    """
    step = horizon[-1] - (horizon[-2] if len(horizon) > 1 else 0.0)
    if is_blind_while_turning(own):
        return _stops(own, float(step), times)
    start = np.full((len(own.courses), 1), own.pose[POINTING])
    last = np.concatenate([start, own.courses[:, :, POINTING]], axis=1)[:, -2:]
    rates = wrap_angles(last[:, 1:] - last[:, :1]) / step
    pointings = np.asarray(wrap_angles(last[:, 1:] + rates * (times - horizon[-1])))
    return pointings, np.ones(pointings.shape, np.bool_)


def is_blind_while_turning(own: Options) -> bool:
    """Return whether a course of a camera that is on makes no scan at some time; then it turns."""
    columns = own.actions.columns
    if POINTS not in columns or own.scans.all():
        return False
    silent = [own.first_action(course) for course in np.flatnonzero(~own.scans.all(axis=1)).tolist()]
    return SWITCH not in columns or bool((own.actions.values[silent, columns.index(SWITCH)] != 0.0).any())


def _stops(own: Options, step: float, times: Floats) -> tuple[Floats, Bools]:
    """Return the result of `turned_on` for a camera that is blind while it turns; step: s, time that it stays."""
    column, first = own.actions.columns.index(POINTS), own.pose[POINTING]
    pointings = np.radians([own.actions.values[own.first_action(course), column] for course in range(len(own.courses))])
    turns = wrap_angles(pointings - first)[:, np.newaxis]
    rate = np.abs(wrap_angles(own.courses[:, 0, POINTING] - first)).max() / step
    if rate == 0.0:
        return np.repeat(wrap_angles(first + turns), len(times), axis=1), np.ones((len(turns), len(times)), np.bool_)
    view = 2.0 * own.courses[:, -1:, HALF_WIDTH]
    since = times - np.abs(turns) / rate
    turned = np.where(since < 0.0, rate, view / (step + view / rate)) * since
    scans = (since >= -_ARRIVED) | (turns == 0.0)
    return wrap_angles(first + turns + np.sign(turns) * turned), scans
