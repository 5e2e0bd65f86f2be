"""The moving platforms of a run."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.models.arguments import float_array, provides
from vedette.platforms.base import HasScans, Platform, course_of, scans_of


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """Platforms, the present action of each, and the time at which it began.

    Attributes:
        platforms: one per sensor.
        starts: (num_sensors, pose_dim) pose of each when it began its action.
        actions: the row of its action, one per sensor. None: it does not move.
        since: s, time when they began.

    Raises:
        InputError: another number of poses or actions than of platforms, or actions of other columns.
    """

    platforms: tuple[Platform, ...]
    starts: Floats
    actions: tuple[Floats | None, ...]
    since: float
    _switched: tuple[int, ...] = field(init=False, default=())  # indices of sensors whose action may keep them off

    def __post_init__(self) -> None:
        num = len(self.platforms)
        if len(self.starts) != num or len(self.actions) != num:
            raise InputError(f"fleet: expected {num} poses and actions; got {len(self.starts)}, {len(self.actions)}")
        for s, (platform, action) in enumerate(zip(self.platforms, self.actions, strict=True)):
            if action is not None:
                float_array(f"sensors[{s}] action", action, (len(platform.columns),))
        under_way = [s for s, action in enumerate(self.actions) if action is not None]
        switched = tuple([s for s in under_way if provides(self.platforms[s], HasScans)])
        object.__setattr__(self, "_switched", switched)

    def poses(self, time: float) -> Floats:
        """Return (num_sensors, pose_dim) the poses of all at `time`, s, which is no earlier than `since`."""
        seconds = np.array([time - self.since])
        at = self.starts.copy()
        for s, (platform, action) in enumerate(zip(self.platforms, self.actions, strict=True)):
            if action is not None:
                at[s] = course_of(f"sensors[{s}].platform", platform, self.starts[s], action, seconds)[0]
        return at

    def off(self, time: float) -> Bools:
        """Return (num_sensors,) whether the action of each keeps its sensor from scanning at `time`, s."""
        seconds, off = np.array([time - self.since]), np.zeros(len(self.platforms), np.bool_)
        for s in self._switched:
            platform, rows = self.platforms[s], np.array([self.actions[s]])
            off[s] = not scans_of(f"sensors[{s}].platform", platform, self.starts[s], rows, seconds)[0, 0]
        return off

    def follow(self, actions: Sequence[Floats | None], time: float) -> "Fleet":
        """Return the fleet that begins new actions at `time`, s, from its poses then."""
        return replace(self, starts=self.poses(time), actions=tuple(actions), since=time)
