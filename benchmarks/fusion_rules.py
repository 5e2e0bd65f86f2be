"""Speed of the rules of fusion, and of the matching of labels.

    python benchmarks/fusion_rules.py [--repeats N]

CPU time of one core, medians over the repeats. Beliefs of eight sensors about twenty targets in a 4-D state, LMBs of
one Gaussian a label, updated from one prediction.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from timing import Measure, Once, milliseconds_of, repeated

from vedette.densities import LMB
from vedette.fusion import ArithmeticAverage, Clmb, FieldsOfView, ParallelUpdate, match_labels
from vedette.models import SensorModel, constant_noise, gaussian_detection, measurement_space_clutter, position

NUM_LABELS, NUM_SENSORS = 20, 8


def rules() -> dict[str, Callable[[], object]]:
    """What is to be timed, by its name."""
    rng = np.random.default_rng(0)
    labels = [(1, i) for i in range(NUM_LABELS)]
    means = np.concatenate([rng.uniform(0.0, 1000.0, (NUM_LABELS, 2)), rng.normal(size=(NUM_LABELS, 2))], axis=1)
    roots = rng.normal(size=(NUM_LABELS, 4, 4))
    covs = 4.0 * (roots @ roots.transpose(0, 2, 1) + np.eye(4))
    prediction = LMB.from_bernoullis(labels, rng.uniform(0.3, 0.9, NUM_LABELS), means, covs)
    posteriors = [
        LMB.from_bernoullis(
            labels, rng.uniform(0.3, 0.99, NUM_LABELS), means + rng.normal(size=means.shape), 0.3 * covs
        )
        for _ in range(NUM_SENSORS)
    ]
    others = [
        LMB.from_bernoullis([(1 + s, i) for i in range(NUM_LABELS)], own.existence, own.tracks.means, own.tracks.covs)
        for s, own in enumerate(posteriors)
    ]
    clutter = measurement_space_clutter(5.0, [0.0, 0.0], [1000.0, 1000.0])
    model = SensorModel(position(), constant_noise([2.0, 2.0]), gaussian_detection(1000.0), clutter)
    poses = np.concatenate([rng.uniform(0.0, 1000.0, (NUM_SENSORS, 2)), np.zeros((NUM_SENSORS, 1))], axis=1)
    views = FieldsOfView((model,) * NUM_SENSORS, poses, (True,) * NUM_SENSORS, prediction)
    equal = np.full(NUM_SENSORS, 1.0 / NUM_SENSORS)
    return {
        "parallel update": lambda: ParallelUpdate().fuse(posteriors, views),
        "GCI": lambda: Clmb(equal).fuse(posteriors, views),
        "GCI by views": lambda: Clmb(equal, field_of_view_weighting=True).fuse(posteriors, views),
        "arithmetic average": lambda: ArithmeticAverage(equal).fuse(posteriors, views),
        "arithmetic average by views": lambda: ArithmeticAverage(equal, field_of_view_weighting=True).fuse(
            posteriors, views
        ),
        "matching of labels": lambda: match_labels(others),
    }


def prepared(name: str) -> Once:
    """What gives the CPU milliseconds of a fusion."""
    return milliseconds_of(rules()[name], calls=20)


def measures() -> Iterator[Measure]:
    """A fusion by each rule."""
    for name in ("parallel update", "GCI", "GCI by views", "arithmetic average"):
        yield Measure("fusion", f"8 sensors, 20 targets, {name}", partial(prepared, name))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=101)
    repeats = parser.parse_args().repeats
    for name, work in rules().items():
        print(f"{name:<28} {1e3 * repeated(work, repeats).median:6.2f} ms")


if __name__ == "__main__":
    main()
