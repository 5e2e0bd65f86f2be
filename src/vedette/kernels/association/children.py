"""Prior hypotheses and the joint choices (children) that follow from them at a scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints


class Parents(NamedTuple):
    """Prior hypotheses. Rows of parent `p` are `rows[offsets[p]:offsets[p + 1]]`.

    groups: (num,) label-set number, or empty. Of each group at least one child is kept whatever its weight.
    """

    offsets: Ints
    rows: Ints
    log_weights: Floats
    groups: Ints


class Children(NamedTuple):
    """Joint choices. Options of child `c` are `options[offsets[c]:offsets[c + 1]]`, one a row of its parent."""

    parents: Ints
    offsets: Ints
    options: Ints
    log_weights: Floats


@kernel
def make_children() -> Children:
    return Children(np.empty(64, np.int64), np.zeros(66, np.int64), np.empty(512, np.int64), np.empty(64))


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
    """Whether one more child of `num_rows` rows needs room. used: (2,) number of children and of their options."""
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


@borrowing
def num_groups(groups: Ints) -> int:
    """Number of label-set groups; 0 where groups are not in use."""
    most = 0
    for group in groups:
        most = max(most, group + 1)
    return most


@borrowing
def widest_parent(parents: Parents) -> int:
    """Number of rows of the parent that has most."""
    most = 0
    for parent in range(len(parents.log_weights)):
        most = max(most, parents.offsets[parent + 1] - parents.offsets[parent])
    return most


__all__ = [
    "Children",
    "Parents",
    "append_child",
    "grown_children",
    "is_full",
    "make_children",
    "num_groups",
    "widest_parent",
]
