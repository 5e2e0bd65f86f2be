"""Assignment and ranking against the enumeration of every joint choice."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filters.tables import children_of, choices_of, make_options, make_parents, tables
from vedette.kernels.association.assignment import ABSENT, MISSED, make_dual_work, solve_assignment
from vedette.kernels.association.coverage import add_uncovered, themes_of_options
from vedette.kernels.association.gibbs import sample_children
from vedette.kernels.association.ranked import rank_children

pytestmark = pytest.mark.lanes

UNLIMITED = (2**62, math.inf, 2**62)


def listed(children):
    """Log weight, parent and options of each child."""
    return [
        (float(w), int(p), tuple(children.options[low:high].tolist()))
        for w, p, low, high in zip(
            children.log_weights, children.parents, children.offsets[:-1], children.offsets[1:], strict=True
        )
    ]


def assert_heaviest(got, expected):
    """The same weights in the same order; each a real child, none twice. Equal weights may come in any order."""
    np.testing.assert_allclose([w for w, _, _ in got], [w for w, _, _ in expected][: len(got)], rtol=0.0, atol=1e-9)
    weights = {(parent, chosen): weight for weight, parent, chosen in expected}
    assert len({child[1:] for child in got}) == len(got)
    for weight, parent, chosen in got:
        assert weight == pytest.approx(weights[parent, chosen], abs=1e-9)


@given(tables(max_rows=5))
def test_best_assignment_and_its_duals(table):
    options, num_columns, parents = table
    rows = parents.rows[: parents.offsets[1]]
    work = make_dual_work(len(rows), num_columns)
    cost = solve_assignment(options, rows, work)
    choices = choices_of(options, rows)
    if not choices:
        assert cost == math.inf
        return
    assert cost == pytest.approx(-max(choices)[0], abs=1e-9)
    assert np.all(work.column_dual <= 1e-12)
    for i, row in enumerate(rows):
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            reduced = -options.log_weights[option] - work.row_dual[i]
            reduced -= work.column_dual[column] if column >= 0 else 0.0
            assert reduced >= -1e-9
            if option == work.row_option[i]:
                assert reduced <= 1e-9
    taken = options.columns[work.row_option[: len(rows)]]
    assert np.all(np.isin(np.flatnonzero(work.column_dual < -1e-9), taken))


@given(tables())
def test_all_children_in_order(table):
    options, num_columns, parents = table
    children, cut = rank_children(options, parents, num_columns, *UNLIMITED)
    expected = children_of(options, parents)
    assert not cut
    assert len(children.parents) == len(expected)
    assert_heaviest(listed(children), expected)


@given(tables(), st.integers(1, 12), st.sampled_from([0.0, 1.0, 2.5, 10.0, math.inf]))
def test_number_and_gap(table, most, gap):
    options, num_columns, parents = table
    parents = parents._replace(groups=np.empty(0, np.int64))
    children, _ = rank_children(options, parents, num_columns, most, gap, 2**62)
    expected = children_of(options, parents)
    near = [child for child in expected if child[0] >= expected[0][0] - gap - 1e-9][:most]
    got = listed(children)
    assert_heaviest(got, expected)
    # One more or less where the gap is met to the last digit.
    exact = [child for child in near if abs(child[0] - expected[0][0] + gap) > 1e-9]
    assert len(exact) <= len(got) <= len(near)


@given(tables(max_parents=5), st.integers(1, 4))
def test_every_group_keeps_its_heaviest(table, most):
    options, num_columns, parents = table
    children, _ = rank_children(options, parents, num_columns, most, 1.0, 2**62)
    if len(parents.groups) == 0:
        return
    heaviest: dict[int, float] = {}
    for weight, parent, _ in children_of(options, parents):
        heaviest.setdefault(int(parents.groups[parent]), weight)
    got: dict[int, float] = {}
    for weight, parent, _ in listed(children):
        group = int(parents.groups[parent])
        got[group] = max(got.get(group, -math.inf), weight)
    assert got == pytest.approx(heaviest, abs=1e-9)


def test_larger_dense_tables():
    rng = np.random.default_rng(5)
    for _ in range(5):
        rows = [[(column, rng.normal()) for column in (ABSENT, MISSED, *range(5))] for _ in range(5)]
        options = make_options(rows)
        parents = make_parents([[0, 1, 2, 3, 4], [0, 2, 4], []], [-1.0, -0.5, -3.0])
        children, _ = rank_children(options, parents, 5, 300, math.inf, 2**62)
        assert len(children.parents) == 300
        assert_heaviest(listed(children), children_of(options, parents))


def test_search_stops_at_the_node_bound_and_says_so():
    rows = [[(column, 0.0) for column in (MISSED, *range(6))] for _ in range(6)]
    options, parents = make_options(rows), make_parents([list(range(6))], [0.0])
    children, cut = rank_children(options, parents, 6, 1000, math.inf, 200)
    assert cut
    assert 0 < len(children.parents) < 1000


@given(tables(), st.integers(0, 2**32 - 1))
def test_samples_are_children_each_found_once_the_best_of_each_parent_among_them(table, seed):
    options, num_columns, parents = table
    children = sample_children(options, parents, num_columns, 20, np.random.default_rng(seed))
    expected = children_of(options, parents)
    weights = {(parent, chosen): weight for weight, parent, chosen in expected}
    got = listed(children)
    assert len({child[1:] for child in got}) == len(got)
    for weight, parent, chosen in got:
        assert weight == pytest.approx(weights[parent, chosen], abs=1e-9)
    best = {parent: weight for weight, parent, _ in reversed(expected)}
    found = {parent: weight for weight, parent, _ in sorted(got)}
    assert found == pytest.approx(best, abs=1e-9)


@given(tables(), st.integers(1, 3), st.sampled_from([3.0, 50.0, math.inf]))
def test_every_theme_of_weight_gets_a_child(table, most, gap):
    options, num_columns, parents = table
    parents = parents._replace(groups=np.empty(0, np.int64))
    num_rows = len(options.offsets) - 1
    labels = np.stack([np.zeros(num_rows, np.int64), np.arange(num_rows) // 2], axis=1)
    themes, num_themes = themes_of_options(labels, options, num_columns)
    ranked, _ = rank_children(options, parents, num_columns, most, math.inf, 2**62)
    children = add_uncovered(options, themes, num_themes, parents, ranked, num_columns, gap)
    got, expected = listed(children), children_of(options, parents)
    assert got[: len(ranked.parents)] == listed(ranked)
    weights = {(parent, chosen): weight for weight, parent, chosen in expected}
    for weight, parent, chosen in got:
        assert weight == pytest.approx(weights[parent, chosen], abs=1e-9)
    for weight, _, _ in got[len(ranked.parents) :]:
        assert weight >= expected[0][0] - gap - 1e-9
    if num_columns == 0 and gap == math.inf:
        # Nothing collides, so that the bound is met and the heaviest child of every theme is found.
        held = {int(themes[option]) for _, _, chosen in got for option in chosen}
        wanted = {int(themes[option]) for _, _, chosen in expected for option in chosen}
        assert held - {-1} == wanted - {-1}


def test_a_theme_is_a_label_and_what_the_scan_did_to_it():
    rows = [[(ABSENT, -1.0), (MISSED, -2.0), (0, -0.5)], [(MISSED, 0.0), (0, -1.0)], [(MISSED, 0.0), (1, -1.0)]]
    options = make_options(rows)
    themes, num_themes = themes_of_options(np.array([[3, 1], [3, 1], [4, 0]]), options, 2)
    assert num_themes == 6
    assert themes[options.columns == ABSENT].tolist() == [-1]
    first, second, third = (
        themes[low:high] for low, high in zip(options.offsets[:-1], options.offsets[1:], strict=True)
    )
    assert set(first[first >= 0]) == set(second)
    assert not set(second) & set(third)
    assert len(set(themes[themes >= 0].tolist())) == 4
