"""Platforms whose actions have prices, and whose sensors can be switched off or have a limited scanning time."""

import math
from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import BUDGET, Bools, Floats
from vedette.models.arguments import positive, real, reject
from vedette.platforms.base import (
    SWITCH,
    actions_at,
    courses_of,
    prices_of,
    scans_of,
)
from vedette.platforms.wrapper import PlatformWrapper

_SLACK = 1e-9  # tolerance for rounding, relative to a time


@dataclass(frozen=True, slots=True)
class Operated(PlatformWrapper):
    """A platform whose actions have a price, in units of the reward, and whose sensor may be switched off.

    An action of a sensor that can be switched has one more number, `on`: 1, or 0 for the same action with the sensor
    off, which makes no measurement and no clutter, and costs nothing.

    Attributes:
        platform: the platform that moves the sensor.
        price: of every action, or the name of the column of its actions with the price of each. None: that of the
            platform.
        switchable: whether each action is listed a second time, with the sensor off, after all those with it on.
        budget: largest number of seconds of scanning in store. Component 5 of the pose is the remaining number. The
            sensor scans until none is left, and then no more before its next action. None: without limit.
        refill: seconds of scanning that the store gains each second, up to `budget`. A sensor that always scans with a
            refill of 0.1 is on for a tenth of the time.

    Raises:
        InputError: no platform, a price that is not finite, no such column, a switch in addition to a column `on`, a
            budget that is not above 0, or a refill that is negative or without a budget.
    """

    price: float | str | None = None
    switchable: bool = False
    budget: float | None = None
    refill: float = 0.0

    def __post_init__(self) -> None:
        PlatformWrapper.__post_init__(self)
        if isinstance(self.price, str) and self.price not in self.platform.columns:
            raise reject("price", f"a number or one of {', '.join(self.platform.columns) or 'no columns'}", self.price)
        if not isinstance(self.price, str | None):
            real("price", self.price)
        if self.switchable and SWITCH in self.platform.columns:
            raise reject("switchable", f"False, as the platform has a column {SWITCH} of its own", True)
        if self.budget is not None:
            positive("budget", self.budget)
        if real("refill", self.refill) < 0.0 or (self.refill > 0.0 and self.budget is None):
            raise reject("refill", "0, or more beside a budget", self.refill)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform, and `on` if the sensor can be switched."""
        return (*self.platform.columns, SWITCH) if self.switchable else tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the actions of the platform, then the same with the sensor off."""
        return self.switched_on_and_off(actions_at("platform", self.platform, pose).values)

    def switched_on_and_off(self, rows: Floats) -> Floats:
        """Return the platform's rows with the sensor on, and then with it off if it can be switched."""
        if not self.switchable:
            return rows
        return np.column_stack([np.tile(rows, (2, 1)), np.repeat([1.0, 0.0], len(rows))])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform, with the remaining seconds of scanning."""
        courses = courses_of("platform", self.platform, pose, self._own(actions), times)
        if self.budget is not None:
            courses[..., BUDGET] = self._left(pose, actions, times)
        return courses

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,), 0 with the sensor off."""
        if self.price is None:
            prices = prices_of("platform", self.platform, self._own(actions))
        elif isinstance(self.price, str):
            prices = actions[:, self.columns.index(self.price)]
        else:
            prices = np.full(len(actions), float(self.price))
        return np.where(self._is_on(actions), prices, 0.0)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) the scans of the platform while the sensor is on."""
        scans = scans_of("platform", self.platform, pose, self._own(actions), times)
        scans &= self._is_on(actions)[:, np.newaxis]
        return scans if self.budget is None else scans & (times <= self._lasts(pose) * (1.0 + _SLACK))

    def _lasts(self, pose: Floats) -> float:
        """Return the time in s after which a scanning sensor has no scanning time left."""
        if len(pose) <= BUDGET:
            wanted = f"{BUDGET + 1} components, the last of them the seconds left to scan"
            raise InputError(f"pose: expected {wanted}; got {len(pose)}")
        return float(pose[BUDGET]) / (1.0 - self.refill) if self.refill < 1.0 else math.inf

    def _left(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return (num_actions, num_times) the seconds of scanning left `times` seconds after each action began."""
        lasts, on = self._lasts(pose), self._is_on(actions)[:, np.newaxis]
        scanning = pose[BUDGET] - (1.0 - self.refill) * times
        empty = self.refill * (times - lasts)
        found = np.where(on, np.where(times <= lasts, scanning, empty), pose[BUDGET] + self.refill * times)
        return np.asarray(np.clip(found, 0.0, self.budget))

    def _own(self, actions: Floats) -> Floats:
        return np.ascontiguousarray(actions[:, :-1]) if self.switchable else actions

    def _is_on(self, actions: Floats) -> Bools:
        return actions[:, -1] != 0.0 if self.switchable else np.ones(len(actions), np.bool_)
