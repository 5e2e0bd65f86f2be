"""Working arrays of the best-first search for the heaviest joint choices: opened parents, nodes, and the heap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import DualWork, make_dual_work
from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints

# Places in `Search.sizes`: what the search must hold, then how much of each store is filled.
PARENTS, ROWS, OPTIONS, COLUMNS, WIDEST = range(5)
NODES, HEAP, POSITIONS, CHOICES, PENALTIES, STAMP = range(5, 11)
_NUM_SIZES = 11


class Search(NamedTuple):
    """Stores of a search; `sizes` tells how far they are filled.

    An opened parent has one position a row, in search order, from `starts[parent]` on (-1: not opened). There
    `position_rows` is the row's place in the parent and `firsts:lasts` are its choices, cheapest first: options and
    what they cost more than the row's part in the optimum. Choices of the rows on their own stand at the places of
    their options; a parent in whose optimum rows give way to each other has its own, and a penalty for each contended
    column that is left unused.

    A node settles the positions up to `depth` of a parent, this one by its choice, those before as in `previous`.
    bounds: least cost of all joint choices under a node. heap_nodes: waiting nodes, least bound (heap_bounds) first.
    taken: (num_columns,) stamp of the node at which a column was last seen taken.
    """

    sizes: Ints
    starts: Ints
    penalty_starts: Ints
    penalty_ends: Ints
    position_rows: Ints
    firsts: Ints
    lasts: Ints
    options: Ints
    costs: Floats
    penalty_columns: Ints
    penalty_costs: Floats
    bounds: Floats
    parents: Ints
    depths: Ints
    choices: Ints
    previous: Ints
    heap_bounds: Floats
    heap_nodes: Ints
    taken: Ints
    work: DualWork


@kernel
def make_search() -> Search:
    """Stores of next to no room."""
    ints, floats = np.empty(0, np.int64), np.empty(0)
    return Search(
        np.zeros(_NUM_SIZES, np.int64), ints, ints, ints, ints, ints, ints, ints, floats, ints, floats, floats,
        ints, ints, ints, ints, floats, ints, ints, make_dual_work(0, 0),
    )  # fmt: skip


@kernel
def grown_search(search: Search) -> Search:
    """The same search with room for its problem, and for at least one more visit of a node."""
    sizes = search.sizes
    positions, choices = sizes[POSITIONS] + sizes[WIDEST], sizes[CHOICES] + sizes[OPTIONS]
    penalties, nodes = sizes[PENALTIES] + sizes[COLUMNS], sizes[NODES] + sizes[PARENTS] + 2 * sizes[WIDEST] + 256
    work = search.work
    if len(work.row_dual) < sizes[WIDEST] or len(work.column_dual) < sizes[COLUMNS]:
        work = make_dual_work(sizes[WIDEST], sizes[COLUMNS])
    return Search(
        sizes,
        grown_ints(search.starts, sizes[PARENTS]),
        grown_ints(search.penalty_starts, sizes[PARENTS]),
        grown_ints(search.penalty_ends, sizes[PARENTS]),
        grown_ints(search.position_rows, positions),
        grown_ints(search.firsts, positions),
        grown_ints(search.lasts, positions),
        grown_ints(search.options, choices),
        grown_floats(search.costs, choices),
        grown_ints(search.penalty_columns, penalties),
        grown_floats(search.penalty_costs, penalties),
        grown_floats(search.bounds, nodes),
        grown_ints(search.parents, nodes),
        grown_ints(search.depths, nodes),
        grown_ints(search.choices, nodes),
        grown_ints(search.previous, nodes),
        grown_floats(search.heap_bounds, nodes),
        grown_ints(search.heap_nodes, nodes),
        grown_ints(search.taken, sizes[COLUMNS]),
        work,
    )


@inlined
def has_room(search: Search) -> bool:
    """Whether one more parent can be opened and one more node visited."""
    sizes = search.sizes
    return (
        sizes[NODES] + 2 * sizes[WIDEST] + 4 <= len(search.bounds)
        and sizes[POSITIONS] + sizes[WIDEST] <= len(search.position_rows)
        and sizes[CHOICES] + sizes[OPTIONS] <= len(search.options)
        and sizes[PENALTIES] + sizes[COLUMNS] <= len(search.penalty_columns)
    )


@inlined
def new_node(search: Search, bound: float, parent: int, depth: int, choice: int, previous: int) -> int:
    node = search.sizes[NODES]
    search.sizes[NODES] = node + 1
    search.bounds[node] = bound
    search.parents[node] = parent
    search.depths[node] = depth
    search.choices[node] = choice
    search.previous[node] = previous
    return node


@inlined
def push(search: Search, node: int) -> None:
    """Let a node wait in the heap."""
    bounds, nodes, bound = search.heap_bounds, search.heap_nodes, search.bounds[node]
    slot = search.sizes[HEAP]
    search.sizes[HEAP] = slot + 1
    while slot > 0:
        above = (slot - 1) // 2
        if bounds[above] <= bound:
            break
        bounds[slot], nodes[slot] = bounds[above], nodes[above]
        slot = above
    bounds[slot], nodes[slot] = bound, node


@inlined
def pop(search: Search) -> int:
    """The waiting node of least bound, which waits no longer."""
    bounds, nodes = search.heap_bounds, search.heap_nodes
    top = nodes[0]
    size = search.sizes[HEAP] - 1
    search.sizes[HEAP] = size
    bound, node = bounds[size], nodes[size]
    slot = 0
    while True:
        below = 2 * slot + 1
        if below >= size:
            break
        if below + 1 < size and bounds[below + 1] < bounds[below]:
            below += 1
        if bounds[below] >= bound:
            break
        bounds[slot], nodes[slot] = bounds[below], nodes[below]
        slot = below
    bounds[slot], nodes[slot] = bound, node
    return top
