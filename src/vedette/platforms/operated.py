"""Platforms whose actions have prices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import real, reject
from vedette.platforms.base import Platform, check_platform, courses_of


@dataclass(frozen=True, slots=True)
class Operated:
    """A platform whose actions have a price, in units of the reward, which planners subtract.

    Attributes:
        platform: what it may do.
        price: of every action; or the name of the column of its actions that has the price of each.

    Raises:
        InputError: no platform, a price that is not finite, or no such column.
    """

    platform: Platform
    price: float | str

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)
        if not isinstance(self.price, str):
            real("price", self.price)
        elif self.price not in self.platform.columns:
            raise reject("price", f"a number or one of {', '.join(self.platform.columns) or 'no columns'}", self.price)

    @property
    def columns(self) -> tuple[str, ...]:
        """Those of the platform."""
        return tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """(num_actions, num_columns) those of the platform."""
        return self.platform.actions(pose)

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """That of the platform."""
        return self.platform.course(pose, action, times)

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Those of the platform."""
        return courses_of("platform", self.platform, pose, actions, times)

    def prices(self, actions: Floats) -> Floats:
        """(num_actions,) of each."""
        if isinstance(self.price, str):
            return actions[:, self.columns.index(self.price)]
        return np.full(len(actions), float(self.price))
