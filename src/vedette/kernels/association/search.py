"""Working arrays of the best-first search for the heaviest joint choices: opened parents, nodes, and the heap."""

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import DualWork, make_dual_work
from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints

# Indices of `Search.sizes`: the sizes of the problem (MEMBERS: rows of all parents together, WIDEST: of the widest),
# then the filled part of each store.
PARENTS, MEMBERS, ROWS, OPTIONS, COLUMNS, WIDEST = range(6)
NODES, HEAP, POSITIONS, CHOICES, PENALTIES, STAMP = range(6, 12)
_NUM_SIZES = 12


class SearchCaps(NamedTuple):
    """Stopping criteria of a search for the heaviest joint choices."""

    max_hypotheses: int  # joint choices found
    max_log_gap: float  # log weight below the best
    max_nodes: int  # nodes visited, a safeguard for scenes of extreme ambiguity


class Search(NamedTuple):
    """Stores of a search.

    An opened parent has one position per row, in the order in which the search settles them. Choices at a position are
    options, cheapest first, with their extra cost over the row's part in the optimum. If the rows' best options do not
    collide, these are the rows' own choices, the same for all parents. A parent in whose optimum some rows do not get
    their best option has its own choices (reduced costs), and a penalty for each contended column that is left unused.

    A node settles the positions of a parent up to `depth`, this one by its choice, those before as in `previous`.
    """

    sizes: Ints  # (12,) sizes of the problem, and filled part of the stores
    starts: Ints  # (num_parents,) first position of a parent, -1: not opened
    penalty_starts: Ints  # (num_parents,)
    penalty_ends: Ints  # (num_parents,)
    position_rows: Ints  # place in the parent of the row at each position
    firsts: Ints  # first choice at each position
    lasts: Ints  # one past its last choice
    options: Ints  # option of each choice
    costs: Floats  # its extra cost over the optimum
    penalty_columns: Ints  # contended columns of each opened parent
    penalty_costs: Floats  # -v > 0 of each
    bounds: Floats  # least cost of all joint choices under a node
    parents: Ints  # parent of the joint choice that a node begins
    depths: Ints  # last position settled, -1: none
    choices: Ints  # made at that position
    previous: Ints  # node of the positions before
    heap_bounds: Floats  # bounds of the waiting nodes, a binary heap, least first
    heap_nodes: Ints  # the waiting nodes
    taken: Ints  # (num_columns,) stamp of the visit in which a column was last seen taken
    work: DualWork


@kernel
def make_search(num_nodes: int) -> Search:
    """Return a search with room for this number of nodes.

    `grown_search` makes room for the rest once the problem is known.
    """
    ints, floats = np.empty(0, np.int64), np.empty(0)
    return Search(
        np.zeros(_NUM_SIZES, np.int64),
        ints,
        ints,
        ints,
        ints,
        ints,
        ints,
        ints,
        floats,
        ints,
        floats,
        np.empty(num_nodes),
        np.empty(num_nodes, np.int64),
        np.empty(num_nodes, np.int64),
        np.empty(num_nodes, np.int64),
        np.empty(num_nodes, np.int64),
        np.empty(num_nodes),
        np.empty(num_nodes, np.int64),
        ints,
        make_dual_work(0, 0),
    )


@kernel
def grown_search(search: Search) -> Search:
    """Return the same search with room for its problem, and for at least one more visit of a node."""
    sizes = search.sizes
    positions, choices = sizes[MEMBERS] + sizes[WIDEST], sizes[CHOICES] + sizes[OPTIONS]
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
    """Return True if one more parent can be opened and one more node visited."""
    sizes = search.sizes
    return (
        sizes[NODES] + 2 * sizes[WIDEST] + 4 <= len(search.bounds)
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
    """Add a node to the heap."""
    bounds, nodes, bound = search.heap_bounds, search.heap_nodes, search.bounds[node]
    slot = search.sizes[HEAP]
    search.sizes[HEAP] = slot + 1
    # Nodes of equal bound stay in order.
    while slot > 0:
        above = (slot - 1) // 2
        if bounds[above] <= bound:
            break
        bounds[slot], nodes[slot] = bounds[above], nodes[above]
        slot = above
    bounds[slot], nodes[slot] = bound, node


@inlined
def pop(search: Search) -> int:
    """Remove and return the waiting node of least bound."""
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
