"""Measurement and noise models of a sensor at a pose."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import ModelError
from vedette.internal.quantities import QUANTITIES
from vedette.kernels.base.types import HEIGHT, VX, VY, Bools, Floats, place_of
from vedette.kernels.gaussian.beam import LEVEL, passage, to_scan_time, turns
from vedette.kernels.gaussian.scans import wrap_columns
from vedette.kernels.gaussian.scratch import FULL_TURN
from vedette.models.arguments import dimension, float_array, params_vector, pose_vector, reject, state_table
from vedette.models.fields import part
from vedette.models.functions import ModelFunction, model_function, require_kind, write_rows
from vedette.models.probe import probe_array, probe_covariance, probe_jacobian


@model_function("measurement")
def _position(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    out[0], out[1] = state[0], state[1]
    if turns(pose) and state.shape[0] > VY:
        at = passage(state, pose)
        out[0], out[1] = state[0] + state[VX] * at.lag, state[1] + state[VY] * at.lag


@model_function("measurement_jacobian")
def _position_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    for i in range(2):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0
    if turns(pose) and state.shape[0] > VY:
        to_scan_time(passage(state, pose), pose, True, LEVEL, out)


def _places(measurements: Floats, pose: Floats) -> Floats:
    return measurements


@part("position", "measurement")
def position() -> "MeasurementModel":
    """z = [px, py] of the target in m, in the frame of the region. The sensor's pose has no effect."""
    functions = _position, np.empty(0), _position_jacobian
    return MeasurementModel(2, *functions, places=_places, is_linear=True, components=("x", "y"))


_ANGLES = np.array([FULL_TURN])


def angular_flags(name: str, angular: Sequence[bool] | Bools, meas_dim: int) -> Bools:
    """Return the flags of the components that are angles, (meas_dim,). An empty `angular` means no angles."""
    flags = np.array(angular)
    if flags.size == 0:
        return np.zeros(meas_dim, np.bool_)
    if flags.dtype != np.bool_ or flags.shape != (meas_dim,):
        raise reject(name, f"{meas_dim} booleans, one a measurement component", angular)
    return flags


def wrap_angles(angles: Floats) -> Floats:
    """Return the angles wrapped to (-pi, pi]. Angles already in it keep every bit."""
    wrapped = np.array(angles, dtype=np.float64, order="C")
    wrap_columns(wrapped.reshape(-1, 1), _ANGLES)
    return wrapped


def wrap_periodic(measurements: Floats, periods: Floats) -> Floats:
    """Return the measurements with each component wrapped to (-period / 2, period / 2], (n, meas_dim)."""
    wrapped = np.array(measurements, dtype=np.float64, order="C")
    wrap_columns(wrapped, periods)
    return wrapped


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementModel:
    """Noise-free measurement of a target's state from a sensor's pose.

    Attributes:
        meas_dim: number of components of a measurement.
        function: model function of kind `measurement`.
        params: its parameter vector. Anything array-like is converted.
        jacobian: model function of kind `measurement_jacobian` (same parameters), or None: sigma points are used.
        angular: one boolean per component, true for an angle in radians. () means that `components` determines them,
            else that there are no angles. Residuals of angles are wrapped to (-pi, pi].
        least: (meas_dim,) smallest value of each component without noise, such as 0 for a range. () means that
            `components` determines them, else that there are no limits.
        periods: (meas_dim,) interval after which a component repeats, such as twice the largest unambiguous range rate
            of a Doppler radar. Residuals are wrapped to half of it either way. inf: it does not repeat. () means 2 pi
            for angles, inf for others.
        places: plain function of (n, meas_dim) measurements and a pose: the (n, 2) positions of the targets in m, or
            (n, 3) with heights if states have them. None if a measurement determines no position. Births from
            measurements need it.
        is_linear: True if measurements are linear in the state: a Jacobian is then exact for Gaussians of any width.
        components: name of the quantity of each component, such as "bearing", "range", "range_rate", "x" or "y" (the
            names of `vedette.internal.quantities.QUANTITIES`, which are also fields of `Bias`). () for other
            quantities.
        state_components: names of components of states, as in `MotionModel.components`, if the function reads more than
            position and velocity. Filters refuse motions without these components in these places.

    Raises:
        InputError: a function of another kind, a bad dimension or parameter, a wrong number of angular flags, an
            unknown component.
    """

    meas_dim: int
    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))
    jacobian: ModelFunction | None = None
    angular: Bools = field(default_factory=lambda: np.empty(0, np.bool_))
    places: Callable[[Floats, Floats], Floats] | None = None
    least: Floats = field(default_factory=lambda: np.empty(0))
    is_linear: bool = False
    components: tuple[str, ...] = ()
    periods: Floats = field(default_factory=lambda: np.empty(0))
    state_components: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        dimension("MeasurementModel.meas_dim", self.meas_dim)
        quantities = [QUANTITIES[name] for name in self.components if name in QUANTITIES]
        if self.components and len(quantities) != self.meas_dim:
            expected = f"{self.meas_dim} names among {', '.join(QUANTITIES)}, or none"
            raise reject("MeasurementModel.components", expected, self.components)
        require_kind("MeasurementModel.function", self.function, "measurement")
        if self.jacobian is not None:
            require_kind("MeasurementModel.jacobian", self.jacobian, "measurement_jacobian")
        if self.places is not None and not callable(self.places):
            raise reject("MeasurementModel.places", "a function or None", self.places)
        object.__setattr__(self, "params", params_vector("MeasurementModel.params", self.params))
        least = (
            self.least
            if np.size(self.least)
            else [each.least for each in quantities] or np.full(self.meas_dim, -np.inf)
        )
        object.__setattr__(self, "least", float_array("MeasurementModel.least", least, (self.meas_dim,), finite=False))
        angular = self.angular if np.size(self.angular) else [each.is_angle for each in quantities]
        object.__setattr__(self, "angular", angular_flags("MeasurementModel.angular", angular, self.meas_dim))
        periods = self.periods if np.size(self.periods) else np.where(self.angular, FULL_TURN, np.inf)
        periods = float_array("MeasurementModel.periods", periods, (self.meas_dim,), finite=False)
        if not ((periods > 0.0) & (~self.angular | (periods == FULL_TURN))).all():
            wanted = f"numbers above 0, {FULL_TURN!r} for an angle"
            raise reject("MeasurementModel.periods", wanted, periods.tolist())
        object.__setattr__(self, "periods", periods)

    @property
    def height(self) -> int:
        """Place in states of the height that the measurement depends on, or -1."""
        return place_of(HEIGHT, self.state_components)

    def check_motion(self, field: str, components: Sequence[str]) -> None:
        """Raise `InputError` for a motion without a component that the function reads. field: of this model."""
        for place, name in enumerate(self.state_components):
            if place_of(name, components) != place:
                wanted = f"a motion with {name} as component {place}, or a model for the components of the motion"
                raise reject(field, wanted, ", ".join(components))

    def measure(self, states: ArrayLike, pose: ArrayLike) -> Floats:
        """Return the noise-free measurements of (n, state_dim) states, (n, meas_dim).

        Raises:
            ModelError: the function raised.
        """
        table, at = state_table("states", states), pose_vector("pose", pose)
        out = np.empty((len(table), self.meas_dim))
        write_rows(self.function, table, at, self.params, out)
        return out

    def positions(self, measurements: Floats, pose: ArrayLike) -> Floats:
        """Return the (n, 2) positions of (n, meas_dim) measurements in the plane, m.

        Raises:
            InputError: the model has no `places`.
            ModelError: its function raised, or returned a wrong shape or values.
        """
        return self._located(measurements, pose)[:, :2]

    def states_at(self, measurements: Floats, pose: ArrayLike, state_dim: int) -> Floats:
        """Return (n, state_dim) states at rest where (n, meas_dim) measurements were taken. Raises like `positions`."""
        located = self._located(measurements, pose)
        states = np.zeros((len(located), state_dim))
        states[:, :2] = located[:, :2]
        if located.shape[1] > 2 and self.height >= 0:
            states[:, self.height] = located[:, 2]
        return states

    def _located(self, measurements: Floats, pose: ArrayLike) -> Floats:
        if self.places is None:
            raise reject("MeasurementModel.places", "a function, as births from measurements need a position", None)
        at = pose_vector("pose", pose)
        try:
            places = np.asarray(self.places(measurements, at), np.float64)
            return float_array("places", places, (len(measurements), 3 if places.shape[1:] == (3,) else 2))
        except Exception as error:
            raise ModelError(f"places of measurements at pose {at}: {type(error).__name__}: {error}") from error

    def check(self, states: ArrayLike, pose: ArrayLike) -> None:
        """Check the functions at each state. `ModelError` has the function, the state, the expected and given value."""
        at = pose_vector("pose", pose)
        for state in state_table("states", states):
            args = (state, at, self.params)
            probe_array(self.function, args, (self.meas_dim,))
            if self.jacobian is not None:
                probe_jacobian(self.jacobian, self.function, args, (self.meas_dim, len(state)), self.angular)


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """Covariance of the additive Gaussian measurement noise as a function of state and pose (paper: R_k(x_k, u_k)).

    Attributes:
        function: model function of kind `measurement_noise_cov`.
        params: its parameter vector.
        meas_dim: number of measurement components. None: any, or not known.
        least_stds: (meas_dim,) smallest standard deviation of each component, used to detect numbers in a wrong unit.
            None: not known.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))
    meas_dim: int | None = None
    least_stds: Floats | None = None

    def __post_init__(self) -> None:
        require_kind("NoiseModel.function", self.function, "measurement_noise_cov")
        object.__setattr__(self, "params", params_vector("NoiseModel.params", self.params))
        if self.meas_dim is not None:
            dimension("NoiseModel.meas_dim", self.meas_dim)
        if self.least_stds is not None:
            object.__setattr__(
                self, "least_stds", float_array("NoiseModel.least_stds", self.least_stds, (self.meas_dim,))
            )

    def covs(self, states: ArrayLike, pose: ArrayLike, meas_dim: int) -> Floats:
        """Return the noise covariances at (n, state_dim) states, (n, meas_dim, meas_dim)."""
        table, at = state_table("states", states), pose_vector("pose", pose)
        out = np.empty((len(table), meas_dim, meas_dim))
        write_rows(self.function, table, at, self.params, out)
        return out

    def check(self, states: ArrayLike, pose: ArrayLike, meas_dim: int) -> None:
        """Check the function at each state, and raise `ModelError` unless it gives a positive definite covariance."""
        at = pose_vector("pose", pose)
        for state in state_table("states", states):
            probe_covariance(self.function, (state, at, self.params), meas_dim, definite=True)
