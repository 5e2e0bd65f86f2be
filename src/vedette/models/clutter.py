"""Poisson clutter: the model, and clutter that is uniform in measurement space."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError, ModelError
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT, QUANTITIES, is_doppler
from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import (
    dimension,
    float_array,
    generator,
    non_negative,
    params_vector,
    pose_vector,
    positive,
    reject,
)
from vedette.models.fields import NonNegative, Reals, part
from vedette.models.functions import ModelFunction, describe, model_function, numbers_at, require_kind
from vedette.models.measurement import MeasurementModel, angular_flags, wrap_periodic
from vedette.models.probe import probe_log_intensity

# Number of clutter scans that a check draws and compares with the intensity.
_NUM_TRIAL_SCANS = 8


class ClutterSampler(Protocol):
    """A function that draws one scan of clutter, including the Poisson number, in plain Python, not compiled."""

    def __call__(
        self, pose: Floats, measurement: MeasurementModel, *, state_dim: int, rng: np.random.Generator
    ) -> Floats:
        """Return (n, meas_dim) clutter measurements of a sensor at `pose`. `state_dim` is the length of states."""


@dataclass(frozen=True, slots=True, eq=False)
class ClutterModel:
    """Poisson clutter of a sensor (paper: lambda_c and kappa).

    Attributes:
        rate: expected number of clutter measurements per scan.
        log_intensity: model function of kind `log_clutter_intensity`. It integrates to `rate` over measurement space. A
            component that a row of `ScanRows` lacks is NaN there, and its density that of the other components.
        params: its parameter vector.
        sampler: draws a scan of clutter, see `ClutterSampler`. None if no scans are simulated.
        meas_dim: number of measurement components. None: not known.
        angular: (meas_dim,) flags of the components that are angles. None: not known.
    """

    rate: float
    log_intensity: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))
    sampler: ClutterSampler | None = None
    meas_dim: int | None = None
    angular: Bools | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", non_negative("ClutterModel.rate", self.rate))
        require_kind("ClutterModel.log_intensity", self.log_intensity, "log_clutter_intensity")
        object.__setattr__(self, "params", params_vector("ClutterModel.params", self.params))
        if self.sampler is not None and not callable(self.sampler):
            raise reject("ClutterModel.sampler", "a function or None", self.sampler)
        if self.meas_dim is not None:
            dimension("ClutterModel.meas_dim", self.meas_dim)
        if self.angular is not None:
            size = len(self.angular) if self.meas_dim is None else self.meas_dim
            object.__setattr__(self, "angular", angular_flags("ClutterModel.angular", self.angular, size))
            object.__setattr__(self, "meas_dim", size)

    def log_intensity_at(self, measurements: ArrayLike, pose: ArrayLike) -> Floats:
        """Return the log intensities at (n, meas_dim) measurements, (n,)."""
        table, at = float_array("measurements", measurements, (None, self.meas_dim)), pose_vector("pose", pose)
        return numbers_at(self.log_intensity, table, at, self.params)

    def sample(
        self, pose: ArrayLike, measurement: MeasurementModel, *, state_dim: int, rng: np.random.Generator
    ) -> Floats:
        """Return the clutter of one scan, (n, meas_dim).

        Raises:
            InputError: this model has no sampler.
            ModelError: the sampler raised, or did not return finite (n, meas_dim) measurements.
        """
        if self.sampler is None:
            raise reject("ClutterModel.sampler", "a sampler, to simulate a scan", None)
        at, rng = pose_vector("pose", pose), generator(rng)
        try:
            drawn = self.sampler(at, measurement, state_dim=state_dim, rng=rng)
        except (ModelError, InputError):
            raise
        except Exception as error:
            raise ModelError(f"clutter sampler at pose {at}: raised {type(error).__name__}: {error}") from error
        try:
            return float_array("clutter sampler", drawn, (None, measurement.meas_dim))
        except InputError as error:
            raise ModelError(f"{error}, at pose {at}") from None

    def check(self, measurements: ArrayLike, pose: ArrayLike, measurement: MeasurementModel, *, state_dim: int) -> None:
        """Check the log intensity at each measurement and at the points that the sampler draws, if there is one.

        Raises:
            ModelError: an invalid log intensity, or clutter drawn where the intensity is 0.
        """
        at = pose_vector("pose", pose)
        for row in float_array("measurements", measurements, (None, measurement.meas_dim)):
            probe_log_intensity(self.log_intensity, (row, at, self.params))
        if self.sampler is None:
            return
        rng = np.random.default_rng(0)
        for _ in range(_NUM_TRIAL_SCANS):
            for row in self.sample(at, measurement, state_dim=state_dim, rng=rng):
                if probe_log_intensity(self.log_intensity, (row, at, self.params)) == -math.inf:
                    place = describe(self.log_intensity, row, at)
                    raise ModelError(f"{place}: expected a finite value, as the sampler drew clutter there; got -inf")


@model_function("log_clutter_intensity")
def _box(measurement: Floats, pose: Floats, params: Floats) -> float:
    dim, level = params.shape[0] // 3, params[0]
    for i in range(dim):
        low, width, period = params[1 + i], params[1 + dim + i], params[1 + 2 * dim + i]
        if math.isnan(measurement[i]):
            level += math.log(width)
            continue
        offset = measurement[i] - low
        if period > 0.0:
            offset -= period * math.floor(offset / period)
        if not 0.0 <= offset <= width:
            return -math.inf
    return level  # type: ignore[no-any-return]


_LARGEST_RATE = 300.0  # m/s, the default largest range rate of clutter
_LARGEST_HEIGHT = 12_000.0  # m, the default largest height of clutter


def at_raw_measurements(clutter: ClutterModel, bias: Floats, moved: Floats) -> ClutterModel:
    """Return built-in clutter whose intensity at a corrected measurement is that at the raw one.

    Biases are subtracted from measurements before filters process them, but clutter is distributed over raw
    measurements. At a corrected measurement z, the intensity is that at z + bias from the sensor's position + moved.

    Args:
        clutter: clutter of `region_clutter`, `around_sensor` or `measurement_space_clutter`.
        bias: (meas_dim,) offset that is subtracted from measurements [rad, m].
        moved: (2,) offset that is subtracted from the sensor's position [m].
    """
    params = clutter.params.copy()
    if clutter.log_intensity is _box:
        params[1 : 1 + len(bias)] -= bias
    else:
        params[-5 : len(params) - 5 + len(bias)], params[-2:] = bias, moved
    return replace(clutter, params=params)


@dataclass(frozen=True, slots=True, eq=False)
class _BoxSampler:
    rate: float
    low: Floats
    high: Floats

    def __call__(
        self, pose: Floats, measurement: MeasurementModel, *, state_dim: int, rng: np.random.Generator
    ) -> Floats:
        num_clutter = int(rng.poisson(self.rate))
        drawn = rng.uniform(self.low, self.high, size=(num_clutter, len(self.low)))
        return wrap_periodic(drawn, measurement.periods) if measurement.meas_dim == len(self.low) else drawn


def plane_params(kind: str, max_range_rate: float | None, max_height: float | None = None) -> Floats:
    """Return the last six params of clutter that is uniform in the plane.

    These are the largest range rate (None: 300 m/s) or, for a kind that depends on heights, the largest height (None:
    12 km), and zeros for the offsets of up to three measurement components and of x, y of the sensor, see
    `at_raw_measurements`. Raises `InputError` for a largest value that is not above 0.
    """
    rate = _LARGEST_RATE if max_range_rate is None else positive("max_range_rate", max_range_rate)
    height = _LARGEST_HEIGHT if max_height is None else positive("max_height", max_height)
    return np.array([height if kind in HEIGHT_DEPENDENT else rate, 0.0, 0.0, 0.0, 0.0, 0.0])


@inlined
def log_density_of_rate(measurement: Floats, params: Floats) -> float:
    """Log density of the third component, a range rate, in s/m: uniform, or 0 if it is missing.

    params: end with `plane_params`.
    """
    if math.isnan(measurement[2]):
        return 0.0
    return -math.log(2.0 * params[-6]) if abs(measurement[2] + params[-3]) <= params[-6] else -math.inf


def with_rates(drawn: Floats, kind: str, largest: float, rng: np.random.Generator) -> Floats:
    """Return the clutter measurements with range rates drawn uniformly, if the kind has them."""
    if is_doppler(kind):
        drawn[:, COMPONENTS[kind].index("range_rate")] = rng.uniform(-largest, largest, len(drawn))
    return drawn


def angular_of(kind: str) -> Bools:
    """Flags of the components of a kind of measurement that are angles, (meas_dim,)."""
    return np.array([QUANTITIES[name].is_angle for name in COMPONENTS[kind]])


def log_or_minus_infinity(value: float) -> float:
    """Return log(value), or -inf at zero."""
    return math.log(value) if value > 0.0 else -math.inf


@part("measurement_space", "clutter")
def measurement_space_clutter(
    rate: NonNegative, low: Reals, high: Reals, *, angular: Sequence[bool] | Bools | None = None
) -> ClutterModel:
    """Poisson clutter, uniform over a box of the sensor's measurement space: intensity rate / volume inside, 0 outside.

    Args:
        rate: expected number per scan.
        low: (meas_dim,) lowest value of each measurement component, a bearing in radians [rad, m].
        high: (meas_dim,) highest value of each measurement component, a bearing in radians [rad, m].
        angular: (meas_dim,) which components are angles. Their bounds may then lie anywhere on the circle, such as
            0 to 2 pi. Without it, bounds of an angle must lie in [-pi, pi], where measured angles are.
    """
    rate = non_negative("rate", rate)
    lows = float_array("low", low, (None,))
    highs = float_array("high", high, (len(lows),))
    if len(lows) == 0 or (highs <= lows).any():
        raise reject("high", f"numbers above low = {lows.tolist()}", highs.tolist())
    flags = None if angular is None else angular_flags("angular", angular, len(lows))
    periods = np.zeros(len(lows)) if flags is None else np.where(flags, 2.0 * math.pi, 0.0)
    widths = highs - lows
    if flags is not None and (widths[flags] > 2.0 * math.pi * (1.0 + 1e-12)).any():
        raise reject("high", "at most 2 pi above low for an angle", highs.tolist())
    params = np.concatenate([[log_or_minus_infinity(rate / float(np.prod(widths)))], lows, widths, periods])
    return ClutterModel(rate, _box, params, _BoxSampler(rate, lows, highs), len(lows), flags)
