"""The heaviest joint choices over all prior hypotheses at once, in exact order.

Truncating a delta-GLMB to its heaviest hypotheses minimises the L1 error (Vo, Vo, Phung 2014, Prop. 5). Instead of
ranking inside each prior hypothesis with a number of children fixed beforehand (Murty), one best-first search runs over
all of them: its bound is the optimal assignment's dual solution, so it is exact from the first node, and rows whose
second choice is far off stay near the root, so that one more hypothesis costs a few nodes.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.assignment import DualWork, Options, solve_assignment
from vedette.kernels.association.children import (
    Children,
    Parents,
    append_child,
    grown_children,
    is_full,
    make_children,
    num_groups,
)
from vedette.kernels.association.openings import open_free, open_solved, size_search, start_search
from vedette.kernels.association.search import (
    HEAP,
    NODES,
    STAMP,
    WIDEST,
    Search,
    grown_search,
    has_room,
    make_search,
    new_node,
    pop,
    push,
)
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Ints


@inlined
def _next_free(search: Search, columns: Ints, choice: int, last: int, stamp: int) -> int:
    """The first choice from `choice` on, before `last`, whose column is free; -1 for none."""
    while choice < last:
        column = columns[search.options[choice]]
        if column < 0 or search.taken[column] != stamp:
            return choice
        choice += 1
    return -1


@inlined
def _take(search: Search, columns: Ints, choice: int, stamp: int) -> None:
    column = columns[search.options[choice]]
    if column >= 0:
        search.taken[column] = stamp


@inlined
def _unused_penalty(search: Search, parent: int, stamp: int) -> float:
    total = 0.0
    for i in range(search.penalty_starts[parent], search.penalty_ends[parent]):
        if search.taken[search.penalty_columns[i]] != stamp:
            total += search.penalty_costs[i]
    return total


@inlined
def _descend(search: Search, node: int, num_rows: int, columns: Ints, limit: float) -> int:
    """Visit `node` and dive along first choices while nothing waiting is better. A full choice's node, or -1."""
    parent = search.parents[node]
    if search.depths[node] == num_rows:
        return node
    first_position = search.starts[parent]
    search.sizes[STAMP] += 1
    stamp = search.sizes[STAMP]
    if search.depths[node] >= 0:
        settled = search.previous[node]
        while search.depths[settled] >= 0:
            _take(search, columns, search.choices[settled], stamp)
            settled = search.previous[settled]
    while True:
        depth, bound = search.depths[node], search.bounds[node]
        if depth >= 0:
            choice, previous = search.choices[node], search.previous[node]
            sibling = _next_free(search, columns, choice + 1, search.lasts[first_position + depth], stamp)
            if sibling >= 0 and search.bounds[previous] + search.costs[sibling] <= limit:
                sibling_bound = search.bounds[previous] + search.costs[sibling]
                push(search, new_node(search, sibling_bound, parent, depth, sibling, previous))
            _take(search, columns, choice, stamp)
        next_choice = -1
        if depth + 1 == num_rows:
            bound += _unused_penalty(search, parent, stamp)
        else:
            position = first_position + depth + 1
            next_choice = _next_free(search, columns, search.firsts[position], search.lasts[position], stamp)
            if next_choice < 0:
                return -1
            bound += search.costs[next_choice]
        if bound > limit:
            return -1
        node = new_node(search, bound, parent, depth + 1, next_choice, node)
        if search.sizes[HEAP] > 0 and search.heap_bounds[0] < bound:
            push(search, node)
            return -1
        if depth + 1 == num_rows:
            return node


@inlined
def _write_choice(search: Search, node: int, out: Ints, start: int) -> None:
    first_position = search.starts[search.parents[node]]
    node = search.previous[node]
    while search.depths[node] >= 0:
        row = search.position_rows[first_position + search.depths[node]]
        out[start + row] = search.options[search.choices[node]]
        node = search.previous[node]


@borrowing
def run_search(
    options: Options,
    parents: Parents,
    max_children: int,
    max_log_gap: float,
    max_nodes: int,
    search: Search,
    children: Children,
    used: Ints,
) -> bool:
    """Append children in descending order of weight. False where search or children must be grown to go on."""
    sizes = search.sizes
    while sizes[HEAP] > 0 and used[0] < max_children and sizes[NODES] < max_nodes:
        limit = max_log_gap - children.log_weights[0] if used[0] > 0 else math.inf
        if search.heap_bounds[0] > limit:
            sizes[HEAP] = 0
            return True
        if not has_room(search) or is_full(children, used, sizes[WIDEST]):
            return False
        node = pop(search)
        parent = search.parents[node]
        rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
        if search.starts[parent] < 0 and not open_free(parent, rows, options, search):
            optimum = solve_assignment(options, rows, search.work) - parents.log_weights[parent]
            if optimum == math.inf:
                continue
            open_solved(parent, rows, options, search)
            search.bounds[node] = optimum
            if sizes[HEAP] > 0 and search.heap_bounds[0] < optimum:
                push(search, node)
                continue
        full = _descend(search, node, len(rows), options.columns, limit)
        if full >= 0:
            start = append_child(children, used, parent, len(rows), -search.bounds[full])
            _write_choice(search, full, children.options, start)
    return True


@borrowing
def add_missing_groups(
    options: Options, parents: Parents, work: DualWork, seen: Ints, children: Children, used: Ints
) -> bool:
    """Append the best child of each group that has none yet. seen: (num_groups,) to work in.

    False where children must be grown to go on; what is already there is not appended again.
    """
    for group in range(len(seen)):
        seen[group] = 0
    for child in range(used[0]):
        seen[parents.groups[children.parents[child]]] = 1
    for group in range(len(seen)):
        if seen[group]:
            continue
        best, best_parent = math.inf, -1
        for parent in range(len(parents.groups)):
            if parents.groups[parent] == group:
                rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
                cost = solve_assignment(options, rows, work) - parents.log_weights[parent]
                if cost < best:
                    best, best_parent = cost, parent
        if best_parent < 0:
            continue
        rows = parents.rows[parents.offsets[best_parent] : parents.offsets[best_parent + 1]]
        if is_full(children, used, len(rows)):
            return False
        solve_assignment(options, rows, work)
        start = append_child(children, used, best_parent, len(rows), -best)
        for i in range(len(rows)):
            children.options[start + i] = work.row_option[i]
    return True


@kernel
def rank_children(
    options: Options, parents: Parents, num_columns: int, max_children: int, max_log_gap: float, max_nodes: int
) -> tuple[Children, bool]:
    """The heaviest joint choices of all parents in descending order: at most `max_children`, and none whose log weight
    is more than `max_log_gap` under the first; besides them the best of every group.

    The flag tells that the search was cut at `max_nodes` before it had found them all.
    """
    search, children, used = make_search(), make_children(), np.zeros(2, np.int64)
    size_search(options, parents, num_columns, search)
    search = grown_search(search)
    start_search(options, parents, search)
    widest = search.sizes[WIDEST]
    while not run_search(options, parents, max_children, max_log_gap, max_nodes, search, children, used):
        search = grown_search(search)
        children = grown_children(children, used, widest)
    cut = search.sizes[HEAP] > 0 and used[0] < max_children
    seen = filled_ints(num_groups(parents.groups), 0)
    while len(seen) and not add_missing_groups(options, parents, search.work, seen, children, used):
        children = grown_children(children, used, widest)
    num = used[0]
    trimmed = Children(
        children.parents[:num], children.offsets[: num + 1], children.options[: used[1]], children.log_weights[:num]
    )
    return trimmed, cut


__all__ = [
    "Children",
    "Parents",
    "add_missing_groups",
    "append_child",
    "grown_children",
    "is_full",
    "num_groups",
    "rank_children",
    "run_search",
    "size_search",
    "start_search",
]
