"""The oracle against a recursion written out target by target, and its plans against all that it could have done."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import mobile_sensor
from vedette.control import ConstantPlanner, Plan, PlanningSettings, StayInside
from vedette.control.baselines import ConstraintReportingPlanner
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.models import Region
from vedette.platforms import Actions, HeadingPlatform, Operated
from vedette.platforms.base import actions_at, courses_of, scans_of
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner, build_sensors
from vedette.simulation import OraclePlanner, RequiresTruth, Schedule, Truth, simulate
from vedette.simulation.cramer_rao import scan_information, transition_jacobians
from vedette.tracking import State

HEADINGS = (-120.0, 0.0, 75.0)
TIMES = np.array([1.0, 2.0, 4.0, 5.0, 7.0, 8.0])
POSES = np.array([[-500.0, 300.0, 0.2], [-450.0, -350.0, -0.4]])
STARTS = np.array([[-60.0, 250.0, 8.0, -3.0], [180.0, -120.0, -4.0, 9.0], [-220.0, -300.0, 0.0, 5.0]])
COVS = [np.diag([400.0, 900.0, 25.0, 9.0]) * (1.0 + 0.3 * i) for i in range(3)]
SHORT = {"time.num_steps": 12, "control.decision_steps": [10], "ospa.last_scan": 12}
SENSORS = (mobile_sensor("lmb", HeadingPlatform(30.0, HEADINGS)), mobile_sensor("lmb", HeadingPlatform(45.0, HEADINGS)))


def moved(states: Any, dt: float) -> Any:
    return states + dt * np.column_stack([states[:, 2:], np.zeros((len(states), 2))])


def truth(scans: int = 4) -> Truth:
    """Three targets, the last of which ends after so many scans."""
    tables = np.stack([moved(STARTS, time - TIMES[0]) for time in TIMES], axis=1)
    alive = np.ones((3, len(TIMES)), bool)
    alive[2, scans:] = False
    return Truth.from_arrays(TIMES, alive, tables)


def state(scale: float = 1.0) -> State:
    """After the first scan; the second sensor knows the targets worse."""
    labels, existence = [(1, 0), (1, 1), (1, 2)], [0.99] * 3
    own = [LMB.from_bernoullis(labels, existence, STARTS + 3.0, [k * scale * cov for cov in COVS]) for k in (1.0, 2.0)]
    return State(tuple(own), own[0], step=1, time=1.0)


def schedule(**fields: Any) -> Schedule:
    return Schedule(TIMES, (1, 4), (0.4, 0.6), one_belief=False, rebirths=False)._replace(**fields)


def information(sensor: int, target: Any, pose: Any) -> Any:
    """P_D H' R^-1 H of bearing and range by hand."""
    model = SENSORS[sensor].filter.sensor
    offset = target[:2] - pose[:2]
    squared = offset @ offset
    jacobian = np.zeros((2, 4))
    jacobian[0, :2] = np.array([-offset[1], offset[0]]) / squared
    jacobian[1, :2] = offset / np.sqrt(squared)
    noise = model.noise.covs(target, pose, 2)[0]
    return model.detection.prob(target, pose)[0] * jacobian.T @ np.linalg.solve(noise, jacobian)


def cost(
    table: Schedule, first: int, last: int, joint: Any, poses: Any, covs: Any, scans: int = 4
) -> tuple[float, Any, Any]:
    """The cost of a joint action from one scan to another, target by target; where it ends, and what is then known."""
    motion, total = SENSORS[0].filter.targets.motion, 0.0
    covs, ends = [[cov.copy() for cov in own] for own in covs], None
    for k in range(first, last):
        dt, ends = TIMES[k] - TIMES[k - 1], []
        ids, states = truth(scans).at(k)
        for s, action in enumerate(joint):
            angle, speed = np.radians(HEADINGS[action]), (30.0, 45.0)[s]
            away = speed * (TIMES[k] - TIMES[first - 1]) * np.array([np.cos(angle), np.sin(angle)])
            ends.append([*(poses[s][:2] + away), angle])
        for target in range(3):
            transition, noise = np.eye(4) + dt * np.eye(4, k=2), motion.noise_cov(STARTS[0], dt)
            told = [np.zeros((4, 4))] * 2
            if target in ids:
                told = [information(s, states[list(ids).index(target)], np.array(ends[s])) for s in range(2)]
            infos = [np.linalg.inv(transition @ own[target] @ transition.T + noise) for own in covs]
            if table.one_belief:
                covs[0][target] = np.linalg.inv(
                    infos[0] + sum(p * own for p, own in zip(table.powers, told, strict=True))
                )
                fused = covs[0][target]
            else:
                for s in range(2):
                    covs[s][target] = np.linalg.inv(infos[s] + told[s])
                fused = np.linalg.inv(
                    sum(p * np.linalg.inv(own[target]) for p, own in zip(table.powers, covs, strict=True))
                )
            if target in ids:
                total += min(np.sqrt(fused[0, 0] + fused[1, 1]), 100.0)
    return total, ends, covs


@pytest.mark.parametrize("one_belief", [False, True])
@pytest.mark.parametrize(("depth", "scans"), [(1, 4), (2, 4), (2, 3), (2, 1)])
def test_it_takes_what_costs_least(one_belief: bool, depth: int, scans: int) -> None:
    table = schedule(one_belief=one_belief, powers=(1.0, 1.0) if one_belief else (0.4, 0.6))
    covs = [COVS] if one_belief else [COVS, [2.0 * cov for cov in COVS]]
    joints = list(itertools.product(range(3), repeat=2))
    costs = {}
    for joint in joints:
        costs[joint], ends, then = cost(table, 1, 4, joint, POSES, covs, scans)
        if depth == 2:
            costs[joint] += min(cost(table, 4, 6, later, ends, then, scans)[0] for later in joints)
    planner = OraclePlanner(SENSORS, table, depth=depth, beam_width=9).with_truth(truth(scans))
    plan = planner.plan(state(), POSES, rng=np.random.default_rng(0))
    plan.validate()
    assert plan.chosen == min(joints, key=lambda joint: costs[joint])
    ranked = sorted(costs.values())
    assert ranked[1] - ranked[0] > 1e-4  # so that the choice was one


def test_derivatives_are_those_by_hand() -> None:
    motion = SENSORS[0].filter.targets.motion
    wanted = [np.eye(4) + 2.0 * np.eye(4, k=2)] * 3
    np.testing.assert_allclose(transition_jacobians(motion, STARTS, 2.0), wanted, atol=1e-8)
    told = scan_information(SENSORS[0].filter.sensor, STARTS, POSES[0])
    np.testing.assert_allclose(told, [information(0, own, POSES[0]) for own in STARTS], rtol=1e-6, atol=1e-12)


def test_the_bearing_may_jump() -> None:
    behind = np.array([[-900.0, 300.0, 0.0, 0.0]])  # from where the sensor is, at 180 degrees
    told = scan_information(SENSORS[0].filter.sensor, behind, POSES[0])
    np.testing.assert_allclose(told[0], information(0, behind[0], POSES[0]), rtol=1e-6, atol=1e-12)


def test_who_does_not_scan_tells_nothing() -> None:
    scans = np.array([[True] * 6, [False] * 6])
    covs = [COVS, [2.0 * cov for cov in COVS]]
    chosen = OraclePlanner(SENSORS, schedule(scans_at=scans), truth=truth()).plan(
        state(), POSES, rng=np.random.default_rng(0)
    )
    assert chosen.chosen[1] == 0  # all its courses are worth the same
    first = [cost(schedule(powers=(1.0, 0.0)), 1, 4, (action, 0), POSES, covs)[0] for action in range(3)]
    assert chosen.chosen[0] == int(np.argmin(first))


def test_who_is_off_tells_nothing() -> None:
    """With one sensor that can only be off, and with one that is better on."""

    class Off(Operated):
        """Of a switched platform what is off."""

        def actions(self, pose: Any) -> Any:
            """Those with the sensor off."""
            return self.switched_on_and_off(self.platform.actions(pose))[3:]

    plans = []
    table = schedule(scans_at=np.array([[True] * 6, [False] * 6]))
    switched = [Operated(own.platform, switchable=True) for own in SENSORS]
    off = Off(SENSORS[1].platform, switchable=True)
    for table_of, platforms in ((table, (SENSORS[0].platform, SENSORS[1].platform)), (schedule(), (switched[0], off))):
        sensors = tuple(replace(own, platform=platform) for own, platform in zip(SENSORS, platforms, strict=True))
        planner = OraclePlanner(sensors, table_of, truth=truth())
        plans.append(planner.plan(state(), POSES, rng=np.random.default_rng(0)))
    assert plans[1].chosen == plans[0].chosen
    assert plans[1].chosen_actions[1][-1] == 0.0


def test_a_decision_at_the_last_scan_with_a_budget_is_made() -> None:
    """No scan follows, for which the seconds left would be worked out."""
    budgeted = Operated(SENSORS[0].platform, switchable=True, budget=60.0)
    pose = np.array([0.0, 40.0, 0.0, 0.0, 0.0, 60.0])
    actions = actions_at("platform", budgeted, pose).values
    assert courses_of("platform", budgeted, pose, actions, np.empty(0)).shape == (len(actions), 0, 6)
    assert scans_of("platform", budgeted, pose, actions, np.empty(0)).shape == (len(actions), 0)


def test_what_is_lost_is_given_up_where_nothing_is_born() -> None:
    sees = replace(state(), fused=LMB.from_bernoullis([(1, 0)], [0.99], STARTS[:1], COVS[:1]))
    planner = OraclePlanner(SENSORS, schedule(), truth=truth())
    assert planner._tracked(sees, *truth().at(0))[0].tolist() == [0]
    again = replace(planner, schedule=schedule(rebirths=True))
    ids, covs = again._tracked(sees, *truth().at(0))
    assert ids.tolist() == [0, 1, 2]
    assert covs[0].shape == (3, 4, 4)


def test_a_target_whose_label_is_held_but_not_estimated_is_kept() -> None:
    """Two labels near the first target: the one that is estimated counts; the second target's is improbable."""
    labels, means = [(1, 0), (1, 1), (1, 2)], np.array([STARTS[0], STARTS[1] + 3.0, STARTS[0]])
    belief = LMB.from_bernoullis(labels, [0.99, 0.05, 0.02], means, COVS)
    planner = OraclePlanner(SENSORS, schedule(one_belief=True), truth=truth())
    ids, covs = planner._tracked(replace(state(), fused=belief), *truth().at(0))
    assert ids.tolist() == [0, 1]
    np.testing.assert_allclose(covs[0], COVS[:2], rtol=1e-12)


@pytest.mark.parametrize("step", [1, 4, 6])
def test_without_gain_each_sensor_takes_its_first_course(step: int) -> None:
    """No target is tracked; after the last scan there is nothing to follow either."""
    none = State((LMB.empty(4),) * 2, LMB.empty(4), step=step, time=float(TIMES[step - 1]))
    plan = OraclePlanner(SENSORS, schedule(), depth=2, truth=truth()).plan(none, POSES, rng=np.random.default_rng(0))
    assert plan.chosen == (0, 0)


def test_it_keeps_to_constraints_and_wants_its_truth() -> None:
    planner = OraclePlanner(SENSORS, schedule(), constraints=(StayInside(Region(-600.0, -100.0, -900.0, 900.0)),))
    with pytest.raises(InputError, match="truth: expected the targets of the run"):
        planner.plan(state(), POSES, rng=np.random.default_rng(0))
    plan = planner.with_truth(truth()).plan(state(), POSES, rng=np.random.default_rng(0))
    for s, (row, speed) in enumerate(zip(plan.chosen_actions, (30.0, 45.0), strict=True)):
        east = POSES[s, 0] + 10.0 * speed * np.cos(np.radians(row[0]))
        assert -600.0 <= east <= -100.0


def test_a_run_tells_it_its_truth() -> None:
    scenario = replace_fields(load_scenario("paper-a"), SHORT | {"planners": {"seer": {"kind": "oracle"}}})
    for name in ("oracle", "seer"):
        record = simulate(build_experiment(scenario), build_planner(scenario, name), seed=1, run=0, score=no_score)
        assert [own.plan.planner for own in record.decisions] == [name]


def test_custom_planners_may_require_the_truth() -> None:
    class Told:
        """A planner that keeps what it was told."""

        name = "true_targets"
        truth: Truth | None = None

        def with_truth(self, truth: Truth) -> Told:
            self.truth = truth
            return self

        def plan(self, state: State, poses: Any, *, rng: np.random.Generator) -> Plan:
            return ConstantPlanner((Actions.of(heading_deg=0.0),) * 2).plan(state, poses, rng=rng)

    scenario, plain, inside = replace_fields(load_scenario("paper-a"), SHORT), Told(), Told()
    sensors = build_sensors(scenario)
    watched = ConstraintReportingPlanner(
        inside, sensors, PlanningSettings(), (StayInside(Region(-9e3, 9e3, -9e3, 9e3)),)
    )
    for planner, own in ((plain, plain), (watched, inside)):
        assert isinstance(planner, RequiresTruth)
        record = simulate(build_experiment(scenario), planner, seed=1, run=0, score=no_score)
        assert own.truth is not None
        np.testing.assert_array_equal(own.truth.states, record.truth.states)


def no_score(truth: Truth, estimates: Any) -> Any:
    return np.zeros((truth.num_scans, 3))
