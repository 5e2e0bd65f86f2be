"""Models at many states side by side: built-in ones in loops that the compiler vectorises, others state by state.

A model is a function of one state. For the built-in models most used in decisions, the same formulas are implemented
here over an index of states. `ModelForms` selects them for a decision (docs/decisions/0033). Arrays are as in `lanes`.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.elementary import Bits, directions, exponentials, make_bits
from vedette.kernels.base.types import Floats, Sensor
from vedette.kernels.gaussian.beam import angle_of_extent
from vedette.kernels.gaussian.detection import AT_CENTRE, checked, detection_probability
from vedette.kernels.gaussian.scratch import Scratch
from vedette.kernels.planning.lanes import copy_rows, place, put_rows, put_state, set_row, take_matrix, take_state

ANY = 0  # a function of one state

BEARING_RANGE, POSITION = 1, 2  # measurements
GROWING, CONSTANT = 1, 2  # noise: of bearing and range, growing with the distance; constant and independent
GAUSSIAN, SAME, SOFT_EDGE = 1, 2, 3  # detection: exp(-d^2 / (2 sigma^2)) at a distance d; constant; logistic in d


class ModelForms(NamedTuple):
    """The closed forms of a decision's models."""

    is_linear: int  # 1 if the motion is x -> F x with constant noise, else 0
    transition: Floats  # (state_dim, state_dim) F over a step of the horizon
    motion_noise: Floats  # (state_dim, state_dim)
    measurement: int
    noise: int
    detection: int
    most_detection: float  # upper limit of GAUSSIAN


class Offsets(NamedTuple):
    """Positions of states relative to the sensor, and working arrays."""

    dx: Floats  # (room,) m
    dy: Floats  # (room,) m
    squares: Floats  # (room,) m^2
    distances: Floats  # (room,) m
    bits: Bits
    more_bits: Bits


@kernel
def make_offsets(room: int) -> Offsets:
    return Offsets(np.empty(room), np.empty(room), np.empty(room), np.empty(room), make_bits(room), make_bits(room))


@borrowing
def find_offsets(pose: Floats, states: Floats, num: int, out: Offsets) -> None:
    """Write the offsets of the first `num` states (state_dim, room) from the pose."""
    x, y, dx, dy, squares, distances = states[0], states[1], out.dx, out.dy, out.squares, out.distances
    px, py = pose[0], pose[1]
    for s in range(num):
        dx[s] = x[s] - px
    for s in range(num):
        dy[s] = y[s] - py
    for s in range(num):
        squares[s] = dx[s] * dx[s] + dy[s] * dy[s]
    for s in range(num):
        distances[s] = math.sqrt(squares[s])


@borrowing
def fill_measurements(
    sensor: Sensor, form: int, pose: Floats, states: Floats, offsets: Offsets, num: int, scratch: Scratch, out: Floats
) -> None:
    """Write out (meas_dim, room): measurements of states (state_dim, room) with known offsets."""
    if form == BEARING_RANGE:
        directions(offsets.dy[:num], offsets.dx[:num], out[0, :num])
        ranges = out[1]
        for s in range(num):
            ranges[s] = offsets.distances[s]
    elif form == POSITION:
        copy_rows(states, num, out)
    else:
        state, measured = scratch.points[0], scratch.residual
        for s in range(num):
            take_state(states, s, state)
            sensor.measurement(state, pose, sensor.measurement_params, measured)
            put_state(measured, s, out)


@borrowing
def fill_jacobians(
    sensor: Sensor, form: int, pose: Floats, states: Floats, offsets: Offsets, num: int, scratch: Scratch, out: Floats
) -> None:
    """Write out (meas_dim * state_dim, room): Jacobians of the measurement, row by row, see `jacobian_width`."""
    dim = states.shape[0]
    if form == BEARING_RANGE:
        across, along, right, up = out[0], out[1], out[dim], out[dim + 1]
        dx, dy, squares, distances = offsets.dx, offsets.dy, offsets.squares, offsets.distances
        # At the position of the sensor there is no direction; a quotient by infinity is zero.
        for s in range(num):
            across[s] = -dy[s] / (squares[s] if squares[s] > 0.0 else math.inf)
        for s in range(num):
            along[s] = dx[s] / (squares[s] if squares[s] > 0.0 else math.inf)
        for s in range(num):
            right[s] = dx[s] / (distances[s] if distances[s] > 0.0 else math.inf)
        for s in range(num):
            up[s] = dy[s] / (distances[s] if distances[s] > 0.0 else math.inf)
    elif form == POSITION:
        for a in range(2):
            for j in range(2):
                set_row(1.0 if a == j else 0.0, num, out[a * dim + j])
    else:
        state, jacobian = scratch.points[0], scratch.measurement_jacobian
        for s in range(num):
            take_state(states, s, state)
            sensor.measurement_jacobian(state, pose, sensor.measurement_params, jacobian)
            put_rows(jacobian, s, out)


@inlined
def jacobian_width(form: int, state_dim: int) -> int:
    """Return the number of columns of a measurement's Jacobian that are filled in. The others are zero."""
    return state_dim if form == ANY else 2


@borrowing
def fill_noise(
    sensor: Sensor, form: int, pose: Floats, states: Floats, offsets: Offsets, num: int, scratch: Scratch, out: Floats
) -> None:
    """Write out (meas_dim (meas_dim + 1) / 2, room): lower triangles of the measurement noise, made symmetric."""
    params, noise = sensor.noise_params, scratch.measurement_noise
    if form == GROWING:
        bearings, ranges, squares, distances = out[0], out[2], offsets.squares, offsets.distances
        near_range, far_range, near_bearing, far_bearing, floor = params[0], params[1], params[2], params[3], params[4]
        for s in range(num):
            std = near_bearing + far_bearing * distances[s]
            bearings[s] = std * std
        set_row(0.0, num, out[1])
        for s in range(num):
            std = near_range + far_range * squares[s]
            ranges[s] = std * std
        for s in range(num if floor > 0.0 else 0):
            bearings[s] += angle_of_extent(floor, squares[s])
            ranges[s] += floor * floor
    elif form == CONSTANT:
        for a in range(noise.shape[0]):
            for b in range(a + 1):
                set_row(params[a] * params[a] if a == b else 0.0, num, out[place(a, b)])
    else:
        state = scratch.points[0]
        for s in range(num):
            take_state(states, s, state)
            sensor.measurement_noise_cov(state, pose, sensor.noise_params, noise)
            for a in range(noise.shape[0]):
                for b in range(a + 1):
                    out[place(a, b), s] = 0.5 * (noise[a, b] + noise[b, a])


@inlined
def _detect_by_form(sensor: Sensor, forms: ModelForms, offsets: Offsets, num: int, out: Floats) -> None:
    # Beyond the largest exponent the result is that of the limit, up to 1e-304.
    if forms.detection == SAME:
        set_row(sensor.detection_params[0], num, out)
    elif forms.detection == GAUSSIAN:
        spread = sensor.detection_params[0] * sensor.detection_params[0]
        for s in range(num):
            out[s] = max(-0.5 * offsets.squares[s] / spread, -700.0)
        exponentials(out[:num], offsets.bits)
        for s in range(num):
            out[s] = min(out[s], forms.most_detection)
    else:
        most, edge, slope = sensor.detection_params[0], sensor.detection_params[1], sensor.detection_params[3]
        for s in range(num):
            out[s] = max(min(slope * (offsets.distances[s] - edge), 700.0), -700.0)
        exponentials(out[:num], offsets.bits)
        cut = edge if sensor.detection_params[5] > 0.0 else math.inf
        for s in range(num):
            out[s] = most * (1.0 / (1.0 + out[s])) if offsets.distances[s] <= cut else 0.0


@borrowing
def fill_detection(
    sensor: Sensor,
    forms: ModelForms,
    pose: Floats,
    states: Floats,
    offsets: Offsets,
    num: int,
    scratch: Scratch,
    out: Floats,
) -> None:
    """Write out (room,): detection probabilities of targets at states (state_dim, room)."""
    if forms.detection != ANY:
        _detect_by_form(sensor, forms, offsets, num, out)
        return
    state = scratch.points[0]
    for s in range(num):
        take_state(states, s, state)
        out[s] = checked(sensor.prob_detection(state, pose, sensor.detection_params))


@borrowing
def fill_detection_of_gaussians(
    sensor: Sensor,
    forms: ModelForms,
    pose: Floats,
    means: Floats,
    covs: Floats,
    offsets: Offsets,
    num: int,
    scratch: Scratch,
    out: Floats,
) -> None:
    """Write out (room,): detection probabilities of Gaussians, by the sensor's `detection_rule`.

    means: (state_dim, room). covs: (state_dim (state_dim + 1) / 2, room) lower triangles.
    """
    if sensor.detection_rule == AT_CENTRE:
        fill_detection(sensor, forms, pose, means, offsets, num, scratch, out)
        return
    mean, cov = scratch.points[1], scratch.factor
    for s in range(num):
        take_state(means, s, mean)
        take_matrix(covs, s, cov)
        out[s] = detection_probability(sensor, pose, mean, cov, scratch.points[0])
