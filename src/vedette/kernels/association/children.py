"""Prior hypotheses and the joint choices (children) that follow from them at a scan."""

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints


class Parents(NamedTuple):
    """Hypotheses over the rows of a scan."""

    offsets: Ints  # (num_parents + 1,) into rows
    rows: Ints  # rows of each parent, in label order
    log_weights: Floats  # (num_parents,)


class Children(NamedTuple):
    """Joint choices of one option for every row of a parent, as found so far."""

    filled: Ints  # (2,) number of children, and of all their options; the arrays may be larger
    parents: Ints  # (num_children,)
    offsets: Ints  # (num_children + 1,) into options
    options: Ints  # in the order of the parent's rows
    log_weights: Floats  # (num_children,)


@kernel
def make_children(num: int, num_options: int) -> Children:
    """Return an empty list with room for `num` children of `num_options` options in total."""
    return Children(
        np.zeros(2, np.int64),
        np.empty(num, np.int64),
        np.zeros(num + 1, np.int64),
        np.empty(num_options, np.int64),
        np.empty(num),
    )


@kernel
def grown_children(children: Children, num_rows: int) -> Children:
    """Return the same children with room for at least one more of `num_rows` rows."""
    num, num_options = children.filled[0], children.filled[1]
    parents = grown_ints(children.parents, num + 1)
    return Children(
        children.filled,
        parents,
        grown_ints(children.offsets, len(parents) + 1),
        grown_ints(children.options, num_options + num_rows),
        grown_floats(children.log_weights, num + 1),
    )


@inlined
def is_full(children: Children, num_rows: int) -> bool:
    """Return True if there is no room for one more child of `num_rows` rows."""
    filled = children.filled
    return filled[0] == len(children.parents) or filled[1] + num_rows > len(children.options)


@inlined
def append_child(children: Children, parent: int, num_rows: int, log_weight: float) -> int:
    """Append one more child, and return the position for its options."""
    filled = children.filled
    num, start = filled[0], filled[1]
    children.parents[num] = parent
    children.offsets[num + 1] = start + num_rows
    children.log_weights[num] = log_weight
    filled[0] += 1
    filled[1] += num_rows
    return start


@borrowing
def widest_parent(parents: Parents) -> int:
    """Return the largest number of rows of a parent."""
    most = 0
    for parent in range(len(parents.log_weights)):
        most = max(most, parents.offsets[parent + 1] - parents.offsets[parent])
    return most
