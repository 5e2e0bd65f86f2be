"""The cost-to-go: the loss beyond the horizon, under a base policy that continues each course to a lost target.

The loss of a course is that of the policy which begins with it (D. P. Bertsekas, Rollout, Policy Iteration, and
Distributed Reinforcement Learning, 2020). The policy goes to one target by the shortest path around zones, meets it
where it will be then, and follows it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vedette.control.constraints.paths import Paths, VisibilityGraph
from vedette.control.extrapolation import extrapolated, seconds_to_search, seconds_to_turn, turn_rate, walked
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import LMB, UndetectedIntensity
from vedette.kernels.base.types import HALF_WIDTH, HEADING, Bools, Floats, Ints
from vedette.models.functions import numbers_at
from vedette.platforms import Options
from vedette.platforms.camera import line_of_sight

# Minimum existence probability of targets that sensors approach from beyond the horizon.
_LEAST_EXISTENCE = 0.1
# Factor on the time to a target, so that the sensor observes it for a while.
_STAY = 1.25
# Distances, m, and number of directions at which the detection range of a sensor is evaluated.
_DISTANCES, _DIRECTIONS = np.geomspace(1.0, 1e6, 121), 8
# Number of pseudo-updates on the way. A step is at most the detection range, so that no target is passed undetected.
_LEAST_STEPS, _MOST_STEPS = 4, 12
# A course leads to the target that it approaches most, as a fraction of the progress of the best course. If these
# fractions differ by at most the first number, it leads to the nearest target. Second number: minimum progress, m.
_SAME_PROGRESS, _LEAST_PROGRESS = 0.05, 1e-6
_SAME_HEADING = 1e-12  # 1 minus the cosine of two headings that are taken for one, 1e-6 rad apart


@dataclass(frozen=True, slots=True, eq=False)
class CostToGo:
    """Targets that attract sensors, how long sensors take to reach them, and how courses continue towards them."""

    options: tuple[Options, ...]  # for each sensor, its options within the horizon
    reaches: Floats  # (num_sensors,) m, detection range of each sensor
    labels: Ints  # (num_targets, 2) labels of the targets that attract sensors
    places: Floats  # (num_targets, 2) m, expected positions of these targets
    paths: tuple[Paths, ...]  # for each sensor, its paths to these positions
    undetected: UndetectedIntensity | None  # intensity of undetected targets; None: not known

    @classmethod
    def of(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        labels: Ints,
        places: Floats,
        graph: VisibilityGraph,
        undetected: UndetectedIntensity | None,
    ) -> "CostToGo":
        """Return the data for these targets. graph: of the zones that constraints forbid."""
        reaches = np.array([detection_range(sensor, own.pose) for sensor, own in zip(sensors, options, strict=True)])
        paths = tuple([graph.to(places, own.pose[:2]) for own in options])
        return cls(tuple(options), reaches, labels, places, paths, undetected)

    def horizons(self, settings: PlanningSettings) -> tuple[PlanningSettings, ...]:
        """Return settings of further horizons, halfway and at the end; none if every sensor can reach its targets.

        Within the horizon, a sensor with a detection range of 250 m that moves 20 m gains nothing from a target 300 m
        away, and of courses with equal rewards the first is taken. Therefore all courses are continued, until each
        sensor may have reached a target and each target may be reached by a sensor. The cost-to-go is the mean over the
        losses at all these times. Targets that no feasible path brings into detection range do not count. Cameras turn
        to targets too, and until they have searched the directions of nearly all undetected targets. If an action
        switches a sensor off, there is at least one more horizon; otherwise the reward would not depend on how the
        sensor moves meanwhile.
        """
        horizon = settings.horizon_steps * settings.horizon_period
        farthest = [np.hypot(*(own.courses[:, -1, :2] - own.pose[:2]).T).max() for own in self.options]
        speeds, turns = np.array(farthest) / horizon, np.array([turn_rate(own, horizon) for own in self.options])
        if not ((speeds > 0.0) | (turns > 0.0)).all():
            return ()
        beyond = self._seconds_to_targets(speeds, turns)
        if self.undetected is not None and turns.any():
            search = seconds_to_search(self.options, turns.tolist(), self.reaches, self.undetected, _LEAST_EXISTENCE)
            beyond = max(beyond, search)
        beyond *= _STAY
        if len(self.places) and not all([own.scans.any(axis=1).all() for own in self.options]):
            beyond = max(beyond, horizon)
        if beyond == 0.0:
            return ()
        rates = (speeds / self.reaches).tolist()
        rates += [
            turn / (2.0 * own.pose[HALF_WIDTH]) for own, turn in zip(self.options, turns, strict=True) if turn > 0.0
        ]
        rate = float(max(rates))
        total = min(horizon + beyond, max(_MOST_STEPS / rate if rate > 0.0 else math.inf, 2.0 * horizon))
        num_steps = min(max(_LEAST_STEPS, math.ceil(total * rate)), _MOST_STEPS)
        return tuple(
            replace(settings, horizon_steps=steps, horizon_period=total / num_steps)
            for steps in (num_steps // 2, num_steps)
        )

    def continued(self, horizon: Floats, times: Floats, paths: Floats) -> tuple[Options, ...]:
        """Return the options with courses at `times` (num_times,) s, by the base policy. See `extrapolated`.

        times: the last is the latest. paths: (num_targets, num_times, 2) m, expected positions of the targets then.
        """
        later = tuple([extrapolated(own, horizon, times) for own in self.options])
        moved = paths - self.places[:, np.newaxis]
        return tuple([self._continued(s, own, horizon, times, moved) for s, own in enumerate(later)])

    def notes(self) -> tuple[str, ...]:
        """Return notes on targets that no sensor can detect from any position on a path around zones."""
        if not any([len(paths.graph.edges.zones) for paths in self.paths]):
            return ()
        moves = [bool((own.courses[:, :, :2] != own.pose[:2]).any()) for own in self.options]
        visible = np.stack(
            [self._in_sight(s) | (self._is_attainable(s) & can_move) for s, can_move in enumerate(moves)]
        )
        return tuple(
            f"target {tuple(label)}: no path that the constraints allow brings a sensor within sight of it"
            for label in self.labels[~visible.any(axis=0)].tolist()
        )

    def distances(self) -> Floats:
        """Return distances (num_sensors, num_targets) m from sensors to targets by feasible paths."""
        rows = zip(self.paths, self.options, strict=True)
        return np.concatenate([paths.distances(own.pose[np.newaxis, :2]) for paths, own in rows])

    def _seconds_to_targets(self, speeds: Floats, turns: Floats) -> float:
        """Return the time, s, until each sensor may have reached a target and each target may be reached."""
        seconds = np.full((len(self.options), len(self.places)), np.inf)
        for s, (own, speed, rate) in enumerate(zip(self.options, speeds.tolist(), turns.tolist(), strict=True)):
            gaps = self._gaps(s) - self.reaches[s]
            if speed > 0.0:
                seconds[s] = gaps / speed
            seconds[s, gaps <= 0.0] = 0.0
            if rate > 0.0:
                seconds[s] = np.maximum(seconds[s], seconds_to_turn(own, rate, self.places))
        longest = np.concatenate([seconds.min(axis=0), seconds.min(axis=1, initial=np.inf)])
        return float(np.where(np.isfinite(longest), longest, 0.0).max())

    def _gaps(self, s: int) -> Floats:
        """Return the distance (num_targets,) m from the best course's end to each target; straight if in range."""
        own = self.options[s]
        ends = np.ascontiguousarray(own.courses[:, -1, :2])
        straight = np.hypot(*(ends[:, np.newaxis] - self.places).transpose(2, 0, 1))
        if len(self.paths[s].graph.edges.zones) == 0:
            return np.asarray(straight.min(axis=0))
        barred = self.paths[s].graph.is_blocked(own.pose[:2], own.courses[:, :, :2])
        allowed = np.ones_like(barred) if barred.all() else ~barred
        around = np.where(self._is_attainable(s), self.paths[s].distances(ends), np.inf)
        return np.asarray(np.where(straight <= self.reaches[s], straight, around)[allowed].min(axis=0))

    def _in_sight(self, s: int) -> Bools:
        """Return (num_targets,) whether each target is within a sensor's detection range at its present position."""
        return np.asarray(np.hypot(*(self.places - self.options[s].pose[:2]).T) <= self.reaches[s])

    def _is_attainable(self, s: int) -> Bools:
        """Return (num_targets,) whether a sensor detects each target from the end of its path to it."""
        return np.asarray(self.paths[s].left <= self.reaches[s])

    def _continued(self, s: int, later: Options, horizon: Floats, times: Floats, moved: Floats) -> Options:
        """Return the continued courses of one sensor: to a target and on with it, or straight up to a zone.

        A course leads along the shortest path to the target that it approaches most. It moves as fast as it approaches
        the target: the best course at its own speed, a course with half the progress at half of this speed. On the way
        it shares the motion of the target in proportion, so that both meet, and then it follows the target. A course
        that approaches no target continues straight, and stops short of a zone.

        moved: (num_targets, num_times, 2) m, motion of the targets since the end of the horizon.
        """
        own, paths = self.options[s], self.paths[s]
        ends = np.ascontiguousarray(own.courses[:, -1, :2])
        steps, rounds = ends - own.pose[:2], np.maximum(times - horizon[-1], 0.0) / horizon[-1]
        open_share = paths.graph.free_fraction(ends, ends + rounds[-1] * steps)
        allowed = ~paths.graph.is_blocked(own.pose[:2], own.courses[:, :, :2])
        goals, advances = self._leads_to(s, ends, np.hypot(steps[:, 0], steps[:, 1]), allowed)
        moves, after, courses = steps.any(axis=1) & allowed, np.flatnonzero(rounds > 0.0), later.courses.copy()
        led, stopped = np.flatnonzero(moves & (goals >= 0)), np.flatnonzero(moves & (goals < 0) & (open_share < 1.0))
        if len(led):
            corners = paths.paths(ends[led], goals[led])
            places, headings, share = walked(corners, rounds[after] * advances[led, np.newaxis])
            shift = share[..., np.newaxis] * moved[goals[led]][:, after]
            begin, end = places.reshape(-1, 2), (places + shift).reshape(-1, 2)
            free = paths.graph.free_fraction(begin, end).reshape(share.shape)
            courses[led[:, np.newaxis], after, :2] = places + free[..., np.newaxis] * shift
            offset = own.courses[led, -1, HEADING] - np.arctan2(steps[led, 1], steps[led, 0])
            ahead = np.cos(offset) > 1.0 - _SAME_HEADING  # a sensor that heads where it moves does so on its path
            courses[led[ahead, np.newaxis], after, HEADING] = headings[ahead]
        share = np.minimum(rounds[after], open_share[stopped, np.newaxis] * rounds[-1])[..., np.newaxis]
        courses[stopped[:, np.newaxis], after, :2] = ends[stopped, np.newaxis] + share * steps[stopped, np.newaxis]
        return later._replace(courses=courses)

    def _leads_to(self, s: int, ends: Floats, lengths: Floats, allowed: Bools) -> tuple[Ints, Floats]:
        """Return (num_courses,) the target of each course of a sensor, and its advance in m per horizon towards it.

        The advance is in proportion to the progress of a course towards the target, relative to the best feasible
        course. If no course approaches the target, because a step to the side has to be made first, the course with the
        smallest retreat advances most. Of targets with about the same fraction the nearest is taken; -1: the course
        leads to no target beyond detection range. ends: (num_courses, 2) m, end points of the courses. lengths:
        (num_courses,) m, from the pose.
        """
        now, then = (self.paths[s].distances(own) for own in (self.options[s].pose[np.newaxis, :2], ends))
        draws = self._is_attainable(s) & ~self._in_sight(s) & np.isfinite(then)
        counts = draws & (allowed & (lengths > 0.0))[:, np.newaxis]
        if not counts.any():
            return np.full(len(ends), -1), lengths
        progress = np.where(counts, now - np.where(counts, then, 0.0), -np.inf)
        best_courses, max_progress = progress.argmax(axis=0), progress.max(axis=0)
        with np.errstate(invalid="ignore"):
            share = np.where(
                max_progress > _LEAST_PROGRESS, progress / max_progress, 1.0 + (progress - max_progress) / lengths.max()
            )
        share = np.where(counts, np.maximum(share, 0.0), 0.0)
        largest = share.max(axis=1, keepdims=True)
        goals = np.where((share >= largest - _SAME_PROGRESS) & (share > 0.0), then, np.inf).argmin(axis=1)
        return np.where(largest[:, 0] > 0.0, goals, -1), largest[:, 0] * lengths[best_courses[goals]]


def attracting_targets(prediction: LMB) -> tuple[Ints, Floats]:
    """Return labels (num, 2) and positions (num, 2), m, of targets that sensors approach from beyond the horizon."""
    draws = prediction.existence >= _LEAST_EXISTENCE
    return prediction.tracks.labels[draws], np.ascontiguousarray(prediction.tracks.means[draws, :2])


def detection_range(sensor: MobileSensor, pose: Floats) -> float:
    """Return the range in m up to which P_D is at least half of its maximum, in the best direction."""
    model, dim = sensor.filter.sensor.detection, sensor.filter.targets.state_dim
    states = np.zeros((len(_DISTANCES) * _DIRECTIONS, dim))
    angles = line_of_sight(pose) + 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    states[:, :2] = pose[:2] + (_DISTANCES[:, np.newaxis, np.newaxis] * around).reshape(-1, 2)
    chances = numbers_at(model.function, states, pose, model.params).reshape(-1, _DIRECTIONS).max(axis=1)
    return float(_DISTANCES[np.flatnonzero(chances >= 0.5 * chances.max())[-1]])
