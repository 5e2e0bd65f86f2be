"""Smoothed tracks: each estimate uses the scans after it, too.

    python examples/smoothed_tracks.py [--picture FILE]

The scene `polar-10`: ten targets turn as they go, and one sensor measures bearing and range. `smooth` goes back through
the densities of the run. `lag_s` limits it to the scans of the next 5 s, as for live tracks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.densities import Estimate, track_histories
from vedette.evaluation import match_run, ospa2_of_run
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import SimulationRun, Truth
from vedette.tracking import TraceEntry, smooth

CUTOFF, WINDOW = 100.0, 10


def main() -> tuple[Truth, dict[str, Sequence[Estimate]]]:
    experiment, trace = build_experiment(load_scenario("polar-10")), []
    world = SimulationRun(experiment, seed=0)
    while not world.is_over:
        scan = world.step()
        trace.append(TraceEntry(scan.time, scan.state.fused, scan.estimate))
    targets = experiment.tracker.targets
    tracks: dict[str, Sequence[Estimate]] = {
        "filtered": [entry.estimate for entry in trace],
        "smoothed, lag 5 s": smooth(trace, targets, lag_s=5.0),
        "smoothed": smooth(trace, targets),
    }
    for name, estimates in tracks.items():
        squares = match_run(world.truth, estimates, cutoff=CUTOFF, order=1.0).distances ** 2
        ospa2 = ospa2_of_run(world.truth, estimates, cutoff=CUTOFF, order=1.0, window=WINDOW)[:, 0]
        print(f"{name:17} position error {np.sqrt(squares.mean()):5.2f} m RMSE, OSPA(2) {ospa2.mean():5.2f} m")
    return world.truth, tracks


def draw(result: tuple[Truth, dict[str, Sequence[Estimate]]]):
    truth, tracks = result
    figure, axes = panels(3, width=10.5, height=3.8)
    paths = [truth.states[truth.ids == target, :2] for target in np.unique(truth.ids)]
    labels = {history.label: k for k, history in enumerate(track_histories(tracks["filtered"], truth.times))}
    for panel, name in zip(axes[:2], ("filtered", "smoothed"), strict=True):
        draw_paths(panel, paths)
        for history in track_histories(tracks[name], truth.times):
            style = {"marker": ".", "markersize": 3, "linewidth": 0.9, "color": f"C{labels[history.label] % 7}"}
            panel.plot(*history.means[:, :2].T, **style)
        panel.set_title(f"{name} tracks, targets in grey", fontsize="medium")
        panel.set(xlim=(80.0, 640.0), ylim=(680.0, 1240.0))
    axes[1].set_ylabel("")
    errors = {name: mean_errors(truth, estimates) for name, estimates in tracks.items()}
    draw_errors(axes[2], truth.times, errors, "mean position error (m)")
    return figure


def mean_errors(truth: Truth, estimates: Sequence[Estimate]) -> np.ndarray:
    """(num_scans,) mean distance of the matched estimates, m."""
    matching = match_run(truth, estimates, cutoff=CUTOFF, order=1.0)
    return matching.mean_by_scan(matching.distances)


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, panels, show

    show(main, draw)
