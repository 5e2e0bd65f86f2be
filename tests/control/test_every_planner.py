"""What all planners do alike: what they refuse and how they say so, what looks bad and is none, what counts not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from control.examples import (
    KNOWN,
    SETTINGS,
    A,
    B,
    C,
    Situation,
    assert_same_plan,
    decided,
    glmb,
    lmb,
    mobile_sensor,
    situation,
)
from vedette import models
from vedette.control import (
    BeamSearch,
    CauchySchwarzReward,
    ConstantPlanner,
    CoordinateAscent,
    ExpectedLossReward,
    HorizonPlanner,
    IndependentPlanner,
    JointPlanner,
    KullbackLeiblerReward,
    MobileSensor,
    Plan,
    RandomPlanner,
    RewardTable,
    Separation,
    TreeSearch,
)
from vedette.control.racing import FIRST_ROUND
from vedette.densities import GLMB, LMB, Poisson, UndetectedIntensity
from vedette.densities.containers import unchecked
from vedette.errors import InputError, ModelError, NumericalError
from vedette.filters import CbMemberFilter, CphdFilter, PhdFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.platforms import Actions, HeadingPlatform
from vedette.tracking import State

AHEAD = partial(HorizonPlanner, depth=2)  # which goes by sums over labels alone
PLANNERS = [JointPlanner, IndependentPlanner, AHEAD]
each_planner = pytest.mark.parametrize("planner", PLANNERS)
each_kind = pytest.mark.parametrize("kind", ["marginal", "lmb"])
RACING = replace(KNOWN, confidence=0.95, max_samples=64)
DIVERGENCE = CauchySchwarzReward()  # of densities that are fused


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


def given(kind: str, planner: Any = None, **parts: Any) -> Situation:
    """A situation that a planner can decide in."""
    return situation(kind, settings=KNOWN if planner is AHEAD else SETTINGS, **parts)


def refused(example: Situation, planner: Any, error: type[Exception] = InputError, reward: Any = None) -> str:
    """What a planner says of a situation."""
    with pytest.raises(error) as raised:
        decided(example, planner, ExpectedLossReward() if reward is None else reward)
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
        poses = HeadingPlatform(30.0).course(pose, action, times) if self.way is None else self.way
        if self.pushes:
            pose[:], action[:], times[:] = 1e6, 1e6, 1e6
        return poses


def on(example: Situation, *platforms: Any) -> Situation:
    """With other platforms; the last ones, where there are fewer than sensors."""
    kept = example.sensors[: len(example.sensors) - len(platforms)]
    moved = zip(example.sensors[len(kept) :], platforms, strict=True)
    return replace(example, sensors=(*kept, *(replace(own, platform=platform) for own, platform in moved)))


def random_planner(sensors: Any, fusion: Any, settings: Any, reward: Any) -> RandomPlanner:
    return RandomPlanner(sensors)


# What is refused.


@pytest.mark.parametrize("actions", [[], [[np.nan]], [[0.0, 1.0]], None, [["north"]], 1.0, [0.0]])
@pytest.mark.parametrize("planner", [*PLANNERS, random_planner])
def test_platforms_that_give_no_actions(planner: Any, actions: Any) -> None:
    message = refused(on(given("lmb", planner), Gives(actions)), planner)
    assert message.startswith("sensors[1].platform.actions")
    assert ": expected" in message


@each_planner
@pytest.mark.parametrize("way", [np.zeros((1, 3)), np.zeros((2, 2)), np.zeros((2, 4)), np.full((2, 3), np.inf), "on"])
def test_platforms_that_give_no_course(planner: Any, way: Any) -> None:
    message = refused(on(given("lmb", planner), Gives([[0.0]], way)), planner)
    assert message.startswith("sensors[1].platform.course: expected")


@each_planner
def test_numbers_of_beliefs_and_poses(planner: Any) -> None:
    example = given("marginal", planner)
    with pytest.raises(InputError, match="state: expected a State; got tuple"):
        planner(example.sensors, example.fusion, KNOWN).plan((), example.poses, rng=np.random.default_rng(0))
    assert "state.local: expected 2 beliefs, one a sensor; got 1" in refused(
        replace(example, beliefs=example.beliefs[:1]), planner
    )
    for poses in (example.poses[:1], example.poses[:, :2], example.poses[0], None, "here"):
        assert refused(replace(example, poses=poses), planner).startswith("poses: expected")
    for bad in (np.nan, np.inf):
        poses = example.poses.copy()
        poses[1, 0] = bad
        assert "poses: expected finite numbers" in refused(replace(example, poses=poses), planner)
    filters: Any = tuple(sensor.filter for sensor in example.sensors)
    for sensors in ((), filters):
        assert "sensors: expected at least one MobileSensor" in refused(replace(example, sensors=sensors), planner)


@each_planner
def test_kinds_and_dimensions_of_beliefs(planner: Any) -> None:
    example, other = given("marginal", planner), given("lmb", planner)
    unlabelled = Poisson.from_gaussians([1.0], np.zeros((1, 4)), np.eye(4)[np.newaxis])
    wide = glmb([(A, B), (A,)], np.random.default_rng(0), 1, 5)
    labelled, dimension = "expected GLMB, LMB or FactoredGLMB", "expected states of dimension 4, as its filter; got 5"
    for changed, message in (
        (
            replace(example, beliefs=(example.beliefs[0], other.beliefs[0])),
            "state.local[1]: expected GLMB; got LMB",
        ),
        (replace(other, beliefs=example.beliefs), "state.local[0]: expected LMB; got GLMB"),
        (replace(example, fused=unlabelled), f"state.fused: {labelled}; got Poisson"),
        (replace(example, fused=None), f"state.fused: {labelled}; got NoneType"),
        (replace(example, beliefs=(example.beliefs[0], wide)), f"state.local[1]: {dimension}"),
        (replace(example, fused=wide), f"state.fused: {dimension}"),
        (
            replace(example, sensors=(example.sensors[0], mobile_sensor("marginal", dim=5))),
            "filters[1].targets: expected the target model of filters[0]; got another",
        ),
    ):
        assert refused(changed, planner) == message


def spoilt(density: Any, **fields: Any) -> Any:
    """The density with other fields, as if its arrays had been changed after it was made."""
    kind = type(density)
    return unchecked(kind, *(fields.get(name, getattr(density, name)) for name in kind.__match_args__))


@each_planner
@each_kind
def test_densities_that_are_none(planner: Any, kind: str) -> None:
    example = given(kind, planner)
    belief = example.beliefs[1]
    covs, means = belief.tracks.covs.copy(), example.fused.tracks.means.copy()
    covs[0], means[0, 1] = -covs[0], np.nan
    indefinite = spoilt(belief, tracks=spoilt(belief.tracks, covs=covs))
    message = refused(replace(example, beliefs=(example.beliefs[0], indefinite)), planner)
    assert message.startswith("state.local[1]: tracks.covs[0]: expected")
    astray = spoilt(example.fused, tracks=spoilt(example.fused.tracks, means=means))
    assert refused(replace(example, fused=astray), planner).startswith("state.fused: tracks.means")
    if kind == "marginal":
        heavy = spoilt(belief, hyp_log_weights=belief.hyp_log_weights + 0.1)
        message = refused(replace(example, beliefs=(heavy, belief)), planner)
        assert message.startswith("state.local[0]: hyp_log_weights")


@each_kind
def test_fusion_weights_that_do_not_fit(kind: str) -> None:
    example = given(kind)
    for weights in ((1.0,), (0.2, 0.3, 0.5)):
        other = replace(example, fusion=replace(example.fusion, weights=weights))
        message = f"beliefs: expected {len(weights)}, one for each fusion weight; got 2"
        assert refused(other, JointPlanner, reward=DIVERGENCE) == message


@pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")
def test_a_fusion_of_other_densities() -> None:
    example = given("lmb")
    message = refused(replace(example, fusion=CmDeltaGlmb((0.5, 0.5))), JointPlanner, reward=DIVERGENCE)
    assert message == "beliefs[0]: expected GLMB; got LMB"
    # Whereas a CLMB takes GLMBs, and the prediction may be of either kind.
    example = replace(given("marginal"), fusion=Clmb((0.5, 0.5)))
    for fused in (example.fused, Clmb((0.5, 0.5)).fuse(example.beliefs)[0]):
        decided(replace(example, fused=fused), reward=DIVERGENCE)


@each_planner
@each_kind
@pytest.mark.parametrize("num_threads", [1, 2])
def test_a_model_that_raises_on_the_way(kind: str, planner: Any, num_threads: int) -> None:
    """Only from places that the pseudo-updates reach."""
    example = given(kind, planner, detection=models.DetectionModel(raises, np.array([-320.0])))
    example = replace(example, settings=replace(example.settings, num_threads=num_threads))
    assert refused(example, planner, ModelError) == "a model function raised ValueError: out of my depth"


@each_kind
def test_models_that_give_nonsense_on_the_way(kind: str) -> None:
    detection = models.DetectionModel(not_a_number, np.array([-320.0]))
    assert "detection" in refused(given(kind, detection=detection), JointPlanner, ModelError)
    example = given(
        kind,
        measurement=models.MeasurementModel(2, nowhere, np.empty(0)),
        noise=models.constant_noise([1.0, 1.0]),
        clutter=models.measurement_space_clutter(1.0, [0.0, 0.0], [1.0, 1.0]),
    )
    assert "measurement" in refused(example, JointPlanner, ModelError)


@each_kind
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
    message = refused(replace(example, beliefs=(sure, half), fused=half), JointPlanner, NumericalError, DIVERGENCE)
    assert message.startswith("pseudo-update: no ")
    assert message.endswith("do the models forbid the ideal scan?")


def test_sensors() -> None:
    local = mobile_sensor("lmb").filter
    with pytest.raises(InputError, match="filter: expected a Filter, with targets, sensor"):
        MobileSensor("filter", HeadingPlatform(1.0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="platform: expected a platform, with columns"):
        MobileSensor(local, (0.0, 90.0))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [PhdFilter, CphdFilter, CbMemberFilter])
@each_planner
def test_filters_without_labels_cannot_be_planned_with(planner: Any, kind: Any) -> None:
    known = mobile_sensor("lmb").filter
    local = kind(known.targets, known.sensor)
    sensors = (MobileSensor(local, HeadingPlatform(1.0)),)
    belief = local.initial()
    with pytest.raises(InputError, match=rf"sensors\[0\].filter: expected one that labels its .*; got {kind.__name__}"):
        planner(sensors, Clmb((1.0,))).plan(State((belief,), belief), np.zeros((1, 3)), rng=np.random.default_rng(0))


def test_fixed_and_random_courses() -> None:
    east = Actions.of(heading_deg=0.0)
    for actions in ((), (0.0,), (east, Actions(("heading_deg",), np.zeros((2, 1))))):
        with pytest.raises(InputError, match="actions: expected one action of each sensor"):
            ConstantPlanner(actions)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    nothing: Any = None
    for planner in (ConstantPlanner((east, east)), RandomPlanner((mobile_sensor("lmb"),) * 2)):
        for poses in (np.zeros((1, 3)), np.full((2, 3), np.nan)):
            with pytest.raises(InputError, match="poses: expected"):
                planner.plan(nothing, poses, rng=rng)
    with pytest.raises(InputError, match="sensors: expected at least one MobileSensor"):
        RandomPlanner(()).plan(nothing, np.zeros((0, 3)), rng=rng)


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


# What looks bad and is none.


def test_label_spaces_that_share_nothing() -> None:
    rng = np.random.default_rng(0)
    example = replace(given("marginal"), fused=glmb([(C,), (B, C)], rng))
    apart = replace(example, beliefs=(glmb([(A,), (A, B)], rng), glmb([(B,), (A, B)], rng)))
    for planner in PLANNERS[:2]:
        message = refused(apart, planner, reward=DIVERGENCE)
        assert message == "fused belief: expected a label set in common with the local beliefs; got none"
    # Bernoullis of no shared label leave nothing to compare: no action is worth anything.
    for planner in PLANNERS:
        own = replace(given("lmb", planner), beliefs=(lmb((A,), rng), lmb((B,), rng)), fused=lmb((C,), rng))
        plan = decided(own, planner, DIVERGENCE)
        assert all((table.mean == 0.0).all() for table in plan.tables)
        assert plan.chosen == (0, 0)


@each_planner
@each_kind
@pytest.mark.parametrize(
    "reward", [DIVERGENCE, CauchySchwarzReward("reference"), ExpectedLossReward(100.0)], ids=["K", "shares", "loss"]
)
@pytest.mark.parametrize("settings", [SETTINGS, KNOWN, RACING], ids=["full", "known", "racing"])
def test_with_no_target_known_nothing_is_worth_anything(planner: Any, kind: str, reward: Any, settings: Any) -> None:
    """No label at all: every reward is 0, and the first action is taken; where samples race, after the first round."""
    nothing: Any = LMB.empty(4) if kind == "lmb" else GLMB.empty(4)
    settings = KNOWN if planner is AHEAD else settings
    plan = decided(replace(situation(kind, settings=settings), beliefs=(nothing,) * 2, fused=nothing), planner, reward)
    assert all((table.mean == 0.0).all() for table in plan.tables)
    assert plan.chosen == (0, 0)
    assert set(plan.expected_rewards) == {(0.0, 0.0)}
    assert (plan.certainty is not None) == (settings is RACING)
    if plan.certainty is not None and not isinstance(reward, ExpectedLossReward):
        assert (plan.certainty.reason, plan.certainty.samples) == ("indifferent", FIRST_ROUND)


def test_a_scan_that_clutter_cannot_explain_is_no_trouble() -> None:
    clutter = models.ClutterModel(0.0, no_clutter, np.empty(0), None, 2, np.array([True, False]))
    decided(given("marginal", clutter=clutter), reward=ExpectedLossReward())


# What changes nothing.


def arrays(density: Any) -> list[Any]:
    tracks = density.tracks
    weights = density.hyp_log_weights if isinstance(density, GLMB) else density.existence_logit
    return [array.copy() for array in (tracks.labels, tracks.log_weights, tracks.means, tracks.covs, weights)]


@each_planner
@pytest.mark.parametrize("kind", ["delta", "lmb"])
def test_nothing_is_written_into_the_arguments(planner: Any, kind: str) -> None:
    example = given(kind, planner)
    beliefs = (*example.beliefs, example.fused)
    before, poses = [arrays(density) for density in beliefs], example.poses.copy()
    gentle, pushing = (on(example, *(Gives([[0.0], [1.0]], pushes=own),) * 2) for own in (False, True))
    assert_same_plan(decided(pushing, planner), decided(gentle, planner))
    np.testing.assert_array_equal(example.poses, poses)
    for density, those in zip(beliefs, before, strict=True):
        for now, then in zip(arrays(density), those, strict=True):
            np.testing.assert_array_equal(now, then)


WAYS: dict[str, tuple[Any, dict[str, Any]]] = {
    "jdm": (JointPlanner, {}),
    "idm": (IndependentPlanner, {}),
    "ascent": (partial(JointPlanner, search=CoordinateAscent(2)), {}),
    "sampled": (JointPlanner, {"ideal_measurements": "sampled"}),
    "sampled idm": (IndependentPlanner, {"ideal_measurements": "sampled"}),
    "race": (JointPlanner, {"confidence": 0.95, "max_samples": 64}),
    "race idm": (IndependentPlanner, {"confidence": 0.95, "max_samples": 64, "indifference": 0.05}),
    "by sums": (JointPlanner, {"association": "known", "ideal_measurements": "sampled"}),
    "race by sums": (JointPlanner, {"association": "known", "confidence": 0.95, "max_samples": 64}),
    "beam": (partial(HorizonPlanner, depth=3, budget=90, search=BeamSearch(3)), {"association": "known"}),
    "tree": (partial(HorizonPlanner, depth=3, budget=90, search=TreeSearch()), {"association": "known"}),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["delta", "marginal", "lmb"])
def test_a_seed_gives_the_same_bytes_whatever_the_number_of_threads(kind: str, way: str) -> None:
    planner, settings = WAYS[way]
    plans = [
        decided(situation(kind, settings=replace(SETTINGS, **settings, num_threads=num_threads)), planner, seed=seed)
        for num_threads, seed in ((1, 5), (1, 5), (2, 5), (3, 5), (7, 5), (1, 6))
    ]
    for plan in plans[1:5]:
        assert_same_plan(plan, plans[0])
    assert any(
        not np.array_equal(mine.mean, its.mean) for mine, its in zip(plans[5].tables, plans[0].tables, strict=True)
    )


@pytest.mark.parametrize("reward", [DIVERGENCE, KullbackLeiblerReward(), ExpectedLossReward()], ids=["K", "KL", "loss"])
@pytest.mark.parametrize("mode", ["ideal", "expected", "sampled"])
@pytest.mark.parametrize("more", ["nothing", "constraint", "undetected", "three sensors", "scans"])
def test_a_sequence_of_one_decision_is_a_single_one(reward: Any, mode: Any, more: str) -> None:
    worth, undetected = 0.0, None
    parts: dict[str, Any] = {}
    if more == "constraint":
        parts = {"constraints": (Separation(500.0),)}
    elif more == "undetected":
        grid = models.CellGrid(models.Region(-600.0, 600.0, -600.0, 600.0), 6, 6)
        undetected = UndetectedIntensity(grid, np.random.default_rng(1).uniform(0.0, 0.05, grid.num_cells))
        worth = 2.0
    settings = replace(KNOWN, ideal_measurements=mode, undetected_target_value=worth)
    example = situation("lmb", 3 if more == "three sensors" else 2, settings=settings)
    if more == "scans":
        sensors = (example.sensors[0], replace(example.sensors[1], scan_times=np.array([3.0, 11.0])))
        example = replace(example, sensors=sensors)
    joint, ahead = (
        decided(example, kind, reward, undetected=undetected, **parts)
        for kind in (JointPlanner, partial(HorizonPlanner, depth=1))
    )
    assert_same_plan(ahead, joint)
    assert ahead.notes == joint.notes
    assert [rows.tolist() for rows in ahead.sequence] == [[row.tolist()] for row in joint.chosen_actions]
    assert str(ahead.explain()).removeprefix("lookahead") == str(joint.explain()).removeprefix("jdm")
    if more == "undetected":
        without = decided(example, JointPlanner, reward)
        assert (joint.tables[0].mean > without.tables[0].mean).all()


@pytest.mark.parametrize("other", [IndependentPlanner, JointPlanner])
def test_random_numbers_are_used_as_by_a_single_decision(other: Any) -> None:
    """What comes after the decision draws the same numbers."""
    example, left = given("lmb", AHEAD), []
    for kind in (partial(HorizonPlanner, depth=1), other):
        rng = np.random.default_rng(3)
        kind(example.sensors, example.fusion, example.settings, DIVERGENCE).plan(*example.arguments, rng=rng)
        left.append(rng.random())
    assert left[0] == left[1]
