"""What a filter is given that it cannot take: each named, and nothing silently passed on."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.densities import GLMB, LMB, FactoredGLMB, TrackTable, existence_probabilities
from vedette.densities.containers import unchecked
from vedette.errors import InputError, ModelError, NumericalError
from vedette.filters import (
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Gibbs,
    Limits,
    LmbFilter,
    PhdFilter,
)
from vedette.filters.inputs import model_errors
from vedette.kernels.base.arrays import counted_ints

pytestmark = pytest.mark.lanes

POSE = np.zeros(3)
REGION = models.Region(-100.0, 100.0, -100.0, 100.0)
NEAR = [[10.0, 10.0]]
KINDS = [DeltaGlmbFilter, LmbFilter, FactoredGlmbFilter]
each_kind = pytest.mark.parametrize("kind", KINDS)
every_kind = pytest.mark.parametrize("kind", [*KINDS, PhdFilter, CphdFilter, CbMemberFilter])


@models.model_function("prob_detection")
def raises(state, pose, params):
    if state[0] > params[0]:
        raise ValueError("out of my depth")
    return 0.5


@models.model_function("prob_detection")
def given(state, pose, params):
    return params[0]


@models.model_function("prob_survival")
def given_survival(state, dt, params):
    return params[0]


@models.model_function("measurement_noise_cov")
def negative_definite(state, pose, params, out):
    out[0, 0] = out[1, 1] = -1e6
    out[0, 1] = out[1, 0] = 0.0


@models.model_function("measurement_noise_cov")
def nan_noise(state, pose, params, out):
    out[0, 0] = out[1, 1] = math.nan
    out[0, 1] = out[1, 0] = 0.0


@models.model_function("transition")
def drifts_off(state, dt, params, out):
    for i in range(state.shape[0]):
        out[i] = math.nan


@models.model_function("log_clutter_intensity")
def given_intensity(measurement, pose, params):
    return params[0]


def birth(num: int = 2, dim: int = 4, existence: float = 0.3) -> models.BirthModel:
    means = np.full((num, dim), 10.0) + 40.0 * np.arange(num)[:, None]
    return models.BirthModel(np.full(num, existence), means, np.tile(20.0 * np.eye(dim), (num, 1, 1)))


def sensor(**parts: Any) -> models.SensorModel:
    chosen: dict[str, Any] = {
        "measurement": models.position(),
        "noise": models.constant_noise([3.0, 3.0]),
        "detection": models.constant_detection(0.9),
        "clutter": models.region_clutter(2.0, REGION, "position"),
        **parts,
    }
    return models.SensorModel(**chosen)


def make(kind: Any, limits: Limits | None = None, **parts: Any) -> Any:
    motion = parts.pop("motion", models.constant_velocity(1.0))
    survival = parts.pop("survival", models.constant_survival(0.95))
    births = parts.pop("birth", birth())
    return kind(models.TargetModel(motion, survival, births), sensor(**parts), limits or Limits())


def step(tracker: Any, scan: Any = NEAR, belief: Any = None, pose: Any = POSE, dt: Any = 1.0, number: int = 1) -> Any:
    prior = tracker.initial() if belief is None else belief
    return tracker.step(prior, scan, pose, dt, number, rng=np.random.default_rng(0))


@every_kind
@pytest.mark.parametrize(
    ("scan", "message"),
    [
        ([[math.nan, 1.0]], r"scan: expected finite numbers; got \[nan, 1.0\] in row 0"),
        ([[0.0, 1.0], [math.inf, 1.0]], r"scan: expected finite numbers; .* in row 1"),
        ([[1.0, 2.0, 3.0]], r"scan: expected an array of shape \(num_measurements, 2\).*got shape \(1, 3\)"),
        ([1.0, 2.0], r"scan: .*got shape \(2,\)"),
        (3.0, r"scan: .*got shape \(\)"),
        (np.zeros((0, 2, 0)), r"scan: .*got shape"),
        (None, "scan: .*got None"),
        ("two targets", "scan: expected numbers in .*; got an array of <U11"),
        ([["a", "b"]], "scan: expected numbers in "),
        ([["1", "2"]], "scan: expected numbers in "),
        ([[1.0, 2.0], [3.0]], r"scan: expected numbers in .*; got \[\[1\.0, 2\.0\], \[3\.0\]\]"),
        ([[1.0, 2.0 + 1e-3j]], "scan: expected numbers in .*; got an array of complex128"),
        ([[True, False]], "scan: expected numbers in .*; got an array of bool"),
        ([[1.0, None]], "scan: expected numbers in .*; got an array of object"),
        (np.ma.masked_equal([[1.0, 2.0], [3.0, 4.0]], 3.0), "scan: expected numbers in .* without masked entries"),
        ([np.ma.masked_equal([1.0, 2.0], 2.0)], "scan: expected numbers in .* without masked entries"),
        ([[1.0, np.ma.masked]], "scan: expected numbers in .* without masked entries"),
    ],
)
def test_scans(kind: Any, scan: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        step(make(kind), scan)


@each_kind
@pytest.mark.parametrize("scan", [[], np.empty((0, 2)), np.empty((0, 7)), [[]]])
def test_a_scan_without_measurements(kind: Any, scan: Any) -> None:
    belief, info = step(make(kind), scan)
    belief.validate()
    assert info.num_duplicates == 0
    missed = 0.3 * 0.1 / (0.7 + 0.3 * 0.1)
    assert list(_existences(belief)) == pytest.approx([missed, missed])
    assert info.log_likelihood == pytest.approx(2.0 * math.log(0.7 + 0.3 * 0.1) - 2.0)


def _existences(belief: Any) -> Any:
    return belief.existence if isinstance(belief, LMB) else existence_probabilities(belief)[1]


@each_kind
def test_repeated_rows_are_counted_and_left_out(kind: Any) -> None:
    belief, info = step(make(kind), [[10.0, 10.0], [50.0, 51.0], [10.0, 10.0], [10.0, 10.0]])
    once, plain = step(make(kind), [[10.0, 10.0], [50.0, 51.0]])
    assert (info.num_duplicates, plain.num_duplicates) == (2, 0)
    np.testing.assert_array_equal(_existences(belief), _existences(once))


@each_kind
def test_scans_of_other_types_are_converted(kind: Any) -> None:
    wanted, _ = step(make(kind), np.array(NEAR))
    for scan in (
        ((10, 10),),
        np.array([[10, 10]], np.int32),
        np.array(NEAR, np.float32),
        np.full((4, 3), 10.0)[:1, :2],
    ):
        np.testing.assert_array_equal(_existences(step(make(kind), scan)[0]), _existences(wanted))


@each_kind
def test_beliefs(kind: Any) -> None:
    tracker = make(kind)
    other = LMB if kind is DeltaGlmbFilter else GLMB
    name = type(tracker.initial()).__name__
    with pytest.raises(InputError, match=f"belief: expected a {name}; got {other.__name__}"):
        step(tracker, belief=other.empty(4))
    with pytest.raises(InputError, match=f"belief: expected a {name}; got str"):
        step(tracker, belief="nothing yet")
    with pytest.raises(InputError, match="belief: expected states of dimension 4; got 5"):
        step(tracker, belief=type(tracker.initial()).empty(5))


@every_kind
@pytest.mark.parametrize("pose", [np.zeros(2), np.zeros((1, 3)), [0.0, 0.0, math.nan], [math.inf, 0.0, 0.0], None, "x"])
def test_poses(kind: Any, pose: Any) -> None:
    with pytest.raises(InputError, match=r"pose: expected .*; got"):
        step(make(kind), pose=pose)


@every_kind
@pytest.mark.parametrize("dt", [0.0, -1.0, math.nan, math.inf, True, np.ones(2), "1", None])
def test_time_steps(kind: Any, dt: Any) -> None:
    with pytest.raises(InputError, match=r"dt: expected a .*number.*; got"):
        step(make(kind), dt=dt)


@every_kind
@pytest.mark.parametrize("number", [1.5, None, True, "1", 0, -1, 2**63, np.uint64(2**63)])
def test_steps(kind: Any, number: Any) -> None:
    with pytest.raises(InputError, match=r"step: expected a whole number from 1 on, below 2\^63; got"):
        step(make(kind), number=number)


@every_kind
def test_the_last_step_that_there_is(kind: Any) -> None:
    step(make(kind), number=2**63 - 1)[0].validate()


@every_kind
@pytest.mark.parametrize("rng", [0, None, np.random.RandomState(0), np.random.default_rng])
def test_generators(kind: Any, rng: Any) -> None:
    tracker = make(kind)
    with pytest.raises(InputError, match=r"rng: expected a numpy\.random\.Generator"):
        tracker.step(tracker.initial(), NEAR, POSE, 1.0, 1, rng=rng)


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
        assert (other.num_duplicates, other.num_clutter_raised) == (0, 0)
        assert type(belief) is type(wanted)
    _, twice = step(tracker, [[0.75 * math.pi, 50.0], [-1.25 * math.pi, 50.0]], pose=pose)
    assert twice.num_duplicates == 1
    with pytest.raises(
        InputError, match=r"expected angles in radians, .*\[500\.0, 50\.0\] in row 1, whose component 0"
    ):
        step(tracker, [[1.0, 50.0], [500.0, 50.0]], pose=pose)
    step(tracker, [[1.0, 500.0]], pose=pose)


@each_kind
def test_a_step_whose_labels_are_in_use(kind: Any) -> None:
    tracker = make(kind)
    belief, _ = step(tracker, number=3)
    for number in (3, 2):
        with pytest.raises(InputError, match=rf"step: expected a step after those of the labels .* is 3; got {number}"):
            step(tracker, belief=belief, number=number)
    # Without births no label is given.
    step(make(kind, birth=models.BirthModel.none(4)), belief=belief, number=3)[0].validate()


def first_belief(kind: Any) -> Any:
    return step(make(kind))[0]


@every_kind
def test_a_model_that_raises(kind: Any) -> None:
    tracker = make(kind, detection=models.DetectionModel(raises, np.array([5.0])))
    with pytest.raises(ModelError, match="a model function raised ValueError: out of my depth"):
        step(tracker)


def test_what_is_no_fault_of_a_model_function_is_not_said_to_be_one() -> None:
    """Of a kernel, or of Numba on the way to one: an integer that no kernel can take."""
    with pytest.raises(Exception, match=r"too large|Maximum allowed") as raised, model_errors():
        counted_ints(10**30)
    assert not isinstance(raised.value, ModelError)
    with pytest.raises(ModelError, match="a model function raised OverflowError: mine"), model_errors():
        raise OverflowError("mine")


@every_kind
@pytest.mark.parametrize("value", [1.5, -0.1, math.nan, math.inf])
def test_probabilities_that_are_none(kind: Any, value: float) -> None:
    # Parameters cannot be NaN, so infinity less infinity stands in for one that a function works out.
    if not math.isnan(value):
        with pytest.raises(ModelError, match="detection model: probability is not in"):
            step(make(kind, detection=models.DetectionModel(given, np.array([value]))))
        with pytest.raises(ModelError, match="survival model: probability is not in"):
            step(
                make(kind, survival=models.SurvivalModel(given_survival, np.array([value]))),
                belief=first_belief(kind),
                number=2,
            )


@every_kind
@pytest.mark.parametrize("noise", [negative_definite, nan_noise])
def test_noise_that_is_none(kind: Any, noise: Any) -> None:
    with pytest.raises(ModelError, match="innovation covariance is not positive definite or not finite"):
        step(make(kind, noise=models.NoiseModel(noise)))


@models.model_function("measurement")
def nowhere(state, pose, params, out):
    for i in range(out.shape[0]):
        out[i] = math.inf


@every_kind
def test_a_measurement_that_is_none(kind: Any) -> None:
    # Kernels as plain Python warn of the NaN before the filter looks at it.
    with pytest.raises((ModelError, RuntimeWarning), match=r"measurement model: |invalid value"):
        step(make(kind, measurement=models.MeasurementModel(2, nowhere)))


@each_kind
def test_a_belief_that_is_no_density(kind: Any) -> None:
    covs = -np.eye(4)[None]
    tracks = unchecked(TrackTable, np.zeros((1, 2), np.int64), np.arange(2), np.zeros(1), np.zeros((1, 4)), covs)
    glmb = unchecked(GLMB, tracks, np.arange(2), np.zeros(1, np.int64), np.zeros(1))
    lmb = unchecked(LMB, tracks, np.zeros(1))
    belief = {DeltaGlmbFilter: glmb, LmbFilter: lmb, FactoredGlmbFilter: FactoredGLMB.from_lmb(lmb)}[kind]
    tracker = make(kind, motion=models.constant_velocity(1.0, method="ukf"))
    with pytest.raises(NumericalError, match="covariance of a track is not positive definite"):
        step(tracker, belief=belief, number=2)


@every_kind
def test_a_motion_to_nowhere(kind: Any) -> None:
    known = models.constant_velocity(1.0)
    motion = models.MotionModel(4, drifts_off, known.process_noise_cov, noise_params=known.noise_params)
    with pytest.raises(ModelError, match="motion model: predicted mean or covariance is not finite"):
        step(make(kind, motion=motion), belief=first_belief(kind), number=2)


@models.model_function("process_noise_cov")
def takes_away(state, dt, params, out):
    for i in range(4):
        for j in range(4):
            out[i, j] = -1e9 if i == j else 0.0


@every_kind
def test_a_process_noise_that_takes_variance_away_is_not_called_infinite(kind: Any) -> None:
    known = models.constant_velocity(1.0)
    motion = models.MotionModel(4, known.transition, takes_away, transition_jacobian=known.transition_jacobian)
    with pytest.raises(ModelError, match="motion model: predicted covariance is not positive definite"):
        step(make(kind, motion=motion), belief=first_belief(kind), number=2)


@every_kind
def test_a_clutter_intensity_without_bound(kind: Any) -> None:
    clutter = models.ClutterModel(1.0, given_intensity, np.array([math.inf]))
    with pytest.raises(ModelError, match="clutter model: log intensity is not a number below infinity"):
        step(make(kind, clutter=clutter))


@each_kind
def test_certain_detection(kind: Any) -> None:
    """Of the built-in model and of one's own, at which a miss is the end of a track."""
    for detection in (models.constant_detection(1.0), models.DetectionModel(given, np.ones(1))):
        tracker = make(kind, detection=detection)
        belief, _ = step(tracker, [[10.0, 10.0], [50.0, 50.0]])
        belief.validate()
        assert _existences(belief).max() > 0.9
        later, _ = step(tracker, [], belief, number=2)
        later.validate()
        assert _existences(later).max(initial=0.0) < 1e-6


@each_kind
def test_a_measurement_outside_the_region_is_counted(kind: Any) -> None:
    belief, info = step(make(kind), [[10.0, 10.0], [500.0, 0.0], [0.0, -101.0]])
    belief.validate()
    assert info.num_clutter_raised == 2
    assert math.isfinite(info.log_likelihood)
    assert step(make(kind), NEAR)[1].num_clutter_raised == 0


@each_kind
def test_no_clutter_at_all(kind: Any) -> None:
    """The one site that may have caused the measurement has."""
    belief, info = step(make(kind, clutter=models.region_clutter(0.0, REGION, "position")), NEAR)
    assert info.num_clutter_raised == 1
    assert _existences(belief).max() > 1.0 - 1e-9


@each_kind
def test_models_that_forbid_the_scan(kind: Any) -> None:
    """A target that is certain to be there and to be seen, and is not."""
    tracker = make(
        kind,
        detection=models.DetectionModel(given, np.ones(1)),
        survival=models.constant_survival(1.0),
        birth=models.BirthModel.none(4),
    )
    mean, cov = np.full((1, 4), 10.0), np.eye(4)[None]
    certain = LMB.from_bernoullis([[0, 0]], [1.0], mean, cov)
    glmb, factored = GLMB.from_hypotheses(certain.tracks, [[0]], [1.0]), FactoredGLMB.from_lmb(certain)
    prior = {DeltaGlmbFilter: glmb, LmbFilter: certain, FactoredGlmbFilter: factored}[kind]
    with pytest.raises(NumericalError, match=r"step 4: no .* has positive weight; do the models forbid this scan"):
        step(tracker, [], prior, number=4)


@each_kind
def test_more_targets_than_caps(kind: Any) -> None:
    sites = birth(8)
    limits = Limits(max_hypotheses=4, max_labels=3)
    scan = sites.means[:, :2]
    belief, info = step(make(kind, limits, birth=sites), scan)
    belief.validate()
    if kind is not DeltaGlmbFilter:
        assert belief.tracks.num_tracks == 3
        assert 4.0 < info.dropped_existence <= 5.0
    else:
        assert belief.num_hyps <= 4
        assert info.discarded_weight_bound > 0.0
        assert _existences(belief).sum() > 7.0


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("max_hypotheses", (0, -1, 2.5, "many", 2**62 + 1, 10**30)),
        ("max_search_nodes", (0,)),
        ("max_components", (0,)),
        ("max_labels", (0,)),
        ("max_intensity_components", (0, 1.5)),
        ("max_existence", (0.0, 1.0, -0.1, math.nan)),
        ("min_relative_weight", (-0.1, 1.0, math.nan)),
        ("min_component_weight", (-0.1, 1.0, math.nan)),
        ("min_existence", (-0.1, 1.0, math.nan)),
        ("min_track_weight", (-0.1, 1.1, math.nan)),
        ("gate_probability", (0.0, 1.1, math.nan)),
        ("merge_distance", (-1.0, math.nan)),
        ("min_log_clutter", (-math.inf, math.inf, math.nan)),
    ],
)
def test_limits_out_of_range(field: str, values: tuple[Any, ...]) -> None:
    for value in values:
        with pytest.raises(InputError, match=rf"Limits\.{field}: expected .*; got "):
            dataclasses.replace(Limits(), **{field: value})


@every_kind
def test_parts_that_do_not_fit(kind: Any) -> None:
    with pytest.raises(InputError, match=r"birth\.means: expected states of dimension 4, as the motion model; got 5"):
        make(kind, birth=birth(dim=5))
    with pytest.raises(InputError, match="motion: expected a MotionModel; got str"):
        make(kind, motion="straight on")
    with pytest.raises(InputError, match="birth: expected a BirthModel; got NoneType"):
        make(kind, birth=None)
    with pytest.raises(InputError, match="survival: expected a SurvivalModel; got float"):
        make(kind, survival=0.9)
    with pytest.raises(InputError, match="sensor: expected a SensorModel"):
        kind(make(kind).targets, None)
    with pytest.raises(InputError, match="targets: expected a TargetModel; got MotionModel"):
        kind(models.constant_velocity(1.0), sensor())
    with pytest.raises(InputError, match="limits: expected a Limits; got int"):
        dataclasses.replace(make(kind), limits=300)


def test_options_of_the_delta_glmb_filter() -> None:
    tracker = make(DeltaGlmbFilter)
    with pytest.raises(InputError, match="assignment: expected Ranked or Gibbs; got str"):
        dataclasses.replace(tracker, assignment="murty")
    value: Any
    for value in (0, -3, math.nan):
        with pytest.raises(InputError, match=r"num_samples: expected .*at least 1"):
            Gibbs(value)
