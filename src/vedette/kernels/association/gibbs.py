"""Joint choices drawn by a Gibbs sampler (Vo, Vo, Hoang 2017, Algorithm 1), an alternative to exact ranking.

Each parent's chain starts at its optimal assignment, so the heaviest choice is never missed. A sweep redraws every row
given the others, and every distinct state is kept once. Samples are divided by the square root of the prior weight.
"""

import math

import numpy as np

from vedette.kernels.association.assignment import DualWork, Options, make_dual_work, solve_assignment
from vedette.kernels.association.children import (
    Children,
    Parents,
    append_child,
    grown_children,
    is_full,
    make_children,
    widest_parent,
)
from vedette.kernels.base.arrays import filled_ints, hashed
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints


@kernel
def _sweep(options: Options, rows: Ints, weights: Floats, work: DualWork, rng: np.random.Generator) -> None:
    """Redraw the option of each row given the columns of all others (`work.column_row`: row of each column)."""
    for i in range(len(rows)):
        old = options.columns[work.row_option[i]]
        # The row releases its measurement before the draw, and may take it again.
        if old >= 0:
            work.column_row[old] = -1
        total = 0.0
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            column = options.columns[option]
            if column < 0 or work.column_row[column] < 0:
                total += weights[option]
        threshold = rng.random() * total
        chosen = work.row_option[i]
        total = 0.0
        for option in range(options.offsets[rows[i]], options.offsets[rows[i] + 1]):
            column = options.columns[option]
            if column < 0 or work.column_row[column] < 0:
                total += weights[option]
                chosen = option
                if total > threshold:
                    break
        work.row_option[i] = chosen
        if options.columns[chosen] >= 0:
            work.column_row[options.columns[chosen]] = i


@kernel
def _is_new(choice: Ints, num: int, children: Children, table: Ints) -> bool:
    """Look the choice up in the hash table of this parent's children, and enter it as child `num` if it is new."""
    mask = len(table) - 1
    key = 0
    for option in choice:
        key = hashed(key, option)
    slot = key & mask
    while table[slot] >= 0:
        start = children.offsets[table[slot]]
        same = True
        for i in range(len(choice)):
            if children.options[start + i] != choice[i]:
                same = False
                break
        if same:
            return False
        slot = (slot + 1) & mask
    table[slot] = num
    return True


@kernel
def _relative_weights(options: Options) -> Floats:
    """Return the linear weights of options relative to the heaviest of their row."""
    weights = np.empty(options.offsets[-1])
    for row in range(len(options.offsets) - 1):
        for option in range(options.offsets[row], options.offsets[row + 1]):
            weights[option] = math.exp(options.log_weights[option] - options.log_weights[options.offsets[row]])
    return weights


@kernel
def sample_children(options: Options, parents: Parents, num_samples: int, rng: np.random.Generator) -> Children:
    """Return distinct joint choices of all parents from about `num_samples` sweeps in total, in order of discovery."""
    shares = 0.0
    for log_weight in parents.log_weights:
        shares += math.exp(0.5 * log_weight)
    work, weights = make_dual_work(widest_parent(parents), options.num_measurements), _relative_weights(options)
    children = make_children(64, 512)
    for parent in range(len(parents.log_weights)):
        rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
        if parents.log_weights[parent] == -math.inf or solve_assignment(options, rows, work) == math.inf:
            continue
        for column in range(options.num_measurements):
            work.column_row[column] = -1
        for i in range(len(rows)):
            if options.columns[work.row_option[i]] >= 0:
                work.column_row[options.columns[work.row_option[i]]] = i
        # By the square root, so that light parents are explored too: their children may be heavy.
        num_sweeps = math.ceil(num_samples * math.exp(0.5 * parents.log_weights[parent]) / shares)
        # At most half full, so that probing stays short.
        size = 4
        while size < 2 * (num_sweeps + 1):
            size *= 2
        table = filled_ints(size, -1)
        choice = work.row_option[: len(rows)]
        for sweep in range(num_sweeps + 1):
            if sweep > 0:
                _sweep(options, rows, weights, work, rng)
            if _is_new(choice, children.filled[0], children, table):
                log_weight = parents.log_weights[parent]
                for option in choice:
                    log_weight += options.log_weights[option]
                if is_full(children, len(rows)):
                    children = grown_children(children, len(rows))
                start = append_child(children, parent, len(rows), log_weight)
                for i in range(len(rows)):
                    children.options[start + i] = choice[i]
    return children
