"""Functions that a user writes: compiled by the decorator, equal to built-ins, and every mistake named."""

from __future__ import annotations

import functools
import math
import pickle

import numpy as np
import pytest

from reference.user_models import my_bearing_range, my_bearing_range_jacobian, user_made_bearing_range
from vedette import models
from vedette.errors import InputError, ModelError
from vedette.kernels.base.compile import JIT_ENABLED
from vedette.kernels.gaussian.sigma_points import CUBATURE, LINEARISED, SWITCHED, UNSCENTED

pytestmark = pytest.mark.lanes

REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
STATES = np.random.default_rng(1).uniform(-900.0, 900.0, (25, 4))
POSE = np.array([-745.0, 830.0, 0.0])


def sensor(measurement=None, noise=None, detection=None, clutter=None, **options):
    return models.SensorModel(
        measurement or models.bearing_range(),
        noise or models.range_dependent_noise(10.0, 5e-5, math.pi / 180, 5e-6),
        detection or models.gaussian_detection(1e4),
        clutter or models.region_clutter(25.0, REGION, "bearing_range"),
        **options,
    )


def test_a_copy_of_bearing_range_gives_identical_values():
    mine, built_in = user_made_bearing_range(), models.bearing_range()
    np.testing.assert_array_equal(mine.measure(STATES, POSE), built_in.measure(STATES, POSE))
    for state in STATES:
        jacobians = np.empty((2, 2, 4))
        mine.jacobian(state, POSE, mine.params, jacobians[0])  # type: ignore[misc]
        built_in.jacobian(state, POSE, built_in.params, jacobians[1])  # type: ignore[misc]
        np.testing.assert_array_equal(jacobians[0], jacobians[1])
    sensor(mine).check(STATES, POSE)


def test_method_follows_the_jacobian():
    without = user_made_bearing_range(jacobian=False)
    assert sensor().to_kernel().method == SWITCHED
    assert sensor(method="ekf").to_kernel().method == LINEARISED
    assert sensor(without).to_kernel().method == UNSCENTED
    assert sensor(without, method="ckf").to_kernel().method == CUBATURE
    assert sensor(method="ukf").to_kernel().method == UNSCENTED
    with pytest.raises(InputError, match=r"SensorModel.method: expected auto, ukf or ckf, as no Jacobian"):
        sensor(without, method="ekf")


def test_the_place_of_a_missing_jacobian_is_filled_but_never_usable():
    bundle = sensor(user_made_bearing_range(jacobian=False)).to_kernel()
    with pytest.raises(NotImplementedError):
        bundle.measurement_jacobian(STATES[0], POSE, np.empty(0), np.empty((2, 4)))
    cv = models.constant_velocity(1.0)
    motion = models.MotionModel(4, cv.transition, cv.process_noise_cov, noise_params=cv.noise_params)
    kernel = models.kernel_motion(motion, models.constant_survival(0.9))
    assert kernel.method == UNSCENTED
    with pytest.raises(NotImplementedError):
        kernel.transition_jacobian(STATES[0], 1.0, np.empty(0), np.empty((4, 4)))


def test_bundles_hold_the_functions_and_parameters():
    cv = models.constant_velocity(5.0)
    bundle = models.kernel_motion(cv, models.constant_survival(0.98))
    assert bundle.transition is cv.transition
    assert bundle.method == LINEARISED
    np.testing.assert_array_equal(bundle.noise_params, [[5.0]])
    np.testing.assert_array_equal(bundle.survival_params, [0.98])
    for vector in (bundle.transition_params, bundle.noise_params, bundle.survival_params):
        assert vector.dtype == np.float64
        assert vector.flags.c_contiguous
        assert vector.flags.writeable


def test_parameters_are_copied_and_converted():
    params = np.array([1, 2, 3, 4])[::2]
    model = models.DetectionModel(models.constant_detection(0.5).function, params)
    params[0] = 7
    np.testing.assert_array_equal(model.params, [1.0, 3.0])
    assert model.params.flags.c_contiguous


def test_models_survive_pickling():
    again = pickle.loads(pickle.dumps(sensor()))
    np.testing.assert_array_equal(again.measurement.measure(STATES, POSE), sensor().measurement.measure(STATES, POSE))


def three(state, pose, params):
    return 0.5


def test_decorator_refuses_a_wrong_kind_and_wrong_arguments():
    with pytest.raises(InputError, match="expected one of transition, "):
        models.model_function("measurment")
    with pytest.raises(InputError, match=r"'three': expected 4 arguments \(state, pose, params, out\); got 3"):
        models.model_function("measurement")(three)
    for not_plain in (np.sin, functools.partial(three, 1), my_bearing_range, 3):
        with pytest.raises(InputError, match="a plain Python function"):
            models.model_function("measurement")(not_plain)  # type: ignore[arg-type]


@pytest.mark.skipif(not JIT_ENABLED, reason="only a compiler finds these")
def test_decorator_explains_what_cannot_be_compiled():
    def unknown_name(state, pose, params):
        return missing(state)  # type: ignore[name-defined]  # noqa: F821

    def text(state, pose, params):
        return "often"

    def returns_instead(state, pose, params, out):
        return state[:2]

    with pytest.raises(ModelError, match=r"(?s)prob_detection function 'unknown_name' cannot be compiled.*missing"):
        models.model_function("prob_detection")(unknown_name)
    with pytest.raises(ModelError, match="'text' cannot be compiled"):
        models.model_function("prob_detection")(text)
    with pytest.raises(ModelError, match="'returns_instead' cannot be compiled"):
        models.model_function("measurement")(returns_instead)


BUILT_IN = sensor()
MOTION = models.constant_velocity(1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: models.MotionModel(0, MOTION.transition, MOTION.process_noise_cov), "MotionModel.state_dim"),
        (lambda: models.MotionModel(4, MOTION.process_noise_cov, MOTION.transition), "MotionModel.transition: .*kind"),
        (lambda: models.MotionModel(4, MOTION.transition, three), "MotionModel.process_noise_cov: .*three"),
        (
            lambda: models.MotionModel(
                4, MOTION.transition, MOTION.process_noise_cov, transition_jacobian=MOTION.transition
            ),
            "MotionModel.transition_jacobian",
        ),
        (
            lambda: models.MotionModel(4, MOTION.transition, MOTION.process_noise_cov, method="ekf"),
            "MotionModel.method",
        ),
        (
            lambda: models.MotionModel(4, MOTION.transition, MOTION.process_noise_cov, [math.nan]),  # type: ignore[arg-type]
            "MotionModel.transition_params: expected numbers that are not NaN",
        ),
        (lambda: models.SurvivalModel(MOTION.transition), "SurvivalModel.function"),
        (lambda: models.MeasurementModel(2.0, my_bearing_range), "MeasurementModel.meas_dim"),  # type: ignore[arg-type]
        (lambda: models.MeasurementModel(2, my_bearing_range_jacobian), "MeasurementModel.function"),
        (lambda: models.MeasurementModel(2, my_bearing_range, jacobian=my_bearing_range), "MeasurementModel.jacobian"),
        (
            lambda: models.MeasurementModel(2, my_bearing_range, angular=np.array([True])),
            "MeasurementModel.angular: expected 2 booleans",
        ),
        (
            lambda: models.MeasurementModel(2, my_bearing_range, angular=np.array([1, 0])),
            "MeasurementModel.angular: expected 2 booleans",
        ),
        (lambda: models.NoiseModel(my_bearing_range), "NoiseModel.function"),
        (lambda: models.DetectionModel(my_bearing_range), "DetectionModel.function"),
        (lambda: models.ClutterModel(-1.0, BUILT_IN.clutter.log_intensity), "ClutterModel.rate"),
        (lambda: models.ClutterModel(1.0, my_bearing_range), "ClutterModel.log_intensity"),
        (lambda: models.ClutterModel(1.0, BUILT_IN.clutter.log_intensity, sampler=3), "sampler"),  # type: ignore[arg-type]
        (lambda: sensor(BUILT_IN.noise), "SensorModel.measurement: expected a MeasurementModel"),
        (lambda: sensor(noise=models.constant_noise([1.0])), "SensorModel.noise: expected a model for 2"),
        (lambda: sensor(clutter=models.region_clutter(1.0, REGION, "range_only")), "SensorModel.clutter: .* 2 meas"),
        (lambda: sensor(clutter=models.region_clutter(1.0, REGION, "position")), "SensorModel.clutter: .*angular"),
        (lambda: sensor(method="best"), "SensorModel.method"),
    ],
)
def test_construction_names_the_field(make, message):
    with pytest.raises(InputError, match=message):
        make()


def made(kind):
    return models.model_function(kind)


@made("measurement")
def forgets_an_entry(state, pose, params, out):
    out[0] = 1.0


@made("measurement")
def reads_outside(state, pose, params, out):
    out[0] = state[7]
    out[1] = 0.0


@made("measurement")
def writes_its_input(state, pose, params, out):
    state[0] = 0.0
    out[0] = 0.0
    out[1] = 0.0


@made("measurement")
def raises(state, pose, params, out):
    raise ValueError("the beam is off")


@made("measurement")
def divides_by_zero(state, pose, params, out):
    out[0] = 1.0 / (state[0] - state[0])
    out[1] = 0.0


@made("measurement_jacobian")
def wrong_sign(state, pose, params, out):
    for i in range(2):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    distance = math.sqrt(dx * dx + dy * dy)
    out[0, 0] = dy / distance**2
    out[0, 1] = -dx / distance**2
    out[1, 0] = dx / distance
    out[1, 1] = dy / distance


@made("measurement_noise_cov")
def indefinite(state, pose, params, out):
    out[0, 0] = out[1, 1] = 1.0
    out[0, 1] = out[1, 0] = 2.0


@made("measurement_noise_cov")
def lopsided(state, pose, params, out):
    out[0, 0] = out[1, 1] = 1.0
    out[0, 1] = 0.5
    out[1, 0] = 0.0


@made("measurement_noise_cov")
def negative(state, pose, params, out):
    out[0, 0] = out[1, 1] = -1.0
    out[0, 1] = out[1, 0] = 0.0


@made("prob_detection")
def above_one(state, pose, params):
    return 1.5


@made("prob_detection")
def not_a_number(state, pose, params):
    return math.nan


@made("log_clutter_intensity")
def infinite(measurement, pose, params):
    return math.inf


@made("log_clutter_intensity")
def never(measurement, pose, params):
    return -math.inf


BAD_SENSORS = [
    ({"measurement": models.MeasurementModel(2, forgets_an_entry)}, r"'forgets_an_entry' at state .* written"),
    (
        {"measurement": models.MeasurementModel(2, reads_outside)},
        r"'reads_outside' at state .* outside an array: index 7",
    ),
    ({"measurement": models.MeasurementModel(2, writes_its_input)}, r"'writes_its_input' at .*'state' to be left"),
    ({"measurement": models.MeasurementModel(2, raises)}, r"'raises' at state .* raised ValueError: the beam is off"),
    (
        {
            "measurement": models.MeasurementModel(
                2, my_bearing_range, jacobian=wrong_sign, angular=np.array([True, False])
            )
        },
        r"measurement_jacobian function 'wrong_sign' .* expected the derivative",
    ),
    ({"noise": models.NoiseModel(indefinite)}, r"'indefinite' at .*a positive definite matrix; got"),
    ({"noise": models.NoiseModel(lopsided)}, r"'lopsided' at .*a symmetric matrix; got"),
    ({"noise": models.NoiseModel(negative)}, r"'negative' at .*variances above 0; got"),
    ({"detection": models.DetectionModel(above_one)}, r"'above_one' at .*a probability in \[0, 1\]; got 1.5"),
    ({"detection": models.DetectionModel(not_a_number)}, r"'not_a_number' at .*; got nan"),
    ({"clutter": models.ClutterModel(1.0, infinite)}, r"'infinite' at measurement .*below \+inf; got inf"),
    (
        {"clutter": models.ClutterModel(5.0, never, sampler=BUILT_IN.clutter.sampler)},
        r"'never' at measurement .*as the sampler drew clutter there; got -inf",
    ),
]


@pytest.mark.parametrize(("parts", "message"), BAD_SENSORS)
def test_check_names_the_function_and_the_state(parts, message):
    clutter = models.ClutterModel(1.0, BUILT_IN.clutter.log_intensity, BUILT_IN.clutter.params)
    with pytest.raises(ModelError, match=f"(?s){message}"):
        sensor(**{"clutter": clutter, **parts}).check(STATES[:1], POSE)


@pytest.mark.skipif(not JIT_ENABLED, reason="plain Python raises here")
def test_check_does_not_take_division_by_zero_for_an_exception():
    measurement = models.MeasurementModel(2, divides_by_zero)
    with pytest.raises(ModelError, match=r"'divides_by_zero' at .* finite; got"):
        measurement.check(STATES[:1], POSE)


@made("transition")
def drifts_off(state, dt, params, out):
    for i in range(4):
        out[i] = math.nan


@made("transition_jacobian")
def frozen(state, dt, params, out):
    for i in range(4):
        for j in range(4):
            out[i, j] = 0.0


@made("process_noise_cov")
def negative_noise(state, dt, params, out):
    for i in range(4):
        for j in range(4):
            out[i, j] = 0.0
    out[0, 0] = out[1, 1] = 1.0
    out[0, 1] = out[1, 0] = 1.0 + 1e-6


def in_order(x: int, y: int, vx: int, vy: int) -> models.MotionModel:
    """Constant velocity with the components of the state in another order."""

    @models.model_function("transition")
    def moves(state, dt, params, out):
        for i in range(len(state)):
            out[i] = state[i]
        out[x] += dt * state[vx]
        out[y] += dt * state[vy]

    @models.model_function("process_noise_cov")
    def shaken(state, dt, params, out):
        for i in range(len(state)):
            for j in range(len(state)):
                out[i, j] = dt if i == j else 0.0

    return models.MotionModel(6, moves, shaken)


@pytest.mark.parametrize(
    ("order", "fault"),
    [
        ((0, 1, 2, 3), None),
        ((0, 1, 3, 4), "component 2, of which 1 more moves a target by 0 m/s along x and 0 m/s along y"),
        ((0, 2, 1, 3), "component 2, of which 1 more moves a target by 0 m/s along x and 0 m/s along y"),
        ((0, 1, 3, 2), "component 2, of which 1 more moves a target by 0 m/s along x and 1 m/s along y"),
    ],
    ids=["x y vx vy", "x y z vx vy vz", "x vx y vy", "x y vy vx"],
)
def test_a_state_whose_velocity_is_elsewhere_is_refused(order, fault):
    motion = in_order(*order)
    assert motion.velocity_fault() == fault
    if fault is None:
        motion.check(np.ones((2, 6)))
    else:
        with pytest.raises(
            ModelError, match=r"motion: expected a state that begins with x, y, vx, vy, .*; got component 2"
        ):
            motion.check(np.ones((2, 6)))


def test_short_states_and_states_in_a_turn_have_no_velocity_fault():
    turning = models.coordinated_turn(1.0, 0.1)
    assert turning.velocity_fault() is None
    assert models.MotionModel(2, MOTION.transition, MOTION.process_noise_cov).velocity_fault() is None


@made("prob_survival")
def minus(state, dt, params):
    return -0.1


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (models.MotionModel(4, drifts_off, MOTION.process_noise_cov), r"'drifts_off' at state .*, dt 1.0: expected"),
        (models.MotionModel(4, MOTION.transition, negative_noise), r"'negative_noise' .*positive semidefinite"),
        (
            models.MotionModel(4, MOTION.transition, MOTION.process_noise_cov, np.empty(0), np.ones(1), frozen),
            r"transition_jacobian function 'frozen' .*the derivative",
        ),
        (models.SurvivalModel(minus), r"'minus' .*probability in \[0, 1\]; got -0.1"),
    ],
)
def test_check_of_motion_and_survival(model, message):
    if getattr(model, "noise_params", np.ones(1)).size == 0:
        model = models.MotionModel(4, model.transition, model.process_noise_cov, np.empty(0), np.ones(1))
    with pytest.raises(ModelError, match=f"(?s){message}"):
        model.check(STATES[:2])


def test_every_evaluation_names_a_function_that_raises():
    with pytest.raises(ModelError, match=r"'raises' at state .*, pose .*: raised ValueError: the beam is off"):
        models.MeasurementModel(2, raises).measure(STATES, POSE)


@models.model_function("prob_detection")
def blind_in_the_west(state, pose, params):
    if state[0] < 0.0:
        raise ValueError("no beam there")
    return 0.9


def test_of_many_states_the_one_is_named_at_which_a_function_raises():
    detection, states = models.DetectionModel(blind_in_the_west), np.abs(STATES)
    np.testing.assert_array_equal(detection.prob(states, POSE), np.full(len(states), 0.9))
    assert len(detection.prob(states[:0], POSE)) == 0
    states[7, 0] = -123.5
    with pytest.raises(ModelError, match=r"'blind_in_the_west' at state \[-123.5 .*: raised ValueError: no beam there"):
        detection.prob(states, POSE)


@pytest.mark.parametrize(
    ("states", "pose", "message"),
    [
        (STATES[0] * np.nan, POSE, "states: expected finite"),
        (STATES, POSE[:2], r"pose: expected an array of shape \(3 or more,\); got shape \(2,\)"),
        (STATES, [0.0, 0.0, np.inf], "pose: expected finite"),
        ([["a"]], POSE, "states: expected numbers"),
    ],
)
def test_bad_states_and_poses(states, pose, message):
    with pytest.raises(InputError, match=message):
        BUILT_IN.check(states, pose)


def test_clutter_sampler_faults():
    intensity, rng = BUILT_IN.clutter.log_intensity, np.random.default_rng(0)

    def broken(pose, measurement, *, state_dim, rng):
        raise RuntimeError("no dice")

    def flat(pose, measurement, *, state_dim, rng):
        return np.zeros(3)

    with pytest.raises(InputError, match=r"ClutterModel\.sampler: expected a sampler"):
        models.ClutterModel(1.0, intensity).sample(POSE, models.bearing_range(), state_dim=4, rng=rng)
    with pytest.raises(ModelError, match="RuntimeError: no dice"):
        models.ClutterModel(1.0, intensity, sampler=broken).sample(POSE, models.bearing_range(), state_dim=4, rng=rng)
    with pytest.raises(ModelError, match=r"clutter sampler: expected an array of shape \(any, 2\); got shape \(3,\)"):
        models.ClutterModel(1.0, intensity, sampler=flat).sample(POSE, models.bearing_range(), state_dim=4, rng=rng)
