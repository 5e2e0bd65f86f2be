"""The heaviest joint choices over all prior hypotheses at once, in exact order.

Truncating a delta-GLMB to its heaviest hypotheses minimises the L1 error (Vo, Vo, Phung 2014, Prop. 5). Instead of
ranking inside each prior hypothesis with a number of children fixed beforehand (Murty), one best-first search runs over
all of them: its bound is the optimal assignment's dual solution, so it is exact from the first node, and rows whose
second choice is far off stay near the root, so that one more hypothesis costs a few nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.arrays import filled_ints, grown_floats, grown_ints
from vedette.kernels.assignment import DualWork, Options, make_dual_work, solve_assignment
from vedette.kernels.compile import inlined, kernel
from vedette.kernels.types import Floats, Ints


class Children(NamedTuple):
    """Joint choices. Options of child `c` are `options[offsets[c]:offsets[c + 1]]`, one a row, in the parent's."""

    parents: Ints
    offsets: Ints
    options: Ints
    log_weights: Floats


class Parents(NamedTuple):
    """Prior hypotheses. Rows of parent `p` are `rows[offsets[p]:offsets[p + 1]]`.

    groups: (num,) label-set number, or empty. Of each group at least one child is kept whatever its weight.
    """

    offsets: Ints
    rows: Ints
    log_weights: Floats
    groups: Ints


class _Layouts(NamedTuple):
    """The opened parents: their rows in search order, options by reduced cost, and what an unused column costs.

    starts, penalty_starts: (num_parents,) first position in `rows` (-1 before the parent is opened) and in
    `penalty_columns`. penalties: (num_parents,) number of penalised columns. rows, offsets: original row position and
    first option of each search position. options, costs: options sorted by reduced cost.
    used: (3,) filled length of the three arenas.
    """

    starts: Ints
    penalty_starts: Ints
    penalties: Ints
    rows: Ints
    offsets: Ints
    options: Ints
    costs: Floats
    penalty_columns: Ints
    penalty_costs: Floats
    used: Ints


class _Nodes(NamedTuple):
    """Partial joint choices: rows 0..depth of a parent are settled, this one by its option of the given rank.

    heap: node numbers, least bound first. used: (2,) number of nodes and length of the heap.
    """

    bound: Floats
    parent: Ints
    depth: Ints
    rank: Ints
    previous: Ints
    heap: Ints
    used: Ints


@kernel
def _grown_nodes(nodes: _Nodes, needed: int) -> _Nodes:
    return _Nodes(
        grown_floats(nodes.bound, needed),
        grown_ints(nodes.parent, needed),
        grown_ints(nodes.depth, needed),
        grown_ints(nodes.rank, needed),
        grown_ints(nodes.previous, needed),
        grown_ints(nodes.heap, needed),
        nodes.used,
    )


@inlined
def _has_room(layouts: _Layouts, num_rows: int, num_options: int, num_columns: int) -> bool:
    return (
        layouts.used[0] + num_rows < len(layouts.rows)
        and layouts.used[1] + num_options <= len(layouts.options)
        and layouts.used[2] + num_columns <= len(layouts.penalty_columns)
    )


@kernel
def _grown_layouts(layouts: _Layouts, num_rows: int, num_options: int, num_columns: int) -> _Layouts:
    rows, opts, pens = layouts.used[0] + num_rows + 1, layouts.used[1] + num_options, layouts.used[2] + num_columns
    return _Layouts(
        layouts.starts,
        layouts.penalty_starts,
        layouts.penalties,
        grown_ints(layouts.rows, rows),
        grown_ints(layouts.offsets, rows),
        grown_ints(layouts.options, opts),
        grown_floats(layouts.costs, opts),
        grown_ints(layouts.penalty_columns, pens),
        grown_floats(layouts.penalty_costs, pens),
        layouts.used,
    )


@inlined
def _push(nodes: _Nodes, bound: float, parent: int, depth: int, rank: int, previous: int) -> None:
    node = nodes.used[0]
    nodes.used[0] += 1
    nodes.bound[node] = bound
    nodes.parent[node] = parent
    nodes.depth[node] = depth
    nodes.rank[node] = rank
    nodes.previous[node] = previous
    _sift_up(nodes, node)


@inlined
def _sift_up(nodes: _Nodes, node: int) -> None:
    heap = nodes.heap
    slot = nodes.used[1]
    nodes.used[1] += 1
    while slot > 0:
        above = (slot - 1) // 2
        if nodes.bound[heap[above]] <= nodes.bound[node]:
            break
        heap[slot] = heap[above]
        slot = above
    heap[slot] = node


@inlined
def _pop(nodes: _Nodes) -> int:
    heap = nodes.heap
    top = heap[0]
    nodes.used[1] -= 1
    size = nodes.used[1]
    last = heap[size]
    slot = 0
    while True:
        below = 2 * slot + 1
        if below >= size:
            break
        if below + 1 < size and nodes.bound[heap[below + 1]] < nodes.bound[heap[below]]:
            below += 1
        if nodes.bound[heap[below]] >= nodes.bound[last]:
            break
        heap[slot] = heap[below]
        slot = below
    if size > 0:
        heap[slot] = last
    return top


@inlined
def _open_parent(parent: int, rows: Ints, options: Options, layouts: _Layouts, work: DualWork) -> None:
    """Lay out a parent whose assignment problem has just been solved: rows with the firmest best option first."""
    num = len(rows)
    first_row, first_penalty = layouts.used[0], layouts.used[2]
    layouts.starts[parent], layouts.penalty_starts[parent] = first_row, first_penalty
    for i in range(num):
        gap = math.inf
        start, stop = options.offsets[rows[i]], options.offsets[rows[i] + 1]
        for option in range(start, stop):
            if option != work.row_option[i]:
                gap = min(gap, _reduced_cost(options, option, i, work))
        work.row_gap[i] = gap
        slot = i
        while slot > 0 and work.row_gap[layouts.rows[first_row + slot - 1]] < gap:
            layouts.rows[first_row + slot] = layouts.rows[first_row + slot - 1]
            slot -= 1
        layouts.rows[first_row + slot] = i
    filled = layouts.used[1]
    for position in range(num):
        i = layouts.rows[first_row + position]
        layouts.offsets[first_row + position] = filled
        start = filled
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            # The optimum's own option stands first: rounding must not put an equal one before it.
            cost = 0.0 if option == work.row_option[i] else max(_reduced_cost(options, option, i, work), 0.0)
            slot = filled
            while slot > start and (layouts.costs[slot - 1] > cost or option == work.row_option[i]):
                layouts.costs[slot] = layouts.costs[slot - 1]
                layouts.options[slot] = layouts.options[slot - 1]
                slot -= 1
            layouts.costs[slot] = cost
            layouts.options[slot] = option
            filled += 1
    layouts.offsets[first_row + num] = filled
    penalties = first_penalty
    for column in range(len(work.column_dual)):
        if work.column_dual[column] < 0.0:
            layouts.penalty_columns[penalties] = column
            layouts.penalty_costs[penalties] = -work.column_dual[column]
            penalties += 1
    layouts.penalties[parent] = penalties - first_penalty
    layouts.used[0], layouts.used[1], layouts.used[2] = first_row + num + 1, filled, penalties


@inlined
def _reduced_cost(options: Options, option: int, row: int, work: DualWork) -> float:
    cost = -options.log_weights[option] - work.row_dual[row]
    column = options.columns[option]
    return cost - work.column_dual[column] if column >= 0 else cost


@inlined
def _next_free(layouts: _Layouts, columns: Ints, position: int, rank: int, taken: Ints, stamp: int) -> int:
    """Rank of the first option at `position`, from `rank` on, whose column is free; -1 for none."""
    start, stop = layouts.offsets[position], layouts.offsets[position + 1]
    while start + rank < stop:
        column = columns[layouts.options[start + rank]]
        if column < 0 or taken[column] != stamp:
            return rank
        rank += 1
    return -1


@inlined
def _mark_path(
    nodes: _Nodes, node: int, first_row: int, layouts: _Layouts, columns: Ints, taken: Ints, stamp: int
) -> None:
    while nodes.depth[node] >= 0:
        column = columns[layouts.options[layouts.offsets[first_row + nodes.depth[node]] + nodes.rank[node]]]
        if column >= 0:
            taken[column] = stamp
        node = nodes.previous[node]


@inlined
def _unused_penalty(layouts: _Layouts, parent: int, taken: Ints, stamp: int) -> float:
    first = layouts.penalty_starts[parent]
    total = 0.0
    for i in range(first, first + layouts.penalties[parent]):
        if taken[layouts.penalty_columns[i]] != stamp:
            total += layouts.penalty_costs[i]
    return total


@inlined
def _descend(
    nodes: _Nodes, node: int, num_rows: int, layouts: _Layouts, columns: Ints, taken: Ints, stamp: int, limit: float
) -> int:
    """Visit `node` and dive along first choices while nothing waiting is better; a full choice's number, or -1."""
    parent = nodes.parent[node]
    first_row = layouts.starts[parent]
    if nodes.depth[node] == num_rows:
        return node
    _mark_path(
        nodes, nodes.previous[node] if nodes.depth[node] >= 0 else node, first_row, layouts, columns, taken, stamp
    )
    while True:
        depth, bound = nodes.depth[node], nodes.bound[node]
        if depth >= 0:
            position, previous = first_row + depth, nodes.previous[node]
            sibling = _next_free(layouts, columns, position, nodes.rank[node] + 1, taken, stamp)
            if sibling >= 0:
                sibling_bound = nodes.bound[previous] + layouts.costs[layouts.offsets[position] + sibling]
                if sibling_bound <= limit:
                    _push(nodes, sibling_bound, parent, depth, sibling, previous)
            column = columns[layouts.options[layouts.offsets[position] + nodes.rank[node]]]
            if column >= 0:
                taken[column] = stamp
        if depth + 1 == num_rows:
            bound += _unused_penalty(layouts, parent, taken, stamp)
            rank = 0
        else:
            rank = _next_free(layouts, columns, first_row + depth + 1, 0, taken, stamp)
            if rank < 0:
                return -1
            bound += layouts.costs[layouts.offsets[first_row + depth + 1] + rank]
        if bound > limit:
            return -1
        child = nodes.used[0]
        if nodes.used[1] > 0 and nodes.bound[nodes.heap[0]] < bound:
            _push(nodes, bound, parent, depth + 1, rank, node)
            return -1
        nodes.used[0] += 1
        nodes.bound[child], nodes.parent[child], nodes.depth[child] = bound, parent, depth + 1
        nodes.rank[child], nodes.previous[child] = rank, node
        if depth + 1 == num_rows:
            return child
        node = child


@inlined
def _write_choice(nodes: _Nodes, node: int, layouts: _Layouts, out: Ints, start: int) -> None:
    first_row = layouts.starts[nodes.parent[node]]
    node = nodes.previous[node]
    while nodes.depth[node] >= 0:
        position = first_row + nodes.depth[node]
        out[start + layouts.rows[position]] = layouts.options[layouts.offsets[position] + nodes.rank[node]]
        node = nodes.previous[node]


@kernel
def _start_search(options: Options, parents: Parents) -> tuple[_Layouts, _Nodes]:
    """Nothing opened; every parent waits with the bound that ignores collisions."""
    num = len(parents.log_weights)
    layouts = _Layouts(
        filled_ints(num, -1),
        filled_ints(num, 0),
        np.zeros(num, np.int64),
        np.empty(64, np.int64),
        np.empty(64, np.int64),
        np.empty(256, np.int64),
        np.empty(256),
        np.empty(16, np.int64),
        np.empty(16),
        np.zeros(3, np.int64),
    )
    capacity = num + 256
    nodes = _Nodes(
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.zeros(2, np.int64),
    )
    for parent in range(num):
        bound = -parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            first = options.offsets[parents.rows[i]]
            bound += -options.log_weights[first] if first < options.offsets[parents.rows[i] + 1] else math.inf
        if bound < math.inf:
            _push(nodes, bound, parent, -1, 0, -1)
    return layouts, nodes


@kernel
def _num_options(options: Options, rows: Ints) -> int:
    total = 0
    for row in rows:
        total += options.offsets[row + 1] - options.offsets[row]
    return total


@kernel
def grown_children(children: Children, used: Ints, num_rows: int) -> Children:
    """Room for at least one more child of `num_rows` rows."""
    return Children(
        grown_ints(children.parents, used[0] + 1),
        grown_ints(children.offsets, 2 * (used[0] + 2)),
        grown_ints(children.options, used[1] + num_rows),
        grown_floats(children.log_weights, used[0] + 1),
    )


@inlined
def is_full(children: Children, used: Ints, num_rows: int) -> bool:
    """Whether one more child of `num_rows` rows needs room first. used: (2,) number of children, of their options."""
    return used[0] == len(children.parents) or used[1] + num_rows > len(children.options)


@inlined
def append_child(children: Children, used: Ints, parent: int, num_rows: int, log_weight: float) -> int:
    """Enter one more child; returns where its options are to be written."""
    num, start = used[0], used[1]
    children.parents[num] = parent
    children.offsets[num + 1] = start + num_rows
    children.log_weights[num] = log_weight
    used[0] += 1
    used[1] += num_rows
    return start


@kernel
def _add_missing_groups(
    options: Options, parents: Parents, seen: Ints, children: Children, used: Ints, work: DualWork
) -> Children:
    """The best child of each group that has none yet."""
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
        solve_assignment(options, rows, work)
        if is_full(children, used, len(rows)):
            children = grown_children(children, used, len(rows))
        start = append_child(children, used, best_parent, len(rows), -best)
        for i in range(len(rows)):
            children.options[start + i] = work.row_option[i]
    return children


@kernel
def num_groups(groups: Ints) -> int:
    """Number of label-set groups; 0 where groups are not in use."""
    most = 0
    for group in groups:
        most = max(most, group + 1)
    return most


@kernel
def rank_children(
    options: Options, parents: Parents, num_columns: int, max_children: int, max_log_gap: float, max_nodes: int
) -> tuple[Children, bool]:
    """The heaviest joint choices of all parents in descending order: at most `max_children`, and none whose log weight
    is more than `max_log_gap` under the first; besides them the best of every group.

    The flag tells that the search was cut at `max_nodes` before it had found them all.
    """
    layouts, nodes = _start_search(options, parents)
    max_rows = 0
    for parent in range(len(parents.log_weights)):
        max_rows = max(max_rows, parents.offsets[parent + 1] - parents.offsets[parent])
    work = make_dual_work(max_rows, num_columns)
    taken = np.zeros(num_columns, np.int64)
    stamp = 0
    limit = math.inf
    seen = filled_ints(num_groups(parents.groups), 0)
    children = Children(np.empty(16, np.int64), np.zeros(18, np.int64), np.empty(128, np.int64), np.empty(16))
    used = np.zeros(2, np.int64)
    while nodes.used[1] > 0 and used[0] < max_children and nodes.used[0] < max_nodes:
        node = _pop(nodes)
        parent = nodes.parent[node]
        if nodes.bound[node] > limit:
            nodes.used[1] = 0
            break
        rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
        if layouts.starts[parent] < 0:
            optimum = solve_assignment(options, rows, work) - parents.log_weights[parent]
            if optimum == math.inf:
                continue
            num_options = _num_options(options, rows)
            if not _has_room(layouts, len(rows), num_options, num_columns):
                layouts = _grown_layouts(layouts, len(rows), num_options, num_columns)
            _open_parent(parent, rows, options, layouts, work)
            nodes.bound[node] = optimum
            if nodes.used[1] > 0 and nodes.bound[nodes.heap[0]] < optimum:
                _sift_up(nodes, node)
                continue
        if nodes.used[0] + 2 * len(rows) + 4 > len(nodes.bound):
            nodes = _grown_nodes(nodes, nodes.used[0] + 2 * len(rows) + 4)
        stamp += 1
        full = _descend(nodes, node, len(rows), layouts, options.columns, taken, stamp, limit)
        if full < 0:
            continue
        if is_full(children, used, len(rows)):
            children = grown_children(children, used, len(rows))
        start = append_child(children, used, parent, len(rows), -nodes.bound[full])
        _write_choice(nodes, full, layouts, children.options, start)
        if used[0] == 1:
            limit = nodes.bound[full] + max_log_gap
        if len(seen):
            seen[parents.groups[parent]] = 1
    cut = nodes.used[1] > 0 and used[0] < max_children
    if len(seen):
        children = _add_missing_groups(options, parents, seen, children, used, work)
    num = used[0]
    trimmed = Children(
        children.parents[:num], children.offsets[: num + 1], children.options[: used[1]], children.log_weights[:num]
    )
    return trimmed, cut
