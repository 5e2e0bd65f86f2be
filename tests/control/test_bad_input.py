"""What a planner refuses, and how it says so; what looks bad and is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import SETTINGS, A, B, C, Situation, glmb, lmb, mobile_sensor, situation
from vedette import models
from vedette.control import (
    CauchySchwarzReward,
    ExpectedLossReward,
    FixedPlanner,
    IndependentPlanner,
    JointPlanner,
    MobileSensor,
    Plan,
    PlanningSettings,
    RandomPlanner,
    RewardTable,
    planning_limits,
)
from vedette.densities import GLMB, LMB, Poisson
from vedette.densities.containers import unchecked
from vedette.errors import InputError, ModelError, NumericalError
from vedette.filters import CbMemberFilter, CphdFilter, Limits, PhdFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.platforms import Actions, Courses
from vedette.tracking import State

PLANNERS = [JointPlanner, IndependentPlanner]
# By default; and of densities that are fused.
LOSS, DIVERGENCE = ExpectedLossReward(), CauchySchwarzReward()


@models.model_function("prob_detection")
def raises(state: Any, pose: Any, params: Any) -> float:
    if pose[0] > params[0]:
        raise ValueError("out of my depth")
    return 0.9


@models.model_function("prob_detection")
def not_a_number(state: Any, pose: Any, params: Any) -> float:
    return np.nan if pose[0] > params[0] else 0.9


@models.model_function("prob_detection")
def certain(state: Any, pose: Any, params: Any) -> float:
    return 1.0


@models.model_function("measurement")
def nowhere(state: Any, pose: Any, params: Any, out: Any) -> None:
    out[0] = np.nan
    out[1] = state[1]


@models.model_function("log_clutter_intensity")
def no_clutter(measurement: Any, pose: Any, params: Any) -> float:
    return -np.inf


def refused(example: Situation, planner: Any, error: type[Exception] = InputError, reward: Any = LOSS) -> str:
    """What a planner says of a situation."""
    with pytest.raises(error) as raised:
        planner(example.sensors, example.fusion, example.settings, reward).plan(
            *example.arguments, rng=np.random.default_rng(5)
        )
    return str(raised.value)


class Gives:
    """A platform that gives the actions, or the course, that it was told to."""

    def __init__(self, actions: Any, course: Any = None, pushes: bool = False) -> None:
        self.columns = ("heading_deg",)
        self.given, self.way, self.pushes = actions, course, pushes

    def actions(self, pose: Any) -> Any:
        if self.pushes:
            pose[:] = 1e6
        return self.given

    def course(self, pose: Any, action: Any, times: Any) -> Any:
        poses = Courses(30.0).course(pose, action, times) if self.way is None else self.way
        if self.pushes:
            pose[:], action[:], times[:] = 1e6, 1e6, 1e6
        return poses


@pytest.mark.parametrize("given", [[], [[np.nan]], [[0.0, 1.0]], None, [["north"]], 1.0, [0.0]])
@pytest.mark.parametrize("planner", [*PLANNERS, RandomPlanner])
def test_platforms_that_give_no_actions(planner: Any, given: Any) -> None:
    example = situation("lmb")
    sensors = (example.sensors[0], replace(example.sensors[1], platform=Gives(given)))
    built = planner(sensors) if planner is RandomPlanner else planner(sensors, example.fusion, SETTINGS)
    with pytest.raises(InputError, match=r"sensors\[1\]\.platform\.actions.*: expected"):
        built.plan(*example.arguments, rng=np.random.default_rng(0))


@pytest.mark.parametrize("way", [np.zeros((1, 3)), np.zeros((2, 2)), np.zeros((2, 4)), np.full((2, 3), np.inf), "on"])
def test_platforms_that_give_no_course(way: Any) -> None:
    example = situation("lmb")
    sensors = (example.sensors[0], replace(example.sensors[1], platform=Gives([[0.0]], way)))
    with pytest.raises(InputError, match=r"sensors\[1\]\.platform\.course: expected"):
        JointPlanner(sensors, example.fusion, SETTINGS).plan(*example.arguments, rng=np.random.default_rng(0))


def test_a_platform_cannot_move_its_sensor() -> None:
    example = situation("lmb")
    before = example.poses.copy()
    plans = [
        JointPlanner(tuple(replace(s, platform=platform) for s in example.sensors), example.fusion, SETTINGS).plan(
            *example.arguments, rng=np.random.default_rng(0)
        )
        for platform in (Gives([[0.0], [1.0]]), Gives([[0.0], [1.0]], pushes=True))
    ]
    np.testing.assert_array_equal(example.poses, before)
    np.testing.assert_array_equal(plans[0].tables[0].mean, plans[1].tables[0].mean)


@pytest.mark.parametrize("planner", PLANNERS)
def test_numbers_of_beliefs_and_poses(planner: Any) -> None:
    example = situation("marginal")
    with pytest.raises(InputError, match="state: expected a State; got tuple"):
        planner(example.sensors, example.fusion, SETTINGS).plan((), example.poses, rng=np.random.default_rng(0))
    assert "state.local: expected 2 beliefs, one a sensor; got 1" in refused(
        replace(example, beliefs=example.beliefs[:1]), planner
    )
    for poses in (example.poses[:1], example.poses[:, :2], example.poses[0], None, "here"):
        assert refused(replace(example, poses=poses), planner).startswith("poses: expected")
    for bad in (np.nan, np.inf):
        poses = example.poses.copy()
        poses[1, 0] = bad
        assert "poses: expected finite numbers" in refused(replace(example, poses=poses), planner)
    assert "sensors: expected at least one MobileSensor" in refused(replace(example, sensors=()), planner)
    filters: Any = tuple(sensor.filter for sensor in example.sensors)
    assert "sensors: expected at least one MobileSensor" in refused(replace(example, sensors=filters), planner)


@pytest.mark.parametrize("planner", PLANNERS)
def test_kinds_of_beliefs(planner: Any) -> None:
    example, other = situation("marginal"), situation("lmb")
    mixed = replace(example, beliefs=(example.beliefs[0], other.beliefs[0]))
    assert refused(mixed, planner) == "state.local[1]: expected GLMB; got LMB"
    assert refused(replace(other, beliefs=example.beliefs), planner) == "state.local[0]: expected LMB; got GLMB"
    unlabelled = Poisson.from_gaussians([1.0], np.zeros((1, 4)), np.eye(4)[np.newaxis])
    assert (
        refused(replace(example, fused=unlabelled), planner)
        == "state.fused: expected GLMB, LMB or FactoredGLMB; got Poisson"
    )
    assert (
        refused(replace(example, fused=None), planner)
        == "state.fused: expected GLMB, LMB or FactoredGLMB; got NoneType"
    )


@pytest.mark.parametrize("planner", PLANNERS)
def test_state_dimensions(planner: Any) -> None:
    example, rng = situation("marginal"), np.random.default_rng(0)
    wide = glmb([(A, B), (A,)], rng, 1, 5)
    expected = "expected states of dimension 4, as its filter; got 5"
    assert refused(replace(example, beliefs=(example.beliefs[0], wide)), planner) == f"state.local[1]: {expected}"
    assert refused(replace(example, fused=wide), planner) == f"state.fused: {expected}"
    sensors = (example.sensors[0], mobile_sensor("marginal", dim=5))
    message = "filters[1].targets: expected the target model of filters[0]; got another"
    assert refused(replace(example, sensors=sensors), planner) == message


def spoilt(density: Any, **fields: Any) -> Any:
    """The density with other fields, as if its arrays had been changed after it was made."""
    kind = type(density)
    return unchecked(kind, *(fields.get(name, getattr(density, name)) for name in kind.__match_args__))


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_densities_that_are_none(planner: Any, kind: str) -> None:
    example = situation(kind)
    belief = example.beliefs[1]
    covs = belief.tracks.covs.copy()
    covs[0] = -covs[0]
    indefinite = spoilt(belief, tracks=spoilt(belief.tracks, covs=covs))
    message = refused(replace(example, beliefs=(example.beliefs[0], indefinite)), planner)
    assert message.startswith("state.local[1]: tracks.covs[0]: expected")
    means = example.fused.tracks.means.copy()
    means[0, 1] = np.nan
    nowhere = spoilt(example.fused, tracks=spoilt(example.fused.tracks, means=means))
    assert refused(replace(example, fused=nowhere), planner).startswith("state.fused: tracks.means")
    if kind == "marginal":
        heavy = spoilt(belief, hyp_log_weights=belief.hyp_log_weights + 0.1)
        message = refused(replace(example, beliefs=(heavy, belief)), planner)
        assert message.startswith("state.local[0]: hyp_log_weights")


def test_label_spaces_that_share_nothing() -> None:
    rng = np.random.default_rng(0)
    example = replace(situation("marginal"), fused=glmb([(C,), (B, C)], rng))
    beliefs = glmb([(A,), (A, B)], rng), glmb([(B,), (A, B)], rng)
    for planner in PLANNERS:
        message = refused(replace(example, beliefs=beliefs), planner, reward=DIVERGENCE)
        assert message == "fused belief: expected a label set in common with the local beliefs; got none"
    # Bernoullis of no shared label leave nothing to compare: no action is worth anything.
    example = replace(situation("lmb"), beliefs=(lmb((A,), rng), lmb((B,), rng)), fused=lmb((C,), rng))
    for planner in PLANNERS:
        plan = planner(example.sensors, example.fusion, SETTINGS, DIVERGENCE).plan(*example.arguments, rng=rng)
        assert all((table.mean == 0.0).all() for table in plan.tables)
        assert plan.chosen == (0, 0)


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_numbers_of_fusion_weights(kind: str) -> None:
    example = situation(kind)
    for weights in ((1.0,), (0.2, 0.3, 0.5)):
        given = replace(example, fusion=replace(example.fusion, weights=weights))
        message = refused(given, JointPlanner, reward=DIVERGENCE)
        assert message == f"beliefs: expected {len(weights)}, one for each fusion weight; got 2"


@pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")
def test_a_fusion_of_other_densities() -> None:
    example = situation("lmb")
    message = refused(replace(example, fusion=CmDeltaGlmb((0.5, 0.5))), JointPlanner, reward=DIVERGENCE)
    assert message == "beliefs[0]: expected GLMB; got LMB"
    # Whereas a CLMB takes GLMBs, and the prediction may be of either kind.
    example = replace(situation("marginal"), fusion=Clmb((0.5, 0.5)))
    for fused in (example.fused, Clmb((0.5, 0.5)).fuse(example.beliefs)[0]):
        plan = JointPlanner(example.sensors, example.fusion, SETTINGS, DIVERGENCE).plan(
            *replace(example, fused=fused).arguments, rng=np.random.default_rng(0)
        )
        plan.validate()


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("num_threads", [1, 2])
def test_a_model_that_raises_on_the_way(kind: str, planner: Any, num_threads: int) -> None:
    """Only from places that the pseudo-updates reach."""
    detection = models.DetectionModel(raises, np.array([-320.0]))
    settings = replace(SETTINGS, num_threads=num_threads)
    example = situation(kind, settings=settings, detection=detection)
    message = refused(example, planner, ModelError)
    assert message == "a model function raised ValueError: out of my depth"


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_models_that_give_nonsense_on_the_way(kind: str) -> None:
    detection = models.DetectionModel(not_a_number, np.array([-320.0]))
    message = refused(situation(kind, detection=detection), JointPlanner, ModelError)
    assert "detection" in message
    measurement = models.MeasurementModel(2, nowhere, np.empty(0))
    example = situation(
        kind,
        measurement=measurement,
        noise=models.constant_noise([1.0, 1.0]),
        clutter=models.measurement_space_clutter(1.0, [0.0, 0.0], [1.0, 1.0]),
    )
    assert "measurement" in refused(example, JointPlanner, ModelError)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"horizon_steps": 0}, "horizon_steps: expected a whole number of at least 1; got 0"),
        ({"horizon_steps": 2.5}, "horizon_steps: expected a whole number"),
        ({"num_samples": 0}, "num_samples: expected a whole number"),
        ({"num_samples": "40"}, "num_samples: expected a whole number"),
        ({"max_prior_hypotheses": -1}, "max_prior_hypotheses: expected a whole number"),
        ({"horizon_period": 0.0}, "horizon_period: expected a number above 0; got 0.0"),
        ({"horizon_period": np.inf}, "horizon_period: expected a finite number"),
        ({"horizon_period": np.nan}, "horizon_period: expected a finite number"),
        ({"detection_threshold": 1.5}, "detection_threshold: expected a probability"),
        ({"ideal_measurements": "perfect"}, "ideal_measurements: expected one of ideal, expected, sampled"),
        ({"num_threads": -1}, "num_threads: expected a whole number"),
        ({"num_threads": 1.5}, "num_threads: expected a whole number"),
        ({"limits": Limits()}, "limits: expected max_components 1, min_existence 0 and min_track_weight 1"),
        ({"limits": replace(planning_limits(), max_components=2)}, "limits: expected max_components 1"),
        ({"limits": replace(planning_limits(), min_track_weight=0.1)}, "limits: expected max_components 1"),
    ],
)
def test_settings(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PlanningSettings(**changes)


def test_sensors() -> None:
    local = mobile_sensor("lmb").filter
    with pytest.raises(InputError, match="filter: expected a Filter, with targets, sensor"):
        MobileSensor("filter", Courses(1.0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="platform: expected a platform, with columns"):
        MobileSensor(local, (0.0, 90.0))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [PhdFilter, CphdFilter, CbMemberFilter])
@pytest.mark.parametrize("planner", [JointPlanner, IndependentPlanner])
def test_filters_without_labels_cannot_be_planned_with(planner: Any, kind: Any) -> None:
    known = mobile_sensor("lmb").filter
    local = kind(known.targets, known.sensor)
    sensors = (MobileSensor(local, Courses(1.0)),)
    belief = local.initial()
    with pytest.raises(InputError, match=rf"sensors\[0\].filter: expected one that labels its .*; got {kind.__name__}"):
        planner(sensors, Clmb((1.0,))).plan(State((belief,), belief), np.zeros((1, 3)), rng=np.random.default_rng(0))


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "unit", True])
def test_unit_volumes(value: Any) -> None:
    with pytest.raises(InputError, match="unit_volume: expected a finite number above 0 or 'reference'"):
        CauchySchwarzReward(value)


def test_fixed_and_random_courses() -> None:
    east = Actions.of(heading_deg=0.0)
    for actions in ((), (0.0,), (east, Actions(("heading_deg",), np.zeros((2, 1))))):
        with pytest.raises(InputError, match="actions: expected one action of each sensor"):
            FixedPlanner(actions)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    nothing: Any = None
    for planner in (FixedPlanner((east, east)), RandomPlanner((mobile_sensor("lmb"),) * 2)):
        for poses in (np.zeros((1, 3)), np.full((2, 3), np.nan)):
            with pytest.raises(InputError, match="poses: expected"):
                planner.plan(nothing, poses, rng=rng)
    with pytest.raises(InputError, match="sensors: expected at least one MobileSensor"):
        RandomPlanner(()).plan(nothing, np.zeros((0, 3)), rng=rng)


def test_a_scan_that_clutter_cannot_explain_is_no_trouble() -> None:
    example = situation(
        "marginal", clutter=models.ClutterModel(0.0, no_clutter, np.empty(0), None, 2, np.array([True, False]))
    )
    plan = JointPlanner(example.sensors, example.fusion, SETTINGS).plan(
        *example.arguments, rng=np.random.default_rng(0)
    )
    plan.validate()


def table(mean: Any, error: Any, sensors: tuple[int, ...] = (0,)) -> RewardTable:
    return RewardTable(sensors, np.array(mean), np.array(error))


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (table([[1.0]], [[0.0]]), "one axis for each of the sensors"),
        (table([1.0, 2.0], [0.0]), "one axis for each of the sensors"),
        (table([1.0, np.inf], [0.0, 0.0]), "expected finite rewards"),
        (table([1.0, 2.0], [0.0, -0.1]), "expected finite rewards"),
        (table([1.0, np.nan], [0.0, 0.0]), "expected finite rewards"),
        (table([1.0, 2.0], [0.0, np.nan]), "expected finite rewards"),
        (table([np.nan, np.nan], [np.nan, np.nan]), "at least one that was"),
        (table([np.nan, 1.0], [np.nan, 0.0]), r"expected a reward of the chosen actions \(0,\)"),
        (table([1.0, 2.0, 3.0], [0.0, 0.0, 0.0]), r"expected shape \(2,\)"),
        (table([1.0, 2.0], [0.0, 0.0], (1,)), "expected sensors below 1"),
    ],
)
def test_plans_that_are_none(bad: RewardTable, message: str) -> None:
    good = Plan(
        "jdm", (Actions(("heading_deg",), np.array([[0.0], [1.0]])),), (0,), (table([1.0, np.nan], [0.0, np.nan]),), {}
    )
    good.validate()
    with pytest.raises(InputError, match=message):
        replace(good, tables=(bad,)).validate()
    for chosen in ((), (2,), (-1,)):
        with pytest.raises(InputError, match=r"plan\.chosen"):
            replace(good, chosen=chosen).validate()


def test_nothing_is_written_into_the_arguments() -> None:
    for kind in ("delta", "lmb"):
        example = situation(kind)
        before = [_copies(density) for density in (*example.beliefs, example.fused)]
        for planner in PLANNERS:
            planner(example.sensors, example.fusion, SETTINGS).plan(*example.arguments, rng=np.random.default_rng(0))
        for density, arrays in zip((*example.beliefs, example.fused), before, strict=True):
            for now, then in zip(_copies(density), arrays, strict=True):
                np.testing.assert_array_equal(now, then)


def _copies(density: GLMB | LMB) -> list[Any]:
    tracks = density.tracks
    weights = density.hyp_log_weights if isinstance(density, GLMB) else density.existence_logit
    return [array.copy() for array in (tracks.labels, tracks.log_weights, tracks.means, tracks.covs, weights)]


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_an_ideal_scan_that_the_models_forbid(kind: str) -> None:
    """A sensor sure of its target and of its detections, and samples in which there is no target."""
    rng = np.random.default_rng(1)
    example = situation(kind, settings=replace(SETTINGS, num_samples=6), detection=models.DetectionModel(certain))
    sure: Any
    half: Any
    if kind == "lmb":
        sure, half = (LMB(lmb((A,), rng).tracks, np.array([logit])) for logit in (np.inf, 0.0))
    else:
        sure, half = glmb([(A,)], rng), glmb([(A,), ()], rng)
    given = replace(example, beliefs=(sure, half), fused=half)
    message = refused(given, JointPlanner, NumericalError, DIVERGENCE)
    assert message.startswith("pseudo-update: no ")
    assert message.endswith("do the models forbid the ideal scan?")
