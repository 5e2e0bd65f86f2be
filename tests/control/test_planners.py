"""Properties of plans: what is chosen, what is kept as evidence, and what must not change it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import (
    ABSENT,
    HEADINGS,
    SETTINGS,
    A,
    B,
    Situation,
    evaluator_of,
    glmb,
    mobile_sensor,
    sample_rewards,
    situation,
)
from vedette import models
from vedette.control import (
    CauchySchwarzReward,
    ConstantPlanner,
    IndependentPlanner,
    JointPlanner,
    Plan,
    PlanningSettings,
    RandomPlanner,
)
from vedette.densities import GLMB, LMB, TrackTable
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.platforms import PAPER_HEADINGS_DEG, Actions, HeadingPlatform

KINDS = ["delta", "marginal", "lmb"]
PAPER = HeadingPlatform(30.0)


def planners(example: Situation, reward: Any = None) -> tuple[JointPlanner, IndependentPlanner]:
    given = example.sensors, example.fusion, example.settings, reward or CauchySchwarzReward("reference")
    return JointPlanner(*given), ABSENT(*given)


def plans(example: Situation, reward: Any = None, seed: int = 5) -> tuple[Plan, Plan]:
    """The joint and the independent decision."""
    both = [planner.plan(*example.arguments, rng=np.random.default_rng(seed)) for planner in planners(example, reward)]
    for plan in both:
        plan.validate()
    return both[0], both[1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_the_joint_choice_is_never_worse_than_the_independent_one(kind: str, seed: int) -> None:
    joint, independent = plans(situation(kind, 3, seed), seed=seed)
    (table,) = joint.tables
    assert table.sensors == (0, 1, 2)
    assert table.mean[joint.chosen] == table.mean.max()
    assert table.mean[joint.chosen] >= table.mean[independent.chosen]
    for s, own in enumerate(independent.tables):
        assert own.sensors == (s,)
        assert own.mean[independent.chosen[s]] == own.mean.max()


@pytest.mark.parametrize("kind", KINDS)
def test_tables_hold_mean_and_standard_error_over_the_samples(kind: str) -> None:
    example = situation(kind)
    joint, independent = plans(example)
    evaluator = evaluator_of(example, CauchySchwarzReward("reference"))
    samples = sample_rewards(evaluator, (0, 1), example.fusion).reshape(3, 3, SETTINGS.num_samples)
    np.testing.assert_allclose(joint.tables[0].mean, samples.mean(axis=2), rtol=1e-12)
    np.testing.assert_allclose(
        joint.tables[0].standard_error, samples.std(axis=2, ddof=1) / np.sqrt(SETTINGS.num_samples), rtol=1e-12
    )
    for s, table in enumerate(independent.tables):
        own = sample_rewards(evaluator, (s,), None)
        np.testing.assert_allclose(table.mean, own.mean(axis=1), rtol=1e-12)
        np.testing.assert_allclose(
            table.standard_error, own.std(axis=1, ddof=1) / np.sqrt(SETTINGS.num_samples), rtol=1e-12
        )


def test_one_sample_has_no_spread() -> None:
    joint, _ = plans(situation("marginal", settings=replace(SETTINGS, num_samples=1)))
    assert (joint.tables[0].standard_error == 0.0).all()


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_west_and_west_share_a_value_and_are_evaluated_once(kind: str) -> None:
    example = situation(kind)
    example = replace(example, sensors=tuple(replace(sensor, platform=PAPER) for sensor in example.sensors))
    joint, independent = plans(example)
    num_samples, num_steps = SETTINGS.num_samples, SETTINGS.horizon_steps
    table = joint.tables[0].mean
    assert table.shape == (13, 13)
    np.testing.assert_array_equal(table[0], table[-1])
    np.testing.assert_array_equal(table[:, 0], table[:, -1])
    assert [len(own.mean) for own in independent.tables] == [13, 13]
    assert joint.actions[0].columns == ("heading_deg",)
    np.testing.assert_array_equal(joint.actions[0].values[:, 0], PAPER_HEADINGS_DEG)
    filter_steps = 2 * 12 * num_samples * num_steps
    pairs = 12 * 12 * num_samples
    assert joint.counts == {"filter_steps": filter_steps, "fusions": pairs, "divergences": pairs}
    assert independent.counts == {
        "filter_steps": filter_steps,
        "fusions": 0,
        "divergences": 2 * 12 * num_samples,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_equal_rewards_go_to_the_first_in_printed_order(kind: str) -> None:
    # At no speed all headings are one place.
    joint, independent = plans(situation(kind, platform=HeadingPlatform(0.0, (120.0, -60.0, 0.0))))
    assert np.ptp(joint.tables[0].mean) == 0.0
    assert joint.chosen == independent.chosen == (0, 0)


def symmetric(kind: str, headings: tuple[float, ...]) -> Situation:
    """One target known to be straight ahead of both sensors, which stand behind each other on its course."""
    detection = models.constant_detection(0.95)
    sensors = tuple(
        mobile_sensor(kind, platform=HeadingPlatform(30.0, headings), detection=detection) for _ in range(2)
    )
    known = [600.0, 0.0, 10.0, 0.0]
    cov = np.diag([900.0, 900.0, 25.0, 25.0])
    belief: Any = LMB.from_bernoullis([A], [0.99], [known], [cov])
    sure: Any = LMB.from_bernoullis([A], [1.0], [known], [1e-18 * np.eye(4)])
    if kind != "lmb":
        belief = GLMB.from_hypotheses(TrackTable.from_gaussians([A], [known], [cov]), [[0], []], [0.99, 0.01])
        sure = GLMB.from_hypotheses(TrackTable.from_gaussians([A], [known], [1e-18 * np.eye(4)]), [[0]], [1.0])
    fusion: Any = Clmb((0.5, 0.5)) if kind == "lmb" else CmDeltaGlmb((0.5, 0.5))
    poses = np.array([[0.0, 0.0, 0.0], [-300.0, 0.0, 0.0]])
    return Situation(sensors, fusion, SETTINGS, (belief, belief), sure, poses)


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_mirrored_actions_tie_and_the_first_is_taken(kind: str) -> None:
    first = symmetric(kind, (-60.0, 60.0, 180.0))
    joint, independent = plans(first)
    table = joint.tables[0].mean
    np.testing.assert_allclose(table[:2, :2], table[1::-1, 1::-1], rtol=1e-9)
    for own in independent.tables:
        assert own.mean[0] == pytest.approx(own.mean[1], rel=1e-9)
        assert own.mean[0] > own.mean[2] + 1e-3
    assert independent.chosen == (0, 0)
    assert joint.chosen[0] == 0
    # Printed the other way round, the other one is the first.
    joint, independent = plans(symmetric(kind, (60.0, -60.0, 180.0)))
    assert independent.chosen == (0, 0)
    assert joint.chosen[0] == 0


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_nearer_is_better_where_noise_grows_with_distance(kind: str) -> None:
    _, independent = plans(symmetric(kind, (0.0, 90.0, 180.0)))
    for table in independent.tables:
        assert (np.diff(table.mean) < -1e-3).all()


@pytest.mark.parametrize("kind", ["marginal", "lmb"])
def test_a_sensor_that_sees_only_what_is_near_goes_there(kind: str) -> None:
    example = symmetric(kind, (180.0, 90.0, 0.0, -90.0))
    short_sighted = models.limited_range(0.95, 450.0)
    sensors = tuple(
        mobile_sensor(kind, sensor.platform, detection=short_sighted, noise=models.constant_noise([0.02, 10.0]))
        for sensor in example.sensors
    )
    example = replace(example, sensors=sensors)
    joint, independent = plans(example)
    # Only the first sensor can come near enough within the horizon, to 600 + 80 - 240 m; the second stays blind.
    assert joint.chosen[0] == independent.chosen[0] == 2
    example = replace(example, poses=example.poses[::-1].copy())
    joint, independent = plans(example)
    assert joint.chosen[1] == independent.chosen[1] == 2


def moved_labels(density: Any) -> Any:
    """The same density with other labels, in the same order."""
    tracks = replace(density.tracks, labels=3 * density.tracks.labels + [[7, 2]])
    return replace(density, tracks=tracks)


@pytest.mark.parametrize("kind", KINDS)
def test_relabelling_changes_nothing(kind: str) -> None:
    example = situation(kind, 3)
    renamed = replace(
        example,
        beliefs=tuple(moved_labels(belief) for belief in example.beliefs),
        fused=moved_labels(example.fused),
    )
    for first, second in zip(plans(example), plans(renamed), strict=True):
        assert first.chosen == second.chosen
        for a, b in zip(first.tables, second.tables, strict=True):
            np.testing.assert_allclose(a.mean, b.mean, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_order_of_the_sensors_turns_the_table_and_nothing_else(kind: str) -> None:
    example, order = situation(kind, 3), [2, 0, 1]
    turned = replace(
        example,
        sensors=tuple(example.sensors[s] for s in order),
        beliefs=tuple(example.beliefs[s] for s in order),
        fusion=replace(example.fusion, weights=[example.fusion.weights[s] for s in order]),
        poses=example.poses[order],
    )
    (first, alone), (second, turned_alone) = plans(example), plans(turned)
    np.testing.assert_allclose(second.tables[0].mean, first.tables[0].mean.transpose(order), rtol=1e-9)
    assert second.chosen == tuple(first.chosen[s] for s in order)
    for s, table in enumerate(turned_alone.tables):
        np.testing.assert_allclose(table.mean, alone.tables[order[s]].mean, rtol=1e-9)


def test_an_action_has_the_same_reward_whatever_the_others_are() -> None:
    example = situation("marginal")
    fewer = replace(
        example,
        sensors=tuple(replace(sensor, platform=HeadingPlatform(30.0, HEADINGS[1:])) for sensor in example.sensors),
    )
    for all_of_them, some in zip(plans(example), plans(fewer), strict=True):
        for large, small in zip(all_of_them.tables, some.tables, strict=True):
            np.testing.assert_array_equal(large.mean[(slice(1, None),) * large.mean.ndim], small.mean)


def test_two_alike_sensors_in_one_place_have_one_table() -> None:
    example = situation("marginal")
    example = replace(example, beliefs=(example.beliefs[0],) * 2, poses=example.poses[[0, 0]])
    joint, independent = plans(example)
    np.testing.assert_array_equal(independent.tables[0].mean, independent.tables[1].mean)
    example = replace(example, fusion=replace(example.fusion, weights=(0.5, 0.5)))
    joint, _ = plans(example)
    np.testing.assert_allclose(joint.tables[0].mean, joint.tables[0].mean.T, rtol=1e-12)


def test_changes_of_heading_are_headings_from_the_present_one() -> None:
    example = situation("marginal")
    poses = example.poses.copy()
    poses[:, 2] = np.radians([170.0, -30.0])
    turns = replace(
        example,
        poses=poses,
        sensors=tuple(
            replace(sensor, platform=HeadingPlatform(30.0, (-30.0, 0.0, 30.0), relative=True))
            for sensor in example.sensors
        ),
    )
    headings = ((140.0, 170.0, -160.0), (-60.0, -30.0, 0.0))
    absolute = replace(
        turns,
        sensors=tuple(
            replace(sensor, platform=HeadingPlatform(30.0, values))
            for sensor, values in zip(example.sensors, headings, strict=True)
        ),
    )
    for first, second in zip(plans(turns), plans(absolute), strict=True):
        np.testing.assert_allclose(first.chosen_actions, second.chosen_actions, atol=1e-9)
        for own, expected in zip(first.actions, headings, strict=True):
            np.testing.assert_allclose(own.values[:, 0], expected, atol=1e-9)
        for a, b in zip(first.tables, second.tables, strict=True):
            np.testing.assert_allclose(a.mean, b.mean, rtol=1e-9)


def test_one_sensor_with_one_action() -> None:
    example = situation("marginal", 1, platform=HeadingPlatform(30.0, (25.0,)))
    joint, independent = plans(example)
    assert joint.chosen == independent.chosen == (0,)
    assert joint.tables[0].mean.shape == (1,)
    np.testing.assert_allclose(joint.tables[0].mean, independent.tables[0].mean, rtol=1e-9)


def test_a_sensor_that_knows_of_no_target_has_nothing_to_gain() -> None:
    example = situation("lmb")
    beliefs = (example.beliefs[0], LMB.empty(4))
    joint, independent = plans(replace(example, beliefs=beliefs, fused=example.fusion.fuse(beliefs)[0]))
    assert (independent.tables[1].mean == 0.0).all()
    np.testing.assert_allclose(joint.tables[0].mean, joint.tables[0].mean[:, :1].repeat(3, axis=1))


def test_the_default_settings_take_the_papers_number_of_steps() -> None:
    rng = np.random.default_rng(3)
    example = situation("marginal", settings=PlanningSettings())
    beliefs = (glmb([(A, B), (A,)], rng), glmb([(A, B), (B,)], rng))
    example = replace(example, beliefs=beliefs, fused=example.fusion.fuse(beliefs)[0])
    joint, _ = plans(example)
    assert joint.counts["filter_steps"] == 2 * 3 * 40 * 5


def test_random_control_takes_each_direction_equally_often() -> None:
    sensors = (mobile_sensor("lmb", PAPER), mobile_sensor("lmb", HeadingPlatform(30.0, (10.0,))))
    planner, rng = RandomPlanner(sensors), np.random.default_rng(0)
    chosen = [planner.plan(None, np.zeros((2, 3)), rng=rng) for _ in range(1200)]  # type: ignore[arg-type]
    counts = np.bincount([plan.chosen[0] for plan in chosen], minlength=13)
    assert counts[12] == 0
    assert (abs(counts[:12] - 100) < 5 * np.sqrt(100)).all()
    assert {plan.chosen[1] for plan in chosen} == {0}
    assert (chosen[0].planner, chosen[0].tables, chosen[0].counts) == ("random", (), {})


def test_a_fixed_action_is_kept() -> None:
    planner = ConstantPlanner((Actions.of(heading_deg=30.0), Actions.of(dx=-45.0, dy=1.0)))
    plan = planner.plan(None, np.zeros((2, 3)), rng=np.random.default_rng(0))  # type: ignore[arg-type]
    assert [row.tolist() for row in plan.chosen_actions] == [[30.0], [-45.0, 1.0]]
    plan.validate()
