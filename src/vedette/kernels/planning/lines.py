"""Straight lines in the plane and their intersections with edges of zones."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Bools, Floats, Ints


class Edges(NamedTuple):
    """The edges of all zones."""

    starts: Floats  # (num_edges, 2)
    ends: Floats  # (num_edges, 2)
    zones: Ints  # (num_edges,) zone of each edge


@inlined
def _side(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return a number above 0 if c is to the left of the line from a to b, below 0 if to the right."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@inlined
def _touched_at(ax: float, ay: float, bx: float, by: float, edges: Edges, e: int) -> float:
    """Return the fraction of the line from a to b at which it touches an edge, or inf if it does not."""
    cx, cy, dx, dy = edges.starts[e, 0], edges.starts[e, 1], edges.ends[e, 0], edges.ends[e, 1]
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx) or max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return math.inf
    a, b = _side(cx, cy, dx, dy, ax, ay), _side(cx, cy, dx, dy, bx, by)
    c, d = _side(ax, ay, bx, by, cx, cy), _side(ax, ay, bx, by, dx, dy)
    if (a > 0.0 and b > 0.0) or (a < 0.0 and b < 0.0) or (c > 0.0 and d > 0.0) or (c < 0.0 and d < 0.0):
        return math.inf
    return 0.0 if a == b else a / (a - b)


@kernel
def clear_lengths(starts: Floats, ends: Floats, edges: Edges) -> Floats:
    """Return lengths (num_starts, num_ends) m of straight lines, or inf for those that touch an edge."""
    found = np.empty((len(starts), len(ends)))
    for i in range(len(starts)):
        for j in range(len(ends)):
            ax, ay, bx, by = starts[i, 0], starts[i, 1], ends[j, 0], ends[j, 1]
            found[i, j] = math.hypot(bx - ax, by - ay)
            for e in range(len(edges.zones)):
                if _touched_at(ax, ay, bx, by, edges, e) < math.inf:
                    found[i, j] = math.inf
                    break
    return found


@kernel
def first_touches(starts: Floats, ends: Floats, edges: Edges, ignored: Bools) -> Floats:
    """Return the fraction (num,) of the line from each start to its end at which it first touches an edge. inf: never.

    ignored: (num, num_zones) zones whose edges do not count for a line.
    """
    found = np.full(len(starts), math.inf)
    for i in range(len(starts)):
        for e in range(len(edges.zones)):
            if not ignored[i, edges.zones[e]]:
                share = _touched_at(starts[i, 0], starts[i, 1], ends[i, 0], ends[i, 1], edges, e)
                found[i] = min(found[i], share)
    return found
