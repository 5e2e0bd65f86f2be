"""Probability that a sensor detects a target whose state has a Gaussian density."""

import math

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Sensor

AT_CENTRE = 0
CLOSED_FORM = 1
BY_NODES = 2
AT_EDGES = 3

# P_D is the same over a Gaussian if it differs by no more than this at the nodes, first at every other one.
_LEAST_DIFFERENCE, _STRIDE = 0.01, 2
_LEAST_VARIANCE = 0.02  # share of its variance that a miss leaves


@inlined
def checked(detection: float) -> float:
    if not 0.0 <= detection <= 1.0:
        raise ModelError("detection model: probability is not in [0, 1]")
    return detection


@inlined
def _at(
    sensor: Sensor, pose: Floats, mean: Floats, root: tuple[float, float, float], u: float, v: float, state: Floats
) -> float:
    """P_D at standard deviates of the position. The rest of the state must stand in `state`."""
    state[0] = mean[0] + root[0] * u
    state[1] = mean[1] + root[1] * u + root[2] * v
    return checked(sensor.prob_detection(state, pose, sensor.detection_params))


@inlined
def root_of_position(cov: Floats) -> tuple[float, float, float]:
    """Return the Cholesky factor (a, 0; b, c) of the covariance of the position."""
    a = math.sqrt(max(cov[0, 0], 0.0))
    b = cov[1, 0] / a if a > 0.0 else 0.0
    return a, b, math.sqrt(max(cov[1, 1] - b * b, 0.0))


@inlined
def _over_nodes(
    sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, state: Floats, stride: int
) -> tuple[float, float]:
    """Mean of P_D over a Gaussian, and the largest difference of P_D between its nodes.

    The sum of weight * P_D at mean + L (standard deviates), L L' the covariance of the position. The rest of the state
    stays at its mean. With a stride above 1 the sum is incomplete where P_D is the same at every stride-th node.
    """
    nodes, total, root = sensor.detection_nodes, 0.0, root_of_position(cov)
    least, most = 1.0, 0.0
    for j in range(mean.shape[0]):
        state[j] = mean[j]
    for first in range(stride):
        for i in range(first, nodes.shape[0], stride):
            found = _at(sensor, pose, mean, root, nodes[i, 1], nodes[i, 2], state)
            total += nodes[i, 0] * found
            least, most = min(least, found), max(most, found)
        if most - least <= _LEAST_DIFFERENCE:
            break
    return min(total, 1.0), most - least  # weights sum to 1 but for rounding


@inlined
def detection_and_edge(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, state: Floats) -> tuple[float, bool]:
    """Return the detection probability of a Gaussian, and True if an edge of the field of view passes through it.

    `sensor.detection_rule` selects P_D at the mean, or its mean over the Gaussian in closed form or by nodes. With
    AT_EDGES it is the mean by nodes where P_D differs between nodes, and P_D at the mean elsewhere. Only this rule
    reports edges. state: (state_dim,) to be written.
    """
    if sensor.detection_rule == CLOSED_FORM:
        return checked(sensor.mean_prob_detection(mean, cov, pose, sensor.detection_params)), False
    if sensor.detection_rule == BY_NODES:
        return _over_nodes(sensor, pose, mean, cov, state, 1)[0], False
    if sensor.detection_rule == AT_EDGES:
        found, difference = _over_nodes(sensor, pose, mean, cov, state, _STRIDE)
        if difference > _LEAST_DIFFERENCE:
            return found, True
    return checked(sensor.prob_detection(mean, pose, sensor.detection_params)), False


@inlined
def detection_probability(sensor: Sensor, pose: Floats, mean: Floats, cov: Floats, state: Floats) -> float:
    """Return the detection probability of a Gaussian, see `detection_and_edge`."""
    return detection_and_edge(sensor, pose, mean, cov, state)[0]


@inlined
def moments_if_missed(
    sensor: Sensor,
    pose: Floats,
    mean: Floats,
    cov: Floats,
    factor: float,
    state: Floats,
    out_mean: Floats,
    out_cov: Floats,
) -> None:
    """Write mean and covariance of (1 - factor P_D(x)) N(x; mean, cov), normalised: of a target that was missed.

    Moments of the position are sums over nodes, those of the rest of the state follow by its regression on the
    position. They stay as they were where P_D is 1 at every node, or the position is known. state: (state_dim,) to be
    written.
    """
    n, nodes, root = mean.shape[0], sensor.detection_nodes, root_of_position(cov)
    for j in range(n):
        state[j] = mean[j]
    total, u, v, uu, uv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(nodes.shape[0]):
        x, y = nodes[i, 1], nodes[i, 2]
        missed = nodes[i, 0] * (1.0 - factor * _at(sensor, pose, mean, root, x, y, state))
        total, u, v = total + missed, u + missed * x, v + missed * y
        uu, uv, vv = uu + missed * x * x, uv + missed * x * y, vv + missed * y * y
    for i in range(n):
        out_mean[i] = mean[i]
        for j in range(n):
            out_cov[i, j] = cov[i, j]
    if total <= 0.0 or root[0] == 0.0 or root[2] == 0.0:
        return
    u, v = u / total, v / total
    # The covariance of the standard deviates less I, what that of the nodes is where all are missed alike.
    uu, uv, vv = uu / total - u * u - 1.0, uv / total - u * v, vv / total - v * v - 1.0
    lack = _LEAST_VARIANCE - 1.0 - 0.5 * (uu + vv) + math.hypot(0.5 * (uu - vv), uv)
    if lack > 0.0:
        uu, vv = uu + lack, vv + lack
    for i in range(n):
        # Covariance of the state with the two standard deviates.
        first = cov[i, 0] / root[0]
        second = (cov[i, 1] - first * root[1]) / root[2]
        out_mean[i] += first * u + second * v
        for j in range(n):
            other = cov[j, 0] / root[0]
            another = (cov[j, 1] - other * root[1]) / root[2]
            out_cov[i, j] += first * (uu * other + uv * another) + second * (uv * other + vv * another)


@kernel
def detection_probabilities(sensor: Sensor, pose: Floats, means: Floats, covs: Floats) -> Floats:
    """Return detection probabilities (num,) for means (num, state_dim) and covariances (num, state_dim, state_dim)."""
    out, state = np.empty(len(means)), np.empty(means.shape[1])
    for i in range(len(means)):
        out[i] = detection_probability(sensor, pose, means[i], covs[i], state)
    return out
