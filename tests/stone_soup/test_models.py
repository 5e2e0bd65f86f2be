"""Models of Stone Soup and their equals here, by Stone Soup's own functions, Jacobians, covariances and densities."""

from __future__ import annotations

import datetime
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

pytest.importorskip("stonesoup")

from stonesoup.models.clutter import ClutterModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import (
    Cartesian2DToBearing,
    CartesianToBearingRange,
    CartesianToBearingRangeRate2D,
    CartesianToElevationBearingRange,
)
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantAcceleration,
    ConstantNthDerivative,
    ConstantVelocity,
    KnownTurnRate,
    RandomWalk,
    Singer,
)
from stonesoup.models.transition.nonlinear import ConstantTurn
from stonesoup.sensor.passive import PassiveElevationBearing
from stonesoup.sensor.radar.radar import RadarBearingRange, RadarRotatingBearingRange
from stonesoup.simulator.simple import SimpleDetectionSimulator
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState, State, StateVector, WeightedGaussianState

from vedette.errors import InputError
from vedette.models import (
    BirthModel,
    Modes,
    SensorModel,
    bearing_slant_range,
    constant_detection,
    measurement_space_clutter,
)
from vedette.models.functions import write_rows
from vedette.models.measurement import wrap_periodic
from vedette.recorded.detections import elements_of
from vedette.stonesoup import (
    StateLayout,
    convert,
    convert_clutter,
    convert_detection,
    convert_measurement,
    convert_modes,
    convert_motion,
    convert_noise,
    convert_pose,
)
from vedette.stonesoup.sensors import measured_quantities

START = datetime.datetime(2026, 1, 1)
PLANE = StateLayout((0, 2, 1, 3))
MOTIONS = {
    "walk": CombinedLinearGaussianTransitionModel([RandomWalk(0.3), RandomWalk(0.7)]),
    "velocity": CombinedLinearGaussianTransitionModel([ConstantVelocity(0.3)] * 2),
    "two velocities": CombinedLinearGaussianTransitionModel([ConstantVelocity(0.3), ConstantVelocity(0.05)]),
    "acceleration": CombinedLinearGaussianTransitionModel([ConstantAcceleration(0.3), ConstantAcceleration(0.1)]),
    "third derivative": CombinedLinearGaussianTransitionModel(
        [ConstantNthDerivative(constant_derivative=3, noise_diff_coeff=q) for q in (0.2, 0.4)]
    ),
    "one acceleration": CombinedLinearGaussianTransitionModel([ConstantAcceleration(0.3)] * 2),
    "one walk": CombinedLinearGaussianTransitionModel([RandomWalk(0.3)] * 2),
    "one known turn": KnownTurnRate(np.array([0.2, 0.2]), math.radians(-7.0)),
    "turn": ConstantTurn(np.array([0.2, 0.4]), 0.01),
    "known turn": KnownTurnRate(np.array([0.2, 0.4]), math.radians(7.0)),
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("seconds", [0.5, 1.0, 3.7])
def test_motions_are_stone_soups_own(name: str, seconds: float) -> None:
    model = MOTIONS[name]
    motion, layout = convert_motion(model)
    rng, interval = np.random.default_rng(3), datetime.timedelta(seconds=seconds)
    vectors = rng.normal(size=(6, motion.state_dim)) * 20.0
    if name == "turn":
        vectors[:, 4] = rng.normal(size=6) * 0.1
    theirs = [
        np.asarray(model.function(State(StateVector(vector)), time_interval=interval), float).ravel()
        for vector in vectors
    ]
    ours = motion.propagate(layout.states(vectors), seconds)
    np.testing.assert_allclose(ours, layout.states(theirs), rtol=1e-10, atol=1e-10)
    cov = np.asarray(model.covar(time_interval=interval), float)
    np.testing.assert_allclose(
        motion.noise_cov(ours[0], seconds), layout.covs(cov[np.newaxis])[0], rtol=1e-10, atol=1e-12
    )
    slopes = np.empty((6, motion.state_dim, motion.state_dim))
    assert motion.transition_jacobian is not None
    write_rows(motion.transition_jacobian, layout.states(vectors), seconds, motion.transition_params, slopes)
    for vector, slope in zip(vectors, slopes, strict=True):
        jacobian = np.asarray(model.jacobian(State(StateVector(vector)), time_interval=interval), float)
        tolerance = 1e-5 if name == "turn" else 1e-10  # whose Jacobian they take by differences
        np.testing.assert_allclose(slope, layout.covs(jacobian[np.newaxis])[0], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_that_are_compiled_hold_to_their_own_checks(name: str) -> None:
    motion, _ = convert_motion(MOTIONS[name])
    motion.check(np.random.default_rng(1).normal(size=(3, motion.state_dim)) + 0.1, 2.0)


def test_where_a_state_has_what() -> None:
    _, layout = convert_motion(MOTIONS["acceleration"])
    assert (layout.order, layout.position) == ((0, 3, 1, 4, 2, 5), (0, 3))
    there = layout.states([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    assert there.tolist() == [[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]]
    assert layout.inverse().states(there).tolist() == [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]


CRUISE = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.04)] * 2)
LEFT, RIGHT = (KnownTurnRate(np.array([0.5, 0.5]), math.radians(rate)) for rate in (9.0, -9.0))


def test_models_with_times_in_each_are_modes() -> None:
    modes, layout = convert_modes([CRUISE, LEFT], stay_s=[40.0, 8.0], names=("cruise", "left"), at_birth=[0.9, 0.1])
    assert isinstance(modes, Modes)
    assert (modes.names, layout) == (("cruise", "left"), PLANE)
    np.testing.assert_allclose(modes.rates, [[-1.0 / 40.0, 1.0 / 40.0], [1.0 / 8.0, -1.0 / 8.0]])
    vector, interval = np.array([5.0, 3.0, -7.0, 2.0]), datetime.timedelta(seconds=2.5)
    for motion, model in zip(modes.in_common, (CRUISE, LEFT), strict=True):
        theirs = np.asarray(model.function(State(StateVector(vector)), time_interval=interval), float).ravel()
        np.testing.assert_allclose(motion.propagate(layout.states([vector]), 2.5), layout.states([theirs]), rtol=1e-12)
        cov = layout.covs([np.asarray(model.covar(time_interval=interval), float)])[0]
        np.testing.assert_allclose(motion.noise_cov(layout.states([vector])[0], 2.5), cov, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.95, 0.03, 0.02], [0.1, 0.88, 0.02], [0.06, 0.04, 0.9]],
        [[1.0, 0.0, 0.0], [0.1, 0.9, 0.0], [0.2, 0.0, 0.8]],
        np.eye(3),
    ],
)
def test_a_transition_matrix_is_that_of_the_modes_after_its_interval(matrix: Any) -> None:
    modes, _ = convert_modes([CRUISE, LEFT, RIGHT], transition_matrix=matrix, interval_s=2.0)
    np.testing.assert_allclose(expm(2.0 * modes.rates), matrix, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("models", "given", "message"),
    [
        ([CRUISE, LEFT], {}, "stay_s, transition_matrix: expected one of the two; got neither"),
        ([CRUISE, LEFT], {"transition_matrix": [[0.9, 0.2], [0.1, 0.9]]}, "transition_matrix: expected rows"),
        ([CRUISE, LEFT], {"transition_matrix": [[0.4, 0.6], [0.1, 0.9]]}, "transition_matrix: .*above 0.5"),
        (
            [CRUISE, LEFT, RIGHT],
            {"transition_matrix": [[0.9, 0.1, 0.0], [0.1, 0.8, 0.1], [0.0, 0.1, 0.9]]},
            "transition_matrix: expected probabilities of a chain in continuous time, or stay_s and to instead",
        ),
        ([CRUISE, MOTIONS["acceleration"]], {"stay_s": [9.0, 9.0]}, r"transition_models\[0\]: expected states with"),
        ([CRUISE, MOTIONS["known turn"]], {"stay_s": [9.0, 9.0]}, r"motions\[1\]: expected a built-in motion"),
        ([CRUISE, ConstantVelocity(0.1)], {"stay_s": [9.0, 9.0]}, "transition_model: expected one of"),
    ],
)
def test_modes_that_cannot_be_are_refused(models: Any, given: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        convert_modes(models, **given)


COV = np.array([[0.02**2, 0.05], [0.05, 15.0**2]])
TURNED = {"translation_offset": np.array([[120.0], [-40.0]]), "rotation_offset": StateVector([[0.0], [0.0], [2.3]])}
MEASURED = {
    "position": LinearGaussian(4, (0, 2), np.diag([9.0, 16.0])),
    "correlated": LinearGaussian(4, (0, 2), np.array([[9.0, 3.0], [3.0, 16.0]])),
    "bearing, range": CartesianToBearingRange(4, (0, 2), np.diag([0.02**2, 15.0**2])),
    "turned": CartesianToBearingRange(4, (0, 2), COV, **TURNED),
    "turned the other way": CartesianToBearingRange(
        4,
        (0, 2),
        COV,
        translation_offset=TURNED["translation_offset"],
        rotation_offset=StateVector([[0.0], [0.0], [-1.1]]),
    ),
    "bearing": Cartesian2DToBearing(4, (0, 2), np.diag([0.02**2]), **TURNED),
}
# All quadrants, seen from the sensor, and along the axes.
STATES = [
    [120.0 + 300.0 * math.cos(angle), 3.0, -40.0 + 300.0 * math.sin(angle), -2.0]
    for angle in np.radians([0.0, 30.0, 90.0, 135.0, 179.0, 180.0, 200.0, 270.0, 330.0])
]


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("vector", STATES)
def test_measurements_are_stone_soups_own(name: str, vector: list[float]) -> None:
    model, state = MEASURED[name], State(StateVector(vector))
    measurement, pose, ours = convert_measurement(model, PLANE), convert_pose(model), PLANE.states([vector])
    their = Detection(model.function(state, noise=False), measurement_model=model)
    taken = np.array([elements_of(their, measured_quantities(model), model, "here")])
    off = wrap_periodic(taken - measurement.measure(ours, pose), measurement.periods)
    np.testing.assert_allclose(off, 0.0, atol=1e-10)

    # As likely as they say, of a measurement that is some way off.
    aside = np.resize([0.03, 12.0], model.ndim_meas)
    noisy = Detection(model.function(state, noise=False) + aside[:, np.newaxis], measurement_model=model)
    taken = np.array([elements_of(noisy, measured_quantities(model), model, "here")])
    off = wrap_periodic(taken - measurement.measure(ours, pose), measurement.periods)[0]
    cov = convert_noise(model).covs(ours, pose, model.ndim_meas)[0]
    np.testing.assert_allclose(cov, np.asarray(model.covar(), float), rtol=1e-12)
    log_density = multivariate_normal.logpdf(off, cov=cov)
    np.testing.assert_allclose(log_density, float(model.logpdf(noisy, state)), rtol=1e-10)
    np.testing.assert_allclose(math.exp(log_density), float(model.pdf(noisy, state)), rtol=1e-10)

    slope = np.empty((1, model.ndim_meas, 4))
    assert measurement.jacobian is not None
    write_rows(measurement.jacobian, ours, pose, measurement.params, slope)
    jacobian = np.asarray(model.jacobian(state), float)[:, PLANE.order]
    if isinstance(model, LinearGaussian):
        np.testing.assert_allclose(slope[0], jacobian, rtol=1e-10)
        return
    np.testing.assert_allclose(slope[0], jacobian, atol=2e-5)  # which they take by differences, of one side
    for column, place in enumerate(PLANE.order[:2]):
        aside = np.eye(4)[place] * 1e-3
        ends = [
            np.asarray(model.function(State(StateVector(vector + side * aside)), noise=False), float).ravel()
            for side in (-1.0, 1.0)
        ]
        between = wrap_periodic((ends[1] - ends[0])[np.newaxis], measurement.periods)[0] / 2e-3
        np.testing.assert_allclose(slope[0][:, column], between, rtol=1e-8, atol=1e-8)


def test_noise_that_is_compiled_holds_to_its_own_checks() -> None:
    model = MEASURED["turned"]
    convert_noise(model).check(PLANE.states(STATES), convert_pose(model), 2)


def radar(kind: Any = RadarBearingRange, **fields: Any) -> Any:
    given = {"ndim_state": 4, "position_mapping": (0, 2), "noise_covar": np.diag([0.01**2, 5.0**2])}
    place = {"position": StateVector([[120.0], [-40.0]])}
    return kind(**(given | place | fields))


def test_fields_of_view_are_those_of_the_radars() -> None:
    rotating = radar(
        RadarRotatingBearingRange,
        dwell_centre=StateVector([2.9]),
        rpm=30,
        fov_angle=math.radians(50.0),
        max_range=400.0,
        orientation=StateVector([[0.0], [0.0], [0.6]]),
    )
    for sensor in (radar(), radar(max_range=250.0), rotating):
        model, seen = sensor.measurement_model, convert_detection(sensor, 0.8)
        rng = np.random.default_rng(8)
        vectors = np.column_stack(
            [rng.uniform(-500, 700, 400), np.zeros(400), rng.uniform(-600, 500, 400), np.zeros(400)]
        )
        theirs = [bool(np.all(sensor.is_detectable(State(StateVector(vector))))) for vector in vectors]
        ours = seen.prob(PLANE.states(vectors), convert_pose(model))
        assert ours.tolist() == [0.8 if one else 0.0 for one in theirs]
    assert 0 < sum(theirs) < 400


def test_clutter_is_as_dense_as_they_say() -> None:
    turned = MEASURED["turned"]
    simulator = SimpleDetectionSimulator([], turned, np.array([[-math.pi, math.pi], [0.0, 900.0]]), clutter_rate=7.0)
    clutter = convert_clutter(simulator, turned)
    density = math.exp(clutter.log_intensity_at([[1.0, 50.0]], convert_pose(turned))[0])
    assert density == pytest.approx(float(simulator.clutter_spatial_density), rel=1e-12)
    assert clutter.log_intensity_at([[1.0, 901.0]], convert_pose(turned))[0] == -math.inf

    sector = SimpleDetectionSimulator([], turned, np.array([[0.0, 0.5], [0.0, 900.0]]), clutter_rate=7.0)
    logs = convert_clutter(sector, turned).log_intensity_at(
        [[2.3 - 0.01, 50.0], [2.3 + 0.01, 50.0]], convert_pose(turned)
    )
    assert np.isinf(logs).tolist() == [True, False]  # as it was turned

    uniform = ClutterModel(clutter_rate=4.0, dist_params=((-200.0, 300.0), (-100.0, 100.0)))
    position = MEASURED["position"]
    there = convert_clutter(uniform, position).log_intensity_at([[290.0, 0.0], [0.0, 290.0]], np.zeros(3))
    assert math.exp(there[0]) == pytest.approx(4.0 / (500.0 * 200.0))
    assert there[1] == -math.inf
    # Of a radar, with the Jacobian: what falls into a small cell around (bearing, range).
    polar = convert_clutter(uniform, turned).log_intensity_at([[math.pi / 2.0, 50.0]], convert_pose(turned))
    assert math.exp(polar[0]) == pytest.approx(4.0 / (500.0 * 200.0) * 50.0)


def test_births_are_in_the_order_of_states_here() -> None:
    box = measurement_space_clutter(1.0, [-900.0, -900.0], [900.0, 900.0])
    prior = GaussianState([0.0, 0.0, 0.0, 0.0], np.diag([100.0, 4.0, 81.0, 9.0]))
    measured = convert(MOTIONS["velocity"], [MEASURED["position"]], births=prior, clutter=box).targets.birth
    assert measured.from_measurements is not None
    assert measured.from_measurements.std.tolist() == [10.0, 9.0, 2.0, 3.0]
    site = WeightedGaussianState([1.0, 2.0, 3.0, 4.0], np.diag([100.0, 4.0, 81.0, 9.0]), weight=0.25)
    sites = convert(MOTIONS["velocity"], [MEASURED["position"]], births=[site], clutter=box).targets.birth
    assert (sites.existence.tolist(), sites.means.tolist()) == ([0.25], [[1.0, 3.0, 2.0, 4.0]])
    assert np.diag(sites.covs[0]).tolist() == [100.0, 81.0, 4.0, 9.0]


def of_parts(**given: Any) -> Any:
    box = measurement_space_clutter(1.0, [-900.0, -900.0], [900.0, 900.0])
    parts = {"births": GaussianState([0.0] * 4, np.eye(4)), "clutter": box} | given
    sensors = parts.pop("sensors", [MEASURED["position"]])
    return convert(parts.pop("transition_model", MOTIONS["velocity"]), sensors, **parts)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"transition_model": CombinedLinearGaussianTransitionModel([Singer(0.1, 0.1)] * 2)},
            "transition_model.model_list: expected two of RandomWalk, .*ConstantNthDerivative, for x and y; "
            "got Singer, Singer",
        ),
        (
            {"transition_model": CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1)] * 3)},
            "transition_model.model_list: expected two of .*; got ConstantVelocity, ConstantVelocity, ConstantVelocity",
        ),
        (
            {"transition_model": CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1), RandomWalk(0.1)])},
            r"expected two models of one constant_derivative; got \[1, 0\]",
        ),
        (
            {"transition_model": ConstantVelocity(0.1)},
            "transition_model: expected one of CombinedLinearGaussianTransitionModel, ConstantTurn, KnownTurnRate, "
            "or a motion of Vedette with its StateLayout; got ConstantVelocity",
        ),
        ({"transition_model": KnownTurnRate(np.array([0.1, 0.1]), 0.0)}, "turn_rate: expected a rate other than 0"),
        ({"sensors": []}, "sensors: expected one or more; got none"),
        (
            {"sensors": [CartesianToBearingRangeRate2D(4, (0, 2), np.eye(3))]},
            "measurement_model: expected one of LinearGaussian, CartesianToBearingRange, Cartesian2DToBearing; "
            "got CartesianToBearingRangeRate2D",
        ),
        (
            {"sensors": [CartesianToElevationBearingRange(6, (0, 2, 4), np.eye(3))]},
            "measurement_model: .*; got CartesianToElevationBearingRange",
        ),
        (
            {"sensors": [LinearGaussian(4, (2, 0), np.eye(2))]},
            r"measurement_model.mapping: expected \(0, 2\), where the transition model has x and y; got \(2, 0\)",
        ),
        (
            {"sensors": [LinearGaussian(4, (0, 2), np.array([[1.0, 2.0], [2.0, 1.0]]))]},
            "measurement_model.noise_covar: expected",
        ),
        (
            {"sensors": [PassiveElevationBearing(ndim_state=4, mapping=(0, 1, 2), noise_covar=np.eye(2))]},
            "measurement_model: .*; got CartesianToElevationBearing",
        ),
        ({"sensors": MEASURED["position"]}, "sensors: expected a list of them, or a mapping .*; got LinearGaussian"),
        ({"clutter": None}, "clutter: expected a clutter_model of LinearGaussian, or here, as of .*; got none"),
        ({"clutter": 0.01}, "clutter: expected a ClutterModel or a SimpleDetectionSimulator .*; got float"),
        (
            {"clutter": ClutterModel(distribution=np.random.default_rng(1).normal)},
            "clutter.distribution: expected a uniform distribution .*; got normal",
        ),
        ({"births": GaussianState([0.0] * 4, np.diag([0.0, 1, 0, 1]))}, "births.covar: expected variances above 0"),
        ({"births": GaussianState([0.0] * 2, np.eye(2))}, r"births.covar: expected 4 by 4, .*; got \[2, 2\]"),
        (
            {"births": [WeightedGaussianState([0.0] * 2, np.eye(2), weight=0.1)]},
            r"births.covar: expected 4 by 4, .*; got \[2, 2\]",
        ),
        ({"births": 3}, "births: expected a GaussianState, WeightedGaussianStates, or a BirthModel .*; got int"),
    ],
)
def test_what_has_no_equal_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        of_parts(**given)


def test_a_sensor_that_leans_is_refused() -> None:
    leaning = CartesianToBearingRange(4, (0, 2), np.eye(2), rotation_offset=StateVector([[0.0], [0.3], [1.0]]))
    with pytest.raises(InputError, match="rotation_offset: expected turns about the z axis alone"):
        convert_pose(leaning)


def test_sensors_may_bring_their_own_clutter_and_detection() -> None:
    own = radar(clutter_model=ClutterModel(clutter_rate=3.0, dist_params=((-900.0, 900.0), (-900.0, 900.0))))
    seen = constant_detection(0.7)
    made = of_parts(sensors={"mast": own}, clutter=None, prob_detection=seen)
    assert made.names == ("mast",)
    assert isinstance(made.sensors[0], SensorModel)
    assert (made.sensors[0].detection, made.sensors[0].clutter.rate) == (seen, 3.0)


def test_a_sensor_of_heights_needs_a_motion_with_one() -> None:
    bearing_range = CartesianToBearingRange(6, mapping=(0, 3), noise_covar=np.diag([0.01**2, 25.0]))
    box = measurement_space_clutter(1.0, [-1.0, 0.0], [1.0, 1e4])
    found = convert(MOTIONS["acceleration"], [bearing_range], births=BirthModel.none(6), clutter=box)
    assert found.targets.motion.components == ("px", "py", "vx", "vy", "ax", "ay")
    (sensor,) = found.sensors
    of_heights = replace(found, sensors=(replace(sensor, measurement=bearing_slant_range()),))
    with pytest.raises(InputError, match=r"sensor.measurement: expected a motion with pz .*got .*vy, ax, ay"):
        of_heights.tracker()
