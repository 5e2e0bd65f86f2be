"""Selection of the joint choices of a scan that are kept as hypotheses."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT
from vedette.kernels.association.children import Children
from vedette.kernels.association.search import SearchCaps
from vedette.kernels.base.arrays import filled_ints, hashed
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Ints
from vedette.kernels.gaussian.mixtures import descending_order


class Truncation(NamedTuple):
    """Limits on the hypotheses of a scan."""

    search: SearchCaps  # number and least weight of hypotheses
    gate: float  # squared Mahalanobis distance beyond which a track cannot take a measurement
    log_clutter_floor: float  # least log clutter intensity
    max_track_gap: float  # log weight gap within which the only hypothesis of a track is kept; 0: none is


@borrowing
def _same_tracks(first: int, second: int, children: Children, columns: Ints) -> bool:
    """Return True if two children are the same hypothesis: the same updated tracks, whatever other tracks died."""
    i, j = children.offsets[first], children.offsets[second]
    end_i, end_j = children.offsets[first + 1], children.offsets[second + 1]
    while True:
        while i < end_i and columns[children.options[i]] == ABSENT:
            i += 1
        while j < end_j and columns[children.options[j]] == ABSENT:
            j += 1
        if i == end_i or j == end_j:
            return i == end_i and j == end_j
        if children.options[i] != children.options[j]:
            return False
        i += 1
        j += 1


@kernel
def merge_equal(children: Children, columns: Ints) -> Ints:
    """Add the weight of each repeated hypothesis to its first occurrence, and return the first occurrences."""
    num = children.filled[0]
    size = 4
    while size < 2 * num:
        size *= 2
    table = filled_ints(size, -1)
    firsts = np.empty(num, np.int64)
    num_firsts = 0
    for child in range(num):
        key = 0
        for i in range(children.offsets[child], children.offsets[child + 1]):
            if columns[children.options[i]] != ABSENT:
                key = hashed(key, children.options[i])
        slot = key & (size - 1)
        while table[slot] >= 0 and not _same_tracks(table[slot], child, children, columns):
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = child
            firsts[num_firsts] = child
            num_firsts += 1
        else:
            first = table[slot]
            # log (exp a + exp b); both are finite, as a child of weight zero is never found.
            a, b = children.log_weights[first], children.log_weights[child]
            children.log_weights[first] = max(a, b) + math.log1p(math.exp(min(a, b) - max(a, b)))
    return firsts[:num_firsts]


@kernel
def heaviest_first(children: Children, firsts: Ints) -> Ints:
    """Return the children `firsts` by descending weight, ties by order of discovery."""
    log_weights = np.empty(len(firsts))
    for i in range(len(firsts)):
        log_weights[i] = children.log_weights[firsts[i]]
    order = descending_order(log_weights)
    for i in range(len(order)):
        order[i] = firsts[order[i]]
    return order


@kernel
def keep_heaviest(children: Children, order: Ints, needed: Ints, caps: SearchCaps) -> Ints:
    """Return the children to keep of those in `order`, heaviest first: those needed.

    Of the others, by number and gap.
    """
    others = caps.max_hypotheses
    for child in order:
        others -= needed[child]
    kept = np.empty(len(order), np.int64)
    num_kept = 0
    for child in order:
        wanted = needed[child] == 1
        # The needed ones are counted already, in the same total.
        gap = children.log_weights[order[0]] - children.log_weights[child]
        if not wanted and others > 0 and gap <= caps.max_log_gap:
            wanted = True
            others -= 1
        if wanted:
            kept[num_kept] = child
            num_kept += 1
    return kept[:num_kept]
