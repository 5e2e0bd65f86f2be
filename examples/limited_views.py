"""Sensors that see different things: what a fusion makes of a target that only one of them sees.

    python examples/limited_views.py [--picture FILE]

Two sectors of 120 degrees that overlap in part (`two-views-1`). Covariance intersection takes a sensor that sees
nothing at its word; by views, a sensor that cannot see a target has no say in it.
"""

from __future__ import annotations

import numpy as np

from vedette.evaluation import custom_metrics, measure_run, run_scenario
from vedette.scenarios import load_scenario, replace_fields
from vedette.simulation import RunRecord

SCENARIO = load_scenario("two-views-1")
FUSIONS = {
    "all the same view": {"kind": "clmb", "matching": "assignment"},
    "by views": {"kind": "clmb", "matching": "assignment", "field_of_view_weighting": True},
    "scans in turn": {"kind": "sequential"},
}


def main() -> dict[str, RunRecord]:
    records = {}
    for name, fusion in FUSIONS.items():
        scenario = replace_fields(SCENARIO, {"fusion": fusion})
        record = records[name] = run_scenario(scenario, "stationary", seed=1)
        tracked = measure_run(record, scenario, custom_metrics(scenario)).custom["tracked_fraction"]
        error = record.ospa[:, 0].mean()
        print(f"{name:18} OSPA {error:5.1f} m, of the targets in sight tracked {np.nanmean(tracked):4.0%}")
    return records


def draw(records: dict[str, RunRecord]):
    from vedette.evaluation.figures import build_scene, tracks_figure

    shown = list(FUSIONS)[:2]
    titles = [f"Covariance intersection, {name}" for name in shown]
    return tracks_figure(*(records[name] for name in shown), titles=titles, scene=build_scene(SCENARIO, "stationary"))


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
