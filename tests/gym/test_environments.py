"""Environments: what their checkers ask for, the runs of a campaign, layouts, rewards, masks and pictures."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

from vedette import models
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.evaluation import ospa, run_scenario
from vedette.filters import LmbFilter
from vedette.gym import Observation, ScenarioEnv, ScenarioParallelEnv, expected_loss, policy_planner
from vedette.gym.observing import belief_arrays
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.simulation import RunRecord, ScanOutcome, Truth
from vedette.simulation.loop import SCENES, run_stream

LMBS = {"filter.kind": "lmb", "fusion.kind": "clmb", "control.reward": {"kind": "expected_loss"}}
ALONE = {"filter.kind": "phd", "fusion": {"kind": "none"}, "control.reward": {"kind": "expected_loss"}}
FENCE = {"x_min": -1000.0, "x_max": 1000.0, "y_min": -1000.0, "y_max": 1000.0}
KEPT = [{"kind": "stay_inside", "region": FENCE}, {"kind": "separation", "distance": 300.0}]
FENCED = {"control.constraints": KEPT}


CRUISE = {"motion": {"kind": "constant_velocity", "sigma_v": 1.0}, "stay_s": 20.0}
MODES = {
    "kind": "modes",
    "modes": {"cruise": CRUISE}
    | {
        name: {"motion": {"kind": "constant_turn", "turn_rate_deg": rate, "sigma_v": 1.0}, "stay_s": 8.0}
        for name, rate in (("left", 15.0), ("right", -15.0))
    },
}


def scene(name: str) -> Scenario:
    """A scenario by name, or a variant of paper-a: LMBs; one of two moves; a PHD filter alone; fenced; modes."""
    paper = load_scenario("paper-a")
    if name == "alone":
        first = paper.model.model_dump(mode="json")["sensors"][:1]
        return replace_fields(paper, {**ALONE, "sensors": first})
    if name == "modes":
        first = paper.model.model_dump(mode="json")["sensors"][:1]
        return replace_fields(paper, {**ALONE, "filter.kind": "lmb", "motion": MODES, "sensors": first})
    fields: dict[str, dict[str, Any]] = {
        "lmb": LMBS,
        "one moves": {**LMBS, "sensors.1.platform": {"kind": "stationary"}},
        "fenced": {**LMBS, **FENCED},
    }
    return replace_fields(paper, fields[name]) if name in fields else load_scenario(name)


def go_on(observation: Observation) -> np.ndarray:
    """Each sensor the last action that it may take."""
    mask = observation["action_mask"]
    return mask.shape[1] - 1 - mask[:, ::-1].argmax(axis=1)


steer = policy_planner(go_on)  # as a scenario names it


def episode(env: ScenarioEnv, policy: Any = go_on, **reset: Any) -> list[tuple[Observation, float]]:
    observation, _ = env.reset(**reset)
    found, over = [], False
    while not over:
        observation, reward, terminated, over, _ = env.step(policy(observation))
        assert not terminated
        found.append((observation, reward))
    return found


def assert_same_run(first: RunRecord, second: RunRecord) -> None:
    """Truth, poses, estimates, scores, health and decisions, bit for bit."""
    for mine, other in (
        (first, second),
        (first.truth, second.truth),
        *zip(first.estimates, second.estimates, strict=True),
    ):
        for name in ("times", "poses", "ospa", "ids", "states", "labels", "means", "covs", "existence"):
            if hasattr(mine, name):
                np.testing.assert_array_equal(getattr(mine, name), getattr(other, name))
    for name in first.health.__match_args__:
        np.testing.assert_array_equal(getattr(first.health, name), getattr(second.health, name))
    assert [own.plan.chosen for own in first.decisions] == [own.plan.chosen for own in second.decisions]


@pytest.mark.parametrize(
    "name", ["paper-a", "paper-e", "six-cameras", "two-searchers", "one moves", "alone", "fenced", "modes"]
)
def test_both_checkers_pass(name: str) -> None:
    """Warnings are errors here."""
    scenario = scene(name)
    check_env(ScenarioEnv(scenario), skip_render_check=True)
    parallel_api_test(ScenarioParallelEnv(scenario), 20)
    parallel_seed_test(lambda: ScenarioParallelEnv(scenario), 20)


@pytest.mark.parametrize("name", ["lmb", "six-cameras", "fenced"])
def test_a_policy_has_the_same_run_as_a_planner_and_in_an_environment(name: str) -> None:
    planners = {"mine": {"kind": "custom", "function": f"{__file__}:steer"}}
    scenario = replace_fields(scene(name), {"planners": planners})
    env = ScenarioEnv(scenario)
    for run in (0, 3):
        episode(env, seed=5, options={"run": run})
        record = run_scenario(scenario, "mine", seed=5, run=run, num_threads=1)
        assert_same_run(env.record(), record)
        assert record.planner == "mine"


def test_resets_go_through_the_runs_of_a_campaign() -> None:
    env, other = ScenarioEnv(scene("lmb")), ScenarioEnv(scene("lmb"))
    env.reset(seed=2)
    told = [env.reset()[1] for _ in range(2)]
    assert [(own["seed"], own["run"]) for own in told] == [(2, 1), (2, 2)]
    other.reset(seed=2, options={"run": 2})
    np.testing.assert_array_equal(env.world.truth.states, other.world.truth.states)
    assert ScenarioEnv(scene("lmb")).reset()[1]["run"] == 0


def test_the_reward_is_minus_the_mean_ospa_to_the_next_decision() -> None:
    env = ScenarioEnv(scene("lmb"))
    rewards = [reward for _, reward in episode(env, seed=1)]
    record = env.record()
    parts = [record.ospa[10:20, 0], record.ospa[20:30, 0], record.ospa[30:40, 0]]
    np.testing.assert_array_equal(rewards, [-own.mean() for own in parts])
    found = ospa(record.estimates[39].means[:, :2], record.truth.at(39)[1][:, :2], cutoff=100.0, order=1.0)
    assert parts[2][-1] == found.total


def test_own_rewards_and_the_expected_loss() -> None:
    seen: list[tuple[Sequence[ScanOutcome], Truth]] = []

    def mine(moments: Sequence[ScanOutcome], truth: Truth) -> float:
        seen.append((moments, truth))
        return 7.0

    assert [reward for _, reward in episode(ScenarioEnv(scene("lmb"), reward=mine), seed=1)] == [7.0] * 3
    moments, truth = seen[1]
    assert [moment.step for moment in moments] == list(range(21, 31))
    np.testing.assert_array_equal(truth.times, [moment.time for moment in moments])
    rewards = [reward for _, reward in episode(ScenarioEnv(scene("lmb"), reward="expected_loss"), seed=1)]
    assert rewards[1] == -np.mean([expected_loss(moment.state.fused, 100.0) for moment in moments])
    covs = np.array([np.diag([9.0, 16.0, 1.0, 1.0]), np.diag([1e6, 0.1, 1.0, 1.0])])
    belief = LMB.from_bernoullis([[1, 0], [1, 1]], [0.5, 0.25], np.zeros((2, 4)), covs)
    assert expected_loss(belief, 100.0) == pytest.approx(0.5 * 5.0 + 0.25 * 100.0)


def test_beliefs_are_laid_out_by_existence() -> None:
    means, covs = np.arange(12.0).reshape(3, 4), np.array([np.diag(np.arange(1.0, 5.0) + i) for i in range(3)])
    covs[:, 0, 1] = covs[:, 1, 0] = 0.5
    belief = LMB.from_bernoullis([[1, 0], [1, 1], [2, 0]], [0.25, 0.75, 0.5], means, covs)
    found, cut = belief_arrays(belief, 3, 4), belief_arrays(belief, 3, 2)
    np.testing.assert_array_equal(found["existence"], [0.75, 0.5, 0.25, 0.0])
    np.testing.assert_array_equal(found["mask"], [1, 1, 1, 0])
    np.testing.assert_array_equal(found["means"][:3], means[[1, 2, 0]])
    roots = found["sqrt_covs"]
    np.testing.assert_allclose(roots[:3] @ roots[:3].transpose(0, 2, 1), covs[[1, 2, 0]], rtol=1e-6)
    assert not roots[3].any() and not found["means"][3].any()  # noqa: PT018
    for name, array in cut.items():
        np.testing.assert_array_equal(array, found[name][:2])
    empty = belief_arrays(LMB.empty(4), 3, 2)
    assert not any(array.any() for array in empty.values())


def test_beliefs_have_the_probabilities_of_modes() -> None:
    motion = models.Modes((models.constant_velocity(1.0),) * 2, (1e6, 1e6), at_birth=(0.25, 0.75))
    sites = np.array([[0.0, 0.0, 1.0, 0.0], [500.0, 0.0, 1.0, 0.0]])
    birth = models.BirthModel(np.array([0.8, 0.6]), sites, np.tile(np.eye(4), (2, 1, 1)), steps=frozenset({1}))
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([3.0, 3.0]),
        models.constant_detection(0.1),
        models.region_clutter(1.0, models.Region(-1e3, 1e3, -1e3, 1e3), "position"),
    )
    tracker = LmbFilter(models.TargetModel(motion, models.constant_survival(1.0), birth), sensor)
    belief, rng, none = tracker.initial(), np.random.default_rng(0), np.empty((0, 2))
    for step, wanted in ((1, [0.0, 0.0]), (2, [0.25, 0.75])):  # drawn at the first prediction
        belief, _ = tracker.step(belief, none, np.zeros(3), 1.0, step, rng=rng)
        found = belief_arrays(belief, step, 3, 2)["mode_probs"]
        np.testing.assert_allclose(found, [wanted, wanted, [0.0, 0.0]], atol=1e-4)
    assert "mode_probs" not in belief_arrays(belief, 2, 3)


@pytest.mark.parametrize("name", ["paper-a", "six-cameras", "one moves", "modes"])
def test_the_page_has_the_layout(name: str) -> None:
    """Names, shapes and types of the table of docs/gym-observations.md, in its order."""
    env = ScenarioEnv(scene(name))
    env.reset(seed=1)
    layout, (num_sensors, pose_dim) = env.episodes.layout, env.world.experiment.poses.shape
    sizes = {"L": 10, "d": env.world.truth.states.shape[1], "S": num_sensors, "p": pose_dim, "2": 2, "M": 3}
    sizes |= {"D": len(layout.deciding), "A": max(layout.num_actions)}
    sizes["U"] = math.prod(layout.shapes.get("undetected", ()))
    page = (Path(__file__).parents[2] / "docs/gym-observations.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([LdSpDAUM2, ]+) \| (float32|int8) \|", page, re.MULTILINE)
    told = {name: (tuple(sizes[own] for own in shape.split(", ")), kind) for name, shape, kind in rows}
    spaces = dict(env.observation_space.items())  # type: ignore[attr-defined]
    for optional in {"undetected", "mode_probs"} - spaces.keys():
        del told[optional]
    assert told == {name: (own.shape, str(own.dtype)) for name, own in spaces.items()}


def test_times_poses_and_where_actions_lead() -> None:
    env = ScenarioEnv(scene("lmb"))
    observation, info = env.reset(seed=1)
    np.testing.assert_array_equal(observation["time"], [10.0, 30.0])
    np.testing.assert_array_equal(observation["poses"], np.float32(env.world.experiment.poses))
    east = np.float32(env.world.experiment.poses[:, :2] + [500.0, 0.0])  # 10 s at 50 m/s: the sixth heading is 0
    np.testing.assert_allclose(observation["ends"][:, 6, :2], east)
    assert (info["step"], info["time"]) == (10, 10.0)
    observation, _, _, _, info = env.step([6, 6])
    np.testing.assert_allclose(observation["poses"][:, :2], east)
    times = [shown["time"].tolist() for shown, _ in episode(env)]
    assert times == [[10.0, 20.0], [10.0, 10.0], [0.0, 0.0]]
    assert set(info["health"]) >= {"num_tracks", "truncation_error_bound", "fusion_num_lost_labels"}


def test_actions_that_constraints_forbid_are_masked_and_moved() -> None:
    env = ScenarioEnv(scene("fenced"))
    observation, _ = env.reset(seed=1)
    mask = observation["action_mask"]
    assert 0 < mask.sum() < mask.size
    np.testing.assert_array_equal(env.action_masks(), mask.ravel())
    env.step(mask.argmin(axis=1))
    assert env.episodes.num_moved == 2
    while not env.episodes.is_over:
        env.step(env.episodes.context.observation["action_mask"].argmin(axis=1))
    places = env.record().poses[..., :2]
    assert np.abs(places).max() <= 1000.0
    assert np.hypot(*(places[:, 0] - places[:, 1]).T).min() >= 300.0


def test_one_sensor_that_moves_is_asked_for_a_number() -> None:
    env = ScenarioEnv(scene("one moves"))
    assert env.action_space == gymnasium.spaces.Discrete(13)
    env.reset(seed=1)
    env.step(6)
    assert ScenarioParallelEnv(scene("one moves")).possible_agents == ["sensor_1"]


def test_agents_are_the_sensors_with_their_own_first() -> None:
    scenario = scene("lmb")
    env, single = ScenarioParallelEnv(scenario, belief="own"), ScenarioEnv(scenario)
    seen, _ = env.reset(seed=4)
    whole, _ = single.reset(seed=4)
    assert list(seen) == env.agents == ["sensor_1", "sensor_2"]
    np.testing.assert_array_equal(seen["sensor_2"]["poses"], whole["poses"][::-1])
    np.testing.assert_array_equal(seen["sensor_2"]["ends"], whole["ends"][1])
    state = env.episodes.context.state
    np.testing.assert_array_equal(seen["sensor_2"]["means"], belief_arrays(state.local[1], 10, 10)["means"])
    _, rewards, ended, truncated, _ = env.step({"sensor_1": 3, "sensor_2": 9})
    _, reward, *_ = single.step([3, 9])
    assert rewards == {"sensor_1": reward, "sensor_2": reward}
    assert not any(ended.values())
    assert not any(truncated.values())
    for _ in range(2):
        *_, truncated, _ = env.step({"sensor_1": 3, "sensor_2": 9})
    assert all(truncated.values())
    assert env.agents == []


def test_scenarios_are_drawn_anew_for_every_run() -> None:
    several = [
        replace_fields(scene("lmb"), {"name": f"clutter {rate}", "sensors.*.clutter.rate": rate}) for rate in (1, 9)
    ]

    def made(rng: np.random.Generator) -> Scenario:
        return replace_fields(several[0], {"sensors.0.position": rng.uniform(-500.0, 500.0, 2).tolist()})

    env, places = ScenarioEnv(several), ScenarioEnv(made)
    names, starts = set(), set()
    for run in range(6):
        env.reset(seed=1, options={"run": run})
        names.add(env.episodes.built.scenario.name)
        starts.add(tuple(places.reset(seed=1, options={"run": run})[0]["poses"][0].tolist()))
    assert names == {"clutter 1", "clutter 9"}
    assert len(starts) == 6
    again = places.reset(seed=1, options={"run": 0})[0]["poses"][0].tolist()
    assert tuple(again) in starts
    mixed = ScenarioEnv([scene("lmb"), scene("six-cameras")])
    other = next(
        run for run in range(10) if run_stream(1, run, SCENES).integers(2) == 1 - run_stream(0, 0, SCENES).integers(2)
    )
    with pytest.raises(InputError, match="expected arrays and actions of one layout at every decision"):
        mixed.reset(seed=1, options={"run": other})


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_several_at_once_are_as_each_alone(mode: str) -> None:
    more: dict[str, Any] = {"vector_kwargs": {"context": "spawn"}} if mode == "async" else {}
    envs: Any = gymnasium.make_vec("vedette/Scenario-v0", 2, mode, scenario="paper-a", **more)
    try:
        seen, told = envs.reset(seed=[1, 2])
        alone = ScenarioEnv("paper-a")
        for place, seed in enumerate((1, 2)):
            mine, info = alone.reset(seed=seed)
            for name, array in mine.items():
                np.testing.assert_array_equal(seen[name][place], array)
            assert told["step"][place] == info["step"]
        for over in (False, False, True):
            _, rewards, _, truncated, _ = envs.step(np.array([[6, 6], [6, 6]]))
            assert truncated.tolist() == [over, over]
        for _ in range(3):
            _, reward, *_ = alone.step([6, 6])
        assert rewards[1] == reward
        envs.step(np.array([[6, 6], [6, 6]]))  # which begins the next runs
    finally:
        envs.close()


def test_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    env = gymnasium.make("vedette/Scenario-v0", scenario="paper-a", render_mode="rgb_array")
    env.reset(seed=1)
    first: Any = env.render()
    env.step([6, 6])
    second: Any = env.render()
    assert first.shape == second.shape
    assert first.shape[1:] == (800, 3)
    assert first.dtype == np.uint8
    assert (first != second).any()
    shown = ScenarioParallelEnv("paper-a", render_mode="human")
    shown.reset(seed=1)
    assert shown.render() is None
    shown.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenario": "linear-10"}, "linear-10: expected decisions, as of control.decision_steps; got a scenario"),
        ({"scenario": []}, "scenario: expected at least one scenario; got none"),
        ({"reward": "gold"}, "reward: expected ospa, expected_loss or a function of moments and truth; got gold"),
        ({"render_mode": "ascii"}, "render_mode: expected rgb_array or human or None; got ascii"),
        ({"num_labels": 0}, "num_labels: expected a whole number of at least 1; got 0"),
    ],
)
def test_what_cannot_be_is_told(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        ScenarioEnv(**arguments)


def test_wrong_actions_and_steps_are_told() -> None:
    env = ScenarioEnv(scene("lmb"))
    with pytest.raises(InputError, match="step: expected a reset first, as there is no run"):
        env.step([0, 0])
    env.reset(seed=1)
    for actions in ([13, 0], [0], [-1, 0]):
        with pytest.raises(InputError, match=r"actions: expected 2 indices below \[13, 13\]; got"):
            env.step(actions)
    episode(env)
    with pytest.raises(InputError, match="step: expected a reset first, as the run is over"):
        env.step([0, 0])
    still = replace_fields(scene("lmb"), {"sensors.*.platform": {"kind": "stationary"}})
    with pytest.raises(InputError, match="sensors: expected one with a choice of actions at least; got none"):
        ScenarioEnv(still)
    alone = ScenarioEnv(scene("alone"), reward="expected_loss")
    alone.reset(seed=1)
    with pytest.raises(InputError, match="reward: expected ospa or a function, as the belief has no labels"):
        alone.step(0)
    worded = ScenarioEnv(scene("lmb"), reward=lambda moments, truth: "much")  # type: ignore[arg-type,return-value]
    worded.reset(seed=1)
    with pytest.raises(InputError, match="reward: expected a function that returns a number; got much"):
        worded.step([0, 0])
    agents = ScenarioParallelEnv(scene("lmb"))
    agents.reset(seed=1)
    with pytest.raises(InputError, match="actions: expected one of each of sensor_1, sensor_2; got"):
        agents.step({"sensor_1": 0})
