"""Platforms of sensors that measure range rates, which are relative to the velocity of the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import OWN_VELOCITY, Bools, Floats
from vedette.platforms.base import Platform, check_platform, courses_of, prices_of, scans_of

_STEP = 1e-3  # s, time step of the differences that give velocities


@dataclass(frozen=True, slots=True)
class WithVelocity:
    """A platform whose poses have its velocity, m/s, as components 6 and 7; poses need 8 components.

    The velocity at a time is the mean over the millisecond before it.

    Attributes:
        platform: the platform that moves.

    Raises:
        InputError: no platform.
    """

    platform: Platform

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform."""
        return tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the actions of the platform."""
        return self.platform.actions(pose)

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the course of the platform, with its velocity."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform, with its velocity."""
        before = np.maximum(times - _STEP, 0.0)
        courses = courses_of("platform", self.platform, pose, actions, times)
        moved = courses[..., :2] - courses_of("platform", self.platform, pose, actions, before)[..., :2]
        stretches = np.where(times > before, times - before, 1.0)
        courses[..., OWN_VELOCITY : OWN_VELOCITY + 2] = moved / stretches[:, np.newaxis]
        return courses

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,) of the platform."""
        return prices_of("platform", self.platform, actions)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) the scans of the platform."""
        return scans_of("platform", self.platform, pose, actions, times)
