"""Curves that lie on one another, as strategies do until they first decide differently."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Bools, Floats


@dataclass(frozen=True, slots=True)
class Shared:
    """A stretch over which several curves are one.

    Attributes:
        members: which curves, increasing.
        shown: (num_points,) the points of the stretch; it may have gaps.
    """

    members: tuple[int, ...]
    shown: Bools


def shared_stretches(curves: Floats) -> tuple[Shared, ...]:
    """Every set of curves that are equal over one or more steps, with the points of those steps.

    Args:
        curves: (num_curves, num_points).
    """
    same_point = curves[:, None, :] == curves[None, :, :]
    same_step = same_point[:, :, :-1] & same_point[:, :, 1:]
    found: dict[tuple[int, ...], Bools] = {}
    for step in range(curves.shape[1] - 1):
        for curve in range(len(curves)):
            members = tuple(np.flatnonzero(same_step[curve, :, step]).tolist())
            if len(members) > 1 and members[0] == curve:
                found.setdefault(members, np.zeros(curves.shape[1], bool))[step : step + 2] = True
    return tuple(Shared(members, shown) for members, shown in found.items())


def own_points(curves: Floats) -> Bools:
    """(num_curves, num_points) ends of the steps over which a curve is equal to no other; all of a single one."""
    num_curves, num_points = curves.shape
    if num_curves == 1:
        return np.ones((1, num_points), bool)
    same_point = curves[:, None, :] == curves[None, :, :]
    alone = (same_point[:, :, :-1] & same_point[:, :, 1:]).sum(axis=1) == 1
    own = np.zeros(curves.shape, bool)
    own[:, :-1] |= alone
    own[:, 1:] |= alone
    return own
