"""Sensor model: measurement, noise, detection and clutter."""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vedette.internal.unit_warnings import LARGE_ANGLE, suppress_unit_warnings, warn_implausible
from vedette.kernels.base.types import Floats, Sensor
from vedette.kernels.gaussian.detection import AT_CENTRE, AT_EDGES, BY_NODES, CLOSED_FORM, detection_probabilities
from vedette.kernels.gaussian.position_integrals import spread_nodes
from vedette.models.arguments import float_array, one_of, pose_vector, reject, state_table
from vedette.models.clutter import ClutterModel
from vedette.models.detection import DetectionModel
from vedette.models.functions import model_function
from vedette.models.measurement import MeasurementModel, NoiseModel
from vedette.models.motion import resolve_method


@model_function("measurement_jacobian")
def _no_measurement_jacobian(state: Floats, pose: Floats, params: Floats, out: Floats) -> None:
    """Placeholder for a missing Jacobian in a kernel bundle whose method never calls it."""
    raise NotImplementedError("this measurement model has no Jacobian")


@model_function("mean_prob_detection")
def _no_mean_detection(mean: Floats, cov: Floats, pose: Floats, params: Floats) -> float:
    """Placeholder for a missing mean in a kernel bundle that never calls it. Returns NaN."""
    return math.nan


_NODES = spread_nodes()
_NO_NODES = np.empty((0, 3))
_NO_FACTORS = np.empty(0)

_PARTS: dict[str, type] = {
    "measurement": MeasurementModel,
    "noise": NoiseModel,
    "detection": DetectionModel,
    "clutter": ClutterModel,
}


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """Model of a sensor for filters, without its pose.

    Attributes:
        measurement, noise, detection, clutter: the four models.
        method: "ekf", "ukf", "ckf", or "auto": the EKF if measurements are close to linear for their noise, else a
            separate linearisation for each measurement, or the UKF if the measurement has no Jacobian.
        detection_at: filters evaluate the probability of detection at the "centre" of a predicted Gaussian, as in the
            paper, or as its "mean" over the Gaussian, with nodes over the position. With the mean, if P_D varies over
            the Gaussian, a miss moves the density to places of low P_D, and a detection has the mean P_D of the
            density after it. None: the mean in filters of a factored GLMB, else the centre. The `sensor` of a filter
            has the value in use.
        mode_factors: (num_modes,) factor of each mode of the targets on the probability of detection by this sensor,
            in [0, 1]. 0 is hidden. None: those of the motion (`Modes.detection_factors`).
        meas_dim: number of components of a measurement.

    Raises:
        InputError: a part of another type, parts for different numbers of measurement components or different angles,
            a standard deviation of an angle above pi, or "ekf" without a Jacobian.
    """

    measurement: MeasurementModel
    noise: NoiseModel
    detection: DetectionModel
    clutter: ClutterModel
    method: str = "auto"
    detection_at: str | None = None
    mode_factors: Floats | None = None
    meas_dim: int = field(init=False)

    def __post_init__(self) -> None:
        for name, kind in _PARTS.items():
            if not isinstance(getattr(self, name), kind):
                raise reject(f"SensorModel.{name}", f"a {kind.__name__}", getattr(self, name))
        object.__setattr__(self, "meas_dim", self.measurement.meas_dim)
        for name, served_dim in (("noise", self.noise.meas_dim), ("clutter", self.clutter.meas_dim)):
            if served_dim is not None and served_dim != self.meas_dim:
                expected = f"a model for {self.meas_dim} measurement components"
                raise reject(f"SensorModel.{name}", expected, f"one for {served_dim}")
        angular = self.clutter.angular
        if angular is not None and not np.array_equal(angular, self.measurement.angular):
            expected = f"a model for measurements whose angular flags are {self.measurement.angular.tolist()}"
            raise reject("SensorModel.clutter", expected, angular.tolist())
        resolve_method("SensorModel.method", self.method, self.measurement.jacobian is not None)
        if self.detection_at is not None:
            one_of("SensorModel.detection_at", self.detection_at, ("centre", "mean"))
        if self.mode_factors is not None:
            factors = float_array("SensorModel.mode_factors", self.mode_factors, (None,))
            if not ((factors >= 0.0) & (factors <= 1.0)).all():
                raise reject("SensorModel.mode_factors", "numbers in [0, 1]", factors.tolist())
            object.__setattr__(self, "mode_factors", factors)
        self._check_bearings()

    def _check_bearings(self) -> None:
        """Raise `InputError` for a standard deviation of an angle above pi, and warn of one that looks like degrees."""
        stds = self.noise.least_stds
        if stds is None:
            return
        for component in np.flatnonzero(self.measurement.angular & (stds > LARGE_ANGLE)).tolist():
            field = "SensorModel.noise"
            expected = f"a standard deviation of component {component}, an angle, in radians"
            got, question = f"{stds[component]:g}", "is it in degrees, or are components exchanged"
            if stds[component] > math.pi:
                raise reject(field, f"{expected}, up to pi", f"{got} ({question}?)")
            warn_implausible(field, expected, got, question)

    def to_kernel(self, detection_at: str | None = None) -> Sensor:
        """Return the functions and parameters for kernels.

        detection_at: replaces the sensor's own. "mean" then uses the model's `mean_function`, if it has one.
        """
        if self.detection.is_constant or (detection_at or self.detection_at or "centre") == "centre":
            return _bundle_of(self, AT_CENTRE)
        if detection_at is None:
            return _bundle_of(self, AT_EDGES)
        return _bundle_of(self, BY_NODES if self.detection.mean_function is None else CLOSED_FORM)

    def mean_detection(self, means: ArrayLike, covs: ArrayLike, pose: ArrayLike) -> Floats:
        """Return the mean probability of detection over each of n Gaussians, (n,), for any `detection_at`.

        Args:
            means: (n, state_dim) means.
            covs: (n, state_dim, state_dim) covariances, positive definite.
            pose: (3 or more,) pose of the sensor.

        Raises:
            InputError: arrays of other shapes, or with numbers that are not finite.
            ModelError: the detection model returned a value that is not a probability.
        """
        centres = float_array("means", means, (None, None))
        num, dim = centres.shape
        spreads, at = float_array("covs", covs, (num, dim, dim)), pose_vector("pose", pose)
        return detection_probabilities(self.to_kernel("mean"), at, centres, spreads)

    def check(self, states: ArrayLike, pose: ArrayLike) -> None:
        """Check every function of the sensor at each of (n, state_dim) states, seen from `pose`.

        Call it once on typical states before a long run. It detects functions that raise, leave part of `out`
        unwritten, use indices outside their arrays, or return an invalid value.

        Raises:
            ModelError: an invalid result. The message has the function, the state, the expected and the given value.
        """
        table, at = state_table("states", states), pose_vector("pose", pose)
        self.measurement.check(table, at)
        self.noise.check(table, at, self.meas_dim)
        self.detection.check(table, at)
        measured = self.measurement.measure(table, at)
        self.clutter.check(measured, at, self.measurement, state_dim=table.shape[1])


@lru_cache(maxsize=1000)
def with_default_detection_at(model: SensorModel, default: str) -> SensorModel:
    """Return the model with this `detection_at` if it has none, the same object for equal arguments."""
    if model.detection_at is not None:
        return model
    with suppress_unit_warnings():  # those of the given model are enough
        return replace(model, detection_at=default)


@lru_cache(maxsize=1000)
def _bundle_of(model: SensorModel, rule: int) -> Sensor:
    """Return the functions and parameters of a model, cached, since kernels recognise a bundle they have seen."""
    jacobian, mean = model.measurement.jacobian, model.detection.mean_function
    return Sensor(
        model.measurement.function,
        _no_measurement_jacobian if jacobian is None else jacobian,
        model.noise.function,
        model.detection.function,
        _no_mean_detection if mean is None else mean,
        model.clutter.log_intensity,
        model.measurement.params,
        model.noise.params,
        model.detection.params,
        model.clutter.params,
        model.measurement.periods,
        resolve_method("SensorModel.method", model.method, jacobian is not None, bends=not model.measurement.is_linear),
        model.measurement.height,
        rule,
        _NO_NODES if rule == AT_CENTRE else _NODES,
        _NO_FACTORS,
    )
