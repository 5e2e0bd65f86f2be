from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from vedette.errors import InputError
from vedette.evaluation import holm, paired_difference, summarise


def test_summary_equals_scipys() -> None:
    values = np.random.default_rng(1).normal(10.0, 3.0, 25)
    summary = summarise(values)
    interval = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert float(summary.mean) == pytest.approx(values.mean())
    assert float(summary.standard_error) == pytest.approx(scipy.stats.sem(values))
    assert (float(summary.low), float(summary.high)) == pytest.approx((interval.low, interval.high))
    assert summary.num_runs == 25


def test_summary_of_curves_is_point_by_point() -> None:
    values = np.random.default_rng(2).normal(size=(12, 40))
    summary = summarise(values)
    assert summary.mean.shape == summary.high.shape == (40,)
    assert float(summary.standard_error[7]) == pytest.approx(float(summarise(values[:, 7]).standard_error))


def test_a_single_run_has_no_error() -> None:
    summary = summarise([[3.0, 4.0]])
    np.testing.assert_array_equal(summary.mean, [3.0, 4.0])
    for unknown in (summary.standard_error, summary.low, summary.high):
        assert np.isnan(unknown).all()


def test_interval_covers_the_truth_as_often_as_it_says() -> None:
    values = np.random.default_rng(3).normal(5.0, 2.0, (8, 4000))  # 4000 campaigns of 8 runs
    summary = summarise(values)
    covered = ((summary.low <= 5.0) & (summary.high >= 5.0)).mean()
    assert covered == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / 4000))


def test_paired_difference_is_sharper_than_the_difference_of_means() -> None:
    rng = np.random.default_rng(4)
    common = rng.normal(20.0, 5.0, 30)
    first, second = common + 1.0 + 0.1 * rng.standard_normal(30), common
    paired = paired_difference(first, second)
    assert float(paired.summary.mean) == pytest.approx(1.0, abs=0.1)
    assert float(paired.summary.standard_error) < 0.05 < float(summarise(first).standard_error)
    assert paired.win_rate == 1.0


def test_wins_and_ties_are_counted_separately() -> None:
    paired = paired_difference([2.0, 1.0, 1.0, 5.0], [1.0, 1.0, 3.0, 4.0])
    assert (paired.win_rate, paired.tie_rate) == (0.5, 0.25)


@pytest.mark.parametrize(
    "values", [[], 3.0, [1.0, np.nan], [np.inf], [1.0, 2.0j], np.ma.array([1.0, 2.0], mask=[False, True]), ["1.0"]]
)
def test_bad_values_are_named(values: object) -> None:
    with pytest.raises(InputError, match="values: expected"):
        summarise(values)  # type: ignore[arg-type]


@pytest.mark.parametrize(("first", "second"), [([1.0, 2.0], [1.0]), ([[1.0]], [[1.0]])])
def test_unpaired_values_are_refused(first: object, second: object) -> None:
    with pytest.raises(InputError, match="equally many"):
        paired_difference(first, second)  # type: ignore[arg-type]


def test_p_value_is_scipys_where_differences_are_not_skewed() -> None:
    rng = np.random.default_rng(6)
    first, second = rng.normal(1.0, 1.0, 40), rng.normal(0.6, 1.0, 40)
    paired = paired_difference(first, second)
    assert not paired.is_skewed
    assert paired.p_value == pytest.approx(scipy.stats.ttest_rel(first, second).pvalue)


def test_skewed_differences_have_an_interval_that_covers_as_it_says() -> None:
    """Of 30 log-normal differences Student's interval covers the mean in 88 to 89 %, this one in 93 to 95 %."""
    rng = np.random.default_rng(7)
    covered = []
    for _ in range(200):
        paired = paired_difference(rng.lognormal(0.0, 1.0, 30), np.zeros(30))
        covered.append(float(paired.summary.low) <= np.exp(0.5) <= float(paired.summary.high))
    assert np.mean(covered) > 0.91


@pytest.mark.parametrize("shift", [0.0, 0.2, 0.5])
def test_interval_and_p_value_of_skewed_differences_agree(shift: float) -> None:
    for seed in range(20):
        values = np.random.default_rng(seed).lognormal(0.0, 1.5, 25) - np.exp(1.125) - shift
        paired = paired_difference(values, np.zeros(25))
        outside = float(paired.summary.low) > 0.0 or float(paired.summary.high) < 0.0
        assert outside == (paired.p_value < 0.05)
        again = paired_difference(values, np.zeros(25))
        assert (paired.p_value, float(paired.summary.low)) == (again.p_value, float(again.summary.low))


def test_differences_of_which_most_are_equal_have_students_interval() -> None:
    """Samples of one value only have no error: their quantiles are no numbers."""
    paired = paired_difference([0.0] * 9 + [1.0], np.zeros(10))
    assert not paired.is_skewed
    assert paired.p_value == pytest.approx(scipy.stats.ttest_1samp([0.0] * 9 + [1.0], 0.0).pvalue)


def test_equal_and_constant_differences_have_a_p_value() -> None:
    assert paired_difference([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]).p_value == 1.0
    assert paired_difference([2.0, 3.0, 4.0], [1.0, 2.0, 3.0]).p_value == 0.0
    assert np.isnan(paired_difference([1.0], [2.0]).p_value)


def test_holm_by_hand() -> None:
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(holm([0.5, np.nan, 0.9]), [1.0, np.nan, 1.0])
    assert holm(np.empty(0)).shape == (0,)
    with pytest.raises(InputError, match="p_values: expected probabilities"):
        holm([0.5, 1.5])


def test_holm_keeps_the_chance_of_any_false_claim() -> None:
    """Five strategies that are alike: one campaign in twenty may claim something; by single tests one in five would."""
    rng = np.random.default_rng(8)
    runs = rng.normal(size=(2000, 5, 10))
    p_values = scipy.stats.ttest_1samp(runs, 0.0, axis=2).pvalue
    claimed = np.mean([(holm(row) < 0.05).any() for row in p_values])
    assert claimed == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / 2000))
    assert (p_values < 0.05).any(axis=1).mean() > 0.15
