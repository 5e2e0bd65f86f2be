"""Base of platforms that add components to the poses of another platform."""

from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Bools, Floats
from vedette.platforms.base import Platform, check_platform, courses_of, prices_of, scans_of


@dataclass(frozen=True, slots=True)
class PlatformWrapper:
    """A platform with the actions, prices and scans of another one. Subclasses extend its `courses`."""

    platform: Platform

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform."""
        return tuple(self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_actions, num_columns) the actions of the platform."""
        return np.asarray(self.platform.actions(pose))

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the course of one action, see `courses`."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the courses of the platform."""
        return courses_of("platform", self.platform, pose, actions, times)

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_actions,) of the platform."""
        return prices_of("platform", self.platform, actions)

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_actions, num_times) the scans of the platform."""
        return scans_of("platform", self.platform, pose, actions, times)
