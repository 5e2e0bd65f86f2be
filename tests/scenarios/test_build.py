# ruff: noqa: E501
"""What is built of a scenario is what it says."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import MINIMAL, changed
from vedette.control import (
    CauchySchwarzReward,
    CoordinateAscent,
    ExpectedLossReward,
    IndependentPlanner,
    JointPlanner,
    RenyiReward,
)
from vedette.densities import GLMB, LMB, least_gospa_estimate
from vedette.errors import InputError, ScenarioError
from vedette.filters import (
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    Gibbs,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    PhdFilter,
    RankedAssignment,
)
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, LabelMatchedFusion, ParallelUpdate
from vedette.scenarios import Scenario, build, list_builtin, load_scenario, parse_scenario, replace_fields
from vedette.scenarios.sections.fusion import Fusion
from vedette.scenarios.sections.planners import NamedPlanner
from vedette.scenarios.sections.scoring import MarginalEstimator
from vedette.scenarios.summary import summary_line, summary_rows
from vedette.scenarios.warnings import scenario_warnings
from vedette.simulation import ScriptedTargets, Truth, simulate_scans
from vedette.tracking import Central

OWN_MODELS = Path(__file__).with_name("own_models.py")


def scenario(*changes: tuple[str, str]) -> Scenario:
    return Scenario(parse_scenario(changed(*changes), folder=OWN_MODELS.parent), OWN_MODELS.with_name("x.yaml"))


def truth_of(loaded: Scenario) -> Truth:
    return build.build_targets(loaded).truth(loaded.model.time.build(), rng=np.random.default_rng(0))


def filters_of(loaded: Scenario) -> Any:
    return [sensor.filter for sensor in build.build_sensors(loaded)]


def test_times_and_poses() -> None:
    experiment = build.build_experiment(scenario(("heading_deg: 4.0", "heading_deg: 90")))
    np.testing.assert_allclose(experiment.times, 2.0 + 0.5 * np.arange(20))
    np.testing.assert_allclose(experiment.poses, [[0.0, 40.0, math.pi / 2], [0.0, -40.0, 0.0]])


def test_births_are_in_the_librarys_state_order() -> None:
    text = changed(
        ("sigma_v: 1.0", "sigma_v: 1.0, state_order: interleaved"),
        ("mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]", "mean: [1, 2, 3, 4], std: [5, 6, 7, 8]"),
    )
    model = parse_scenario(text)
    birth = model.birth.build(model.motion, model.region)
    np.testing.assert_array_equal(birth.means, [[1, 3, 2, 4]])
    np.testing.assert_array_equal(birth.covs, [np.diag([25.0, 49.0, 36.0, 64.0])])
    assert birth.steps == frozenset({1, 5})


def test_a_covariance_of_births_is_reordered_both_ways() -> None:
    rows = "cov: [[4, 1, 0, 0], [1, 9, 0, 0], [0, 0, 16, 2], [0, 0, 2, 25]]"
    model = scenario(
        ("sigma_v: 1.0", "sigma_v: 1.0, state_order: interleaved"), ("std: [5.0, 5.0, 2.0, 2.0]", rows)
    ).model
    cov = model.birth.build(model.motion, model.region).covs[0]
    np.testing.assert_array_equal(cov, [[4, 0, 1, 0], [0, 16, 0, 2], [1, 0, 9, 0], [0, 2, 0, 25]])


def test_scripted_targets_live_from_step_to_step() -> None:
    truth = truth_of(
        scenario(
            ("state: [1.0, 2.0, 0.5, -0.5]", "state: [1, 0.5, 2, -0.5]"), ("sigma_v: 1.0", "state_order: interleaved")
        )
    )
    np.testing.assert_array_equal(np.diff(truth.offsets), [0] + [1] * 17 + [0] * 2)
    np.testing.assert_allclose(truth.states[0], [1.0, 2.0, 0.5, -0.5])
    np.testing.assert_allclose(truth.states[-1], [1.0 + 16 * 0.25, 2.0 - 16 * 0.25, 0.5, -0.5])


def test_no_target_is_a_scenario_too() -> None:
    truth = truth_of(scenario(("    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}", "    []")))
    assert len(truth.ids) == 0


@pytest.mark.parametrize(
    ("text", "dim", "angular"),
    [
        ("measurement: {kind: bearing_range}, noise: {kind: range_dependent}", 2, [True, False]),
        ("measurement: {kind: bearing_only}, noise: {kind: range_dependent}", 1, [True]),
        ("measurement: {kind: range_only}, noise: {kind: range_dependent}", 1, [False]),
        ("measurement: {kind: position}, noise: {kind: constant, std: [1, 2]}", 2, [False, False]),
    ],
)
def test_measurements_and_their_noise(text: str, dim: int, angular: list[bool]) -> None:
    sensor = filters_of(scenario(("heading_deg: 4.0", text)))[0].sensor
    assert sensor.meas_dim == dim
    assert list(sensor.measurement.angular) == angular
    sensor.check([[10.0, 20.0, 1.0, 1.0]], [0.0, 40.0, 0.0])


def test_degrees_become_radians() -> None:
    text = "noise: {kind: range_dependent, sigma_range: 3.0, eta_range: 0.0, sigma_bearing_deg: 2.0, eta_bearing: 0.0}"
    sensor = filters_of(scenario(("heading_deg: 4.0", text)))[0].sensor
    cov = sensor.noise.covs([10.0, 20.0, 0.0, 0.0], [0.0, 0.0, 0.0], 2)
    np.testing.assert_allclose(cov[0], np.diag([math.radians(2.0) ** 2, 9.0]))


def test_a_sector_is_around_the_heading() -> None:
    text = "detection: {kind: limited_sector, probability: 0.9, max_range: 50.0, half_width_deg: 30.0}"
    detection = filters_of(scenario(("heading_deg: 4.0", text)))[0].sensor.detection
    states = [[10.0, 5.0, 0.0, 0.0], [10.0, 8.0, 0.0, 0.0], [60.0, 0.0, 0.0, 0.0]]
    np.testing.assert_allclose(detection.prob(states, [0.0, 0.0, 0.0]), [0.9, 0.0, 0.0])


def test_clutter_of_the_region_and_of_measurement_space() -> None:
    text = "clutter: {kind: measurement_space, rate: 7, low: [0.0, 0.0], high: [6.283185307179586, 100.0]}"
    north, south = (local.sensor.clutter for local in filters_of(scenario(("heading_deg: 4.0", text))))
    assert (north.rate, south.rate) == (7.0, 25.0)


def test_custom_models_from_a_file_next_to_the_scenario() -> None:
    own = {
        name: f"{{kind: custom, function: 'own_models.py:{name}'}}"
        for name in ("survival", "noise", "detection", "clutter")
    }
    sensor = ", ".join(f"{name}: {own[name]}" for name in ("noise", "detection", "clutter"))
    loaded = scenario(
        (
            "{kind: constant_velocity, sigma_v: 1.0}",
            "{kind: custom, function: 'own_models.py:motion', arguments: {speed: 2.5}, components: [px, py, own_2]}",
        ),
        ("{kind: constant, probability: 0.95}", own["survival"]),
        ("mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]", "mean: [0, 0, 0], std: [1, 1, 1]"),
        ("state: [1.0, 2.0, 0.5, -0.5]", "state: [1, 2, 3]"),
        (
            "  noise: {kind: constant, std: [0.02, 3.0]}",
            "  measurement: {kind: custom, function: 'own_models.py:measurement'}\n  noise: {kind: constant, std: [3.0]}\n  clutter: {kind: measurement_space, low: [0], high: [100]}",
        ),
        ("heading_deg: 4.0", sensor),
    )
    north, south = filters_of(loaded)
    assert north.targets.motion.state_dim == 3
    np.testing.assert_allclose(north.targets.motion.propagate([1.0, 2.0, 3.0], 2.0), [[6.0, 2.0, 3.0]])
    assert north.targets.survival.prob([[0.0, 0.0, 0.0]], 1.0) == 0.75
    assert (north.sensor.clutter.rate, south.sensor.clutter.rate) == (3.0, 25.0)
    np.testing.assert_allclose(north.sensor.noise.covs([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 1), [[[4.0]]])
    step: Any = north.step
    belief, _ = step(north.initial(), [[5.0]], [0.0, 0.0, 0.0], 1.0, 1, rng=np.random.default_rng(0))
    assert belief.tracks.means.shape[1] == 3


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        ("own_models.py:motion.absent", "{}", "motion.absent to give a MotionModel; got AttributeError"),
        ("own_models.py:bad_motion", "{}", "got ValueError: no such current"),
        ("own_models.py:survival", "{}", "to give a MotionModel; got a SurvivalModel"),
        ("own_models.py:motion", "{pace: 3}", "got TypeError"),
        ("math:sqrt", "{}", "got TypeError"),
        ("json:dumps", "{obj: 1}", "to give a MotionModel; got a str"),
    ],
)
def test_models_that_cannot_be_imported(function: str, arguments: str, message: str) -> None:
    text = f"{{kind: custom, function: '{function}', arguments: {arguments}, components: [px, py, vx, vy]}}"
    loaded = scenario(("{kind: constant_velocity, sigma_v: 1.0}", text))
    with pytest.raises(InputError, match=r"^motion\.function: ") as error:
        filters_of(loaded)
    assert message in str(error.value)


def test_components_that_are_not_the_models() -> None:
    text = "{kind: custom, function: 'own_models.py:motion', components: [px, py, vx, vy]}"
    with pytest.raises(
        InputError,
        match=r"motion\.components: expected those of own_models\.py:motion, px, py, own_2; got px, py, vx, vy",
    ):
        filters_of(scenario(("{kind: constant_velocity, sigma_v: 1.0}", text)))


def test_a_state_in_another_order_is_refused() -> None:
    text = "{kind: custom, function: 'own_models.py:height_third', components: [px, py, vx, vy, own_4, own_5]}"
    loaded = scenario(
        ("{kind: constant_velocity, sigma_v: 1.0}", text),
        ("mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]", "mean: [0, 0, 0, 0, 0, 0], std: [1, 1, 1, 1, 1, 1]"),
        ("state: [1.0, 2.0, 0.5, -0.5]", "state: [1, 2, 3, 4, 5, 6]"),
    )
    message = r"motion\.function: expected a state that begins with x, y, vx, vy, .*; got component 2, of which 1 more"
    with pytest.raises(InputError, match=message):
        filters_of(loaded)


def test_filters_of_each_kind() -> None:
    ranked, _ = filters_of(scenario())
    assert isinstance(ranked, DeltaGlmbFilter)
    assert (ranked.marginalised, ranked.assignment) == (True, RankedAssignment())
    text = "kind: delta_glmb, gaussian_method: ckf, assignment: {kind: gibbs, num_samples: 77}, limits: {max_hypotheses: 9}"
    gibbs, _ = filters_of(scenario(("kind: m_delta_glmb", text)))
    assert isinstance(gibbs, DeltaGlmbFilter)
    assert (gibbs.marginalised, gibbs.assignment) == (False, Gibbs(77))
    assert (gibbs.targets.motion.method, gibbs.sensor.method, gibbs.limits.max_hypotheses) == ("ckf", "ckf", 9)
    lmb, _ = filters_of(scenario(("kind: m_delta_glmb", "kind: lmb"), ("kind: cm_delta_glmb", "kind: clmb")))
    assert isinstance(lmb, LmbFilter)


ALONE = (
    ("  - {name: south, position: [0.0, -40.0]}\n", ""),
    ("kind: cm_delta_glmb, weights: [0.5, 0.5]", "kind: none"),
    ("kind: marginal, threshold: 0.6", "kind: map"),
)
UNLABELLED = [("phd", PhdFilter), ("cphd", CphdFilter), ("cb_member", CbMemberFilter)]


@pytest.mark.parametrize(("kind", "container"), UNLABELLED)
def test_a_filter_without_labels_runs_alone_and_names_its_estimates_by_the_scan(kind: str, container: type) -> None:
    text = f"kind: {kind}, limits: {{max_intensity_components: 7, max_existence: 0.5}}"
    loaded = scenario(*ALONE, ("kind: m_delta_glmb", text))
    (local,) = filters_of(loaded)
    assert isinstance(local, container)
    own: Any = local
    assert (own.limits.max_intensity_components, own.limits.max_existence) == (7, 0.5)
    experiment, state, _ = tracked(loaded, 8, np.random.default_rng(1))
    estimate = experiment.estimate(state.fused, 8)
    estimate.validate()
    assert estimate.labels.tolist() == [[8, i] for i in range(estimate.num_targets)]
    for planner in ("random", "constant"):
        made: Any = build.build_planner(loaded, planner)
        made.plan(state, experiment.poses, rng=np.random.default_rng(0))
    for planner in ("jdm", "idm"):
        with pytest.raises(
            InputError,
            match=rf"^planner {planner}: expected nearest, .*, as {kind} filters have no labels .*; got {planner}",
        ):
            build.build_planner(loaded, planner)


def test_fusions_of_each_kind_have_weights_that_sum_to_one() -> None:
    cm = Fusion(kind="cm_delta_glmb", weights=(0.3333333, 0.3333333, 0.3333333), missing_weight=1e-3).build(3, Path())
    assert isinstance(cm, CmDeltaGlmb)
    assert math.fsum(cm.weights) == pytest.approx(1.0, abs=1e-12)
    assert cm.missing_log_weight == math.log(1e-3)
    clmb = Fusion(kind="clmb", missing_existence=0.01).build(4, Path())
    assert isinstance(clmb, Clmb)
    assert (clmb.weights, clmb.missing_existence) == ((0.25,) * 4, 0.01)
    assert Fusion(kind="none").build(1, Path()) is None


@pytest.mark.parametrize("local", ["factored_glmb", "lmb", "delta_glmb"])
def test_without_fusion_all_scans_update_one_belief(local: str) -> None:
    plain = changed(
        ("fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}\n", ""), ("kind: m_delta_glmb", f"kind: {local}")
    )
    loaded = Scenario(parse_scenario(plain))
    assert loaded.model.fusion.kind == "sequential"
    assert isinstance(build.build_experiment(loaded).tracker, Central)


def of_decisions(loaded: Scenario) -> Any:
    planner: Any = build.build_planner(loaded, "jdm")
    return planner.fusion


@pytest.mark.parametrize(
    ("kind", "filters", "rule", "of_decision"),
    [
        (
            "clmb, field_of_view_weighting: true",
            "lmb",
            Clmb((0.5, 0.5), field_of_view_weighting=True),
            ParallelUpdate(),
        ),
        (
            "arithmetic_average, field_of_view_weighting: true",
            "lmb",
            ArithmeticAverage((0.5, 0.5), True),
            ParallelUpdate(),
        ),
        ("arithmetic_average", "m_delta_glmb", ArithmeticAverage((0.5, 0.5)), ParallelUpdate()),
        ("clmb, matching: assignment", "lmb", LabelMatchedFusion(Clmb((0.5, 0.5))), Clmb((0.5, 0.5))),
        (
            "cm_delta_glmb, matching: assignment",
            "delta_glmb",
            LabelMatchedFusion(CmDeltaGlmb((0.5, 0.5))),
            CmDeltaGlmb((0.5, 0.5)),
        ),
        ("parallel", "lmb", ParallelUpdate(), ParallelUpdate()),
    ],
)
def test_decisions_take_scans_in_full_or_go_by_plain_covariance_intersection(
    kind: str, filters: str, rule: Any, of_decision: Any
) -> None:
    loaded = scenario(
        ("kind: m_delta_glmb", f"kind: {filters}"),
        ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", f"{{kind: {kind}, limits: {{merge_distance: 1.0}}}}"),
    )
    tracker: Any = build.build_experiment(loaded).tracker
    for made, expected in ((tracker.fusion, rule), (of_decisions(loaded), of_decision)):
        if isinstance(expected, LabelMatchedFusion):
            made, expected = made.rule, expected.rule
        assert type(made) is type(expected)
        if not isinstance(expected, ParallelUpdate):
            assert made.weights == expected.weights
            assert made.limits.merge_distance == 1.0
        assert getattr(made, "field_of_view_weighting", False) == getattr(expected, "field_of_view_weighting", False)
    assert tracker.feedback == (kind == "parallel")
    assert isinstance(tracker.fusion, LabelMatchedFusion) == ("matching" in kind)
    assert kind.split(",")[0] in dict(summary_rows(loaded.model))["fusion"]
    assert ("by views" in dict(summary_rows(loaded.model))["fusion"]) == ("field_of_view_weighting" in kind)


CENTRAL = [
    ("delta_glmb", MultiSensorGlmbFilter),
    ("m_delta_glmb", MultiSensorGlmbFilter),
    ("lmb", MultiSensorLmbFilter),
]


@pytest.mark.parametrize(("kind", "container"), CENTRAL)
def test_one_filter_may_take_the_scans_of_all_sensors(kind: str, container: type) -> None:
    loaded = scenario(
        ("kind: m_delta_glmb", f"kind: {kind}, limits: {{max_hypotheses: 9}}"),
        ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: central}"),
    )
    tracker: Any = build.build_experiment(loaded).tracker
    assert isinstance(tracker, Central)
    assert isinstance(tracker.filter, container)
    assert tracker.filter.limits.max_hypotheses == 9  # type: ignore[attr-defined]
    assert getattr(tracker.filter, "marginalised", False) == (kind == "m_delta_glmb")
    planner: Any = build.build_planner(loaded, "jdm")
    assert planner.fusion == ParallelUpdate()
    assert {type(sensor.filter.initial()) for sensor in planner.sensors} == {type(tracker.initial().fused)}
    assert f"2 sensors; filter {kind}, fusion central, " in summary_line(loaded)
    assert ("fusion", "central: one filter takes the scans of all sensors") in summary_rows(loaded.model)
    assert not any("GCI" in caution for caution in scenario_warnings(loaded))


def test_the_marginal_estimator_has_its_threshold() -> None:
    estimate = MarginalEstimator(threshold=0.9).build(Path())
    for empty in (GLMB.empty(4), LMB.empty(4)):
        assert len(estimate(empty, 1).labels) == 0


GOSPA_REWARD = ("decision_steps: [4, 8]}", "decision_steps: [4, 8], reward: {kind: expected_gospa, cutoff: 30.0}}")


@pytest.mark.parametrize(
    ("filters", "changes", "kind"),
    [
        ("factored_glmb", [], "least_ospa"),
        ("factored_glmb", [GOSPA_REWARD], "least_gospa"),
        ("m_delta_glmb", [GOSPA_REWARD], "map"),
        ("lmb", [], "map"),
    ],
)
def test_the_default_estimator_follows_filter_and_reward(filters: str, changes: Any, kind: str) -> None:
    fusion = "{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: sequential}"
    loaded = scenario(
        ("kind: m_delta_glmb", f"kind: {filters}"),
        fusion,
        ("estimator: {kind: marginal, threshold: 0.6}\n", ""),
        *changes,
    )
    assert loaded.model.estimates_by.kind == kind
    given = replace_fields(loaded, {"estimator": {"kind": "marginal"}})
    assert given.model.estimates_by.kind == "marginal"
    assert replace_fields(given, {"estimator": None}).model.estimates_by.kind == kind


@pytest.mark.parametrize(
    ("given", "cutoff", "order"),
    [("", 50.0, 1.0), (", order: 2.0", 50.0, 2.0), (", cutoff: 9.0, order: 3.0", 9.0, 3.0)],
)
def test_the_estimator_of_least_gospa_has_the_scores_cutoff_and_order(given: str, cutoff: float, order: float) -> None:
    loaded = scenario(("{kind: marginal, threshold: 0.6}", f"{{kind: least_gospa{given}}}"))
    section = loaded.model.estimates_by
    assert (section.cutoff, section.order) == (cutoff, order)
    assert ("estimate", f"least gospa, cutoff {cutoff:g} m, order {order:g}") in summary_rows(loaded.model)
    belief = LMB.from_bernoullis([(1, 0)], [0.8], np.zeros((1, 4)), [np.eye(4) * 144.0])
    wanted = least_gospa_estimate(belief, cutoff, order)
    assert len(section.build(Path())(belief, 1)) == len(wanted) == (cutoff == 50.0)
    rebuilt = replace_fields(loaded, {"ospa.cutoff": 200.0})
    assert rebuilt.model.estimates_by.cutoff == (200.0 if cutoff == 50.0 else 9.0)


def test_actions_of_one_sensor_and_of_all() -> None:
    text = "platform: {kind: heading, speed: 5.0, headings_deg: [-10, 10], relative: true}"
    shared = "sensor_defaults:\n  platform: {kind: heading, speed: 5.0}"
    loaded = scenario(("heading_deg: 4.0", text), ("sensor_defaults:", shared))
    own, common = (sensor.platform for sensor in build.build_sensors(loaded))
    pose = np.array([0.0, 0.0, math.pi / 2])
    np.testing.assert_allclose(own.actions(pose)[:, 0], [80.0, 100.0])
    np.testing.assert_allclose(common.actions(pose)[:, 0], np.arange(-180, 181, 30))


NAMED = """
planners:
  ascent: {kind: joint, search: {kind: coordinate_ascent}}
  bhattacharyya: {kind: joint, reward: {kind: renyi}}
  alone: {kind: independent, reward: {kind: renyi}}
  as it is: {kind: joint}
"""


def test_named_strategies_replace_their_own_parts_alone() -> None:
    named = Scenario(parse_scenario(MINIMAL + NAMED))
    plain = build.build_planner(named, "jdm")
    settings = replace(named.model.control.build(named.model.horizon), end=float(named.model.time.build()[-1]))
    assert isinstance(plain, JointPlanner)
    found: dict[str, Any] = {name: build.build_planner(named, name) for name in named.model.planners}
    assert [planner.name for planner in found.values()] == ["ascent", "bhattacharyya", "alone", "as it is"]
    inner: dict[str, Any] = {
        name: planner.planner for name, planner in found.items() if isinstance(planner, NamedPlanner)
    }
    assert [type(planner) for planner in inner.values()] == [
        JointPlanner,
        JointPlanner,
        IndependentPlanner,
        JointPlanner,
    ]
    assert all(planner.settings == settings for planner in inner.values())
    searches = [planner.search for planner in inner.values() if isinstance(planner, JointPlanner)]
    assert searches == [CoordinateAscent(2), plain.search, plain.search]
    assert [planner.reward for planner in inner.values()] == [plain.reward, RenyiReward(), RenyiReward(), plain.reward]


@pytest.mark.parametrize(("name", "presumed"), [("paper-a", "absent"), ("paper-e", "absent"), ("eight-mobile", "stay")])
def test_only_in_the_paper_scenes_do_sensors_presume_that_there_are_no_others(name: str, presumed: str) -> None:
    planners = {"own": {"kind": "independent"}, "paper": {"kind": "independent", "others": "absent"}}
    scenario = replace_fields(load_scenario(name), {"planners": planners})
    found: dict[str, Any] = {own: build.build_planner(scenario, own) for own in ("idm", "own", "paper")}
    assert [found["idm"].others, found["own"].planner.others, found["paper"].planner.others] == [
        presumed,
        presumed,
        "absent",
    ]


def test_named_strategies_need_labels_too() -> None:
    text = changed(
        ("{kind: m_delta_glmb}", "{kind: phd}"),
        ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: none}"),
        ("{kind: marginal, threshold: 0.6}", "{kind: map}"),
    )
    text = text.replace("  - {name: south, position: [0.0, -40.0]}\n", "")
    with pytest.raises(
        ScenarioError, match=r"planners\.ascent\.kind: expected nearest, .*, as phd filters have no labels"
    ):
        parse_scenario(text + NAMED)


def test_first_states_of_targets_have_their_spread_in_the_librarys_order() -> None:
    drawn = ("end_step: 18", "end_step: 18, std: [3.0, 4.0, 0.5, 0.25]")
    assert targets_of(scenario()).initial_stds is None
    np.testing.assert_array_equal(targets_of(scenario(drawn)).initial_stds, [[3.0, 4.0, 0.5, 0.25]])
    other = ("{kind: constant_velocity, sigma_v: 1.0}", "{kind: constant_velocity, state_order: interleaved}")
    np.testing.assert_array_equal(targets_of(scenario(drawn, other)).initial_stds, [[3.0, 0.5, 4.0, 0.25]])


def targets_of(built: Scenario) -> ScriptedTargets:
    source = build.build_targets(built)
    assert isinstance(source, ScriptedTargets)
    return source


@pytest.mark.parametrize(
    ("score", "reward"),
    [
        ("ospa: {cutoff: 50.0,", ExpectedLossReward(50.0)),
        ("ospa: {cutoff: 50.0, order: 2.0,", ExpectedLossReward(50.0, 2.0)),
        ("ospa: {order: 2.0,", ExpectedLossReward(100.0, 2.0)),
        ("ospa: {cutoff: 5.0, order: 2.0, components: state,", ExpectedLossReward()),
    ],
)
def test_default_reward_is_the_scored_error(score: str, reward: ExpectedLossReward) -> None:
    """Where that is of positions."""
    text = changed(("ospa: {cutoff: 50.0,", score))
    for name in ("jdm", "idm", "lookahead"):
        built: Any = build.build_planner(Scenario(parse_scenario(text), Path("f.yaml")), name)
        assert built.reward == reward
        named = text.replace("decision_steps: [4, 8]", "decision_steps: [4, 8], reward: {kind: cauchy_schwarz}")
        other: Any = build.build_planner(Scenario(parse_scenario(named), Path("f.yaml")), name)
        assert other.reward == CauchySchwarzReward()


def test_an_unknown_planner() -> None:
    loaded = scenario()
    known = (
        "jdm, idm, lookahead, nearest, assigned_target, centroid, oracle, true_targets, random, constant, stationary"
    )
    with pytest.raises(InputError, match=f"planner: expected one of {known}; got 'greedy'"):
        build.build_planner(loaded, "greedy")


def tracked(loaded: Scenario, num_steps: int, rng: np.random.Generator) -> tuple[Any, Any, Any]:
    """The experiment, what is believed after some scans with the sensors at rest, and the truth."""
    experiment: Any = build.build_experiment(loaded)
    tracker, poses, rngs = experiment.tracker, experiment.poses, [rng] * experiment.num_sensors
    truth, state = experiment.targets.truth(experiment.times, rng=rng), tracker.initial()
    for step in range(num_steps):
        scans = simulate_scans(truth.at(step)[1], poses, tracker.sensors, rngs=rngs)
        state, _ = tracker.step(state, [scan.measurements for scan in scans], poses, experiment.times[step], rngs=rngs)
    return experiment, state, truth


@pytest.mark.parametrize("name", list_builtin())
def test_built_in_scenarios_run(name: str) -> None:
    loaded, rng = load_scenario(name), np.random.default_rng(1)
    experiment, state, truth = tracked(loaded, 12, rng)
    assert abs(len(experiment.estimate(state.fused, 12).labels) - len(truth.at(11)[0])) <= 1
    for planner in ("random", "constant"):
        decides: Any = build.build_planner(loaded, planner)
        plan = decides.plan(state, experiment.poses, rng=rng)
        assert plan.num_sensors == experiment.num_sensors


def test_decisions_of_the_papers_scenario_are_the_printed_ones() -> None:
    loaded, rng = load_scenario("paper-e"), np.random.default_rng(3)
    experiment, state, _ = tracked(loaded, 10, rng)
    for planner in ("jdm", "idm"):
        decides: Any = build.build_planner(loaded, planner)
        plan = decides.plan(state, experiment.poses, rng=rng)
        np.testing.assert_allclose(np.ravel(plan.chosen_actions), [-30.0, 30.0])
