"""Cameras that turn: six of them on masts, each 90 degrees wide, and eleven targets that spread.

    python examples/cameras.py [--picture FILE]

`six-cameras` is a scenario that comes with the library. Turned jointly, no two cameras look at the same and nobody is
left out.
"""

from __future__ import annotations

import numpy as np

from vedette.evaluation import custom_metrics, measure_run, run_scenario
from vedette.scenarios import load_scenario
from vedette.simulation import RunRecord

SCENARIO = load_scenario("six-cameras")


def main() -> dict[str, RunRecord]:
    records = {
        planner: run_scenario(SCENARIO, planner, seed=1, num_threads=1) for planner in ("stationary", "random", "jdm")
    }
    for planner, record in records.items():
        tracked = measure_run(record, SCENARIO, custom_metrics(SCENARIO)).custom["tracked_of_all"]
        print(f"{planner:7} OSPA {record.ospa[:, 0].mean():5.1f} m, of all targets tracked {np.nanmean(tracked):4.0%}")
    return records


def draw(records: dict[str, RunRecord]):
    from vedette.evaluation.figures import build_scene, tracks_figure

    shown = [records["stationary"], records["jdm"]]
    return tracks_figure(*shown, titles=["Never turned", "Turned jointly"], scene=build_scene(SCENARIO, "jdm"))


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
