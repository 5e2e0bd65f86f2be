"""The heaviest joint choices over all prior hypotheses at once, in exact order.

Truncating a delta-GLMB to its heaviest hypotheses minimises the L1 error (Vo, Vo, Phung 2014, Prop. 5). Instead of
ranking within each prior hypothesis with a number of children fixed in advance (Murty), one best-first search runs over
all of them. Its bound is the dual solution of the optimal assignment, so it is exact from the first node, and rows
whose second choice is far off stay near the root, so that one more hypothesis costs a few nodes. Step by step:
docs/devdocs/ranked-search.md.
"""

import math
from typing import NamedTuple

from vedette.kernels.association.assignment import DualWork, Options, solve_assignment
from vedette.kernels.association.children import (
    Children,
    Parents,
    append_child,
    grown_children,
    is_full,
    make_children,
    widest_parent,
)
from vedette.kernels.association.search import (
    HEAP,
    NODES,
    STAMP,
    WIDEST,
    Search,
    SearchCaps,
    grown_search,
    has_room,
    make_search,
    new_node,
    pop,
    push,
)
from vedette.kernels.association.search_start import open_free, open_solved, start_search
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Ints

# Nodes that a search visits for each child that it finds, with a margin (12.8 were measured over 86 rows), and
# the largest number of children for which room is made in advance.
_NODES_A_CHILD = 16
_MOST_CHILDREN = 2048


class Ranking(NamedTuple):
    """Working arrays of a ranking and the children that it found."""

    search: Search
    children: Children


@inlined
def _next_free(search: Search, columns: Ints, choice: int, last: int, stamp: int) -> int:
    """Return the first choice from `choice` on, before `last`, whose column is free, or -1 for none."""
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
    """Return the sum of -v over the contended columns that no row of the full choice has taken."""
    total = 0.0
    for i in range(search.penalty_starts[parent], search.penalty_ends[parent]):
        if search.taken[search.penalty_columns[i]] != stamp:
            total += search.penalty_costs[i]
    return total


@inlined
def _descend(search: Search, node: int, num_rows: int, columns: Ints, limit: float) -> int:
    """Visit `node` and dive along first choices while no waiting node is better. Return a full choice's node, or -1.

    A node's bound is its parent hypothesis's optimum plus the extra costs of the choices settled so far. It is a lower
    bound for all its descendants, since extra costs and penalties are never negative. It is attained by a full choice
    that continues with choices of cost 0 and leaves no contended column unused, and for the root by the optimum itself.
    """
    parent = search.parents[node]
    # A full choice from the heap: its bound is its cost, and no waiting node is cheaper.
    if search.depths[node] == num_rows:
        return node
    first_position = search.starts[parent]
    # The columns taken so far carry this visit's stamp: a new stamp frees all of them without a loop.
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
            # A node represents its choice and all costlier ones at its position. On its visit the next free one of them
            # is split off to wait: each joint choice is then under one node only, and none is made before it is needed.
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
        # Continuing without the heap is the same as a push followed by a pop.
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
def run_search(options: Options, parents: Parents, caps: SearchCaps, search: Search, children: Children) -> bool:
    """Append children in descending order of weight. Returns False if search or children must be grown to continue.

    At most `max_hypotheses` in total, none more than `max_log_gap` below the first. Called again with the grown arrays,
    the search continues where it stopped.
    """
    sizes, filled = search.sizes, children.filled
    while sizes[HEAP] > 0 and filled[0] < caps.max_hypotheses and sizes[NODES] < caps.max_nodes:
        limit = caps.max_log_gap - children.log_weights[0] if filled[0] > 0 else math.inf
        if search.heap_bounds[0] > limit:
            sizes[HEAP] = 0
            return True
        if not has_room(search) or is_full(children, sizes[WIDEST]):
            return False
        node = pop(search)
        parent = search.parents[node]
        rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
        # A parent's first bound lets rows share columns. Its assignment is solved only when it reaches the top, and
        # not even then if the rows' best options do not collide, as they are then the optimum.
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
            start = append_child(children, parent, len(rows), -search.bounds[full])
            _write_choice(search, full, children.options, start)
    return True


@borrowing
def _most_children(options: Options, parents: Parents) -> int:
    """Return the number of joint choices, collisions included, up to `_MOST_CHILDREN`."""
    total = 0
    for parent in range(len(parents.log_weights)):
        count = 1
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            row = parents.rows[i]
            count = min(count * (options.offsets[row + 1] - options.offsets[row]), _MOST_CHILDREN)
        total = min(total + count, _MOST_CHILDREN)
    return total


@kernel
def rank_children(options: Options, parents: Parents, caps: SearchCaps) -> tuple[Children, bool]:
    """Return the heaviest joint choices of all parents in descending order, in new arrays.

    Also returns True if the search stopped at `max_nodes` before it had found all within the other caps.
    """
    num, widest = min(caps.max_hypotheses, _most_children(options, parents)), widest_parent(parents)
    # Made as large as they are likely to become: growing them took a third of the search time.
    search = make_search(_NODES_A_CHILD * num + len(parents.log_weights) + 2 * widest + 4)
    ranking, cut = ranked(options, parents, caps, Ranking(search, make_children(num, num * widest)))
    return ranking.children, cut


@kernel
def ranked(options: Options, parents: Parents, caps: SearchCaps, ranking: Ranking) -> tuple[Ranking, bool]:
    """Apply `rank_children` in the arrays of an earlier ranking, which grow if needed."""
    search, children = ranking.search, ranking.children
    while not start_search(options, parents, search, children):
        search = grown_search(search)
    while not run_search(options, parents, caps, search, children):
        search, children = grown_search(search), grown_children(children, search.sizes[WIDEST])
    return Ranking(search, children), search.sizes[HEAP] > 0 and children.filled[0] < caps.max_hypotheses


@borrowing
def add_missing_groups(
    options: Options, parents: Parents, groups: Ints, seen: Ints, work: DualWork, children: Children
) -> bool:
    """Append the best child of each group of parents that has none yet, whatever its weight.

    groups: (num_parents,) group of each parent. seen: (num_groups,) working array. Returns False if children must be
    grown to continue. Existing children are not appended again.
    """
    for group in range(len(seen)):
        seen[group] = 0
    for child in range(children.filled[0]):
        seen[groups[children.parents[child]]] = 1
    for group in range(len(seen)):
        if seen[group]:
            continue
        best, best_parent = math.inf, -1
        for parent in range(len(groups)):
            if groups[parent] == group:
                rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
                cost = solve_assignment(options, rows, work) - parents.log_weights[parent]
                if cost < best:
                    best, best_parent = cost, parent
        if best_parent < 0:
            continue
        rows = parents.rows[parents.offsets[best_parent] : parents.offsets[best_parent + 1]]
        if is_full(children, len(rows)):
            return False
        # Solved again: other assignments have overwritten the working arrays since.
        solve_assignment(options, rows, work)
        start = append_child(children, best_parent, len(rows), -best)
        for i in range(len(rows)):
            children.options[start + i] = work.row_option[i]
    return True
