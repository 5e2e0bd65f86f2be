"""A hundred sensors that decide jointly: 9^100 joint actions, and two hundred targets that spread.

    python examples/hundred_sensors.py [--picture FILE]

The scene is made from a seed, as by `vedette generate --sensors 100`. Each sensor sees 250 m, and they decide three
times.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from vedette.evaluation import run_scenario
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.generated import GeneratedScene, scene_text
from vedette.simulation import RunRecord

SHORTER = {
    "time.num_steps": 25,
    "control.decision_steps": [5, 10, 15],
    "control.horizon_steps": 2,
    "control.horizon_period": 2.5,
}


def main() -> dict[str, RunRecord]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.yaml"
        file.write_text(scene_text(GeneratedScene(num_sensors=100, decide_every=5)), "utf-8")
        scenario = replace_fields(load_scenario(file), SHORTER)
    records = {}
    for planner in ("stationary", "nearest", "jdm"):
        record = records[planner] = run_scenario(scenario, planner, seed=1, num_threads=1)
        print(f"{planner:8} OSPA {record.ospa[:, 0].mean():5.1f} m, at the end {record.ospa[-1, 0]:5.1f} m")
    plan = records["jdm"].decisions[0].plan
    print(f"first decision: {sum(len(own) for own in plan.actions)} courses of {len(plan.actions)} sensors")
    return records


def draw(records: dict[str, RunRecord]):
    figure, (left, right) = panels(2)
    record = records["jdm"]
    truth = record.truth
    paths = [truth.states[truth.ids == target, :2] for target in np.unique(truth.ids)]
    draw_paths(left, paths)
    for s in range(record.poses.shape[1]):
        left.plot(
            *record.poses[:, s, :2].T, color="C0", linewidth=1, label=None if s else "sensors, by joint decisions"
        )
        left.plot(*record.poses[-1, s, :2], "C0s", markersize=2)
    legend_above(left)
    names = {"stationary": "not moving", "nearest": "each to its nearest target", "jdm": "joint decisions"}
    draw_errors(right, record.times, {names[name]: own.ospa[:, 0] for name, own in records.items()}, "OSPA (m)")
    for decision in record.decisions:
        right.axvline(decision.time, color="0.8", zorder=0)
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, legend_above, panels, show

    show(main, draw)
