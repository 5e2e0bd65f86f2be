"""Ranked and sampled joint choices against enumeration of every one of them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vedette.kernels.assignment import ABSENT, MISSED, Options, make_dual_work, solve_assignment
from vedette.kernels.gibbs import sample_children
from vedette.kernels.ranked import Children, Parents, rank_children

pytestmark = pytest.mark.lanes

NO_CAP = 2**62
NO_GROUPS = np.empty(0, np.int64)
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


def random_rows(rng: np.random.Generator, num_rows: int, num_columns: int, density: float, ties: bool) -> Any:
    """A row may lack any of its options, at times all of them. Ties: weights are whole numbers, many of them equal."""
    rows: list[dict[int, float]] = []
    for _ in range(num_rows):
        columns = [c for c in range(ABSENT, num_columns) if rng.random() < (density if c >= 0 else 0.8)]
        rows.append({c: float(rng.integers(-2, 2)) if ties else float(3.0 * rng.normal()) for c in columns})
    return rows


def parents_of(rows: list[list[int]], log_weights: Any, groups: Any = NO_GROUPS) -> Parents:
    return Parents(
        np.cumsum([0, *(len(row) for row in rows)]),
        np.array([r for row in rows for r in row], np.int64),
        np.array(log_weights, np.float64),
        np.array(groups, np.int64),
    )


@dataclass(frozen=True)
class Problem:
    options: Options
    parents: Parents
    num_columns: int

    def rows_of(self, parent: int) -> list[int]:
        start, stop = self.parents.offsets[parent : parent + 2]
        return [int(row) for row in self.parents.rows[start:stop]]

    def enumerate(self) -> dict[tuple[int, ...], float]:
        """Log weight of every possible choice, by (parent, options)."""
        weights = {}
        for parent, log_weight in enumerate(self.parents.log_weights):
            runs = [range(self.options.offsets[r], self.options.offsets[r + 1]) for r in self.rows_of(parent)]
            for choice in itertools.product(*runs):
                taken = [self.options.columns[o] for o in choice if self.options.columns[o] >= 0]
                if len(set(taken)) == len(taken):
                    weights[(parent, *choice)] = float(log_weight) + sum(self.options.log_weights[o] for o in choice)
        return weights

    def rank(self, max_children: int = NO_CAP, max_log_gap: float = math.inf, max_nodes: int = NO_CAP) -> Any:
        return rank_children(self.options, self.parents, self.num_columns, max_children, max_log_gap, max_nodes)


def random_problem(rng: np.random.Generator, *, ties: bool | None = None, groups: bool = False) -> Problem:
    num_rows, num_columns, num_parents = (int(rng.integers(0, 6)), int(rng.integers(0, 5)), int(rng.integers(1, 5)))
    density = float(rng.choice([0.2, 0.6, 1.0]))
    rows = random_rows(rng, num_rows, num_columns, density, bool(rng.random() < 0.4) if ties is None else ties)
    members = [[r for r in range(num_rows) if rng.random() < 0.7][:4] for _ in range(num_parents)]
    numbers = rng.integers(0, 3, num_parents) if groups else NO_GROUPS
    return Problem(option_table(rows), parents_of(members, rng.normal(size=num_parents), numbers), num_columns)


def keyed(children: Children) -> dict[tuple[int, ...], float]:
    """Log weight of each child by (parent, options); no child may be there twice."""
    found = {}
    for child, parent in enumerate(children.parents):
        choice = children.options[children.offsets[child] : children.offsets[child + 1]]
        found[(int(parent), *(int(o) for o in choice))] = float(children.log_weights[child])
    assert len(found) == len(children.parents)
    return found


def assert_weights(found: dict[tuple[int, ...], float], every: dict[tuple[int, ...], float]) -> None:
    assert set(found) <= set(every)
    for key, log_weight in found.items():
        assert log_weight == pytest.approx(every[key], abs=1e-9)


def assert_descending(log_weights: Any) -> None:
    assert (np.diff(log_weights) <= 1e-12).all()


@given(SEEDS)
def test_the_optimum_of_one_assignment(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    rows = np.array(problem.rows_of(0), np.int64)
    work = make_dual_work(len(rows), problem.num_columns)
    cost = solve_assignment(problem.options, rows, work) - problem.parents.log_weights[0]
    every = {key: weight for key, weight in problem.enumerate().items() if key[0] == 0}
    if not every:
        assert cost == math.inf
        return
    assert -cost == pytest.approx(max(every.values()), abs=1e-9)
    assert every[(0, *(int(o) for o in work.row_option[: len(rows)]))] == pytest.approx(-cost, abs=1e-9)
    # Dual feasible, and tight where chosen: what proves that it is the optimum.
    assert (work.column_dual <= 1e-9).all()
    for i, row in enumerate(rows):
        for option in range(problem.options.offsets[row], problem.options.offsets[row + 1]):
            column = problem.options.columns[option]
            slack = -problem.options.log_weights[option] - work.row_dual[i]
            slack -= work.column_dual[column] if column >= 0 else 0.0
            assert slack >= -1e-9
            assert option != work.row_option[i] or abs(slack) < 1e-9


@given(SEEDS)
def test_everything_is_found_in_order(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed))
    children, cut = problem.rank()
    found, every = keyed(children), problem.enumerate()
    assert not cut
    assert set(found) == set(every)
    assert_weights(found, every)
    assert_descending(children.log_weights)


@given(SEEDS, st.integers(1, 30))
def test_the_heaviest_within_a_number(seed: int, most: int) -> None:
    problem = random_problem(np.random.default_rng(seed))
    children, cut = problem.rank(max_children=most)
    every = problem.enumerate()
    assert not cut
    assert_weights(keyed(children), every)
    heaviest = sorted(every.values(), reverse=True)[:most]
    np.testing.assert_allclose(children.log_weights, heaviest, rtol=0, atol=1e-9)


@given(SEEDS, st.floats(0.1, 6.0))
def test_none_beyond_the_gap(seed: int, gap: float) -> None:
    problem = random_problem(np.random.default_rng(seed), ties=False)
    children, cut = problem.rank(max_log_gap=gap)
    every = problem.enumerate()
    best = max(every.values(), default=0.0)
    assert not cut
    assert_weights(keyed(children), every)
    heaviest = [weight for weight in sorted(every.values(), reverse=True) if weight >= best - gap]
    np.testing.assert_allclose(children.log_weights, heaviest, rtol=0, atol=1e-9)


@given(SEEDS, st.integers(1, 8), st.sampled_from([0.5, math.inf]))
def test_every_group_keeps_its_best(seed: int, most: int, gap: float) -> None:
    problem = random_problem(np.random.default_rng(seed), ties=False, groups=True)
    children, _ = problem.rank(max_children=most, max_log_gap=gap)
    found, every = keyed(children), problem.enumerate()
    assert_weights(found, every)
    best = max(every.values(), default=0.0)
    heaviest = [weight for weight in sorted(every.values(), reverse=True)[:most] if weight >= best - gap]
    np.testing.assert_allclose(children.log_weights[: len(heaviest)], heaviest, rtol=0, atol=1e-9)
    groups = problem.parents.groups
    for group in set(groups.tolist()):
        mine = [weight for key, weight in every.items() if groups[key[0]] == group]
        kept = [weight for key, weight in found.items() if groups[key[0]] == group]
        assert not mine or max(kept) == pytest.approx(max(mine), abs=1e-9)
    assert len(found) <= len(heaviest) + len(set(groups.tolist()))


@pytest.mark.parametrize("seed", range(4))
def test_a_crowd(seed: int) -> None:
    """All rows want the same few columns."""
    rng = np.random.default_rng(seed)
    rows = [{c: (5.0 if c >= 0 else 0.0) + rng.normal() for c in range(ABSENT, 4)} for _ in range(5)]
    problem = Problem(option_table(rows), parents_of([[0, 1, 2, 3, 4], [1, 3]], [-1.0, 0.0]), 4)
    children, _ = problem.rank(max_children=200)
    every = problem.enumerate()
    assert_weights(keyed(children), every)
    heaviest = sorted(every.values(), reverse=True)[:200]
    np.testing.assert_allclose(children.log_weights, heaviest, rtol=0, atol=1e-9)


def test_no_rows() -> None:
    problem = Problem(option_table([]), parents_of([[], []], [-0.5, -1.5]), 3)
    children, cut = problem.rank()
    np.testing.assert_array_equal(children.log_weights, [-0.5, -1.5])
    np.testing.assert_array_equal(children.parents, [0, 1])
    assert len(children.options) == 0
    assert not cut


def test_no_columns() -> None:
    rows = [{ABSENT: -1.0, MISSED: -2.0}, {MISSED: 0.5}]
    problem = Problem(option_table(rows), parents_of([[0, 1]], [0.0]), 0)
    np.testing.assert_allclose(problem.rank()[0].log_weights, [-0.5, -1.5])


def test_a_row_without_options_forbids_its_parent() -> None:
    problem = Problem(option_table([{}, {MISSED: 0.0}]), parents_of([[0, 1], [1]], [5.0, 0.0]), 0)
    children, _ = problem.rank()
    np.testing.assert_array_equal(children.parents, [1])


def test_two_rows_that_need_the_same_column() -> None:
    problem = Problem(option_table([{0: 0.0}, {0: 0.0}]), parents_of([[0, 1]], [0.0], [0]), 1)
    children, cut = problem.rank()
    assert len(children.parents) == 0
    assert not cut


def test_the_search_may_be_cut() -> None:
    rng = np.random.default_rng(3)
    rows = [{c: rng.normal() for c in range(ABSENT, 4)} for _ in range(4)]
    problem = Problem(option_table(rows), parents_of([[0, 1, 2, 3]], [0.0]), 4)
    children, cut = problem.rank(max_nodes=20)
    every = sorted(problem.enumerate().values(), reverse=True)
    assert cut
    assert 0 < len(children.parents) < len(every)
    np.testing.assert_allclose(children.log_weights, every[: len(children.parents)], rtol=0, atol=1e-9)


@given(SEEDS, st.integers(1, 40))
def test_samples_are_some_of_all(seed: int, num_samples: int) -> None:
    problem = random_problem(np.random.default_rng(seed))
    children = sample_children(
        problem.options, problem.parents, problem.num_columns, num_samples, np.random.default_rng(seed)
    )
    found, every = keyed(children), problem.enumerate()
    assert_weights(found, every)
    for parent in range(len(problem.parents.log_weights)):
        mine = [weight for key, weight in every.items() if key[0] == parent]
        sampled = [weight for key, weight in found.items() if key[0] == parent]
        assert not mine or max(sampled) == pytest.approx(max(mine), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_plenty_of_samples_are_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = [{c: 0.5 * rng.normal() for c in range(ABSENT, 2)} for _ in range(3)]
    problem = Problem(option_table(rows), parents_of([[0, 1, 2], [1, 2], []], rng.normal(size=3)), 2)
    children = sample_children(problem.options, problem.parents, 2, 3000, rng)
    assert set(keyed(children)) == set(problem.enumerate())
    again = sample_children(problem.options, problem.parents, 2, 50, np.random.default_rng(seed))
    same = sample_children(problem.options, problem.parents, 2, 50, np.random.default_rng(seed))
    for one, other in zip(again, same, strict=True):
        np.testing.assert_array_equal(one, other)
