"""Powers of mixtures, the limits on the cost of a fusion, and the cubature rule of powers."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np

from vedette.errors import InputError, NumericalError
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.reduction import MixtureCaps
from vedette.kernels.labelled.gci import PowerRule
from vedette.models.arguments import instance, one_of, real
from vedette.models.fields import Count, NonNegative, check_fields

MixturePower = Literal["auto", "moment_matched", "component_wise", "quadrature"]
MIXTURE_POWERS: tuple[MixturePower, ...] = ("auto", "moment_matched", "component_wise", "quadrature")

ONE = MixtureCaps(-math.inf, 0.0, 1)  # replaces a mixture by the Gaussian of its moments
# Merging within these distances is as accurate as the power itself: docs/decisions/0003.
_MERGE_DISTANCE = {"auto": 2.0, "moment_matched": 0.0, "component_wise": 2.0, "quadrature": 0.5}

MAX_DIM = 7  # largest state dimension whose cubature rule has no negative weight


class FusionLimits(NamedTuple):
    """Caps on the cost of a fusion.

    Attributes:
        log_min_component_weight: log of the weight below which components of a track's mixture are dropped before it is
            raised to a power and after the fusion, unused when moment matched.
        merge_distance: components within this Mahalanobis distance are merged at the same times. none: 2 for
            component_wise, 0.5 for quadrature powers.
        max_components: largest number of components of a track before its power is taken, unused when moment matched.
        max_combinations: bound on the combinations of components of one label at all sensors, max_components^sensors.
            `auto` reduces the number of components until it holds.
        max_hypotheses: largest number of label sets of the fused density.
    """

    log_min_component_weight: float = math.log(1e-5)
    merge_distance: NonNegative | None = None
    max_components: Count = 4
    max_combinations: Count = 4096
    max_hypotheses: Count = 1000


def check_power(mixture_power: str, limits: FusionLimits, num_sensors: int) -> None:
    """Raise `InputError` for an unknown power of mixtures or limits that cannot be met."""
    one_of("mixture_power", mixture_power, MIXTURE_POWERS)
    check_limits(limits)
    combinations = limits.max_components**num_sensors
    if mixture_power in ("component_wise", "quadrature") and combinations > limits.max_combinations:
        raise InputError(
            f"limits.max_components: expected {limits.max_components}^{num_sensors} (components to the power of the "
            f"number of sensors) to be at most max_combinations = {limits.max_combinations}; got {combinations}; "
            f"lower max_components or use auto"
        )


def check_limits(limits: Any) -> None:
    """Raise `InputError` unless the limits are valid."""
    instance("limits", limits, FusionLimits)
    check_fields(limits, "limits.")
    least = limits.log_min_component_weight
    if not (isinstance(least, float) and least == -math.inf):
        real("limits.log_min_component_weight", least)


def power_rule(mixture_power: str, limits: FusionLimits, state_dim: int, num_sensors: int = 1) -> PowerRule:
    """Return the caps and the cubature rule of a power of mixtures. Raises `InputError` if there is no rule."""
    points, point_weights, most = np.empty((0, state_dim)), np.empty(0), int(limits.max_components)
    if mixture_power == "auto":
        most = min(most, int(limits.max_combinations ** (1.0 / num_sensors)) + 1)
        while most > 1 and most**num_sensors > limits.max_combinations:
            most -= 1
    if mixture_power == "moment_matched" or (mixture_power == "auto" and most == 1):
        return PowerRule(ONE, points, point_weights)
    if mixture_power == "quadrature":
        if state_dim > MAX_DIM:
            raise InputError(f"mixture_power: quadrature needs at most {MAX_DIM} state dimensions; got {state_dim}")
        points, point_weights = fifth_degree_rule(state_dim)
    distance = limits.merge_distance if limits.merge_distance is not None else _MERGE_DISTANCE[mixture_power]
    caps = MixtureCaps(float(limits.log_min_component_weight), float(distance), most)
    return PowerRule(caps, points, point_weights)


@contextmanager
def numerical_errors_of_tracks() -> Iterator[None]:
    """Convert a FloatingPointError of a kernel (a product of powers that is not a density) into a `NumericalError`."""
    try:
        yield
    except FloatingPointError as fault:
        raise NumericalError(f"fusion of tracks: {fault}") from None


def _simplex(dim: int) -> Floats:
    """Return the corners of a regular simplex on the unit sphere, shape (dim + 1, dim)."""
    corners = np.zeros((dim + 1, dim))
    for i in range(dim):
        corners[i, i] = math.sqrt((dim + 1) * (dim - i) / (dim * (dim - i + 1)))
        corners[i + 1 :, i] = -corners[i, i] / (dim - i)
    return corners


@cache
def fifth_degree_rule(dim: int) -> tuple[Floats, Floats]:
    """Points and weights that integrate all polynomials of degree 5 and less under the standard normal of `dim` <= 7.

    The points are the centre, the corners of a regular simplex and of its opposite, and the midpoints of their edges
    projected to the same sphere: dim^2 + 3 dim + 3 points (Lu and Darmofal 2004, "Higher-dimensional integration with
    Gaussian weight for applications in probabilistic design", after Mysovskikh). No weight is negative, so a covariance
    computed with these points is never indefinite. For larger `dim` one weight would be negative.
    """
    corners = _simplex(dim)
    first, second = np.triu_indices(dim + 1, 1)
    edges = corners[first] + corners[second]
    edges *= math.sqrt(dim / (2.0 * (dim - 1))) if dim > 1 else 0.0
    radius = math.sqrt(dim + 2.0)
    points = radius * np.concatenate([np.zeros((1, dim)), corners, -corners, edges, -edges])
    weights = np.full(len(points), 2.0 * (dim - 1) ** 2 / ((dim + 1) ** 2 * (dim + 2) ** 2))
    weights[: 2 * dim + 3] = dim**2 * (7 - dim) / (2.0 * (dim + 1) ** 2 * (dim + 2) ** 2)
    weights[0] = 2.0 / (dim + 2)
    return points, weights
