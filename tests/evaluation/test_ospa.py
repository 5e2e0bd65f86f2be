from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evaluation.synthetic import make_record, make_truth
from reference import ospa as reference
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation import OspaResult, ospa, ospa_of_run
from vedette.kernels.base.types import Floats
from vedette.simulation.truth import Truth

coordinates = st.floats(-1000.0, 1000.0, allow_subnormal=False)
point_sets = st.integers(0, 5).flatmap(lambda num: hnp.arrays(np.float64, (num, 2), elements=coordinates))
cutoffs = st.floats(0.1, 2000.0)
orders = st.sampled_from([1.0, 1.5, 2.0, 4.0])


def parts(result: OspaResult) -> tuple[float, float, float]:
    return result.total, result.localisation, result.cardinality


@given(point_sets, point_sets, cutoffs, orders)
def test_equals_brute_force(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    expected = reference.ospa(first, second, cutoff, order)
    assert parts(ospa(first, second, cutoff=cutoff, order=order)) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(point_sets, point_sets, cutoffs, st.sampled_from([1.0, 2.0, 7.0, math.inf]))
def test_is_symmetric_and_within_the_cutoff(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    there, back = (ospa(a, b, cutoff=cutoff, order=order) for a, b in ((first, second), (second, first)))
    assert parts(there) == pytest.approx(parts(back))
    assert 0.0 <= there.total <= cutoff * (1.0 + 1e-12)


@given(point_sets, point_sets, point_sets, cutoffs, st.sampled_from([1.0, 2.0, math.inf]))
def test_obeys_the_triangle_inequality(a: Floats, b: Floats, c: Floats, cutoff: float, order: float) -> None:
    def distance(x: Floats, y: Floats) -> float:
        return ospa(x, y, cutoff=cutoff, order=order).total

    assert distance(a, c) <= distance(a, b) + distance(b, c) + 1e-9


@given(point_sets, point_sets, cutoffs)
def test_an_infinite_order_is_the_limit_of_high_orders(first: Floats, second: Floats, cutoff: float) -> None:
    high = ospa(first, second, cutoff=cutoff, order=5000.0).total
    assert ospa(first, second, cutoff=cutoff, order=math.inf).total == pytest.approx(high, rel=2e-3, abs=1e-12)


@given(point_sets, point_sets, cutoffs, orders)
def test_parts_make_up_the_total(first: Floats, second: Floats, cutoff: float, order: float) -> None:
    result = ospa(first, second, cutoff=cutoff, order=order)
    assert result.localisation**order + result.cardinality**order == pytest.approx(result.total**order)


@pytest.mark.parametrize("order", [1.0, 2.0, math.inf])
def test_empty_sets(order: float) -> None:
    none, two = np.empty((0, 2)), np.zeros((2, 2))
    assert parts(ospa(none, none, cutoff=100.0, order=order)) == (0.0, 0.0, 0.0)
    assert parts(ospa([], two, cutoff=100.0, order=order)) == (100.0, 0.0, 100.0)
    assert parts(ospa(two, none, cutoff=100.0, order=order)) == (100.0, 0.0, 100.0)


def test_infinite_cutoff() -> None:
    two, three = np.array([[0.0, 0], [10, 0]]), np.array([[3.0, 4], [10, 0], [900, 0]])
    assert parts(ospa(two, three[:2], cutoff=math.inf, order=1.0)) == (2.5, 2.5, 0.0)
    result = ospa(two, three, cutoff=math.inf, order=2.0)
    assert math.isinf(result.total)
    assert math.isinf(result.cardinality)
    assert math.isfinite(result.localisation)


def test_bottleneck_of_the_infinite_order_may_differ_from_the_least_sum() -> None:
    first, second = np.array([[0.0, 0], [5, 0]]), np.array([[5.0, 0], [10, 0]])
    assert ospa(first, second, cutoff=100.0, order=math.inf).total == 5.0
    assert ospa(first, second, cutoff=100.0, order=1.0).total == 5.0  # 0 and 10, or 5 and 5


def test_the_best_pairs_depend_on_the_order() -> None:
    first, second = np.array([[0.0, 0], [5, 1]]), np.array([[5.0, 1], [10, 0]])
    assert ospa(first, second, cutoff=100.0, order=1.0).total == pytest.approx(5.0)  # 10 and 0; 2 * 26**0.5 is more
    for order in (2.0, 25.0, 31.0, 300.0, math.inf):
        assert ospa(first, second, cutoff=100.0, order=order).total == pytest.approx(math.sqrt(26.0))


def test_a_very_high_order_neither_overflows_nor_underflows() -> None:
    far = ospa([[0.0, 0.0]], [[900.0, 0.0]], cutoff=1000.0, order=400.0)
    near = ospa([[0.0, 0.0]], [[0.001, 0.0]], cutoff=1000.0, order=400.0)
    assert far.total == pytest.approx(900.0)
    assert near.total == pytest.approx(0.001)


def test_points_of_any_dimension() -> None:
    assert ospa([[1.0]], [[4.0]], cutoff=10.0, order=1.0).total == 3.0
    assert ospa([[1.0, 2, 2]], [[0.0, 0, 0]], cutoff=10.0, order=1.0).total == 3.0


@pytest.mark.parametrize(
    ("estimates", "truths", "cutoff", "order", "message"),
    [
        ([[0.0, 0.0]], [[0.0, 0.0]], 0.0, 1.0, "cutoff"),
        ([[0.0, 0.0]], [[0.0, 0.0]], math.nan, 1.0, "cutoff"),
        ([[0.0, 0.0]], [[0.0, 0.0]], 1.0, 0.5, "order"),
        ([[0.0, 0.0]], [[0.0, 0.0]], 1.0, math.nan, "order"),
        ([[math.nan, 0.0]], [[0.0, 0.0]], 1.0, 1.0, "estimates: expected finite"),
        ([[0.0, 0.0]], [[0.0, math.inf]], 1.0, 1.0, "truths: expected finite"),
        ([0.0, 0.0], [[0.0, 0.0]], 1.0, 1.0, "estimates: expected shape"),
        ([[0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, 1.0, "equal dimension"),
        ([["a", "b"]], [[0.0, 0.0]], 1.0, 1.0, "estimates: expected an array"),
        ([[1.0j, 0.0]], [[0.0, 0.0]], 1.0, 1.0, "estimates: expected an array"),
        (np.ma.array([[0.0, 0.0]], mask=[[True, False]]), [[0.0, 0.0]], 1.0, 1.0, "estimates: .* without masked"),
    ],
)
def test_bad_input_is_named(estimates: object, truths: object, cutoff: float, order: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ospa(estimates, truths, cutoff=cutoff, order=order)  # type: ignore[arg-type]


def test_of_a_run_is_scan_by_scan() -> None:
    record = make_record("idm")
    table = ospa_of_run(record.truth, record.estimates, cutoff=50.0, order=2.0)
    assert table.shape == (record.num_scans, 3)
    for scan in (0, 9, 39):
        _, states = record.truth.at(scan)
        expected = ospa(record.estimates[scan].means[:, :2], states[:, :2], cutoff=50.0, order=2.0)
        assert tuple(table[scan]) == parts(expected)


def test_of_whole_states_takes_all_components() -> None:
    record = make_record("idm")
    table = ospa_of_run(record.truth, record.estimates, cutoff=5.0, order=2.0, components="state")
    for scan in (0, 9, 39):
        _, states = record.truth.at(scan)
        expected = reference.ospa(record.estimates[scan].means, states, 5.0, 2.0)
        np.testing.assert_allclose(table[scan], expected, rtol=1e-12)
    assert (table[:, 0] >= ospa_of_run(record.truth, record.estimates, cutoff=5.0, order=2.0)[:, 0]).all()


def test_of_whole_states_by_hand() -> None:
    truth = Truth(np.array([1.0]), np.array([0, 1]), np.array([0]), np.array([[0.0, 0.0, 1.0, 2.0]]))
    estimate = Estimate(np.array([[1, 0]]), np.array([[0.0, 0.0, 1.0, 5.0]]), np.eye(4)[None], np.ones(1))
    both = [ospa_of_run(truth, [estimate], cutoff=9.0, order=1.0, components=of) for of in ("position", "state")]
    assert both[0].tolist() == [[0.0, 0.0, 0.0]]
    assert both[1].tolist() == [[3.0, 3.0, 0.0]]


def test_whole_states_of_other_components_are_refused() -> None:
    truth, estimates = make_truth(), make_record().estimates
    flat = replace(truth, states=np.ascontiguousarray(truth.states[:, :3]))
    with pytest.raises(InputError, match=r"components: expected position, as true states have 3 .* estimated ones 4"):
        ospa_of_run(flat, estimates, cutoff=50.0, order=2.0, components="state")
    with pytest.raises(InputError, match="components: expected position, state or places in states; got velocity"):
        ospa_of_run(truth, estimates, cutoff=50.0, order=2.0, components="velocity")


def test_of_a_run_needs_one_estimate_a_scan() -> None:
    with pytest.raises(InputError, match="one for each of 40 scans; got 39"):
        ospa_of_run(make_truth(), make_record().estimates[1:], cutoff=50.0, order=2.0)
