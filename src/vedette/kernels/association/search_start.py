"""Start of a ranking search, and preparation of a prior hypothesis at its first visit."""

import math

from vedette.kernels.association.assignment import DualWork, Options
from vedette.kernels.association.children import Children, Parents, widest_parent
from vedette.kernels.association.search import (
    CHOICES,
    COLUMNS,
    MEMBERS,
    OPTIONS,
    PARENTS,
    PENALTIES,
    POSITIONS,
    ROWS,
    STAMP,
    WIDEST,
    Search,
    new_node,
    push,
)
from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats, Ints


@borrowing
def size_search(options: Options, parents: Parents, search: Search) -> bool:
    """Store the size of the problem. Return False if the search must be grown to hold it."""
    sizes, num_columns = search.sizes, options.num_measurements
    for k in range(len(sizes)):
        sizes[k] = 0
    sizes[PARENTS], sizes[ROWS], sizes[COLUMNS] = len(parents.log_weights), len(options.offsets) - 1, num_columns
    sizes[MEMBERS], sizes[WIDEST] = parents.offsets[sizes[PARENTS]], widest_parent(parents)
    sizes[OPTIONS] = options.offsets[sizes[ROWS]]
    sizes[CHOICES] = sizes[OPTIONS]
    return (
        sizes[PARENTS] <= len(search.starts)
        and sizes[MEMBERS] + sizes[WIDEST] <= len(search.position_rows)
        and 2 * sizes[OPTIONS] <= len(search.options)
        and sizes[PARENTS] + 2 * sizes[WIDEST] + 4 <= len(search.bounds)
        and num_columns <= len(search.taken)
        and num_columns <= len(search.work.column_dual)
        and sizes[WIDEST] <= len(search.work.row_dual)
    )


@borrowing
def start_search(options: Options, parents: Parents, search: Search, children: Children) -> bool:
    """Reset the search: every parent waits with the bound that ignores collisions.

    False if the search must be grown.
    """
    if not size_search(options, parents, search):
        return False
    children.filled[0] = children.filled[1] = 0
    # The rows' own choices, shared by all parents whose best options do not collide.
    for row in range(search.sizes[ROWS]):
        first = options.offsets[row]
        for option in range(first, options.offsets[row + 1]):
            search.options[option] = option
            search.costs[option] = options.log_weights[first] - options.log_weights[option]
    for column in range(search.sizes[COLUMNS]):
        search.taken[column] = 0
    for parent in range(search.sizes[PARENTS]):
        search.starts[parent] = -1
        bound = -parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            first = options.offsets[parents.rows[i]]
            bound += -options.log_weights[first] if first < options.offsets[parents.rows[i] + 1] else math.inf
        if bound < math.inf:
            push(search, new_node(search, bound, parent, -1, -1, -1))
    return True


@inlined
def _insert_position(search: Search, first: int, count: int, row: int, gap: float, gaps: Floats) -> None:
    """Insert a row among the `count` positions from `first` on, after those of a larger gap."""
    gaps[row] = gap
    slot = first + count
    while slot > first and gaps[search.position_rows[slot - 1]] < gap:
        search.position_rows[slot] = search.position_rows[slot - 1]
        slot -= 1
    search.position_rows[slot] = row


@inlined
def open_free(parent: int, rows: Ints, options: Options, search: Search) -> bool:
    """Prepare a parent whose rows' best options do not collide. Return False if they do."""
    first_position, gaps = search.sizes[POSITIONS], search.work.row_gap
    search.sizes[STAMP] += 1
    stamp = search.sizes[STAMP]
    for i in range(len(rows)):
        first, last = options.offsets[rows[i]], options.offsets[rows[i] + 1]
        column = options.columns[first]
        if column >= 0:
            # Nothing needs to be undone: positions are counted only at the end.
            if search.taken[column] == stamp:
                return False
            search.taken[column] = stamp
        gap = search.costs[first + 1] if first + 1 < last else math.inf
        # Rows with a clear best option are settled first, so that nothing branches near the root.
        _insert_position(search, first_position, i, i, gap, gaps)
    for position in range(first_position, first_position + len(rows)):
        row = rows[search.position_rows[position]]
        search.firsts[position], search.lasts[position] = options.offsets[row], options.offsets[row + 1]
    search.starts[parent] = first_position
    search.penalty_starts[parent] = search.penalty_ends[parent] = 0
    search.sizes[POSITIONS] += len(rows)
    return True


@inlined
def _reduced_cost(options: Options, option: int, row: int, work: DualWork) -> float:
    cost = -options.log_weights[option] - work.row_dual[row]
    column = options.columns[option]
    return cost - work.column_dual[column] if column >= 0 else cost


@inlined
def open_solved(parent: int, rows: Ints, options: Options, search: Search) -> None:
    """Prepare a parent whose assignment problem has just been solved: rows with the clearest best option first.

    By the duals u, v of the optimum, the cost of any joint choice is the optimum, plus the reduced costs c - u - v >= 0
    of its options, plus -v of every column that it leaves unused: the sum of the u and of all v is the cost of the
    optimum.
    """
    work, first_position = search.work, search.sizes[POSITIONS]
    for i in range(len(rows)):
        gap = math.inf
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            if option != work.row_option[i]:
                gap = min(gap, _reduced_cost(options, option, i, work))
        _insert_position(search, first_position, i, i, gap, work.row_gap)
    filled = search.sizes[CHOICES]
    for position in range(first_position, first_position + len(rows)):
        i = search.position_rows[position]
        search.firsts[position] = start = filled
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            # The optimum's own option is first: rounding must not put an equal one before it.
            cost = 0.0 if option == work.row_option[i] else max(_reduced_cost(options, option, i, work), 0.0)
            slot = filled
            while slot > start and (search.costs[slot - 1] > cost or option == work.row_option[i]):
                search.costs[slot] = search.costs[slot - 1]
                search.options[slot] = search.options[slot - 1]
                slot -= 1
            search.costs[slot] = cost
            search.options[slot] = option
            filled += 1
        search.lasts[position] = filled
    penalties = search.sizes[PENALTIES]
    search.starts[parent], search.penalty_starts[parent] = first_position, penalties
    for column in range(search.sizes[COLUMNS]):
        # Only contended columns have a price.
        if work.column_dual[column] < 0.0:
            search.penalty_columns[penalties] = column
            search.penalty_costs[penalties] = -work.column_dual[column]
            penalties += 1
    search.penalty_ends[parent] = penalties
    search.sizes[POSITIONS] += len(rows)
    search.sizes[CHOICES], search.sizes[PENALTIES] = filled, penalties
