"""Scores of single targets, and scores where only some targets are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.matching import near_targets
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.metrics.targets import target_scores
from vedette.simulation.records import RunRecord

CUTOFF = 40.0


def with_strangers(record: RunRecord, distance: float) -> RunRecord:
    """The record with one more estimate at each scan, this far east of a target."""
    added = list[Estimate]()
    for scan, own in enumerate(record.estimates):
        mean = record.truth.at(scan)[1][0] + [distance, 0.0, 0.0, 0.0]
        rows = np.array([[scan + 1, 99]]), mean[None], np.eye(4)[None], np.ones(1)
        parts = (own.labels, own.means, own.covs, own.existence)
        added.append(Estimate(*(np.concatenate(pair) for pair in zip(parts, rows, strict=True))))
    return replace(record, estimates=tuple(added))


def test_of_every_target_as_counted_by_hand():
    record = make_record("random")
    errors: dict[int, list[float]] = {}
    squares: dict[int, list[float]] = {}
    alive: dict[int, int] = {}
    last: dict[int, tuple[int, ...]] = {}
    switches = dict.fromkeys(range(4), 0)
    for scan, estimate in enumerate(record.estimates):
        ids, states = record.truth.at(scan)
        # Targets are hundreds of metres apart, so that each estimate belongs to the nearest one.
        for target, state in zip(ids.tolist(), states, strict=True):
            alive[target] = alive.get(target, 0) + 1
            offsets = estimate.means[:, :2] - state[:2]
            near = np.hypot(*offsets.T)
            if len(near) == 0 or near.min() >= CUTOFF:
                continue
            best = int(near.argmin())
            errors.setdefault(target, []).append(float(near[best]))
            own = offsets[best]
            squares.setdefault(target, []).append(float(own @ np.linalg.solve(estimate.covs[best, :2, :2], own)))
            label = tuple(estimate.labels[best].tolist())
            switches[target] += last.get(target, label) != label
            last[target] = label
    found = {own.target: own for own in target_scores(record, cutoff=CUTOFF, order=1.0)}
    assert sorted(found) == sorted(alive)
    for target, own in found.items():
        assert own.num_scans == alive[target]
        assert own.covered == pytest.approx(len(errors[target]) / alive[target])
        assert own.rmse_m == pytest.approx(math.sqrt(np.square(errors[target]).mean()))
        assert own.error_ratio == pytest.approx(math.sqrt(np.mean(squares[target]) / 2.0))
        assert own.label_switches == switches[target]


def test_a_target_that_was_never_covered_has_no_error():
    record = make_record()
    absent = replace(record, estimates=tuple(Estimate.empty(4) for _ in record.estimates))
    for own in target_scores(absent, cutoff=CUTOFF, order=1.0):
        assert own.covered == 0.0
        assert math.isnan(own.rmse_m)
        assert math.isnan(own.error_ratio)


def test_partial_truth_leaves_out_estimates_beyond_the_cutoff_and_no_others():
    record = make_record()
    far, near = with_strangers(record, 5000.0), with_strangers(record, 5.0)
    kept = near_targets(far.truth, far.estimates, CUTOFF)
    assert sum(map(len, kept)) == sum(map(len, near_targets(record.truth, record.estimates, CUTOFF)))
    scores = [
        ospa_of_run(each.truth, near_targets(each.truth, each.estimates, CUTOFF), cutoff=CUTOFF, order=1.0)[:, 0]
        for each in (record, far)
    ]
    np.testing.assert_array_equal(scores[0], scores[1])
    assert ospa_of_run(far.truth, far.estimates, cutoff=CUTOFF, order=1.0)[:, 0].mean() > scores[0].mean() + 1.0
    # A second estimate near a known target remains an error.
    assert sum(map(len, near_targets(near.truth, near.estimates, CUTOFF))) > sum(map(len, kept))


def test_partial_truth_expects_an_estimate_per_scan():
    record = make_record()
    with pytest.raises(InputError, match="one for each of 40 scans; got 39"):
        near_targets(record.truth, record.estimates[1:], CUTOFF)
