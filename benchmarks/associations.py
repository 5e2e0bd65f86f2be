"""CPU time of one scan of an LMB filter in crowds, by how it associates.

    python benchmarks/associations.py

Tracks anywhere on a square whose side is given, each known to 8 m along both axes and there with a probability of .95;
measurements of 19 in 20 of them to 10 m, and no false ones. The least of four times, and what the posterior says.
"""

from __future__ import annotations

import time

import numpy as np

from vedette import models
from vedette.densities import LMB
from vedette.filters import BeliefPropagation, Limits, LmbFilter, RankedAssignment

CROWDS = ((20, 100.0), (50, 200.0), (200, 400.0), (1000, 900.0))  # tracks, m
PRIOR, MEASURED, SEEN = 8.0, 10.0, 0.95
REPEATS = 4


def sensor() -> models.SensorModel:
    region = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
    return models.SensorModel(
        models.position(),
        models.constant_noise([MEASURED, MEASURED]),
        models.constant_detection(SEEN),
        models.region_clutter(30.0, region, "position"),
    )


def crowd(num: int, side: float, rng: np.random.Generator) -> tuple[LMB, np.ndarray]:
    """What is believed before the scan, and the scan."""
    places = rng.uniform(-side / 2.0, side / 2.0, (num, 2))
    means = np.column_stack([places + rng.normal(0.0, PRIOR, (num, 2)), np.zeros((num, 2))])
    covs = np.tile(np.diag([PRIOR**2, PRIOR**2, 4.0, 4.0]), (num, 1, 1))
    labels = np.array([(0, i) for i in range(num)])
    scan = places[rng.random(num) < SEEN]
    return LMB.from_bernoullis(labels, np.full(num, SEEN), means, covs), scan + rng.normal(0.0, MEASURED, scan.shape)


def main() -> None:
    motion, survival = models.constant_velocity(1.0), models.constant_survival(0.99)
    targets = models.TargetModel(motion, survival, models.BirthModel.none(4))
    print("tracks  side m  association            ms  existence  log likelihood  left out, at most")
    for num, side in CROWDS:
        belief, scan = crowd(num, side, np.random.default_rng(0))
        for assignment in (RankedAssignment(), BeliefPropagation()):
            tracker = LmbFilter(targets, sensor(), Limits(max_labels=5000), assignment)
            seconds = []
            for _ in range(REPEATS):
                start, rng = time.process_time(), np.random.default_rng(0)
                posterior, info = tracker.step(belief, scan, np.zeros(3), 1.0, 1, rng=rng)
                seconds.append(time.process_time() - start)
            print(
                f"{num:6d}  {side:6.0f}  {type(assignment).__name__:18s}  {1e3 * min(seconds):7.1f}"
                f"  {posterior.existence.sum():9.1f}  {info.log_likelihood:14.1f}  {info.truncation_error_bound:17.3f}"
            )


if __name__ == "__main__":
    main()
