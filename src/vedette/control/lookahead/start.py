"""A joint sequence that is allowed, found before there is any reward."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vedette.control.constraints import Mask, opened, repaired
from vedette.control.lookahead.ahead import Ahead, Place
from vedette.control.lookahead.constrained import ConstrainedTree
from vedette.control.lookahead.courses import Sequence

# Courses that are tried. With more, a decision would wait for the proof that nothing is allowed; what is found in so
# many is as good as known.
_MOST_TRIES = 10_000


def furthest(trees: tuple[ConstrainedTree, ...], ahead: Ahead, mask: Mask) -> tuple[Sequence, ...]:
    """Courses that all sensors may take together, for as many decisions as such were found; perhaps for none.

    Decision after decision the courses that keep to the last action, repaired, are tried first; depth first, with a
    bound on the tries. mask: of the first decision; allows a joint action.
    """
    dive = _Dive(trees, ahead, mask)
    dive.descend(((),) * len(trees))
    return dive.furthest


class _Dive:
    """Depth first over joint beginnings."""

    def __init__(self, trees: tuple[ConstrainedTree, ...], ahead: Ahead, mask: Mask) -> None:
        self.trees, self.ahead, self.mask, self.tries = trees, ahead, mask, _MOST_TRIES
        self.furthest: tuple[Sequence, ...] = ((),) * len(trees)

    def descend(self, joint: tuple[Sequence, ...]) -> bool:
        """Whether a whole joint sequence was found that begins so."""
        if len(joint[0]) > len(self.furthest[0]):
            self.furthest = joint
        if len(joint[0]) == self.trees[0].stages.depth:
            return True
        return any(
            self.descend(tuple((*own, course) for own, course in zip(joint, courses, strict=True)))
            for courses in self._choices(joint)
        )

    def _choices(self, joint: tuple[Sequence, ...]) -> Iterator[tuple[int, ...]]:
        """Joint actions that are allowed after a joint beginning."""
        orders = [tree.nearest(own, tree.allowed(own)) for tree, own in zip(self.trees, joint, strict=True)]
        mask = self._mask(joint, orders)
        first = repaired(mask, [own[0] for own in orders] if joint[0] else opened(self.mask)[1])
        if mask.allows(np.array([first]))[0]:
            for s, own in enumerate(orders):
                own.sort(key=lambda course, s=s: course != first[s])  # type: ignore[misc]
            yield from self._combined(mask, orders, [-1] * len(orders), 0)

    def _mask(self, joint: tuple[Sequence, ...], allowed: list[list[int]]) -> Mask:
        single = tuple(np.zeros(len(tree.different(own)), bool) for tree, own in zip(self.trees, joint, strict=True))
        for own, courses in zip(single, allowed, strict=True):
            own[courses] = True
        if not joint[0]:
            return Mask(single, self.mask.together)
        places = {s: Place.after(tree, own) for s, (tree, own) in enumerate(zip(self.trees, joint, strict=True))}
        return Mask(single, self.ahead.pairs(len(joint[0]) + 1, places))

    def _combined(self, mask: Mask, orders: list[list[int]], at: list[int], sensor: int) -> Iterator[tuple[int, ...]]:
        """Joint actions without a clash, sensor after sensor."""
        if sensor == len(at):
            yield tuple(at)
            return
        clashes = mask.clashes(at, sensor)
        for course in orders[sensor]:
            self.tries -= 1
            if self.tries < 0:
                return
            if clashes[course] == 0:
                at[sensor] = course
                yield from self._combined(mask, orders, at, sensor + 1)
                at[sensor] = -1
