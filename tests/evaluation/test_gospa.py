from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evaluation.synthetic import make_record
from reference import gospa as reference
from vedette.errors import InputError
from vedette.evaluation import gospa, gospa_distance, gospa_of_run, ospa
from vedette.kernels.base.types import Floats

coordinates = st.floats(-1000.0, 1000.0, allow_subnormal=False)
corners = st.sampled_from([0.0, 3.0, 4.0])  # many equal distances
point_sets = st.integers(0, 4).flatmap(
    lambda num: (
        hnp.arrays(np.float64, (num, 2), elements=coordinates) | hnp.arrays(np.float64, (num, 2), elements=corners)
    )
)
cutoffs = st.floats(0.1, 2000.0) | st.sampled_from([3.0, 4.0, 5.0])
orders = st.sampled_from([1.0, 1.5, 2.0, 4.0])
alphas = st.floats(0.01, 2.0)


@given(point_sets, point_sets, cutoffs, orders)
def test_equals_brute_force_over_sets_of_pairs(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    total, *_ = reference.gospa_parts(first, second, cutoff, order)
    assert gospa(first, second, cutoff=cutoff, order=order).total == pytest.approx(total, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_parts_equal_brute_force_where_the_best_pairs_are_unique(order: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        first, second = (rng.uniform(0.0, 20.0, (rng.integers(0, 5), 2)) for _ in range(2))
        total, localisation, missed, false = reference.gospa_parts(first, second, 8.0, order)
        result = gospa(first, second, cutoff=8.0, order=order)
        assert (result.total, result.localisation) == pytest.approx((total, localisation))
        assert (result.num_missed, result.num_false) == (missed, false)


@given(point_sets, point_sets, cutoffs, orders, alphas)
def test_distance_equals_brute_force(first: Floats, second: Floats, cutoff: float, order: float, alpha: float) -> None:
    expected = reference.gospa(first, second, cutoff, order, alpha)
    actual = gospa_distance(first, second, cutoff=cutoff, order=order, alpha=alpha)
    assert actual == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(point_sets, point_sets, cutoffs, orders)
def test_parts_add_up_to_the_distance(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    result = gospa(first, second, cutoff=cutoff, order=order)
    assert result.localisation + result.missed + result.false == pytest.approx(result.total**order)
    assert result.missed == pytest.approx(result.num_missed * cutoff**order / 2.0)
    assert result.false == pytest.approx(result.num_false * cutoff**order / 2.0)
    assert result.num_missed - result.num_false == len(second) - len(first)
    assert result.total == pytest.approx(gospa_distance(first, second, cutoff=cutoff, order=order), abs=1e-12)


@given(point_sets, point_sets, point_sets, cutoffs, orders, alphas)
def test_is_a_metric(a: Floats, b: Floats, c: Floats, cutoff: float, order: float, alpha: float) -> None:
    def distance(x: Floats, y: Floats) -> float:
        return gospa_distance(x, y, cutoff=cutoff, order=order, alpha=alpha)

    assert distance(a, a[::-1]) == 0.0
    assert distance(a, b) == pytest.approx(distance(b, a))
    assert distance(a, c) <= (distance(a, b) + distance(b, c)) * (1.0 + 1e-9) + 1e-9


@given(point_sets, point_sets, cutoffs, orders)
def test_alpha_of_one_is_ospa_without_its_division(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    larger = max(len(first), len(second), 1)
    mean = ospa(first, second, cutoff=cutoff, order=order).total
    total = gospa_distance(first, second, cutoff=cutoff, order=order, alpha=1.0)
    assert total == pytest.approx(mean * larger ** (1.0 / order), rel=1e-9, abs=1e-9)


def test_missed_and_false_of_empty_sets() -> None:
    none, two = np.empty((0, 2)), np.zeros((2, 2))
    nothing = gospa(none, [], cutoff=10.0, order=2.0)
    assert (nothing.total, nothing.num_missed, nothing.num_false) == (0.0, 0, 0)
    missed = gospa(none, two, cutoff=10.0, order=2.0)
    assert (missed.total, missed.missed, missed.false, missed.num_missed) == (10.0, 100.0, 0.0, 2)
    false = gospa(two, none, cutoff=10.0, order=2.0)
    assert (false.total, false.missed, false.false, false.num_false) == (10.0, 0.0, 100.0, 2)


def test_the_best_pairs_depend_on_the_order() -> None:
    first, second = np.array([[0.0, 0], [5, 1]]), np.array([[5.0, 1], [10, 0]])
    assert gospa(first, second, cutoff=100.0, order=1.0).total == pytest.approx(10.0)
    assert gospa(first, second, cutoff=100.0, order=2.0).localisation == pytest.approx(52.0)


def test_a_pair_at_the_cutoff_is_a_missed_and_a_false_point() -> None:
    result = gospa([[0.0, 0.0]], [[5.0, 0.0]], cutoff=5.0, order=1.0)
    assert (result.total, result.localisation, result.num_missed, result.num_false) == (5.0, 0.0, 1, 1)


def test_a_high_order_overflows_into_the_costs_alone() -> None:
    result = gospa([[0.0, 0.0]], [[900.0, 0.0], [5000.0, 0.0]], cutoff=1000.0, order=400.0)
    assert result.total == pytest.approx(1000.0, rel=0.01)
    assert (result.missed, result.false) == (math.inf, 0.0)
    near = gospa([[0.0, 0.0]], [[0.001, 0.0]], cutoff=1000.0, order=400.0)
    assert near.total == pytest.approx(0.001)
    assert near.missed == 0.0


@pytest.mark.parametrize("name", ["cutoff", "order", "alpha"])
@pytest.mark.parametrize("value", [0.0, math.nan, math.inf])
def test_bad_parameters_are_named(name: str, value: float) -> None:
    given = {"cutoff": 1.0, "order": 1.0, "alpha": 2.0, name: value}
    with pytest.raises(InputError, match=f"^{name}: expected"):
        gospa_distance([[0.0, 0.0]], [[0.0, 0.0]], **given)


def test_bad_points_are_named() -> None:
    with pytest.raises(InputError, match="estimates: expected finite"):
        gospa([[math.nan, 0.0]], [[0.0, 0.0]], cutoff=1.0, order=1.0)
    with pytest.raises(InputError, match="equal dimension"):
        gospa_distance([[0.0]], [[0.0, 0.0]], cutoff=1.0, order=1.0)


def test_of_a_run_is_scan_by_scan() -> None:
    record = make_record("idm")
    series = gospa_of_run(record.truth, record.estimates, cutoff=15.0, order=2.0)
    for scan in range(record.num_scans):
        _, states = record.truth.at(scan)
        one = gospa(record.estimates[scan].means[:, :2], states[:, :2], cutoff=15.0, order=2.0)
        for name in ("total", "localisation", "missed", "false", "num_missed", "num_false"):
            assert getattr(series, name)[scan] == pytest.approx(getattr(one, name)), name
