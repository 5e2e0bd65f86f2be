"""Conversion of Stone Soup target and sensor models into Vedette models, for the tracker and the sensor manager."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from stonesoup.types.state import GaussianState

from vedette.filters import DeltaGlmbFilter, LmbFilter, MultiSensorGlmbFilter, SequentialLmbFilter
from vedette.fusion import Fusion
from vedette.kernels.base.types import Floats
from vedette.models import (
    BirthModel,
    ClutterModel,
    DetectionModel,
    MeasurementBirth,
    SensorModel,
    TargetModel,
    constant_survival,
)
from vedette.models.arguments import one_of, reject
from vedette.models.functions import write_rows
from vedette.stonesoup.motions import StateLayout, convert_motion
from vedette.stonesoup.sensors import (
    convert_clutter,
    convert_detection,
    convert_measurement,
    convert_noise,
    measured_quantities,
    measurement_model_of,
)
from vedette.tracking import Central, Distributed, Tracker

_FILTERS = {"lmb": LmbFilter, "glmb": DeltaGlmbFilter}
_CENTRAL_FILTERS = {"lmb": SequentialLmbFilter, "glmb": MultiSensorGlmbFilter}
Births: TypeAlias = BirthModel | MeasurementBirth | GaussianState | Sequence[Any]


@dataclass(frozen=True, slots=True, eq=False)
class ConvertedModels:
    """Result of `convert`: Vedette models equal to Stone Soup models.

    Attributes:
        targets: motion, survival and birth models.
        sensors: model of each sensor.
        layout: order of the components in Stone Soup's states.
        sources: for each sensor, the Stone Soup sensor or its measurement model, from which scans take its position.
        names: for each sensor, its name in a detection's `metadata["sensor"]`.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]
    layout: StateLayout
    sources: tuple[Any, ...]
    names: tuple[str, ...]

    def tracker(
        self, kind: Literal["lmb", "glmb"] = "lmb", *, fusion: Fusion | None = None, feedback: bool = False
    ) -> Tracker:
        """Return a Vedette tracker: the filter of one sensor, or for several, one filter of all scans, or a fusion.

        Args:
            kind: kind of filter.
            fusion: fusion of a filter at each sensor. None: one filter takes all scans (decision 8).
            feedback: whether sensors take over the fused belief, see `vedette.tracking.Distributed`.
        """
        one_of("kind", kind, _FILTERS)
        if fusion is None and len(self.sensors) > 1:
            return Central(_CENTRAL_FILTERS[kind](self.targets, self.sensors))
        own = tuple(_FILTERS[kind](self.targets, sensor) for sensor in self.sensors)
        return Distributed(own, fusion, feedback)

    def predicted(self, mean: Any, cov: Any, seconds: float) -> tuple[Any, Any]:
        """Return the mean and covariance, in Vedette's order, after some seconds, with the motion linearised."""
        motion, state = self.targets.motion, np.asarray(mean, np.float64)[np.newaxis]
        slope = np.empty((1, motion.state_dim, motion.state_dim))
        write_rows(motion.transition_jacobian, state, float(seconds), motion.transition_params, slope)  # type: ignore[arg-type]
        spread = slope[0] @ cov @ slope[0].T + motion.noise_cov(state[0], seconds)
        return motion.propagate(state, seconds)[0], 0.5 * (spread + spread.T)


def convert(
    transition_model: Any,
    sensors: Mapping[str, Any] | Sequence[Any],
    *,
    births: Births,
    clutter: Any = None,
    prob_detection: float | DetectionModel = 0.9,
    prob_survival: float = 0.99,
    expected_births: float = 0.5,
    max_existence: float = 0.03,
) -> ConvertedModels:
    """Convert models of Stone Soup into equal Vedette models.

    Args:
        transition_model: see `convert_motion`. Of targets that change their motion, the result of `convert_modes`.
        sensors: sensors or measurement models (see `convert_measurement`), one or more. Several by the names in their
            detections' `metadata["sensor"]`, or in a list, for names "0", "1", ...
        births: where targets appear. A `GaussianState`, as the prior of a `SimpleMeasurementInitiator`: at every
            measurement that no track explains, with its variances. A list of `WeightedGaussianState`: at these
            positions, each with its weight as the probability of a birth at a scan. Or a `BirthModel` or
            `MeasurementBirth` of `vedette.models`.
        clutter: see `convert_clutter`. None: the `clutter_model` of each sensor.
        prob_detection: probability in a sensor's field of view (`convert_detection`), or a detection model.
        prob_survival: probability of survival to the next scan.
        expected_births, max_existence: for births from measurements, see `vedette.models.MeasurementBirth`.

    Raises:
        InputError: a model without an equal in Vedette. The message names the model, the field and the value.
    """
    try:
        named = dict(sensors) if isinstance(sensors, Mapping) else {str(k): own for k, own in enumerate(sensors)}
    except TypeError:
        raise reject("sensors", "a list of them, or a mapping from their names", type(sensors).__name__) from None
    if not named:
        raise reject("sensors", "one or more", "none")
    motion, layout = convert_motion(transition_model)
    birth = _births(births, layout, motion.state_dim, expected_births, max_existence)
    made = []
    for source in named.values():
        model = measurement_model_of(source)
        measured = convert_measurement(model, layout)
        seen = (
            prob_detection if isinstance(prob_detection, DetectionModel) else convert_detection(source, prob_detection)
        )
        unwanted = _clutter(source, clutter, model)
        made.append(SensorModel(measured, convert_noise(model), seen, unwanted))
    targets = TargetModel(motion, constant_survival(prob_survival), birth)
    return ConvertedModels(targets, tuple(made), layout, tuple(named.values()), tuple(map(str, named)))


def _clutter(sensor: Any, given: Any, model: Any) -> ClutterModel:
    source = getattr(sensor, "clutter_model", None) if given is None else given
    if source is None:
        what = f"a clutter_model of {type(sensor).__name__}, or here, as of vedette.models.measurement_space_clutter"
        raise reject("clutter", what, f"none ({', '.join(measured_quantities(model))} measured)")
    return convert_clutter(source, model)


def _births(given: Any, layout: StateLayout, dim: int, expected: float, most: float) -> BirthModel:
    if isinstance(given, BirthModel):
        return given
    if isinstance(given, GaussianState):
        variances = np.diag(layout.covs(_covs([given], dim))[0])
        if (variances <= 0.0).any():
            raise reject("births.covar", "variances above 0: of a birth about what was measured", variances.tolist())
        given = MeasurementBirth(expected, most, np.sqrt(variances))
    none = BirthModel.none(dim)
    if isinstance(given, MeasurementBirth):
        return BirthModel(none.existence, none.means, none.covs, None, given)
    try:
        weights = [float(site.weight) for site in given]
        means = [np.asarray(site.mean, np.float64).ravel() for site in given]
        covs = _covs(given, dim)
    except (AttributeError, TypeError):
        wanted = "a GaussianState, WeightedGaussianStates, or a BirthModel or MeasurementBirth of vedette.models"
        raise reject("births", wanted, type(given).__name__) from None
    return BirthModel(np.array(weights), layout.states(np.array(means)), layout.covs(covs))


def _covs(states: Sequence[Any], dim: int) -> Floats:
    covs = [np.asarray(state.covar, np.float64) for state in states]
    for cov in covs:
        if cov.shape != (dim, dim):
            raise reject("births.covar", f"{dim} by {dim}, as the transition model's state is", list(cov.shape))
    return np.array(covs)
