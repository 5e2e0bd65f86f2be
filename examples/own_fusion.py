"""A fusion of your own: for each target, the belief of the sensor that is surest of where it is.

    python examples/own_fusion.py [--picture FILE]

`fuse` takes one belief a sensor and gives one back. What the other sensors know is thrown away; covariance
intersection and a parallel update, on the same scans, use it.
"""

from __future__ import annotations

import numpy as np

from vedette.densities import LMB, track_moments
from vedette.evaluation import run_scenario
from vedette.scenarios import load_scenario, replace_fields

FUSIONS = {
    "own: the surest sensor": {"kind": "custom", "function": "own_fusion:SurestSensor"},
    "covariance intersection": {"kind": "clmb"},
    "parallel update": {"kind": "parallel"},
}
RUNS = 10


class SurestSensor:
    """Of each label, the Bernoulli of the sensor with the least variance of its position."""

    def fuse(self, beliefs, views=None):
        best: dict[tuple[int, ...], tuple[float, float, np.ndarray, np.ndarray]] = {}
        for belief in beliefs:
            means, covs = track_moments(belief.tracks)
            for label, r, mean, cov in zip(belief.tracks.labels.tolist(), belief.existence, means, covs, strict=True):
                variance = float(cov[0, 0] + cov[1, 1])
                if tuple(label) not in best or variance < best[tuple(label)][0]:
                    best[tuple(label)] = variance, float(r), mean, cov
        if not best:
            return beliefs[0], None
        _, existence, means, covs = zip(*best.values(), strict=True)
        return LMB.from_bernoullis(list(best), existence, means, covs), None


def main() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    errors = {}
    for name, fusion in FUSIONS.items():
        parts = {"filter": {"kind": "lmb"}, "fusion": {**fusion, "feedback": True}}
        scenario = replace_fields(load_scenario("paper-a"), parts)
        records = [run_scenario(scenario, "constant", seed=1, run=run) for run in range(RUNS)]
        errors[name] = np.mean([record.ospa[:, 0] for record in records], axis=0)
        print(f"{name:24} OSPA {errors[name][10:].mean():5.1f} m")
    return records[0].times, errors


def draw(found: tuple[np.ndarray, dict[str, np.ndarray]]):
    figure, axes = panels(1, width=5.0)
    draw_errors(axes, *found, f"OSPA, mean of {RUNS} runs (m)")
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, panels, show

    show(main, draw)
