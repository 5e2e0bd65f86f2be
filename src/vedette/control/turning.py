"""How long cameras take to turn to where targets are, and how they turn on beyond their horizon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.densities import UndetectedIntensity
from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_angles
from vedette.platforms import Options
from vedette.platforms.camera import HALF_WIDTH, POINTING, is_camera


def turn_rate(own: Options, horizon: float) -> float:
    """rad/s of the course that turns a camera most within `horizon` seconds; 0 of any other sensor."""
    if not is_camera(own.pose):
        return 0.0
    return float(np.abs(wrap_angles(own.courses[:, -1, POINTING] - own.pose[POINTING])).max()) / horizon


def views_a_second(own: Options, rate: float) -> float:
    """How many widths of its view a camera turns in a second, at `rate` rad/s."""
    return rate / float(2.0 * own.pose[HALF_WIDTH]) if rate > 0.0 else 0.0


def seconds_to_turn(own: Options, rate: float, places: Floats) -> Floats:
    """(num_places,) s from the end of the best course until a camera that turns at `rate` rad/s points at places.

    places: (num_places, 2) m. 0 where nothing turns.
    """
    if rate == 0.0:
        return np.zeros(len(places))
    ends = own.courses[:, np.newaxis, -1]
    offsets = places - ends[:, :, :2]
    off = wrap_angles(np.arctan2(offsets[:, :, 1], offsets[:, :, 0]) - ends[:, :, POINTING])
    return np.asarray(np.maximum(np.abs(off) - ends[:, :, HALF_WIDTH], 0.0).min(axis=0) / rate)


def seconds_to_search(
    options: Sequence[Options], rates: Sequence[float], reaches: Floats, undetected: UndetectedIntensity, least: float
) -> float:
    """s from the end of the best courses until fewer than `least` undetected targets are where nobody has looked.

    Of targets in reach of a sensor now. rates: rad/s, at which each turns. reaches: m, how far each sees.
    """
    seconds = np.full(undetected.num_cells, np.inf)
    for own, rate, reach in zip(options, rates, reaches.tolist(), strict=True):
        near = np.hypot(*(undetected.centres - own.pose[:2]).T) <= reach
        seconds[near] = np.minimum(seconds[near], seconds_to_turn(own, rate, undetected.centres[near]))
    order = np.argsort(-seconds)
    order = order[np.isfinite(seconds[order])]
    last = int(np.searchsorted(np.cumsum(undetected.expected[order]), least))
    return float(seconds[order[last]]) if last < len(order) else 0.0


def turned_on(own: Options, horizon: Floats, times: Floats) -> Floats:
    """(num_courses, num_times) rad, where a camera points at times after its horizon if it goes on turning as at last.

    horizon: (num_steps,) s of the poses that there are. One that points where it was to point stays so.
    """
    start = np.full((len(own.courses), 1), own.pose[POINTING])
    last = np.concatenate([start, own.courses[:, :, POINTING]], axis=1)[:, -2:]
    step = horizon[-1] - (horizon[-2] if len(horizon) > 1 else 0.0)
    rates = wrap_angles(last[:, 1:] - last[:, :1]) / step
    return np.asarray(wrap_angles(last[:, 1:] + rates * (times - horizon[-1])))
