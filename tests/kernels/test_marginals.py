"""Marginal probabilities of options against enumeration of every joint choice."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vedette.kernels.assignment import ABSENT, MISSED, Options
from vedette.kernels.marginals import MAX_EXACT_MEASUREMENTS, option_marginals

pytestmark = pytest.mark.lanes

NO_CAP = 2**62
SEEDS = st.integers(0, 2**32 - 1)


def option_table(rows: list[dict[int, float]]) -> Options:
    """Rows given as {column: log weight}, sorted as the kernels expect them."""
    ordered = [sorted(row.items(), key=lambda item: -item[1]) for row in rows]
    flat = [item for row in ordered for item in row]
    return Options(
        np.cumsum([0, *(len(row) for row in ordered)]),
        np.array([column for column, _ in flat], np.int64),
        np.array([weight for _, weight in flat], np.float64),
        np.zeros(len(flat), np.int64),
        np.empty(0),
        np.empty((0, 2)),
    )


def marginals(options: Options, num_columns: int, most: int = NO_CAP, gap: float = math.inf) -> tuple[Any, float, int]:
    """Linear marginals, log total weight, number of clusters that were ranked."""
    out = np.full(options.offsets[-1], np.nan)
    log_total, num_ranked = option_marginals(options, num_columns, most, gap, NO_CAP, out)
    return np.exp(out), log_total, num_ranked


def choices(options: Options) -> dict[tuple[int, ...], float]:
    """Linear weight of every possible joint choice."""
    runs = [range(start, stop) for start, stop in itertools.pairwise(options.offsets)]
    weights = {}
    for choice in itertools.product(*runs):
        taken = [options.columns[o] for o in choice if options.columns[o] >= 0]
        if len(set(taken)) == len(taken):
            weights[choice] = math.exp(sum(options.log_weights[o] for o in choice))
    return weights


def expected(options: Options, weights: dict[tuple[int, ...], float]) -> tuple[Any, float]:
    out, total = np.zeros(options.offsets[-1]), sum(weights.values())
    for choice, weight in weights.items():
        out[list(choice)] += weight / total
    return out, math.log(total)


def assert_enumerated(options: Options, num_columns: int, num_ranked: int = 0) -> None:
    found, log_total, ranked = marginals(options, num_columns)
    wanted, wanted_total = expected(options, choices(options))
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-14)
    assert log_total == pytest.approx(wanted_total, abs=1e-10)
    assert ranked == num_ranked


def random_row(rng: np.random.Generator, columns: Any, density: float) -> dict[int, float]:
    row = {int(c): float(3.0 * rng.normal()) for c in columns if rng.random() < density}
    return {ABSENT: float(rng.normal()), MISSED: float(rng.normal()), **row}


@given(SEEDS)
def test_random_tables(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num_columns = int(rng.integers(0, 7))
    density = float(rng.choice([0.15, 0.5, 1.0]))
    rows = [random_row(rng, range(num_columns), density) for _ in range(rng.integers(0, 5))]
    for row in rows:
        if rng.random() < 0.3:
            del row[ABSENT]
    assert_enumerated(option_table(rows), num_columns)


@pytest.mark.parametrize("seed", range(3))
def test_a_dense_cluster_at_the_limit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = [random_row(rng, range(MAX_EXACT_MEASUREMENTS), 1.0) for _ in range(3)]
    assert_enumerated(option_table(rows), MAX_EXACT_MEASUREMENTS)


@pytest.mark.parametrize("seed", range(3))
def test_a_cluster_beyond_the_limit_is_ranked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    num_columns = MAX_EXACT_MEASUREMENTS + 1
    rows = [random_row(rng, range(num_columns), 1.0) for _ in range(3)]
    assert_enumerated(option_table(rows), num_columns, num_ranked=1)


def test_a_ranked_cluster_within_a_number() -> None:
    rng = np.random.default_rng(7)
    num_columns, most = MAX_EXACT_MEASUREMENTS + 2, 40
    options = option_table([random_row(rng, range(num_columns), 1.0) for _ in range(3)])
    found, log_total, num_ranked = marginals(options, num_columns, most)
    heaviest = dict(sorted(choices(options).items(), key=lambda item: -item[1])[:most])
    wanted, wanted_total = expected(options, heaviest)
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-14)
    assert log_total == pytest.approx(wanted_total, abs=1e-10)
    assert num_ranked == 1


def test_rows_that_meet_through_others_are_one_cluster() -> None:
    rows = [{MISSED: 0.0, 0: 1.0}, {MISSED: 0.0, 2: 1.0}, {MISSED: 0.0, 1: 1.0, 2: 0.5}, {0: 0.2, 1: 2.0}]
    assert_enumerated(option_table(rows), 3)


def test_rows_alone() -> None:
    options = option_table([{ABSENT: -1.0, 2: 3.0}, {MISSED: 0.7}, {ABSENT: 0.0, 0: -2.0, 1: 0.0}])
    assert_enumerated(options, 3)
    # However many measurements, a row alone needs no ranking.
    rng = np.random.default_rng(0)
    assert_enumerated(option_table([random_row(rng, range(30), 1.0)]), 30)


def test_weights_far_below_one() -> None:
    rows = [{MISSED: -900.0, 0: -905.0, 1: -901.0}, {MISSED: -1200.0, 0: -1198.0}]
    found, log_total, num_ranked = marginals(option_table(rows), 2)
    wanted, wanted_total = expected(*shifted(rows, [900.0, 1200.0]))
    np.testing.assert_allclose(found, wanted, rtol=1e-10)
    assert log_total == pytest.approx(wanted_total - 2100.0, abs=1e-9)
    assert num_ranked == 0


def shifted(rows: list[dict[int, float]], shifts: list[float]) -> tuple[Options, dict[tuple[int, ...], float]]:
    moved = [{c: weight + shift for c, weight in row.items()} for row, shift in zip(rows, shifts, strict=True)]
    options = option_table(moved)
    return options, choices(options)


def test_a_best_choice_that_underflows_beside_the_rows_own_best() -> None:
    """Both rows want one measurement by a factor beyond the range of floats: the fall-back still gives the answer."""
    rows = [{MISSED: -800.0, 0: 0.0}, {MISSED: -801.0, 0: 0.0}]
    found, log_total, num_ranked = marginals(option_table(rows), 1)
    share = 1.0 / (1.0 + math.exp(-1.0))
    np.testing.assert_allclose(found, [1.0 - share, share, share, 1.0 - share], rtol=1e-10)
    assert log_total == pytest.approx(-800.0 + math.log1p(math.exp(-1.0)), abs=1e-9)
    assert num_ranked == 1


def test_nothing_possible() -> None:
    assert marginals(option_table([{0: 0.0}, {0: 0.0}]), 1)[1] == -math.inf
    assert marginals(option_table([{}, {MISSED: 0.0}]), 1)[1] == -math.inf


def test_no_rows() -> None:
    found, log_total, num_ranked = marginals(option_table([]), 2)
    assert (len(found), log_total, num_ranked) == (0, 0.0, 0)
