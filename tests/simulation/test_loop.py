"""The loop: what a run records, and that its random numbers are those of its seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vedette.control import ConstantPlanner, RandomPlanner
from vedette.errors import InputError
from vedette.platforms import Actions
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_sensors
from vedette.simulation.journal import STAGES
from vedette.simulation.loop import simulate


def no_score(truth, estimates):
    return np.zeros((truth.num_scans, 3))


@pytest.fixture(scope="module")
def shortened():
    """paper-e, fourteen scans, one decision."""
    whole = build_experiment(load_scenario("paper-e"))
    return replace(whole, times=whole.times[:14], decision_steps=(10,))


def run(experiment, planner, **overrides):
    return simulate(experiment, planner, **{"seed": 3, "run": 0, "score": no_score, **overrides})


def test_without_a_planner_sensors_never_move(shortened):
    record = run(shortened, None)
    np.testing.assert_array_equal(record.poses, np.broadcast_to(shortened.poses, record.poses.shape))
    assert record.planner == "stationary"
    assert record.decisions == ()
    assert len(record.estimates) == record.num_scans == 14


def test_sensors_lie_still_until_the_first_decision_and_then_keep_its_course(shortened):
    record = run(shortened, ConstantPlanner((Actions.of(heading_deg=-30.0), Actions.of(heading_deg=45.0))))
    (decision,) = record.decisions
    assert (decision.step, decision.time) == (10, 10.0)
    np.testing.assert_array_equal(record.poses[9], shortened.poses)
    for later in range(10, 14):
        expected = shortened.poses.copy()
        for pose, angle, platform in zip(expected, np.radians([-30.0, 45.0]), shortened.platforms, strict=True):
            pose += (later - 9.0) * platform.speed * np.array([np.cos(angle), np.sin(angle), 0.0])
            pose[2] = angle
        np.testing.assert_allclose(record.poses[later], expected, atol=1e-9)


def test_a_sensor_may_be_under_way_from_the_start(shortened):
    record = run(
        replace(shortened, first_actions=(np.zeros(1), None)), ConstantPlanner((Actions.of(heading_deg=0.0),) * 2)
    )
    assert record.poses[1, 0, 0] == pytest.approx(shortened.poses[0, 0] + shortened.platforms[0].speed)
    np.testing.assert_array_equal(record.poses[1, 1], shortened.poses[1])


def test_equal_seeds_give_equal_runs_and_other_run_numbers_other_ones(shortened):
    first, again, other = run(shortened, None), run(shortened, None), run(shortened, None, run=1)
    for mine, same in zip(first.estimates, again.estimates, strict=True):
        assert mine.means.tobytes() == same.means.tobytes()
        assert mine.labels.tobytes() == same.labels.tobytes()
    assert any(
        mine.means.shape != another.means.shape or not np.array_equal(mine.means, another.means)
        for mine, another in zip(first.estimates, other.estimates, strict=True)
    )


def test_strategies_are_alike_until_they_decide(shortened):
    still, random = run(shortened, None), run(shortened, RandomPlanner(build_sensors(load_scenario("paper-e"))))
    for k in range(10):
        np.testing.assert_array_equal(still.estimates[k].means, random.estimates[k].means)
    np.testing.assert_array_equal(still.truth.states, random.truth.states)


def test_feedback_gives_every_sensor_the_fused_belief(shortened):
    plain, fed = run(shortened, None), run(replace(shortened, tracker=replace(shortened.tracker, feedback=True)), None)
    assert any(
        len(mine.means) != len(other.means) or not np.array_equal(mine.means, other.means)
        for mine, other in zip(plain.estimates[3:], fed.estimates[3:], strict=True)
    )


def test_unequal_scan_times_move_sensors_by_the_time_between(shortened):
    times = np.array([1.0, 2.0, 4.0, 4.5])
    uneven = replace(shortened, times=times, decision_steps=(1,))
    record = run(uneven, ConstantPlanner((Actions.of(heading_deg=0.0),) * 2))
    np.testing.assert_allclose(np.diff(record.poses[:, 0, 0]), np.diff(times) * uneven.platforms[0].speed)


def test_time_is_taken_by_stage_and_scan(shortened):
    record = run(shortened, RandomPlanner(build_sensors(load_scenario("paper-e"))))
    assert tuple(record.timings) == STAGES
    assert all(seconds.shape == (14,) and (seconds >= 0.0).all() for seconds in record.timings.values())
    assert (record.timings["filter"] > 0.0).all()
    np.testing.assert_array_equal(np.flatnonzero(record.timings["planning"]), [9])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tracker": None}, "tracker: expected a Tracker, with targets, sensors"),
        ({"platforms": ()}, "platforms: expected 2, one for each sensor of the tracker; got 0"),
        ({"decision_steps": (99,)}, "decision_steps: expected scans from 1 to 14; got 99"),
        ({"poses": np.zeros((3, 3))}, "poses: expected finite numbers"),
        ({"first_actions": (None,)}, "first_actions: expected 2, one a sensor; got 1"),
    ],
)
def test_parts_that_do_not_fit(shortened, change, message):
    with pytest.raises(InputError, match=message):
        replace(shortened, **change)
