"""What all filters do alike: what they refuse, what looks bad and is none, and what changes nothing."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest

from filters.examples import assert_same_glmb, plain_glmb
from filters.members import (
    BELIEFS,
    CENTRAL,
    LABELLED,
    NEAR,
    POSE,
    REGION,
    UNLABELLED,
    arrays,
    believed,
    birth,
    components,
    existences,
    given,
    make,
    sensor,
    step,
    targets,
)
from vedette import models
from vedette.densities import GLMB, LMB, FactoredGLMB, unlabelled_estimate
from vedette.densities.containers import unchecked
from vedette.densities.tracks import gaussian_tracks
from vedette.errors import InputError, ModelError, NumericalError
from vedette.filters import (
    CphdFilter,
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Gibbs,
    Limits,
    LmbFilter,
    PredictUpdateFilter,
)
from vedette.filters.inputs import model_errors
from vedette.kernels.base.arrays import counted_ints
from vedette.kernels.base.compile import JIT_ENABLED

pytestmark = pytest.mark.lanes

every_kind = pytest.mark.parametrize("kind", BELIEFS)
labelled = pytest.mark.parametrize("kind", [*LABELLED, *CENTRAL])
single = pytest.mark.parametrize("kind", LABELLED | UNLABELLED)
NOBODY = models.BirthModel.none(4)
CERTAIN: dict[str, Any] = {"survival": models.constant_survival(1.0), "birth": NOBODY}
SURE = models.DetectionModel(given, np.ones(1))
AT_SITE = np.full((1, 4), 10.0), np.eye(4)[None]
BOTH = [[10.0, 10.0], [50.0, 51.0]]


@models.model_function("prob_detection")
def raises(state, pose, params):
    if state[0] > params[0]:
        raise ValueError("out of my depth")
    return 0.5


@models.model_function("prob_survival")
def given_survival(state, dt, params):
    return params[0]


@models.model_function("measurement_noise_cov")
def given_noise(state, pose, params, out):
    out[0, 0] = out[1, 1] = params[0] - 1.0 if params[0] < 0.0 else math.nan
    out[0, 1] = out[1, 0] = 0.0


@models.model_function("measurement")
def nowhere(state, pose, params, out):
    for i in range(out.shape[0]):
        out[i] = math.inf


@models.model_function("transition")
def drifts_off(state, dt, params, out):
    for i in range(state.shape[0]):
        out[i] = math.nan


@models.model_function("process_noise_cov")
def takes_away(state, dt, params, out):
    for i in range(4):
        for j in range(4):
            out[i, j] = -1e9 if i == j else 0.0


@models.model_function("log_clutter_intensity")
def given_intensity(measurement, pose, params):
    return params[0]


# What is refused.


@every_kind
@pytest.mark.parametrize(
    ("scan", "message"),
    [
        ([[math.nan, 1.0]], r": expected finite numbers; got \[nan, 1.0\] in row 0"),
        ([[0.0, 1.0], [math.inf, 1.0]], r": expected finite numbers; .* in row 1"),
        ([[1.0, 2.0, 3.0]], r": expected an array of shape \(num_measurements, 2\).*got shape \(1, 3\)"),
        ([1.0, 2.0], r": .*got shape \(2,\)"),
        (3.0, r": .*got shape \(\)"),
        (np.zeros((0, 2, 0)), ": .*got shape"),
        ("two targets", ": expected numbers in .*; got an array of <U11"),
        ([["a", "b"]], ": expected numbers in "),
        ([["1", "2"]], ": expected numbers in "),
        ([[1.0, 2.0], [3.0]], r": expected numbers in .*; got \[\[1\.0, 2\.0\], \[3\.0\]\]"),
        ([[1.0, 2.0 + 1e-3j]], ": expected numbers in .*; got an array of complex128"),
        ([[True, False]], ": expected numbers in .*; got an array of bool"),
        ([[1.0, None]], ": expected numbers in .*; got an array of object"),
        (np.ma.masked_equal([[1.0, 2.0], [3.0, 4.0]], 3.0), ": expected numbers in .* without masked entries"),
        ([np.ma.masked_equal([1.0, 2.0], 2.0)], ": expected numbers in .* without masked entries"),
        ([[1.0, np.ma.masked]], ": expected numbers in .* without masked entries"),
    ],
)
def test_scans(kind: Any, scan: Any, message: str) -> None:
    with pytest.raises(InputError, match=(r"^scans\[0\]: scan" if kind in CENTRAL else "^scan") + message):
        step(make(kind), scan)


@single
def test_no_scan(kind: Any) -> None:
    with pytest.raises(InputError, match=r"scan: .*got None"):
        step(make(kind), None)


BAD_ARGUMENTS: list[tuple[str, list[Any], str]] = [
    (
        "pose",
        [np.zeros(2), np.zeros((1, 3)), [0.0, 0.0, math.nan], [math.inf, 0.0, 0.0], None, "x"],
        r"poses?(\[0\])?: expected .*; got",
    ),
    ("dt", [-1.0, math.nan, math.inf, True, np.ones(2), "1", None], r"dt: expected a .*number.*; got"),
    (
        "number",
        [1.5, None, True, "1", 0, -1, 2**63, np.uint64(2**63)],
        r"step: expected a whole number from 1 on, below 2\^63; got",
    ),
    ("rng", [1, None, np.random.RandomState(0), np.random.default_rng], r"rng: expected a numpy\.random\.Generator"),
    ("belief", ["nothing yet"], "belief: expected a {own}; got str"),
]


@every_kind
@pytest.mark.parametrize(("name", "values", "message"), BAD_ARGUMENTS)
def test_arguments(kind: Any, name: str, values: list[Any], message: str) -> None:
    for value in values:
        with pytest.raises(InputError, match=message.format(own=BELIEFS[kind].__name__)):
            step(make(kind), **{name: value})


@every_kind
def test_beliefs(kind: Any) -> None:
    tracker, own = make(kind), BELIEFS[kind]
    other = LMB if own is not LMB else GLMB
    assert type(tracker.initial()) is own
    tracker.initial().validate()
    with pytest.raises(InputError, match=f"belief: expected a {own.__name__}; got {other.__name__}"):
        step(tracker, belief=other.empty(4))
    with pytest.raises(InputError, match="belief: expected states of dimension 4; got 5"):
        step(tracker, belief=own.empty(5))


@every_kind
def test_parts_that_do_not_fit(kind: Any) -> None:
    for parts, message in (
        ({"birth": birth(dim=5)}, r"birth\.means: expected states of dimension 4, as the motion model; got 5"),
        ({"motion": "straight on"}, "motion: expected a MotionModel; got str"),
        ({"birth": None}, "birth: expected a BirthModel; got None"),
        ({"survival": 0.9}, "survival: expected a SurvivalModel; got float"),
    ):
        with pytest.raises(InputError, match=message):
            make(kind, **parts)
    with pytest.raises(InputError, match=r"sensors?: expected a .*SensorModel"):
        kind(targets(), None)
    own = (sensor(),) if kind in CENTRAL else sensor()
    with pytest.raises(InputError, match="targets: expected a TargetModel; got MotionModel"):
        kind(models.constant_velocity(1.0), own)
    with pytest.raises(InputError, match="limits: expected a Limits; got int"):
        dataclasses.replace(make(kind), limits=300)


@labelled
def test_a_step_whose_labels_are_in_use(kind: Any) -> None:
    tracker = make(kind)
    belief, _ = step(tracker, number=3)
    for number in (3, 2):
        with pytest.raises(InputError, match=rf"step: expected a step after those of the labels .* is 3; got {number}"):
            step(tracker, belief=belief, number=number)
    # Without births no label is given.
    step(make(kind, birth=NOBODY), belief=belief, number=3)[0].validate()


@pytest.mark.parametrize("kind", LABELLED)
def test_a_belief_that_is_no_density(kind: Any) -> None:
    tracks = gaussian_tracks(np.zeros((1, 2), np.int64), np.zeros((1, 4)), -AT_SITE[1])
    glmb = unchecked(GLMB, tracks, np.arange(2), np.zeros(1, np.int64), np.zeros(1))
    lmb = unchecked(LMB, tracks, np.zeros(1))
    belief = {DeltaGlmbFilter: glmb, LmbFilter: lmb}.get(kind, FactoredGLMB.of(lmb))
    tracker = make(kind, motion=models.constant_velocity(1.0, method="ukf"))
    with pytest.raises(NumericalError, match="covariance of a track is not positive definite"):
        step(tracker, belief=belief, number=2)


@pytest.mark.parametrize("kind", LABELLED)
def test_births_must_be_new(kind: Any) -> None:
    local = make(kind)
    belief, _ = local.predict(local.initial(), 1.0, 1)
    born = LMB.from_bernoullis([[1, 7]], [0.1], *AT_SITE)
    with pytest.raises(InputError, match="after those of the labels in the belief, of which the last is 1"):
        local.predict(belief, 1.0, 2, births=born)
    with pytest.raises(InputError, match="births: expected a LMB; got GLMB"):
        local.predict(belief, 1.0, 2, births=GLMB.empty(4))
    with pytest.raises(InputError, match="births: expected states of dimension 4; got 5"):
        local.step(belief, np.empty((0, 2)), POSE, 1.0, 2, rng=np.random.default_rng(0), births=LMB.empty(5))


@pytest.mark.parametrize(
    ("kind", "field", "value", "message"),
    [
        (DeltaGlmbFilter, "assignment", "murty", "assignment: expected RankedAssignment or Gibbs; got str"),
        (FactoredGlmbFilter, "max_split_error", 3.0, "max_split_error: expected a number from 0 to 2"),
        (FactoredGlmbFilter, "max_factor_labels", 0, "max_factor_labels"),
    ],
)
def test_options_of_one_kind(kind: Any, field: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        dataclasses.replace(make(kind), **{field: value})


@pytest.mark.parametrize("value", [0, -3, math.nan])
def test_numbers_of_samples(value: Any) -> None:
    with pytest.raises(InputError, match=r"num_samples: expected .*at least 1"):
        Gibbs(value)


# Models that do not do what they should.


def known(**parts: Any) -> models.MotionModel:
    """Constant velocity, but for some of it."""
    own = models.constant_velocity(1.0)
    return dataclasses.replace(own, **parts)


FAULTY: list[tuple[dict[str, Any], int, str]] = [  # parts, the step at which it shows, what is said
    (
        {"detection": models.DetectionModel(raises, np.array([5.0]))},
        1,
        "a model function raised ValueError: out of my depth",
    ),
    *(
        ({"detection": models.DetectionModel(given, np.array([p]))}, 1, "detection model: probability is not in")
        for p in (1.5, -0.1, math.inf)
    ),
    *(
        (
            {"survival": models.SurvivalModel(given_survival, np.array([p]))},
            2,
            "survival model: probability is not in",
        )
        for p in (1.5, -0.1, math.inf)
    ),
    *(
        (
            {"noise": models.NoiseModel(given_noise, np.array([p]))},
            1,
            "innovation covariance is not positive definite or not finite",
        )
        for p in (-1e6, 1.0)
    ),
    # Kernels as plain Python warn of the NaN before the filter looks at it.
    ({"measurement": models.MeasurementModel(2, nowhere)}, 1, r"measurement model: |invalid value"),
    (
        {"motion": known(transition=drifts_off, transition_jacobian=None)},
        2,
        "motion model: predicted mean or covariance is not finite",
    ),
    (
        {"motion": known(process_noise_cov=takes_away, noise_params=np.empty(0))},
        2,
        "motion model: predicted covariance is not positive definite",
    ),
    (
        {"clutter": models.ClutterModel(1.0, given_intensity, np.array([math.inf]))},
        1,
        "clutter model: log intensity is not a number below infinity",
    ),
]


@single
@pytest.mark.parametrize(("parts", "number", "message"), FAULTY)
def test_models_that_give_nonsense(kind: Any, parts: dict[str, Any], number: int, message: str) -> None:
    belief = step(make(kind))[0] if number > 1 else None
    with pytest.raises((ModelError, RuntimeWarning), match=message):
        step(make(kind, **parts), belief=belief, number=number)


def test_what_is_no_fault_of_a_model_function_is_not_said_to_be_one() -> None:
    """Of a kernel, or of Numba on the way to one: an integer that no kernel can take."""
    with pytest.raises(Exception, match=r"too large|Maximum allowed") as raised, model_errors():
        counted_ints(10**30)
    assert not isinstance(raised.value, ModelError)
    with pytest.raises(ModelError, match="a model function raised OverflowError: mine"), model_errors():
        raise OverflowError("mine")


@pytest.mark.parametrize("kind", [*LABELLED, *CENTRAL, CphdFilter])
def test_models_that_forbid_the_scan(kind: Any) -> None:
    """A target that is certain to be there and to be seen, and is not."""
    tracker = make(kind, detection=SURE, **CERTAIN)
    wanted = (
        r"step 4(, sensor 0)?: no .* (has positive weight; do the models forbid this scan|can have given this scan)"
    )
    with pytest.raises(NumericalError, match=wanted):
        step(tracker, [], believed(kind, 1.0, *AT_SITE), number=4)


# What looks bad and is none.


@every_kind
@pytest.mark.parametrize("scan", [[], np.empty((0, 2)), np.empty((0, 7)), [[]]])
def test_a_scan_without_measurements(kind: Any, scan: Any) -> None:
    belief, info = step(make(kind), scan)
    belief.validate()
    assert info.num_duplicates == 0
    if kind in UNLABELLED:
        assert 0.0 < belief.expected_number < 0.1
        return
    missed = 0.3 * 0.1 / (0.7 + 0.3 * 0.1)
    assert list(existences(belief)) == pytest.approx([missed, missed])
    assert info.log_likelihood == pytest.approx(2.0 * math.log(0.7 + 0.3 * 0.1) - 2.0)


@every_kind
def test_repeated_rows_are_counted_and_left_out(kind: Any) -> None:
    belief, info = step(make(kind), [*BOTH, [10.0, 10.0], [10.0, 10.0]])
    once, plain = step(make(kind), BOTH)
    assert (info.num_duplicates, plain.num_duplicates) == (2, 0)
    np.testing.assert_array_equal(existences(belief), existences(once))


@every_kind
def test_scans_of_other_types_are_converted(kind: Any) -> None:
    wanted, _ = step(make(kind), np.array(NEAR))
    whole = np.full((4, 3), 10.0)
    for scan in (((10, 10),), np.array([[10, 10]], np.int32), np.array(NEAR, np.float32), whole[:1, :2]):
        np.testing.assert_array_equal(existences(step(make(kind), scan)[0]), existences(wanted))


@every_kind
def test_the_order_of_the_scan_does_not_matter(kind: Any) -> None:
    one, other = (step(make(kind, Limits.none()), scan)[0] for scan in (BOTH, BOTH[::-1]))
    np.testing.assert_allclose(existences(one), existences(other), rtol=0.0, atol=1e-12)
    for mine, its in zip(map(np.ravel, components(one)), map(np.ravel, components(other)), strict=True):
        np.testing.assert_allclose(np.sort(mine), np.sort(its), rtol=1e-9, atol=1e-9)


@every_kind
def test_the_last_step_that_there_is(kind: Any) -> None:
    step(make(kind), number=2**63 - 1)[0].validate()


@pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")  # of a bearing with much noise
@every_kind
def test_angles(kind: Any) -> None:
    """Any within a full turn is taken as the direction that it is; beyond that it is in other units."""
    clutter = models.region_clutter(2.0, REGION, "bearing_range")
    tracker = make(kind, measurement=models.bearing_range(), clutter=clutter)
    pose = np.array([60.0, 10.0, 0.0])
    wanted, info = step(tracker, [[math.pi - 0.05, 50.0]], pose=pose)
    for bearing in (math.pi - 0.05 - 2.0 * math.pi, -math.pi - 0.05):
        belief, other = step(tracker, [[bearing, 50.0]], pose=pose)
        assert other.log_likelihood == pytest.approx(info.log_likelihood, rel=1e-9, nan_ok=True)
        assert (other.num_duplicates, other.num_clutter_floored) == (0, 0)
        assert type(belief) is type(wanted)
    _, twice = step(tracker, [[0.75 * math.pi, 50.0], [-1.25 * math.pi, 50.0]], pose=pose)
    assert twice.num_duplicates == 1
    with pytest.raises(
        InputError, match=r"expected angles in radians, .*\[500\.0, 50\.0\] in row 1, whose component 0"
    ):
        step(tracker, [[1.0, 50.0], [500.0, 50.0]], pose=pose)
    step(tracker, [[1.0, 500.0]], pose=pose)


@every_kind
def test_certain_detection(kind: Any) -> None:
    """Of the built-in model and of one's own, at which a miss is the end of a target, and of the density of one."""
    for detection in (models.constant_detection(1.0), SURE):
        tracker = make(kind, detection=detection)
        belief, _ = step(tracker, [[10.0, 10.0], [50.0, 50.0]])
        belief.validate()
        assert existences(belief).max() > 0.9
        if kind in UNLABELLED:
            assert belief.expected_number == pytest.approx(2.0, abs=0.2)
        later, info = step(tracker, [], belief, number=2)
        later.validate()
        assert existences(later).max(initial=0.0) < 1e-6
        assert kind not in UNLABELLED or detection is not SURE or info.num_tracks == 0


@every_kind
def test_certain_death(kind: Any) -> None:
    tracker = make(kind, survival=models.constant_survival(0.0), birth=NOBODY)
    belief, _ = step(tracker, NEAR, believed(kind, 1.0, *AT_SITE))
    belief.validate()
    assert existences(belief).sum() == 0.0


@every_kind
def test_no_births_and_no_targets(kind: Any) -> None:
    belief, info = step(make(kind, birth=NOBODY), NEAR)
    belief.validate()
    assert (existences(belief).sum(), info.num_tracks) == (0.0, 0)
    assert kind not in UNLABELLED or unlabelled_estimate(belief, 0).num_targets == 0


@every_kind
def test_a_measurement_outside_the_region_is_counted(kind: Any) -> None:
    belief, info = step(make(kind), [[10.0, 10.0], [500.0, 0.0], [0.0, -101.0]])
    belief.validate()
    assert info.num_clutter_floored == 2
    assert kind in UNLABELLED or math.isfinite(info.log_likelihood)
    assert step(make(kind), NEAR)[1].num_clutter_floored == 0


@every_kind
def test_no_clutter_at_all(kind: Any) -> None:
    """The one site that may have caused the measurement has."""
    belief, info = step(make(kind, clutter=models.region_clutter(0.0, REGION, "position")), NEAR)
    belief.validate()
    assert info.num_clutter_floored == 1
    if kind in UNLABELLED:
        assert 0.9 < belief.expected_number < 1.1
    else:
        assert existences(belief).max() > 1.0 - 1e-9


@labelled
def test_more_targets_than_caps(kind: Any) -> None:
    sites = birth(8)
    belief, info = step(make(kind, Limits(max_hypotheses=4, max_labels=3), birth=sites), sites.means[:, :2])
    belief.validate()
    if BELIEFS[kind] is not GLMB:
        assert belief.tracks.num_tracks == 3
        assert 4.0 < info.dropped_existence <= 5.0
    else:
        assert belief.num_hyps <= 4
        assert info.truncation_error_bound > 0.0
        assert existences(belief).sum() > 7.0


@every_kind
@pytest.mark.parametrize("number", [0, -3, 1.5])
def test_a_step_of_no_time_has_a_number_too(kind: Any, number: Any) -> None:
    with pytest.raises(InputError, match="step: expected"):
        step(make(kind), NEAR, dt=0.0, number=number)


@every_kind
def test_a_filter_prints_in_a_line(kind: Any) -> None:
    printed = repr(make(kind))
    assert printed.startswith(type(make(kind)).__name__)
    assert len(printed) <= 160
    assert "0x" not in printed


# What changes nothing.


@every_kind
def test_nothing_is_written_into_the_arguments_and_a_filter_can_be_sent(kind: Any) -> None:
    tracker = make(kind)
    again = pickle.loads(pickle.dumps(tracker))
    belief, _ = step(tracker, BOTH)
    before, scan = [array.copy() for array in arrays(belief)], np.array(BOTH) + 1.0
    given_scan = scan.copy()
    found, other = (step(own, scan, belief, number=2)[0] for own in (tracker, again))
    np.testing.assert_array_equal(scan, given_scan)
    for now, then in (*zip(arrays(belief), before, strict=True), *zip(arrays(found), arrays(other), strict=True)):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("kind", LABELLED)
def test_a_prediction_and_an_update_are_a_step(kind: Any) -> None:
    local = make(kind, Limits.none())
    assert isinstance(local, PredictUpdateFilter)
    belief = two = local.initial()
    for number, scan in enumerate(([[12.0, 9.0]], [[13.0, 7.0], [47.0, 53.0]]), start=1):
        belief, info = step(local, scan, belief, number=number)
        predicted, before = local.predict(two, 1.0, number)
        two, after = local.update(predicted, np.array(scan), POSE, rng=np.random.default_rng(0))
        assert before.log_likelihood == pytest.approx(0.0, abs=1e-12)
        assert after.log_likelihood == pytest.approx(info.log_likelihood, abs=1e-11)
        if isinstance(belief, GLMB):  # whose tracks may come in another order
            assert_same_glmb(plain_glmb(two), plain_glmb(belief), 1e-11)
            continue
        for mine, its in zip(arrays(two), arrays(belief), strict=True):
            np.testing.assert_allclose(mine, its, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("kind", CENTRAL)
def test_one_of_several_sensors_is_named(kind: Any) -> None:
    bearing = models.SensorModel(
        models.bearing_only(),
        models.constant_noise([0.1]),
        models.constant_detection(0.9),
        models.measurement_space_clutter(2.0, [-math.pi], [math.pi]),
    )
    tracker = kind(targets(), (sensor(), sensor(), bearing))
    belief, rng, poses, scans = tracker.initial(), np.random.default_rng(0), [POSE] * 3, [NEAR, NEAR, [[0.7]]]
    for bad_scans, bad_poses, message in (
        (scans[:2], poses, "scans: expected 3, one a sensor; got 2"),
        (scans, None, "poses: expected 3, one a sensor; got None"),
        ([*scans[:2], [[1.0, 2.0]]], poses, r"scans\[2\]: .*\(num_measurements, 1\)"),
        (scans, [POSE, [0.0], POSE], r"poses\[1\]"),
    ):
        with pytest.raises(InputError, match=message):
            tracker.step(belief, bad_scans, bad_poses, 1.0, 1, rng=rng)
    with pytest.raises(InputError, match="sensors: expected a sequence of at least one SensorModel"):
        kind(targets(), [])
    with pytest.raises(InputError, match=r"sensors\[0\]: expected a SensorModel; got str"):
        kind(targets(), ["radar"])
    with pytest.raises(InputError, match="targets: expected a TargetModel"):
        kind(sensor(), (sensor(),))


@pytest.mark.parametrize("kind", CENTRAL)
def test_a_sensor_that_does_not_scan_is_as_if_it_were_not_there(kind: Any) -> None:
    far = sensor(noise=models.constant_noise([2.0, 6.0]))
    three, two = kind(targets(), (far, sensor(), sensor())), kind(targets(), (sensor(), sensor()))
    rng, scans = np.random.default_rng(0), [NEAR, BOTH]
    got, _ = three.step(three.initial(), [None, *scans], [POSE] * 3, 1.0, 1, rng=rng)
    wanted, _ = two.step(two.initial(), scans, [POSE] * 2, 1.0, 1, rng=rng)
    np.testing.assert_array_equal(got.tracks.means, wanted.tracks.means)
    np.testing.assert_array_equal(existences(got), existences(wanted))
    # A scan without measurements is another thing: it says that nothing was seen.
    empty, _ = three.step(three.initial(), [np.empty((0, 2)), *scans], [POSE] * 3, 1.0, 1, rng=rng)
    assert existences(empty).sum() < existences(got).sum()
    # Nobody at all: the prediction.
    alone = kind(targets(birth=NOBODY), (far, sensor(), sensor()))
    nobody, info = alone.step(got, [None] * 3, [POSE] * 3, 1.0, 2, rng=rng)
    np.testing.assert_allclose(existences(nobody).sum(), 0.95 * existences(got).sum(), rtol=1e-5)
    assert info.log_likelihood == pytest.approx(0.0, abs=1e-6)


# Numbers at the edge of what a double holds: a valid density, or an error that says what could not be done.

WIDE = models.region_clutter(1.0, models.Region(-1e4, 1e4, -1e4, 1e4), "position")


def of_one(kind: Any, stds: Any = (10.0, 10.0), method: str = "ekf", limits: Any = None, sigma_v: float = 1.0) -> Any:
    """For a target that is known, and no other."""
    return make(
        kind,
        limits,
        noise=models.constant_noise(stds),
        clutter=WIDE,
        method=method,
        motion=models.constant_velocity(sigma_v, method=method),
        birth=NOBODY,
    )


@every_kind
@pytest.mark.parametrize("method", ["ekf", "ukf", "ckf"])
@pytest.mark.parametrize("std", [1e-12, 1e-6, 1e-3])
def test_noise_far_below_what_was_expected(kind: Any, method: str, std: float) -> None:
    """The variance of a measured position is then that of the noise, which P - K S K' rounds away."""
    tracker, cov = of_one(kind, (std, 2.0 * std), method), np.diag([1e4, 1e4, 100.0, 100.0])
    cov[0, 2] = cov[2, 0] = 300.0
    belief, _ = step(tracker, [[3.0, 4.0]], believed(kind, 0.9, [[0.0, 0.0, 1.0, 0.0]], cov[None]))
    belief.validate()
    _, means, covs = components(belief)
    seen = int(np.argmin(covs[:, 0, 0]))
    np.testing.assert_allclose(means[seen, :2], [3.0, 4.0], atol=1e-6)
    np.testing.assert_allclose(np.diagonal(covs[seen])[:2], [std**2, 4.0 * std**2], rtol=1e-2)


def test_a_bearing_of_next_to_no_noise() -> None:
    """It fixes a direction that is no axis, to more digits than the entries of a covariance have."""
    prior = believed(LmbFilter, 0.9, [[1e3, 1e3, 0.0, 0.0]], np.diag([1e4, 1e4, 100.0, 100.0])[None])
    clutter = models.measurement_space_clutter(1.0, [-np.pi], [np.pi])
    fine, finer = (
        make(
            LmbFilter,
            measurement=models.bearing_only(),
            noise=models.constant_noise([std]),
            detection=models.constant_detection(0.95),
            clutter=clutter,
            method="ekf",
            birth=NOBODY,
        )
        for std in (1e-8, 1e-11)
    )
    step(fine, [[0.786]], prior)[0].validate()
    with pytest.raises(NumericalError, match="positive definite within the precision"):
        step(finer, [[0.786]], prior)


@every_kind
def test_what_a_double_cannot_hold_is_refused_by_name(kind: Any) -> None:
    """No process noise and a huge step: position and velocity are one number to sixteen digits."""
    prior = believed(kind, 0.9, np.zeros((1, 4)), np.diag([1e-8, 1e-8, 1e8, 1e8])[None])
    with pytest.raises(NumericalError, match="covariance of a track is not positive definite within the precision"):
        step(of_one(kind, sigma_v=0.0), [], prior, dt=1e4)


@pytest.mark.skipif(not JIT_ENABLED, reason="an exponential that overflows is an error in plain Python")
@every_kind
def test_scans_far_from_everything_without_a_gate(kind: Any) -> None:
    """Log weights of -1e14, whose sum must still be one."""
    tracker = of_one(kind, (1e-3, 1e-3), limits=Limits(gate_probability=1.0, merge_distance=0.0, max_components=5))
    means = [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]]
    prior = believed(kind, 0.9, means, np.tile(1e-6 * np.eye(4), (3, 1, 1)))
    step(tracker, [[9e3, 9e3], [-9e3, 9e3], [9e3, -9e3]], prior, dt=1e-3)[0].validate()
