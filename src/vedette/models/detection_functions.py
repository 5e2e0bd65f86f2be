"""The built-in detection functions, and their means over a Gaussian where a closed form is known."""

import math

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import HALF_WIDTH, HEADING, POINTING, Floats
from vedette.kernels.gaussian.beam import offset_at_beam
from vedette.kernels.gaussian.position_integrals import gaussian_mean, share_in_sector
from vedette.kernels.gaussian.scratch import wrap_angle
from vedette.models.functions import model_function

# Largest value of the built-in models: with certain detection, a single missed detection would have probability 0, and
# with it every hypothesis that contains the target (paper-notes 4).
MAX_PROB_DETECTION = 1.0 - 1e-9

# Beyond this exponent the logistic function is 0 to the last bit, and its exponential overflows.
_LARGEST_EXPONENT = 700.0


@model_function("prob_detection")
def constant(state: Floats, pose: Floats, params: Floats) -> float:
    """params: probability."""
    return params[0]  # type: ignore[no-any-return]


@model_function("mean_prob_detection")
def mean_constant(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """params: as in `constant`."""
    return params[0]  # type: ignore[no-any-return]


@model_function("prob_detection")
def gaussian(state: Floats, pose: Floats, params: Floats) -> float:
    """params: sigma."""
    dx, dy = offset_at_beam(state, pose)
    return min(math.exp(-0.5 * (dx * dx + dy * dy) / (params[0] * params[0])), MAX_PROB_DETECTION)


@model_function("mean_prob_detection")
def mean_gaussian(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """params: as in `gaussian`. The cap applies to the mean."""
    dx, dy = offset_at_beam(mean, pose)
    return min(gaussian_mean(dx, dy, cov, params[0] * params[0]), MAX_PROB_DETECTION)


@model_function("prob_detection")
def limited_range(state: Floats, pose: Floats, params: Floats) -> float:
    """params: probability, max_range, outside."""
    dx, dy = offset_at_beam(state, pose)
    return params[0] if dx * dx + dy * dy <= params[1] * params[1] else params[2]  # type: ignore[no-any-return]


@model_function("mean_prob_detection")
def mean_limited_range(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """params: as in `limited_range`."""
    dx, dy = offset_at_beam(mean, pose)
    share = share_in_sector(dx, dy, cov, params[1], 0.0, math.pi)
    return params[2] + (params[0] - params[2]) * share  # type: ignore[no-any-return]


@kernel
def _in_sector(dx: float, dy: float, max_range: float, middle: float, half_width: float) -> bool:
    """Return True if (dx, dy) is within `max_range` and within `half_width` of `middle`, or is the origin."""
    square = dx * dx + dy * dy
    if square > max_range * max_range:
        return False
    return not (square > 0.0 and abs(wrap_angle(math.atan2(dy, dx) - middle)) > half_width)


@model_function("prob_detection")
def limited_sector(state: Floats, pose: Floats, params: Floats) -> float:
    """params: probability, max_range, half_width_rad, outside."""
    dx, dy = offset_at_beam(state, pose)
    in_view = _in_sector(dx, dy, params[1], pose[HEADING], params[2])
    return params[0] if in_view else params[3]  # type: ignore[no-any-return]


@model_function("mean_prob_detection")
def mean_limited_sector(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """params: as in `limited_sector`."""
    dx, dy = offset_at_beam(mean, pose)
    share = share_in_sector(dx, dy, cov, params[1], pose[HEADING], params[2])
    return params[3] + (params[0] - params[3]) * share  # type: ignore[no-any-return]


@kernel
def _logistic(exponent: float) -> float:
    return 1.0 / (1.0 + math.exp(min(exponent, _LARGEST_EXPONENT)))


@model_function("prob_detection")
def soft_sector(state: Floats, pose: Floats, params: Floats) -> float:
    """params: probability, max_range, half_width_rad, range_slope, angle_slope (0: a sharp edge), cut (1 or 0)."""
    dx, dy = offset_at_beam(state, pose)
    distance = math.sqrt(dx * dx + dy * dy)
    if params[5] > 0.0 and distance > params[1]:
        return 0.0
    if distance == 0.0 or (params[2] >= math.pi and params[4] == 0.0):  # no angular edge
        off = 0.0
    else:
        off = abs(wrap_angle(math.atan2(dy, dx) - pose[HEADING]))
    beyond = off - params[2]
    if (params[5] > 0.0 or params[4] == 0.0) and beyond > 0.0:
        return 0.0
    angular = _logistic(params[4] * beyond) if params[4] > 0.0 else 1.0
    return params[0] * _logistic(params[3] * (distance - params[1])) * angular  # type: ignore[no-any-return]


@kernel
def _reach(pose: Floats, params: Floats) -> float:
    """Return the range of a camera: with a narrower field of view, the same pixels see farther."""
    if len(pose) < 5:
        raise ValueError("camera: expected a pose with pointing_rad and half_width_rad")
    return params[1] * params[2] / pose[HALF_WIDTH] if params[2] > 0.0 and pose[HALF_WIDTH] > 0.0 else params[1]  # type: ignore[no-any-return]


@model_function("prob_detection")
def camera(state: Floats, pose: Floats, params: Floats) -> float:
    """params: probability, max_range, reference half width (0: none)."""
    reach = _reach(pose, params)
    dx, dy = offset_at_beam(state, pose)
    in_view = _in_sector(dx, dy, reach, pose[POINTING], pose[HALF_WIDTH])
    return params[0] if in_view else 0.0


@model_function("mean_prob_detection")
def mean_camera(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """params: as in `camera`."""
    reach = _reach(pose, params)
    if not pose[HALF_WIDTH] > 0.0:
        return 0.0
    dx, dy = offset_at_beam(mean, pose)
    return params[0] * share_in_sector(dx, dy, cov, reach, pose[POINTING], pose[HALF_WIDTH])  # type: ignore[no-any-return]
