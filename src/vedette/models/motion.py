"""Motion and survival models of a target."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import ModelError
from vedette.kernels.base.types import PLANE, VELOCITY, VX, VY, Floats, Motion, Switching
from vedette.kernels.gaussian.sigma_points import CUBATURE, LINEARISED, SWITCHED, UNSCENTED
from vedette.models.arguments import dimension, one_of, params_vector, positive, probability, real, reject, state_table
from vedette.models.fields import Positive, Probability, part
from vedette.models.functions import ModelFunction, model_function, numbers_at, require_kind, write_rows
from vedette.models.probe import probe_array, probe_covariance, probe_jacobian, probe_probability

_ONE_MODE = Switching(np.zeros((1, 1)), np.ones(1), np.inf)
_BRIEF = 1e-3  # s, in which the direction of a velocity hardly changes
METHODS = {"ekf": LINEARISED, "ukf": UNSCENTED, "ckf": CUBATURE}


def resolve_method(name: str, method: str, has_jacobian: bool, *, bends: bool = False) -> int:
    """Return the kernel's number of a Gaussian method. "auto" is the EKF if there is a Jacobian, else the UKF.

    bends: True if "auto" may linearise again at each measurement, with a Jacobian.

    Raises:
        InputError: an unknown method, or "ekf" without a Jacobian.
    """
    if one_of(name, method, ("auto", *METHODS)) == "auto":
        return UNSCENTED if not has_jacobian else SWITCHED if bends else LINEARISED
    if method == "ekf" and not has_jacobian:
        raise reject(name, "auto, ukf or ckf, as no Jacobian is given", method)
    return METHODS[method]


STATE_ORDER = "that begins with x, y, vx, vy, other components behind them"


@model_function("transition_jacobian")
def _no_transition_jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    """Placeholder for a missing Jacobian in a kernel bundle whose method never calls it."""
    raise NotImplementedError("this motion model has no Jacobian")


@dataclass(frozen=True, slots=True, eq=False)
class MotionModel:
    """Markov motion of one target over any time step (paper: the transition density f(x_k | x_k-1)).

    Attributes:
        state_dim: length of the state.
        transition: model function of kind `transition`.
        process_noise_cov: model function of kind `process_noise_cov`.
        transition_params, noise_params: parameter vectors of the two functions. Anything array-like is converted.
        transition_jacobian: model function of kind `transition_jacobian`, or None.
        method: "auto" (EKF if there is a Jacobian, else UKF), "ekf", "ukf" or "ckf".
        components: names of the components of the state: px and py, in a state of four or more then vx and vy, and in
            any order the height pz, the vertical velocity vz, an acceleration ax, ay, a turn rate turn_rate, or custom
            names. (): all components behind position and velocity are custom.

    Raises:
        InputError: a function of another kind, a bad dimension, parameter or name, "ekf" without a Jacobian.
    """

    state_dim: int
    transition: ModelFunction
    process_noise_cov: ModelFunction
    transition_params: Floats = field(default_factory=lambda: np.empty(0))
    noise_params: Floats = field(default_factory=lambda: np.empty(0))
    transition_jacobian: ModelFunction | None = None
    method: str = "auto"
    components: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        dim = dimension("MotionModel.state_dim", self.state_dim)
        begin = PLANE[: len(PLANE) if dim > VY else 2]
        names = tuple(self.components) or (*begin, *(f"own_{i}" for i in range(len(begin), dim)))
        if len(set(names)) < len(names) or len(names) != dim or names[: len(begin)] != begin:
            raise reject("MotionModel.components", f"{dim} different names, first {', '.join(begin)}", self.components)
        object.__setattr__(self, "components", names)
        require_kind("MotionModel.transition", self.transition, "transition")
        require_kind("MotionModel.process_noise_cov", self.process_noise_cov, "process_noise_cov")
        if self.transition_jacobian is not None:
            require_kind("MotionModel.transition_jacobian", self.transition_jacobian, "transition_jacobian")
        for name in ("transition_params", "noise_params"):
            object.__setattr__(self, name, params_vector(f"MotionModel.{name}", getattr(self, name)))
        resolve_method("MotionModel.method", self.method, self.transition_jacobian is not None)

    def propagate(self, states: ArrayLike, dt: float) -> Floats:
        """Return the states after `dt` seconds without process noise, (n, state_dim). One state may be a vector.

        Raises:
            ModelError: the transition function raised.
        """
        table, dt = state_table("states", states, self.state_dim), real("dt", dt)
        out = np.empty_like(table)
        write_rows(self.transition, table, dt, self.transition_params, out)
        return out

    def noise_cov(self, state: ArrayLike, dt: float) -> Floats:
        """Return the process noise covariance over `dt` seconds from `state`, (state_dim, state_dim)."""
        return np.asarray(self.noise_covs(state_table("state", state, self.state_dim)[:1], dt)[0])

    def noise_covs(self, states: ArrayLike, dt: float) -> Floats:
        """Return the process noise covariances over `dt` seconds from each state, (n, state_dim, state_dim).

        Raises:
            ModelError: the noise function raised.
        """
        table, dt = state_table("states", states, self.state_dim), real("dt", dt)
        out = np.empty((len(table), self.state_dim, self.state_dim))
        write_rows(self.process_noise_cov, table, dt, self.noise_params, out)
        return out

    def velocity_fault(self) -> str | None:
        """Return in words why the velocity is not behind the position. None if it is, or does not exist.

        Births, regions and outputs take these components for it. In a state [x, vx, y, vy] they would read y as a
        velocity. Raises `ModelError` if the transition function does.
        """
        if self.state_dim <= VY:
            return None  # without velocities
        states = np.zeros((3, self.state_dim))
        states[:, :2], states[:, VELOCITY] = (100.0, 200.0), (30.0, 40.0)
        states[1:, VELOCITY] += np.eye(2)
        places = self.propagate(states, _BRIEF)[:, :2]
        for axis, moved in enumerate(places[1:] - places[0]):
            if moved[axis] <= 10.0 * abs(moved[1 - axis]):  # not if one is NaN, which is another fault
                x, y = moved / _BRIEF
                by = f"{x:g} m/s along x and {y:g} m/s along y"
                return f"component {VX + axis}, of which 1 more moves a target by {by}"
        return None

    def check(self, states: ArrayLike, dt: float = 1.0) -> None:
        """Check every function at each state, and the order of the components.

        Raises:
            ModelError: an invalid result. The message has the function, the state, the expected and the given value.
        """
        dt = positive("dt", dt)
        shape = (self.state_dim, self.state_dim)
        for state in state_table("states", states, self.state_dim):
            args = (state, dt, self.transition_params)
            probe_array(self.transition, args, (self.state_dim,))
            probe_covariance(self.process_noise_cov, (state, dt, self.noise_params), self.state_dim, definite=False)
            if self.transition_jacobian is not None:
                probe_jacobian(self.transition_jacobian, self.transition, args, shape, False)
        if (fault := self.velocity_fault()) is not None:
            raise ModelError(f"motion: expected a state {STATE_ORDER}; got {fault}")


@dataclass(frozen=True, slots=True, eq=False)
class SurvivalModel:
    """Probability that a target survives a time step.

    Attributes:
        function: model function of kind `prob_survival`.
        params: its parameter vector.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        require_kind("SurvivalModel.function", self.function, "prob_survival")
        object.__setattr__(self, "params", params_vector("SurvivalModel.params", self.params))

    def prob(self, states: ArrayLike, dt: float) -> Floats:
        """Return the survival probabilities over `dt` seconds, (n,)."""
        table = state_table("states", states)
        return numbers_at(self.function, table, real("dt", dt), self.params)

    def check(self, states: ArrayLike, dt: float = 1.0) -> None:
        """Check the function at each state, and raise `ModelError` unless it gives a probability."""
        dt = positive("dt", dt)
        for state in state_table("states", states):
            probe_probability(self.function, (state, dt, self.params))


@lru_cache(maxsize=1000)
def kernel_motion(motion: MotionModel, survival: SurvivalModel) -> Motion:
    """Return the functions and parameters for prediction kernels, the same object for the same two models."""
    jacobian = motion.transition_jacobian
    return Motion(
        motion.transition,
        _no_transition_jacobian if jacobian is None else jacobian,
        motion.process_noise_cov,
        survival.function,
        motion.transition_params[np.newaxis],
        motion.noise_params[np.newaxis],
        survival.params,
        _ONE_MODE,
        resolve_method("MotionModel.method", motion.method, jacobian is not None),
    )


@model_function("prob_survival")
def _constant_survival(state: Floats, dt: float, params: Floats) -> float:
    return params[0]  # type: ignore[no-any-return]


@model_function("prob_survival")
def _survival_within(state: Floats, dt: float, params: Floats) -> float:
    return params[0] ** (dt / params[1])  # type: ignore[no-any-return]


@part("constant", "survival", probability="prob_survival")
def constant_survival(prob_survival: Probability = 0.98, period: Positive | None = None) -> SurvivalModel:
    """The same probability of survival everywhere.

    Args:
        prob_survival: probability of surviving until the next scan (paper: 0.98), or through the period. Over dt
            seconds it is then prob_survival^(dt / period), in any number of steps.
        period: time to which the probability refers. none: one scan interval of any length [s].

    Raises:
        InputError: a number that is not a probability, or a period that is not above 0.
    """
    chance = probability("prob_survival", prob_survival)
    if period is None:
        return SurvivalModel(_constant_survival, np.array([chance]))
    return SurvivalModel(_survival_within, np.array([chance, positive("period", period)]))
