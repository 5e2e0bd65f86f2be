"""What a sensor that decides by itself presumes of the others: that they stay as they are, or that there are none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import ABSENT, KNOWN, SETTINGS, additive_of, decided, situation
from control.plain_loop import plain_rewards
from control.test_additive import plain_loss, shared
from control.test_racing import certain
from vedette.control import (
    CauchySchwarzReward,
    ExpectedLossReward,
    IndependentPlanner,
    JointPlanner,
    SequentialGreedy,
)
from vedette.control.constraints.mask import Mask
from vedette.control.inputs import options_of, stationary_courses
from vedette.platforms import GridPlatform, HeadingPlatform, MountedPlatform, Pointing, options_at

LOSS = ExpectedLossReward(60.0)
TIMES = np.array([1.0, 2.0])


def one_scan(example: Any) -> Any:
    """With one scan of each sensor, at the end of a horizon of one step, as the plain formula has it."""
    settings = replace(KNOWN, horizon_steps=1)
    last = np.array([example.state.time + settings.horizon_period])
    return replace(example, settings=settings, sensors=tuple(replace(own, scan_times=last) for own in example.sensors))


def stay_of(example: Any) -> tuple[int, ...]:
    return stationary_courses(options_of(example.sensors, example.poses, example.settings), None)


@pytest.mark.parametrize("seed", [1, 2])
def test_each_sensor_takes_what_is_best_while_the_others_stay(seed: int) -> None:
    """All rewards by the formula of the expected loss; the enumeration of one sensor's courses, the others staying."""
    example = one_scan(shared(3, seed))
    evaluator, stay = additive_of(example, LOSS), stay_of(example)
    plan = decided(example, IndependentPlanner, LOSS)
    for s, table in enumerate(plan.tables):
        worth = [plain_loss(example, evaluator, (*stay[:s], own, *stay[s + 1 :])) for own in range(3)]
        np.testing.assert_allclose(table.mean, worth, rtol=1e-9)
        assert plan.chosen[s] == int(np.argmax(worth))
    absent = decided(example, ABSENT, LOSS)
    assert not np.allclose(absent.tables[0].mean, plan.tables[0].mean)


@pytest.mark.parametrize("kind", ["delta", "lmb"])
def test_case_by_case_the_rewards_are_of_densities_fused_with_those_of_sensors_that_stay(kind: str) -> None:
    example = situation(kind)
    joint, alone = plain_rewards(example, 1.0, 1)
    means, stay = joint.mean(axis=1).reshape(3, 3), stay_of(example)
    plan = decided(example, IndependentPlanner, CauchySchwarzReward())
    np.testing.assert_allclose(plan.tables[0].mean, means[:, stay[1]], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(plan.tables[1].mean, means[stay[0]], rtol=1e-9, atol=1e-9)
    absent = decided(example, ABSENT, CauchySchwarzReward())
    for table, own in zip(absent.tables, alone, strict=True):
        np.testing.assert_allclose(table.mean, own.mean(axis=1), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("order", ["sensor_order", "best_first"])
@pytest.mark.parametrize("kind", ["delta", "lmb"])
def test_greedy_decides_one_by_one_while_the_undecided_stay(order: Any, kind: str) -> None:
    """By enumeration on the joint table; rewards may be of any kind."""
    example = situation(kind, 3, 2)
    table, at = decided(example, JointPlanner, LOSS if kind == "lmb" else None).tables[0].mean, list(stay_of(example))
    undecided = [0, 1, 2]
    while undecided:
        worth = {
            (s, action): table[(*at[:s], action, *at[s + 1 :])] for s in undecided for action in range(table.shape[s])
        }
        considered = undecided if order == "best_first" else undecided[:1]
        s, at_s = max((key for key in worth if key[0] in considered), key=worth.__getitem__)
        at[s] = at_s
        undecided.remove(s)
    found = decided(example, JointPlanner, LOSS if kind == "lmb" else None, search=SequentialGreedy(order))
    assert found.chosen == tuple(at)
    assert table[found.chosen] >= table[stay_of(example)]


def test_a_race_presumes_the_same() -> None:
    """In every round, with courses left out."""
    example = certain(situation("lmb", 3, 3, KNOWN))
    reward, stay = CauchySchwarzReward("reference"), stay_of(example)
    plan = decided(example, IndependentPlanner, reward, seed=5)
    assert plan.certainty is not None
    settings = replace(example.settings, confidence=None, num_samples=2000)
    table = decided(replace(example, settings=settings), JointPlanner, reward).tables[0]
    for s, own in enumerate(plan.tables):
        line = tuple(slice(None) if s == other else stay[other] for other in range(3))
        error = np.hypot(own.standard_error, table.standard_error[line])
        assert (np.abs(own.mean - table.mean[line]) < 4.0 * error).all()


def test_it_is_explained_by_what_each_sensor_adds_to_those_that_stay() -> None:
    example = shared(3, 2)
    joint, stay = additive_of(example, LOSS).joint(), np.array(stay_of(example))
    plan = decided(example, IndependentPlanner, LOSS)
    why, rows = plan.explain(), []
    for s, chosen in enumerate(plan.chosen):
        own, without = stay.copy(), stay.copy()
        own[s], without[s] = chosen, -1
        rows.append(joint(np.array([own, without]))[:, 0])
    with_it, without_it = np.array(rows).T
    assert why.reward == pytest.approx(with_it.sum())
    assert why.baseline == pytest.approx(without_it.sum())
    assert why.of_sensors is not None
    np.testing.assert_allclose(why.of_sensors, with_it - without_it, atol=1e-9)
    assert why.of_targets is not None
    assert why.baseline + why.of_targets.total.sum() == pytest.approx(why.reward)
    assert why.counterfactual(1, 0).difference == pytest.approx(
        plan.tables[1].mean[0] - plan.tables[1].mean[plan.chosen[1]]
    )


CAMERA = [0.0, 0.0, 0.5, np.radians(170.0), 0.3]


@pytest.mark.parametrize(
    ("platform", "pose", "wanted"),
    [
        (HeadingPlatform(5.0), [3.0, 4.0, np.radians(61.0)], [60.0]),
        (HeadingPlatform(5.0), [0.0, 0.0, np.radians(-179.0)], [-180.0]),
        (HeadingPlatform((5.0, 8.0), (0.0, 90.0)), [0.0, 0.0, 1.5], [90.0, 5.0]),
        (HeadingPlatform(0.0, (-20.0, 0.0, 20.0), relative=True), [0.0, 0.0, np.pi / 2], [90.0]),
        (GridPlatform(10.0, 5.0), [0.0, 0.0, 0.0], [0.0, 0.0]),
        (GridPlatform(10.0, 5.0, allow_staying=False), [0.0, 0.0, np.radians(50.0)], None),
        (Pointing((-170.0, 150.0)), CAMERA, [-170.0]),
        (MountedPlatform(GridPlatform(10.0, 5.0), Pointing((0.0, 160.0))), CAMERA, [0.0, 0.0, 160.0]),
    ],
)
def test_a_sensor_that_stays_changes_its_pose_least(platform: Any, pose: list[float], wanted: Any) -> None:
    options = options_at("platform", platform, np.array(pose), TIMES)
    (course,) = stationary_courses((options,), None)
    action = options.actions.values[options.first_action(course)]
    expected = 10.0 * np.sqrt([0.5, 0.5]) if wanted is None else wanted
    np.testing.assert_allclose(action, expected, atol=1e-9)


def test_a_sensor_does_not_stay_on_a_course_that_is_forbidden() -> None:
    options = options_at("platform", HeadingPlatform(5.0, (0.0, 40.0, 180.0)), np.array([0.0, 0.0, 0.0]), TIMES)
    assert stationary_courses((options,), Mask((np.array([False, True, True]),))) == (1,)
    assert stationary_courses((options,), Mask((np.zeros(3, bool),))) == (0,)


def test_settings_of_the_presumption_are_checked() -> None:
    example = situation("lmb", settings=SETTINGS)
    gone: Any = "gone"
    with pytest.raises(ValueError, match="others: expected one of stay, absent; got gone"):
        decided(example, IndependentPlanner, others=gone)


def test_one_sensor_has_nobody_to_presume_of() -> None:
    example = shared(1, 3)
    stay, absent = (decided(example, kind, LOSS) for kind in (IndependentPlanner, ABSENT))
    np.testing.assert_allclose(stay.tables[0].mean, absent.tables[0].mean, rtol=1e-12)
    assert stay.chosen == absent.chosen
