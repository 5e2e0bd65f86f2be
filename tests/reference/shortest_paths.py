"""Shortest paths among polygons, by samples along every line between corners."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Zone = Sequence[Any]  # polygons (num_corners, 2), m; forbidden is what is inside of an odd number of them


def forbidden(points: Any, zones: Sequence[Zone], depth: float = 1e-4) -> Any:
    """(num,) whether points (num, 2) are inside a zone, and farther than `depth` from its edges."""
    found = np.zeros(len(points), bool)
    for zone in zones:
        odd, near = np.zeros(len(points), bool), np.full(len(points), math.inf)
        for ring in zone:
            for (x1, y1), (x2, y2) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                x, y = points.T
                if y1 != y2:
                    odd ^= ((y1 > y) != (y2 > y)) & (x < x1 + (y - y1) / (y2 - y1) * (x2 - x1))
                size = math.hypot(x2 - x1, y2 - y1)
                share = np.clip(((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / size**2, 0.0, 1.0)
                near = np.minimum(near, np.hypot(x - x1 - share * (x2 - x1), y - y1 - share * (y2 - y1)))
        found |= odd & (near > depth)
    return found


def free_line(start: Any, end: Any, zones: Sequence[Zone], num: int = 200) -> bool:
    """Whether none of many points of a straight line is forbidden."""
    shares = (np.arange(num)[:, np.newaxis] + 0.5) / num
    return not forbidden(start + shares * (end - start), zones).any()


def path_length(start: Any, goal: Any, zones: Sequence[Zone]) -> float:
    """m, of the shortest path from corner to corner; inf: there is none."""
    nodes = np.concatenate([[start, goal], *(ring for zone in zones for ring in zone)])
    best = {0: 0.0}
    queue = [(0.0, 0)]
    done: set[int] = set()
    while queue:
        length, at = heapq.heappop(queue)
        if at == 1:
            return length
        if at in done:
            continue
        done.add(at)
        for to in range(1, len(nodes)):
            further = length + float(np.hypot(*(nodes[to] - nodes[at])))
            if to not in done and further < best.get(to, math.inf) and free_line(nodes[at], nodes[to], zones):
                best[to] = further
                heapq.heappush(queue, (further, to))
    return math.inf


def nearest_free(point: Any, zones: Sequence[Zone], step: float) -> float:
    """m, from a point to the nearest one that is not forbidden, to within a step: by circles around it."""
    angles = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    around, radius = np.stack([np.cos(angles), np.sin(angles)], axis=1), 0.0
    while forbidden(point + radius * around, zones).all():
        radius += step
    return radius
