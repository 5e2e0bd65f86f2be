"""Platforms of sensors that measure range rates, which are relative to the velocity of the sensor."""

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import OWN_VELOCITY, Floats
from vedette.platforms.base import courses_of
from vedette.platforms.wrapper import PlatformWrapper

_STEP = 1e-3  # s, time step of the differences that give velocities


@dataclass(frozen=True, slots=True)
class WithVelocity(PlatformWrapper):
    """A platform whose poses have its velocity, m/s, as components 6 and 7. Poses need 8 components.

    The velocity at a time is the mean over the millisecond before it.

    Attributes:
        platform: the platform that moves.

    Raises:
        InputError: no platform.
    """

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform, with its velocity."""
        before = np.maximum(times - _STEP, 0.0)
        courses = courses_of("platform", self.platform, pose, actions, times)
        moved = courses[..., :2] - courses_of("platform", self.platform, pose, actions, before)[..., :2]
        stretches = np.where(times > before, times - before, 1.0)
        courses[..., OWN_VELOCITY : OWN_VELOCITY + 2] = moved / stretches[:, np.newaxis]
        return courses
