"""A reward of your own: targets near the harbour count, those far out hardly.

    python examples/own_reward.py [--picture FILE]

A plain function says what each target adds, by what is believed of it before and after the planned scans. It is
compiled, so that the planner searches with it as fast as with a built-in one. The scenario names it; nothing in the
library changes.
"""

from __future__ import annotations

import math

import numpy as np

from vedette import models
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.simulation import RunRecord

HARBOUR = np.array([-150.0, -700.0])
REACH = 300.0  # m
RUNS = 10


@models.model_function("label_reward")
def near_harbour(existence, mean, cov, new_existence, new_mean, new_cov, params, out):
    """params: place of the harbour, and over how many metres from it a target's worth falls off."""
    square = (new_mean[0] - params[0]) ** 2 + (new_mean[1] - params[1]) ** 2
    gain = math.sqrt(cov[0, 0] + cov[1, 1]) - math.sqrt(new_cov[0, 0] + new_cov[1, 1])
    out[0] = math.exp(-0.5 * square / params[2] ** 2) * new_existence * gain


class HarbourReward:
    """Metres by which targets are known better, weighed by how near they are to the harbour."""

    function = staticmethod(near_harbour)
    params = np.array([*HARBOUR, REACH])
    num_terms = 1
    coefficients = np.ones(1)  # linear in the sums, so that plans have bounds

    def combine(self, sums: np.ndarray) -> np.ndarray:
        return sums[..., 0]


def scenarios() -> dict[str, Scenario]:
    plain = replace_fields(load_scenario("paper-a"), {"filter": {"kind": "lmb"}, "fusion": {"kind": "sequential"}})
    own = {"kind": "custom", "function": "own_reward:HarbourReward"}  # module:name; file.py:name beside a scenario
    return {
        "expected loss": replace_fields(plain, {"control.reward": {"kind": "expected_loss", "cutoff": 100.0}}),
        "own: near the harbour": replace_fields(plain, {"control.reward": own}),
    }


def errors(record: RunRecord) -> tuple[float, float]:
    """Mean distance to the nearest estimate over the last ten scans: of targets near the harbour, and of the others."""
    near, far = [], []
    for scan in range(record.num_scans - 10, record.num_scans):
        targets, means = record.truth.at(scan)[1][:, :2], record.estimates[scan].means[:, :2]
        missed = np.linalg.norm(targets[:, None] - means, axis=2).min(axis=1, initial=100.0)
        inside = np.linalg.norm(targets - HARBOUR, axis=1) < REACH
        near += missed[inside].tolist()
        far += missed[~inside].tolist()
    return float(np.mean(near)), float(np.mean(far))


def main() -> dict[str, RunRecord]:
    shown = {}
    for name, scenario in scenarios().items():
        records = [run_scenario(scenario, "jdm", seed=1, run=run, num_threads=1) for run in range(RUNS)]
        near, far = np.mean([errors(record) for record in records], axis=0)
        print(f"{name:22} error near the harbour {near:5.1f} m, of the others {far:5.1f} m")
        shown[name] = records[0]
    return shown


def draw(shown: dict[str, RunRecord]):
    from matplotlib.patches import Circle

    from vedette.evaluation.figures import tracks_figure

    figure = tracks_figure(*shown.values(), titles=[name.capitalize() for name in shown])
    for axes in figure.axes:
        axes.add_patch(Circle(tuple(HARBOUR), REACH, fill=False, linestyle=":"))
        axes.annotate("harbour", (HARBOUR[0] + REACH, HARBOUR[1] - REACH / 2), va="top")
    return figure


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
