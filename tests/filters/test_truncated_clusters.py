"""A cluster too large for the exact sum: what is left out of it is bounded, and makes nothing certain."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from filters.tables import make_options, marginals_of
from vedette import models
from vedette.densities import LMB
from vedette.filters import Limits, LmbFilter
from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.association.marginals import option_marginals
from vedette.kernels.association.search import SearchCaps

NUM_MEASUREMENTS = 14  # more than the exact sum takes


def crowd(rng: np.random.Generator, scale: float) -> Options:
    """Three rows in one cluster, each of which may be absent, missed or detected as any measurement."""
    columns = (ABSENT, MISSED, *range(NUM_MEASUREMENTS))
    return make_options([[(column, scale * rng.normal()) for column in columns] for _ in range(3)], NUM_MEASUREMENTS)


@pytest.mark.parametrize("scale", [0.3, 2.0, 6.0])
@pytest.mark.parametrize(("most", "gap"), [(1, math.inf), (3, math.inf), (50, math.inf), (10_000, 4.0), (10_000, 12.0)])
def test_marginals_are_within_the_share_left_out(scale: float, most: int, gap: float) -> None:
    for seed in range(3):
        options = crowd(np.random.default_rng(seed), scale)
        log_all, log_expected = marginals_of(options)
        expected = np.exp(log_expected)
        weights_before = options.log_weights.copy()
        got, (log_summed, num_ranked, log_kept) = option_marginals(options, SearchCaps(most, gap, 2**62), None)
        assert num_ranked == 1
        np.testing.assert_array_equal(options.log_weights, weights_before)
        left_out = -math.expm1(log_summed - log_all)
        assert left_out <= -math.expm1(log_kept) + 1e-12
        assert np.abs(np.exp(got) - expected).max() <= left_out + 1e-12
        for row, (low, high) in enumerate(itertools.pairwise(options.offsets.tolist())):
            assert np.exp(got[low:high]).sum() == pytest.approx(1.0, abs=1e-12), row
            absent = float(got[low:high][options.columns[low:high] == ABSENT][0])
            assert -math.inf < absent < 0.0


def contended(rng: np.random.Generator, num_rows: int) -> Options:
    """Rows of which two and two want the same measurement, and all a little of every other."""
    others = [(column, -3.0 + rng.normal()) for column in (ABSENT, MISSED, *range(NUM_MEASUREMENTS))]
    rows = []
    for row in range(num_rows):
        wanted = row // 2
        own = [(column, weight + 0.1 * rng.normal()) for column, weight in others if column != wanted]
        rows.append(sorted([(wanted, 1.0 + rng.normal()), *own], key=lambda option: -option[1]))
    return make_options(rows, NUM_MEASUREMENTS)


@pytest.mark.parametrize("num_rows", [2, 3, 4])
@pytest.mark.parametrize("most", [5, 200, 3000])
def test_what_two_rows_contend_for_is_not_counted_as_left_out(num_rows: int, most: int) -> None:
    """The bound holds, and is nearer to the truth than if rows could share measurements."""
    bounds, loose_bounds, truths = [], [], []
    for seed in range(3):
        options = contended(np.random.default_rng(seed), num_rows)
        log_all, _ = marginals_of(options)
        _, (log_summed, num_ranked, log_kept) = option_marginals(options, SearchCaps(most, math.inf, 2**62), None)
        assert num_ranked == 1
        rows = itertools.pairwise(options.offsets.tolist())
        log_shared = sum(math.log(np.exp(options.log_weights[low:high]).sum()) for low, high in rows)
        truths.append(-math.expm1(log_summed - log_all))
        bounds.append(-math.expm1(log_kept))
        loose_bounds.append(-math.expm1(log_summed - log_shared))
        assert truths[-1] <= bounds[-1] + 1e-12
        assert bounds[-1] <= loose_bounds[-1] + 1e-12
    # Of what the loose bound has too much, a third at least is gone; with two rows nearly all.
    excess, loose_excess = np.subtract(bounds, truths).sum(), np.subtract(loose_bounds, truths).sum()
    assert excess <= (0.1 if num_rows == 2 else 0.67) * loose_excess


def test_a_sum_of_all_choices_leaves_nothing_out() -> None:
    options = crowd(np.random.default_rng(0), 1.0)
    got, (log_summed, num_ranked, log_kept) = option_marginals(options, SearchCaps(2**62, math.inf, 2**62), None)
    log_all, expected = marginals_of(options)
    assert (num_ranked, log_kept) == (1, 0.0)
    assert log_summed == pytest.approx(log_all, abs=1e-10)
    np.testing.assert_allclose(np.exp(got), np.exp(expected), rtol=1e-10)


def test_an_exact_sum_that_falls_below_the_smallest_number_leaves_both_sides_open() -> None:
    rows = [[(0, 0.0), (MISSED, -1.0), (ABSENT, -900.0)], [(0, 0.0), (MISSED, -2.0)]]
    got, (_, num_ranked, log_kept) = option_marginals(make_options(rows, 1), SearchCaps(2**62, math.inf, 2**62), None)
    assert (num_ranked, log_kept) == (0, 0.0)
    assert got[2] == pytest.approx(-900.0 - math.log(math.exp(-1.0) + math.exp(-2.0) + math.exp(-3.0)), abs=0.4)


@pytest.mark.parametrize("most", [1, 2, 20])
def test_no_target_of_a_crowd_becomes_certain(most: int) -> None:
    """With one joint choice kept, every label was certain to be there or not."""
    places = np.array([[10.0 * i, 5.0 * (i % 2)] for i in range(16)])
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([10.0, 10.0]),
        models.constant_detection(0.9),
        models.region_clutter(5.0, models.Region(-500.0, 500.0, -500.0, 500.0), "position"),
    )
    targets = models.TargetModel(
        models.constant_velocity(1.0), models.constant_survival(0.99), models.BirthModel.none(4)
    )
    tracker = LmbFilter(targets, sensor, Limits(max_hypotheses=most))
    labels = np.column_stack([np.zeros(16), np.arange(16)]).astype(np.int64)
    means = np.column_stack([places, np.zeros((16, 2))])
    belief = LMB.from_bernoullis(labels, np.full(16, 0.9), means, np.tile(25.0 * np.eye(4), (16, 1, 1)))
    scan = places[:14] + np.random.default_rng(0).normal(scale=5.0, size=(14, 2))
    posterior, info = tracker.step(belief, scan, np.zeros(3), 1.0, 1, rng=np.random.default_rng(0))
    posterior.validate()
    assert info.num_inexact_clusters == 1
    assert np.isfinite(posterior.existence_logit).all()
    assert 0.0 < info.truncation_error_bound <= 1.0
