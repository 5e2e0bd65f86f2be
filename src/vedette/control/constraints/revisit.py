"""Places and targets that sensors must visit repeatedly."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.constraints.protocol import ConstraintContext, PerSensorConstraint, least_on_legs
from vedette.densities import as_lmb, track_moments
from vedette.errors import InputError
from vedette.kernels.base.types import POINTING, VISITS, Floats, Ints
from vedette.models.arguments import float_array
from vedette.models.fields import Positive, Probability, check_fields
from vedette.models.measurement import wrap_angles
from vedette.platforms.camera import angle_beyond_view, is_camera, view_gap

# Horizons of lead before a place is due: one in which a platform may still move away, and one for the way.
_HORIZONS = 2.0


@dataclass(frozen=True, slots=True)
class Revisit(PerSensorConstraint):
    """A maximum time between visits of each place by any platform, or between scans of each target by any sensor.

    Poses contain the seconds since their platforms were at each place (`Patrolling`), states the seconds since a scan
    had each label in view (`vedette.tracking.ViewTracker`). When the remaining time is little more than the time to
    move or turn there, the sensor that can be first takes only courses that come to the place or target, or nearest to
    it. Sensors share the places. Ways are straight, at the speed of the fastest course. Decisions over several periods
    apply the constraint on targets to the first.

    Attributes:
        places: (num_places, 2) m, those of `Patrolling`. (): all targets.
        radius: distance within which a platform is at a place, or a sensor has a target in view. A camera must also
            have it in its field of view [m].
        every: longest time from one visit of a place, or scan of a target, to the next [s].
        existence: minimum existence probability of the targets.

    Raises:
        InputError: places of another shape, a radius or time that is not above 0, or no probability.
    """

    places: Sequence[tuple[float, float]]
    radius: Positive
    every: Positive
    existence: Probability = 0.5
    name: ClassVar[str] = "revisit"

    def __post_init__(self) -> None:
        places = float_array("places", self.places, (None, 2)).tolist() if len(self.places) else ()
        object.__setattr__(self, "places", tuple(map(tuple, places)))
        check_fields(self)

    @property
    def needs_beliefs(self) -> bool:
        """True for targets, whose positions must be predicted."""
        return not self.places

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return (num_courses,) m, the distance of each course from its sensor's place, less that of the nearest."""
        violations = [np.zeros(len(own)) for own in situation.courses]
        if situation.poses is not None:
            to_go = self._to_places if self.places else self._to_targets
            for sensor, gaps in to_go(situation, situation.poses):
                if len(gaps):
                    violations[sensor] = gaps - gaps.min()
        return tuple(violations)

    def _to_places(self, situation: ConstraintContext, poses: Floats) -> Iterator[tuple[int, Floats]]:
        """Yield the sensors that must go to a place, each with the distances (num_courses,) m of its courses."""
        places, num = np.array(self.places), VISITS + len(self.places)
        if poses.shape[1] < num:
            expected = f"poses of {num} components, the last of them seconds since the last visits (see Patrolling)"
            raise InputError(f"constraint {self.name}: expected {expected}; got {poses.shape[1]}")
        patrols = np.flatnonzero(poses[:, VISITS] >= 0.0)
        since = poses[patrols, VISITS:num].min(axis=0, initial=math.inf)
        for sensor, place in self._sent(situation, patrols, poses[:, :2], places, since):
            x, y = np.moveaxis(situation.ways(sensor) - places[place], 2, 0)
            yield sensor, np.maximum(np.sqrt(least_on_legs(x, y).min(axis=1)) - self.radius, 0.0)

    def _to_targets(self, situation: ConstraintContext, poses: Floats) -> Iterator[tuple[int, Floats]]:
        """Yield the sensors that must see a target, each with the least distance out of view (num_courses,) m.

        The target counts as farther away by `radius` at times at which the sensor does not scan.
        """
        if situation.unseen is None:
            raise InputError(f"constraint {self.name}: expected a state with `unseen` (see ViewTracker); got none")
        lmbs = [as_lmb(belief) for belief in situation.beliefs]
        since = np.array([situation.unseen.get((birth, k), -math.inf) for birth, k in lmbs[0].tracks.labels.tolist()])
        held = (lmbs[0].existence >= self.existence) & (since >= 0.0)
        paths = np.stack([track_moments(lmb.tracks)[0][held, :2] for lmb in lmbs], axis=1)
        for s, target in self._sent(situation, np.arange(len(poses)), poses, paths[:, -1], since[held]):
            silent = ~situation.scans[s] if situation.scans else False
            yield s, (view_gap(situation.courses[s], paths[target], self.radius) + silent * self.radius).min(axis=1)

    def _sent(
        self, situation: ConstraintContext, sensors: Ints, poses: Floats, places: Floats, since: Floats
    ) -> list[tuple[int, int]]:
        """Return the sensors that must go to a place, each with the place.

        The place that was not visited for longest comes first: with an order by remaining distance, a sensor would turn
        back and forth. Each place goes to the sensor that can arrive first, possibly by way of other places. A sensor
        moves to its first place when any of its places is due. since: (num_places,) s.
        """
        at, ready, (speeds, turn_rates) = poses[sensors], np.zeros(len(sensors)), _rates(situation, sensors)
        first: dict[int, int] = {}
        due: set[int] = set()
        for place in np.argsort(-since, kind="stable").tolist():
            offsets = places[place] - at[:, :2]
            distances = np.hypot(*offsets.T)
            with np.errstate(divide="ignore", invalid="ignore"):
                move = np.maximum(distances - self.radius, 0.0) / speeds
                turn = angle_beyond_view(at, places[place]) / turn_rates
            arrival = ready + np.fmax(np.fmax(move, turn), 0.0)
            if not np.isfinite(arrival).any():  # out of reach
                continue
            k = int(np.argmin(arrival))
            first.setdefault(k, place)
            if self.every - since[place] - arrival[k] <= _HORIZONS * _horizon(situation.times):
                due.add(k)
            ready[k] = arrival[k]
            if is_camera(at[k]):
                at[k, POINTING] = np.arctan2(offsets[k, 1], offsets[k, 0])
            if speeds[k] > 0.0:
                at[k, :2] = places[place]
        return [(int(sensors[k]), first[k]) for k in sorted(due)]


def _horizon(times: Floats) -> float:
    """Return the time in s from one decision to the next, with steps of equal length."""
    step = times[0] if len(times) == 1 else times[1] - times[0]
    return float(times[-1] - times[0] + step)


def _rates(situation: ConstraintContext, sensors: Ints) -> Floats:
    """Return the speed in m/s and turn rate in rad/s of the fastest courses, (2, num_sensors).

    Sensors whose courses are not known are as fast as the fastest of the others.
    """
    rates, known = np.zeros((2, len(sensors))), np.array([len(situation.courses[s]) > 0 for s in sensors], bool)
    for k in np.flatnonzero(known).tolist():
        ways, courses = situation.ways(sensors[k]), situation.courses[sensors[k]]
        rates[0, k] = np.hypot(*np.diff(ways, axis=1).transpose(2, 0, 1)).sum(axis=1).max()
        if situation.poses is not None and is_camera(situation.poses[sensors[k]]):
            rates[1, k] = np.abs(wrap_angles(courses[:, -1, POINTING] - situation.poses[sensors[k], POINTING])).max()
    rates[:, ~known] = rates.max(axis=1, keepdims=True, initial=0.0)
    return rates / _horizon(situation.times)
