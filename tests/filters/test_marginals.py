"""The LMB filter and its association marginals against enumeration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.tables import make_options, marginals_of, tables
from vedette.kernels.association.assignment import ABSENT, MISSED
from vedette.kernels.association.marginals import option_marginals
from vedette.kernels.association.search import SearchCaps

pytestmark = pytest.mark.lanes

UNLIMITED = SearchCaps(2**62, math.inf, 2**62)


def assert_marginals(options, num_ranked=None):
    got, (total, ranked, _) = option_marginals(options, UNLIMITED, None)
    expected_total, expected = marginals_of(options)
    if expected_total == -math.inf:
        assert total == -math.inf
        return
    assert total == pytest.approx(expected_total, abs=1e-10)
    np.testing.assert_allclose(np.exp(got), np.exp(expected), rtol=1e-10, atol=1e-13)
    if num_ranked is not None:
        assert ranked == num_ranked


@given(tables(max_rows=5))
def test_marginals(table):
    options, _ = table
    assert_marginals(options)


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_dense_clusters(seed):
    rng = np.random.default_rng(seed)
    rows = [[(column, rng.normal(scale=2.0)) for column in (ABSENT, MISSED, *range(4))] for _ in range(5)]
    rows += [[(column, rng.normal()) for column in (MISSED, 4, 5)] for _ in range(2)]
    assert_marginals(make_options(rows, 6), num_ranked=0)


def test_more_measurements_than_the_exact_sum_takes_are_ranked():
    rng = np.random.default_rng(2)
    spans = [range(0, 6), range(4, 11), range(9, 15)]
    rows = [[(column, rng.normal(scale=2.0)) for column in (ABSENT, MISSED, *span)] for span in spans]
    assert_marginals(make_options(rows, 15), num_ranked=1)


def test_weights_beyond_the_range_of_floats():
    rows = [[(0, 0.0), (1, -700.0), (MISSED, -800.0)], [(0, 0.0), (MISSED, -650.0)], [(1, -2.0), (0, -3.0)]]
    assert_marginals(make_options(rows, 2), num_ranked=1)


def test_a_row_without_options_forbids_all():
    tables_without_choice: list[list[list[tuple[int, float]]]] = [[[]], [[(0, 1.0)], []], [[(0, 0.0)], [(0, 0.0)]]]
    for rows in tables_without_choice:
        _, sums = option_marginals(make_options(rows, 1), UNLIMITED, None)
        assert sums.log_total == -math.inf
