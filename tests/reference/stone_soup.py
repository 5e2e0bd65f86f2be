"""Writes stone_soup.json: cases with the values that Stone Soup gives them, to compare with.

Run by hand, in an environment of its own that has `stonesoup` (which the project does not need):
`python tests/reference/stone_soup.py > tests/reference/stone_soup.json`.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import sys
from typing import Any

import numpy as np
from stonesoup.dataassociator.clearmot import ClearMotAssociator
from stonesoup.measures import Euclidean, SquaredMahalanobis
from stonesoup.metricgenerator.clearmotmetrics import ClearMotMetrics
from stonesoup.metricgenerator.manager import MultiManager
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.groundtruth import GroundTruthPath
from stonesoup.types.state import GaussianState, State
from stonesoup.types.track import Track

START = datetime.datetime(2020, 1, 1)
NUM_SCANS = 12


def state(position: Any, scan: int = 0) -> Any:
    return State(np.asarray(position, float).reshape(-1, 1), timestamp=START + datetime.timedelta(seconds=scan))


def set_case(rng: np.random.Generator, cutoff: float, order: int) -> dict[str, Any]:
    numbers = rng.integers(0, 6, 2)
    if not numbers.any():
        numbers[0] = 1  # Stone Soup has no time for two empty sets
    points = [rng.uniform(-50.0, 50.0, (number, 2)).round(3) for number in numbers]
    estimates, truths = ([state(point) for point in side] for side in points)
    parts = GOSPAMetric(c=cutoff, p=order).compute_gospa_metric(estimates, truths)[0].value
    return {
        "cutoff": cutoff,
        "order": order,
        "estimates": points[0].tolist(),
        "truths": points[1].tolist(),
        "ospa": float(OSPAMetric(c=cutoff, p=order).compute_OSPA_distance(estimates, truths).value),
        "gospa": {name: float(parts[name]) for name in ("distance", "localisation", "missed", "false")},
    }


def mahalanobis_case(rng: np.random.Generator) -> dict[str, Any]:
    root = rng.normal(size=(4, 6))
    mean, true, cov = rng.normal(size=4), rng.normal(size=4), root @ root.T
    estimate = GaussianState(mean.reshape(-1, 1), cov)
    squared = SquaredMahalanobis(mapping=range(4))(estimate, state(true))
    return {"mean": mean.tolist(), "cov": cov.tolist(), "true": true.tolist(), "squared": float(squared)}


def clear_mot_case(rng: np.random.Generator) -> dict[str, Any]:
    """Targets far apart, so that there is one way to match them.

    Where definitions differ the cases are silent. A label lasts two scans or more, as Stone Soup has no association of
    a single moment. It does not change where the target was lost between, which Stone Soup does not count as a switch.
    And false tracks are about equally far from all targets, as Stone Soup weighs distances beyond the threshold too.
    """
    truths: dict[int, dict[int, list[float]]] = {}
    tracks: dict[int, dict[int, list[float]]] = {}
    for target in range(3):
        scan, end = int(rng.integers(0, 4)), int(rng.integers(NUM_SCANS - 3, NUM_SCANS + 1))
        truths[target] = {k: [1000.0 * target, 5.0 * k] for k in range(scan, end)}
        label = 10 * target
        while scan + 2 <= end:
            length = min(int(rng.integers(2, 5)), end - scan)
            for k in range(scan, scan + length):
                position = np.array(truths[target][k]) + rng.uniform(-9.0, 9.0, 2)
                tracks.setdefault(label, {})[k] = position.round(3).tolist()
            gap = int(rng.integers(0, 3))
            scan, label = scan + length + gap, label + (gap == 0)
    for false in rng.choice(NUM_SCANS, 3, replace=False).tolist():
        tracks[100 + false] = {false: [1000.0, 1e6]}
    ground = {GroundTruthPath([state(x, scan) for scan, x in path.items()]) for path in truths.values()}
    found = {Track([state(x, scan) for scan, x in path.items()]) for path in tracks.values()}
    manager = MultiManager(
        [ClearMotMetrics(distance_measure=Euclidean())], associator=ClearMotAssociator(association_threshold=30.0)
    )
    manager.add_data({"groundtruth_paths": ground, "tracks": found})
    values = manager.generate_metrics()["clearmot_generator"]
    return {
        "cutoff": 30.0,
        "num_scans": NUM_SCANS,
        "truths": [[target, scan, *x] for target, path in truths.items() for scan, x in path.items()],
        "tracks": [[label, scan, *x] for label, path in tracks.items() for scan, x in path.items()],
        "motp": float(values["MOTP"].value),
        "mota": float(values["MOTA"].value),
    }


def main() -> None:
    rng = np.random.default_rng(2017)
    json.dump(
        {
            "stonesoup": importlib.metadata.version("stonesoup"),
            "sets": [set_case(rng, cutoff, order) for cutoff in (20.0, 60.0) for order in (1, 2, 3) for _ in range(12)],
            "mahalanobis": [mahalanobis_case(rng) for _ in range(10)],
            "clear_mot": [clear_mot_case(rng) for _ in range(10)],
        },
        sys.stdout,
    )
    print()


if __name__ == "__main__":
    main()
