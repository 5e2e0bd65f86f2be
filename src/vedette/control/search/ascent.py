"""Coordinate ascent, one sensor at a time, and the automatic choice of a search by the number of sensors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.control.constraints.active import Active
from vedette.control.search.problem import Joint, JointProblem, RewardCache, best_of_all, tie_tolerance
from vedette.models.fields import Checked, Count, Repeats, part

# Maximum number of sensors for which every joint action is evaluated.
_MAX_SENSORS = 3

# Minimum number of restarts. If the relative gap to the bound is larger than the fraction below, the restarts evaluate
# about a thousand courses in their first sweep: 27 restarts with four sensors of nine courses each, 13 with eight. Of
# 560 problems of four and five sensors (`benchmarks/searches.py`) 2 restarts found the best in 76 %, 8 in 90 %, 23 in
# 97 %, 31 in 99 %.
_NUM_RESTARTS, _LEAST_GAP, _FIRST_TRIES = 2, 0.01, 1000


@part("coordinate_ascent", "search")
@dataclass(frozen=True, slots=True)
class CoordinateAscent(Checked):
    """A search of one sensor at a time, the others held, until no sensor alone can do better, for many sensors.

    The first ascent starts at the independent decision, so its result is never worse than that. The result is a local
    maximum: no change of one sensor's action improves it, a change of two might. No joint action is evaluated twice.

    With a mask it moves from one allowed joint action to another. A start that is not allowed is first replaced by an
    allowed one near it. If there is none, the mask is relaxed (`vedette.control.constraints.relaxed`). If only some
    sensors may scan, no sensor alone can change which ones do. Then exchanges of two are tried from the best result,
    and ascents continue from there.

    Attributes:
        num_restarts: ascents from random joint actions, after that from the independent decision.
    """

    num_restarts: Repeats = 2

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the best result of all ascents, of equal ones that were evaluated the first in printed order."""
        cache = RewardCache(problem)
        ascents(cache, first_starts(cache, self.num_restarts, rng=rng))
        return cache.best()


def first_starts(cache: RewardCache, num_restarts: int, *, rng: np.random.Generator) -> list[Joint]:
    """Return the independent decision, and joint actions drawn at random."""
    return [cache.allowed(cache.problem.independent()), *cache.drawn(num_restarts, rng=rng)]


def ascents(cache: RewardCache, starts: Sequence[Joint]) -> list[Joint]:
    """Return the results of ascents. They and the first start are then in the cache.

    If only some sensors may scan, exchanges of two and ascents continue from the best result until none improves it.
    """
    ends = list[Joint]()
    for start in starts:
        if ends and cache.is_late():
            break
        ends.append(_climbed(cache, start))
    cache.rewards([starts[0], *ends])
    if cache.mask is not None and cache.mask.active is not None:
        best: Joint | None = max(ends, key=cache.values.__getitem__)
        while best is not None and not cache.is_late():
            ends.append(_climbed(cache, best))
            cache.rewards(ends[-1:])
            best = _exchanged(cache, ends[-1], cache.mask.active)
    return ends


def _climbed(cache: RewardCache, start: Joint) -> Joint:
    """Return the result of an ascent."""
    climb = cache.problem.ascend
    return _ascend(cache, start) if climb is None else cache.allowed(climb(start))


def _exchanged(cache: RewardCache, start: Joint, active: Active) -> Joint | None:
    """Return the best joint action in which another sensor scans instead of one. None: no exchange improves it."""
    candidates, value = [start], cache.values.__getitem__
    for s, course in enumerate(start):
        silent = [joint for joint in cache.line(start, s) if not active.on[s][joint[s]]]
        if not active.on[s][course] or not silent:
            continue
        without = max(silent, key=value)
        for other in range(len(start)):
            if other != s and not active.on[other][start[other]]:
                candidates += cache.line(without, other)
    best = max(candidates, key=value)
    return best if value(best) > value(start) + tie_tolerance(value(start)) else None


def _ascend(cache: RewardCache, start: Joint) -> Joint:
    """Return the result of one ascent. On each line the first exact maximum is taken, so that no ascent cycles."""
    at, settled, sensor, num_sensors = start, 0, 0, len(start)
    while settled < num_sensors:
        line = cache.line(at, sensor)
        best = max(line, key=cache.values.__getitem__)
        settled = settled + 1 if best == at else 1
        at, sensor = best, (sensor + 1) % num_sensors
    return at


@part("automatic", "search")
@dataclass(frozen=True, slots=True)
class AutomaticSearch(Checked):
    """A search of every joint action for up to three sensors, and coordinate ascent with restarts for more.

    The ascent has two restarts, or up to 1000 divided by the number of all sensors' courses if the problem has a bound
    that leaves a possible gain of more than 1 %.

    Attributes:
        max_joint_actions: number above which two or three sensors are searched by coordinate ascent, too.
    """

    max_joint_actions: Count = 1_000_000

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the result of the search that it selects."""
        if len(problem.shape) <= _MAX_SENSORS and math.prod(problem.shape) <= self.max_joint_actions:
            return best_of_all(problem, self.max_joint_actions)
        cache = RewardCache(problem)
        ascents(cache, first_starts(cache, _NUM_RESTARTS, rng=rng))
        more = _FIRST_TRIES // sum(problem.shape) - _NUM_RESTARTS
        if cache.is_late():
            return cache.best()
        if more > 0 and problem.bound is not None:
            best, upper = max(cache.values.values()), problem.bound()
            if upper - best > _LEAST_GAP * max(abs(upper), abs(best)):
                ascents(cache, cache.drawn(more, rng=rng))
        return cache.best()
