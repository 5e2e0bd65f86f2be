from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reference import tracks as reference
from vedette.densities.estimates import Estimate
from vedette.evaluation import Continuity, continuity_of_run
from vedette.simulation.truth import Truth

CUTOFF = 10.0


def make_truth(alive: Any, positions: Any) -> Truth:
    flags = np.asarray(alive, np.bool_)
    states = np.concatenate([np.asarray(positions, float), np.zeros((*flags.shape, 2))], axis=2)
    return Truth.from_arrays(np.arange(1.0, flags.shape[1] + 1), flags, states)


def make_estimate(labels: Any, positions: Any) -> Estimate:
    number = len(labels)
    means = np.concatenate([np.asarray(positions, float).reshape(number, 2), np.zeros((number, 2))], axis=1)
    pairs = np.array([[1, label] for label in labels], np.int64).reshape(number, 2)
    return Estimate(pairs, means, np.tile(np.eye(4), (number, 1, 1)), np.ones(number))


def of_one_target(alive: str, labels: str) -> Continuity:
    """A resting target, alive at the scans of 'x'; the label that it is seen under at each scan, or '.' for none."""
    truth = make_truth([[there == "x" for there in alive]], np.zeros((1, len(alive), 2)))
    estimates = [
        make_estimate([] if label == "." else [int(label)], [] if label == "." else [[1, 1]]) for label in labels
    ]
    return continuity_of_run(truth, estimates, cutoff=CUTOFF, order=1.0)


@pytest.mark.parametrize(
    ("alive", "labels", "switches", "fragmentations"),
    [
        ("xxxxx", "11111", "00000", "00000"),
        ("xxxxx", "..111", "00000", "00000"),  # a late start is no break
        ("xxxxx", "111..", "00000", "00000"),  # nor an early end
        ("xxxxx", "11222", "00100", "00000"),
        ("xxxxx", "1.1.1", "00000", "00101"),
        ("xxxxx", "11.22", "00010", "00010"),  # the last match counts, not the last scan
        ("xxxxx", "12121", "01111", "00000"),
        ("xx.xx", "11.11", "00000", "00000"),  # it was not there to be tracked
        ("xx.xx", "11122", "00010", "00000"),
        ("xxx.x", "11..1", "00000", "00001"),
        (".xxx.", "11111", "00000", "00000"),  # labels before birth and after death match nothing
        (".xxx.", "12322", "00110", "00000"),
        ("xxxxx", ".....", "00000", "00000"),
        (".....", "12121", "00000", "00000"),
    ],
)
def test_of_one_target(alive: str, labels: str, switches: str, fragmentations: str) -> None:
    result = of_one_target(alive, labels)
    assert "".join(map(str, result.label_switches)) == switches
    assert "".join(map(str, result.fragmentations)) == fragmentations
    assert result.label_switches.sum() == sum(map(int, switches))
    assert result.fragmentations.sum() == sum(map(int, fragmentations))


def test_two_targets_that_trade_their_labels_are_two_switches() -> None:
    truth = make_truth(np.ones((2, 3)), [[[0, 0]] * 3, [[50, 0]] * 3])
    estimates = [make_estimate([1, 2], places) for places in ([[0, 1], [50, 1]], [[50, 1], [0, 1]], [[50, 1], [0, 1]])]
    assert continuity_of_run(truth, estimates, cutoff=CUTOFF, order=1.0).label_switches.tolist() == [0, 2, 0]


def test_an_estimate_beyond_the_cutoff_does_not_track() -> None:
    truth = make_truth([[1, 1, 1]], np.zeros((1, 3, 2)))
    estimates = [make_estimate([1], [[x, 0]]) for x in (1, CUTOFF, 1)]
    result = continuity_of_run(truth, estimates, cutoff=CUTOFF, order=1.0)
    assert result.fragmentations.tolist() == [0, 0, 1]


@pytest.mark.parametrize("seed", range(25))
def test_equals_plain_loops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num_targets, num_labels, num_scans = int(rng.integers(0, 4)), int(rng.integers(0, 4)), 8
    truth = make_truth(rng.random((num_targets, num_scans)) < 0.8, rng.uniform(0, 20, (num_targets, num_scans, 2)))
    there = rng.random((num_scans, num_labels)) < 0.8
    estimates = [make_estimate(np.flatnonzero(row), rng.uniform(0, 20, (row.sum(), 2))) for row in there]
    true: dict[Any, reference.Track] = {}
    found: dict[Any, reference.Track] = {}
    for scan, estimate in enumerate(estimates):
        for target, state in zip(*truth.at(scan), strict=True):
            true.setdefault(int(target), {})[scan] = state[:2]
        for label, mean in zip(estimate.labels.tolist(), estimate.means, strict=True):
            found.setdefault(tuple(label), {})[scan] = mean[:2]
    switches, fragmentations = reference.continuity(found, true, num_scans, CUTOFF)
    result = continuity_of_run(truth, estimates, cutoff=CUTOFF, order=1.0)
    assert result.label_switches.tolist() == switches
    assert result.fragmentations.tolist() == fragmentations
