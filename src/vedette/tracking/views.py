"""Tracker that maintains the time since the last scan of each label, for the constraint on revisits of targets."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vedette.densities import as_lmb, track_moments
from vedette.platforms.camera import view_gap
from vedette.tracking.base import State, TrackerInfo, TrackerWrapper


@dataclass(frozen=True, slots=True, eq=False)
class ViewTracker(TrackerWrapper):
    """Wrapper of a tracker whose states also have the seconds since a scan had each label in view (`State.unseen`).

    A scan has a label in view if the mean of its density after the scan is within `radius` of the sensor and, for a
    camera, in its field of view. New labels count as in view.

    Attributes:
        tracker: the wrapped tracker.
        radius: m, as in `vedette.control.Revisit`.
    """

    radius: float

    def initial(self) -> State:
        """Return the wrapped tracker's first state."""
        return replace(self.tracker.initial(), unseen={})

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Step the wrapped tracker, whose beliefs must have labels. See `Tracker.step`."""
        after, info = self.tracker.step(state, scans, poses, time, rngs=rngs)
        tracks, before = as_lmb(after.fused).tracks, state.unseen or {}
        scanned = np.asarray(poses, np.float64)[[scan is not None for scan in scans], np.newaxis]
        in_view = (view_gap(scanned, track_moments(tracks)[0][:, :2], self.radius) == 0.0).any(axis=0)
        dt = 0.0 if state.time is None else float(time) - state.time
        unseen = {
            (birth, number): 0.0 if seen else before.get((birth, number), -dt) + dt
            for (birth, number), seen in zip(tracks.labels.tolist(), in_view.tolist(), strict=True)
        }
        return replace(after, unseen=unseen), info
