"""Platforms whose actions have prices, and whose sensors can be switched off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import real, reject
from vedette.platforms.base import (
    SWITCH,
    Platform,
    actions_at,
    check_platform,
    courses_of,
    prices_of,
    scans_of,
)


@dataclass(frozen=True, slots=True)
class Operated:
    """A platform whose actions have a price, in units of the reward, and whose sensor may be switched off.

    An action of a sensor that can be switched has one number more, `on`: 1, or 0 of the same action with the sensor
    off, which makes no measurement and no clutter, and costs nothing.

    Attributes:
        platform: what it may do.
        price: of every action; or the name of the column of its actions that has the price of each; None: that of the
            platform.
        switchable: whether each action is listed a second time, with the sensor off, after all those with it on.

    Raises:
        InputError: no platform, a price that is not finite, no such column, or a switch beside a column `on`.
    """

    platform: Platform
    price: float | str | None = None
    switchable: bool = False

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)
        if isinstance(self.price, str) and self.price not in self.platform.columns:
            raise reject("price", f"a number or one of {', '.join(self.platform.columns) or 'no columns'}", self.price)
        if not isinstance(self.price, str | None):
            real("price", self.price)
        if self.switchable and SWITCH in self.platform.columns:
            raise reject("switchable", f"False, as the platform has a column {SWITCH} of its own", True)

    @property
    def columns(self) -> tuple[str, ...]:
        """Those of the platform, and `on` where the sensor can be switched."""
        return (*self.platform.columns, SWITCH) if self.switchable else tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """(num_actions, num_columns) those of the platform; then those with the sensor off."""
        return self.switched_on_and_off(actions_at("platform", self.platform, pose).values)

    def switched_on_and_off(self, rows: Floats) -> Floats:
        """The platform's own actions as this one's: with the sensor on, and then off where it can be switched."""
        if not self.switchable:
            return rows
        return np.column_stack([np.tile(rows, (2, 1)), np.repeat([1.0, 0.0], len(rows))])

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """That of the platform."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Those of the platform."""
        return courses_of("platform", self.platform, pose, self._own(actions), times)

    def prices(self, actions: Floats) -> Floats:
        """(num_actions,) of each; none of those with the sensor off."""
        if self.price is None:
            prices = prices_of("platform", self.platform, self._own(actions))
        elif isinstance(self.price, str):
            prices = actions[:, self.columns.index(self.price)]
        else:
            prices = np.full(len(actions), float(self.price))
        return np.where(self._is_on(actions), prices, 0.0)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """(num_actions, num_times) those of the platform, where the sensor is on."""
        scans = scans_of("platform", self.platform, pose, self._own(actions), times)
        return scans & self._is_on(actions)[:, np.newaxis]

    def _own(self, actions: Floats) -> Floats:
        return np.ascontiguousarray(actions[:, :-1]) if self.switchable else actions

    def _is_on(self, actions: Floats) -> Bools:
        return actions[:, -1] != 0.0 if self.switchable else np.ones(len(actions), np.bool_)
