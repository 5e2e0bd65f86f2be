"""A policy for the environment, trained with NumPy alone: 57 numbers that say what a course is worth.

    python examples/gym_policy.py [--picture FILE]   # the kept policy, in the environment and as a planner
    python examples/gym_policy.py --train            # trains it anew, into gym_policy.npz: 2.6 minutes of CPU

Sensors choose one after the other. Of each target and course a small network is told how uncertain the target's place
is, how far from it the course ends, how far the sensor is now, whether that is within reach, and how many sensors
before it reach it. The network's sum over the targets is the course's worth. The cross-entropy method finds the
weights: draw some, play with each, keep the best, draw around those.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from vedette.evaluation import run_scenario
from vedette.gym import Observation, ScenarioEnv, policy_planner
from vedette.scenarios import Scenario, load_scenario, replace_fields

KEPT = Path(__file__).with_name("gym_policy.npz")
TOLD, HIDDEN = 6, 8
LABELS = 30  # targets that the policy is shown
REACH = 100.0  # m, in which it measures distances: what the sensors of eight-mobile see
STRATEGIES = ("jdm", "policy", "idm", "assigned_target", "nearest", "centroid", "random")
SEED, RUNS = 1, 3  # of the comparison; trained on seed 1000


class Network:
    """The policy of some weights."""

    def __init__(self, weights: np.ndarray) -> None:
        self.first = weights[: TOLD * HIDDEN].reshape(TOLD, HIDDEN)
        self.last = weights[TOLD * HIDDEN : (TOLD + 1) * HIDDEN]
        self.move = weights[-1]

    def __call__(self, observation: Observation) -> np.ndarray:
        """The action of each sensor that decides; all sensors of the scene must."""
        shown = observation["mask"] == 1
        places = observation["means"][shown, :2].astype(np.float64)
        stds = np.sqrt((observation["sqrt_covs"][shown, :2, :2].astype(np.float64) ** 2).sum(axis=(1, 2)))
        taken, chosen = np.zeros(len(places)), []
        for pose, ends, allowed in zip(*(observation[name] for name in ("poses", "ends", "action_mask")), strict=True):
            gaps = np.linalg.norm(ends[:, None, :2] - places, axis=2) / REACH
            now = np.linalg.norm(pose[:2] - places, axis=1) / REACH
            near = np.exp(-(gaps**4))
            told = np.broadcast_arrays(stds / 10.0, gaps, now, near, taken, np.exp(-gaps) / (1.0 + taken))
            worth = np.tanh(np.stack(told, axis=-1) @ self.first).dot(self.last).sum(axis=1)
            worth += self.move * (ends[:, :2] != pose[:2]).any(axis=1)
            best = int(np.where(allowed, worth, -np.inf).argmax())
            taken += near[best]
            chosen.append(best)
        return np.array(chosen)


def steer(**parts: Any) -> Any:
    """The kept policy as a planner of a scenario: `kind: custom`, `function: "gym_policy.py:steer"`."""
    return policy_planner(Network(np.load(KEPT)["weights"]), num_labels=LABELS)(**parts)


def scene(name: str = "eight-mobile", scans: int = 100) -> Scenario:
    """A scene with the policy among its planners; of eight-mobile its first scans."""
    fields: dict[str, Any] = {"planners": {"policy": {"kind": "custom", "function": f"{__file__}:steer"}}}
    if name == "eight-mobile":
        fields |= {"time.num_steps": scans, "control.decision_steps": list(range(1, scans))}
    return replace_fields(load_scenario(name), fields)


def play(env: ScenarioEnv, policy: Network, seed: int, run: int) -> float:
    """Mean reward of a run: minus the mean OSPA [m] of its scans after the first decision."""
    observation, _ = env.reset(seed=seed, options={"run": run})
    rewards, over = [], False
    while not over:
        observation, reward, _, over, _ = env.step(policy(observation))
        rewards.append(reward)
    return float(np.mean(rewards))


def train(generations: int = 10, size: int = 24, elite: int = 6, runs: int = 3, seed: int = 1000) -> None:
    """The cross-entropy method, on the first 40 scans of runs of one seed; each generation has runs of its own."""
    env = ScenarioEnv(scene(scans=40), num_labels=LABELS)
    rng, num = np.random.default_rng(0), (TOLD + 1) * HIDDEN + 1
    mean, std = np.zeros(num), np.ones(num)
    for generation in range(generations):
        drawn = mean + std * rng.standard_normal((size, num))
        played = range(runs * generation, runs * (generation + 1))
        rewards = np.array([np.mean([play(env, Network(own), seed, run) for run in played]) for own in drawn])
        best = drawn[np.argsort(-rewards)[:elite]]
        mean, std = best.mean(axis=0), best.std(axis=0) + 0.3 * np.exp(-0.5 * generation)
        told = f"OSPA {-rewards.max():5.2f} at best, {-rewards.mean():5.2f} m on average"
        print(f"generation {generation}: {told}", flush=True)
        np.savez_compressed(KEPT, weights=mean)


def errors(scenario: Scenario) -> dict[str, np.ndarray]:
    """(runs, scans) OSPA [m] of each strategy on the same runs, from the first decision on."""
    first = scenario.model.control.decision_steps[0]
    found: dict[str, np.ndarray] = {}
    for name in STRATEGIES:
        records = [run_scenario(scenario, name, seed=SEED, run=run, num_threads=1) for run in range(RUNS)]
        found[name] = np.array([record.ospa[first:, 0] for record in records])
    return found


def main() -> dict[str, np.ndarray]:
    """The comparison; of the last scene it returns the errors."""
    policy, found = Network(np.load(KEPT)["weights"]), dict[str, np.ndarray]()
    for name in ("paper-a", "eight-mobile"):
        scenario = scene(name)
        found = errors(scenario)
        env = ScenarioEnv(scenario, num_labels=LABELS)
        reward = play(env, policy, SEED, 0)
        assert (env.record().ospa[:, 0][-found["policy"].shape[1] :] == found["policy"][0]).all()  # in every bit
        print(f"{name}: in the environment run 0 gives {-reward:.3f} m, as a planner {found['policy'][0].mean():.3f} m")
        for strategy, values in found.items():
            more = (values - found["jdm"]).mean(axis=1)
            beyond = f"{more.mean():6.2f} +- {2.0 * error_of(more):.2f} m more than jdm"
            print(f"  {strategy:9} OSPA {values.mean():6.2f} m, {beyond}")
    return found


def error_of(values: np.ndarray) -> float:
    """Standard error of a mean."""
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def draw(found: dict[str, np.ndarray]) -> Any:
    """OSPA against time, mean over the runs."""
    from pictures import draw_errors, panels

    figure, axes = panels(1)
    times = np.arange(found["jdm"].shape[1]) + 2.0  # s, from the first scan after a decision
    draw_errors(axes, times, {name: own.mean(axis=0) for name, own in found.items()}, "OSPA (m)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


if __name__ == "__main__":
    from pictures import show

    if "--train" in sys.argv:
        train()
    else:
        show(main, draw)
