"""Assignment and ranking against the enumeration of every joint choice."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filters.tables import children_of, choices_of, make_options, make_parents, tables
from vedette.kernels.association.assignment import ABSENT, MISSED, make_dual_work, solve_assignment
from vedette.kernels.association.children import grown_children, make_children
from vedette.kernels.association.detection_coverage import add_uncovered, associations_of_options
from vedette.kernels.association.gibbs import sample_children
from vedette.kernels.association.ranked import add_missing_groups, rank_children, run_search
from vedette.kernels.association.search import WIDEST, SearchCaps, grown_search, make_search
from vedette.kernels.association.search_start import start_search

pytestmark = pytest.mark.lanes

UNLIMITED = SearchCaps(2**62, math.inf, 2**62)


def listed(children):
    """Log weight, parent and options of each child."""
    num, offsets = int(children.filled[0]), children.offsets
    return [
        (float(children.log_weights[c]), int(children.parents[c]), tuple(children.options[offsets[c] : offsets[c + 1]]))
        for c in range(num)
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
    options, parents = table
    rows = parents.rows[: parents.offsets[1]]
    work = make_dual_work(len(rows), options.num_measurements)
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
    options, parents = table
    children, cut = rank_children(options, parents, UNLIMITED)
    expected = children_of(options, parents)
    assert not cut
    assert children.filled[0] == len(expected)
    assert_heaviest(listed(children), expected)


@given(tables(), st.integers(1, 12), st.sampled_from([0.0, 1.0, 2.5, 10.0, math.inf]))
def test_number_and_gap(table, most, gap):
    options, parents = table
    children, _ = rank_children(options, parents, SearchCaps(most, gap, 2**62))
    expected = children_of(options, parents)
    near = [child for child in expected if child[0] >= expected[0][0] - gap - 1e-9][:most]
    got = listed(children)
    assert_heaviest(got, expected)
    # One more or less where the gap is met to the last digit.
    exact = [child for child in near if abs(child[0] - expected[0][0] + gap) > 1e-9]
    assert len(exact) <= len(got) <= len(near)


@given(tables(max_parents=5), st.integers(1, 4), st.lists(st.integers(0, 2), min_size=5, max_size=5))
def test_every_group_keeps_its_heaviest(table, most, numbers):
    options, parents = table
    groups, seen = np.array(numbers[: len(parents.log_weights)], np.int64), np.zeros(3, np.int64)
    children, _ = rank_children(options, parents, SearchCaps(most, 1.0, 2**62))
    widest = int(np.diff(parents.offsets).max())
    work = make_dual_work(widest, options.num_measurements)
    while not add_missing_groups(options, parents, groups, seen, work, children):
        children = grown_children(children, widest)
    heaviest: dict[int, float] = {}
    for weight, parent, _ in children_of(options, parents):
        heaviest.setdefault(int(groups[parent]), weight)
    got: dict[int, float] = {}
    for weight, parent, _ in listed(children):
        group = int(groups[parent])
        got[group] = max(got.get(group, -math.inf), weight)
    assert got == pytest.approx(heaviest, abs=1e-9)


@given(tables(max_rows=5), st.integers(1, 40))
def test_a_search_whose_stores_are_grown_goes_on_where_it_stopped(table, most):
    options, parents = table
    caps, search, children = SearchCaps(most, math.inf, 2**62), make_search(0), make_children(0, 0)
    while not start_search(options, parents, search, children):
        search = grown_search(search)
    while not run_search(options, parents, caps, search, children):
        search, children = grown_search(search), grown_children(children, search.sizes[WIDEST])
    assert listed(children) == listed(rank_children(options, parents, caps)[0])


def test_larger_dense_tables():
    rng = np.random.default_rng(5)
    for _ in range(5):
        rows = [[(column, rng.normal()) for column in (ABSENT, MISSED, *range(5))] for _ in range(5)]
        options = make_options(rows, 5)
        parents = make_parents([[0, 1, 2, 3, 4], [0, 2, 4], []], [-1.0, -0.5, -3.0])
        children, _ = rank_children(options, parents, SearchCaps(300, math.inf, 2**62))
        assert children.filled[0] == 300
        assert_heaviest(listed(children), children_of(options, parents))


def test_search_stops_at_the_node_bound_and_says_so():
    rows = [[(column, 0.0) for column in (MISSED, *range(6))] for _ in range(6)]
    options, parents = make_options(rows, 6), make_parents([list(range(6))], [0.0])
    children, cut = rank_children(options, parents, SearchCaps(1000, math.inf, 200))
    assert cut
    assert 0 < children.filled[0] < 1000


@given(tables(), st.integers(0, 2**32 - 1))
def test_samples_are_children_each_found_once_the_best_of_each_parent_among_them(table, seed):
    options, parents = table
    children = sample_children(options, parents, 20, np.random.default_rng(seed))
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
def test_every_association_of_weight_gets_a_child(table, most, gap):
    options, parents = table
    num_rows = len(options.offsets) - 1
    labels = np.stack([np.zeros(num_rows, np.int64), np.arange(num_rows) // 2], axis=1)
    associations = associations_of_options(labels, options)
    ranked, _ = rank_children(options, parents, SearchCaps(most, math.inf, 2**62))
    before = listed(ranked)
    got, expected = listed(add_uncovered(options, associations, parents, ranked, gap)), children_of(options, parents)
    assert got[: len(before)] == before
    weights = {(parent, chosen): weight for weight, parent, chosen in expected}
    for weight, parent, chosen in got:
        assert weight == pytest.approx(weights[parent, chosen], abs=1e-9)
    for weight, _, _ in got[len(before) :]:
        assert weight >= expected[0][0] - gap - 1e-9
    if options.num_measurements == 0 and gap == math.inf:
        # Nothing collides, so that the bound is met and the heaviest child of every association is found.
        held = {int(associations.of_option[option]) for _, _, chosen in got for option in chosen}
        wanted = {int(associations.of_option[option]) for _, _, chosen in expected for option in chosen}
        assert held - {-1} == wanted - {-1}


def test_an_association_is_a_label_and_what_the_scan_did_to_it():
    rows = [[(ABSENT, -1.0), (MISSED, -2.0), (0, -0.5)], [(MISSED, 0.0), (0, -1.0)], [(MISSED, 0.0), (1, -1.0)]]
    options = make_options(rows, 2)
    numbers, num = associations_of_options(np.array([[3, 1], [3, 1], [4, 0]]), options)
    assert num == 6
    assert numbers[options.columns == ABSENT].tolist() == [-1]
    first, second, third = (
        numbers[low:high] for low, high in zip(options.offsets[:-1], options.offsets[1:], strict=True)
    )
    assert set(first[first >= 0]) == set(second)
    assert not set(second) & set(third)
    assert len(set(numbers[numbers >= 0].tolist())) == 4
