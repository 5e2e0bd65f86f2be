"""Decisions that take as many samples as they need: rounds of fresh samples for the candidates that are left."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from vedette.control.allowed import single_mask
from vedette.control.bounds import bound_of
from vedette.control.evaluator import SampleRewards
from vedette.control.evidence import Evidence
from vedette.control.explanation import Bound
from vedette.control.plan import Certainty, RewardTable, SearchCurve
from vedette.control.preparation import AnyEvaluator, Preparation
from vedette.control.problem import searched
from vedette.control.racing import FIRST_ROUND, Race, next_total
from vedette.control.search import JointSearch, all_joint_actions
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Actions, Options

# Joint actions that race against each other where a search evaluates all there are; with more, its best ones do.
_MOST_OF_ALL = 4096
_MOST_OF_SEARCH = 64

# Samples of a search that leaves joint actions out. In nine decisions of eight sensors 8 lost 0.3 % of the reward, 16
# and 40 lost 0.1 %, and of 256 candidates no better one came than of 64.
_SEARCHED = 2 * FIRST_ROUND

# Samples are drawn at most so many at a time, to bound the memory of their pseudo-updates.
_BLOCK = 250


class Decided(NamedTuple):
    """What became of a decision."""

    best: tuple[int, ...]  # the course of each sensor
    tables: tuple[RewardTable, ...]
    counts: dict[str, int]
    notes: tuple[str, ...]
    certainty: Certainty
    curve: SearchCurve | None = None
    bound: Bound | None = None


class Entrant(NamedTuple):
    """A race, and whose joint actions run."""

    race: Race
    sensor: int | None  # of one sensor alone; None: of all sensors, fused


@dataclass(slots=True, eq=False)
class Rounds:
    """Fresh samples, round after round, and an account of all.

    Attributes:
        preparation: of the decision.
        evaluator: the first one, of all courses, whose account is that of all.
        num_samples: so many were drawn.
        rng: draws them.
        began: s on the clock, when the decision was asked for.
    """

    preparation: Preparation
    evaluator: AnyEvaluator
    num_samples: int
    rng: np.random.Generator
    began: float

    @classmethod
    def begin(cls, preparation: Preparation, num_samples: int, *, rng: np.random.Generator) -> Rounds:
        """With an evaluator of all courses on so many samples."""
        began = time.perf_counter()
        return cls(preparation, preparation.evaluator(num_samples, rng=rng), num_samples, rng, began)

    def run(self, entrants: Sequence[Entrant]) -> Literal["max_samples", "max_seconds"] | None:
        """Rounds until all races are over, or why they were stopped before; the first round is always run."""
        settings = self.preparation.settings
        most = settings.max_samples - self.num_samples + entrants[0].race.num_samples
        while going := [each for each in entrants if each.race.verdict is None or each.race.num_samples == 0]:
            num = going[0].race.num_samples
            if num >= most:
                return "max_samples"
            late = settings.max_seconds is not None and time.perf_counter() - self.began >= settings.max_seconds
            if late and num > 0:
                return "max_seconds"
            self._run_one(going, next_total(num, most) - num)
        return None

    def _run_one(self, going: Sequence[Entrant], num: int) -> None:
        """One round of so many samples."""
        sizes = [min(_BLOCK, num - first) for first in range(0, num, _BLOCK)]
        blocks = [self._rewards(going, size) for size in sizes]
        for place, each in enumerate(going):
            each.race.add(np.concatenate([block[place] for block in blocks], axis=1))
        self.num_samples += num

    def _rewards(self, going: Sequence[Entrant], num: int) -> list[Floats]:
        """Of each race (num_left, num) rewards on samples drawn now, of the courses that are still wanted."""
        options = self.preparation.options
        wanted = [_wanted(going, s) for s in range(len(options))]
        few = tuple(_only(own, courses) for own, courses in zip(options, wanted, strict=True))
        evaluator = self.preparation.evaluator(num, few, rng=self.rng)
        rewards = []
        for race, sensor in going:
            evaluate = evaluator.joint() if sensor is None else evaluator.alone(sensor)
            those = wanted if sensor is None else [wanted[sensor]]
            columns = [np.searchsorted(own, race.candidates[:, axis]) for axis, own in enumerate(those)]
            rewards.append(evaluate(np.stack(columns, axis=1)))
        for name, count in evaluator.counts.items():
            self.evaluator.counts[name] = self.evaluator.counts.get(name, 0) + count
        self.evaluator.notes.update(evaluator.notes)
        return rewards

    def certainty(
        self, entrants: Sequence[Entrant], stopped: Literal["max_samples", "max_seconds"] | None
    ) -> Certainty:
        """How all races ended; what may go wrong in any of them adds up."""
        races = [each.race for each in entrants]
        over: Literal["one left", "indifferent"] = "indifferent"
        if all(race.verdict == "one left" for race in races):
            over = "one left"
        confidence = max(0.0, 1.0 - sum(1.0 - race.reached for race in races))
        left, started = tuple(len(race.left) for race in races), tuple(len(race.actions) for race in races)
        return Certainty(stopped or over, confidence, self.num_samples, left, started)


def decide_jointly(preparation: Preparation, search: JointSearch, *, rng: np.random.Generator) -> Decided:
    """The joint action that is best with confidence, of all or, where a search leaves some out, of its best ones.

    All joint actions race from the first sample on. What a search has picked is raced on fresh samples, as those that
    it was picked by speak for it; so are those that a mask allows.
    """
    settings, shape = preparation.settings, tuple(len(own.courses) for own in preparation.options)
    all_at_once = math.prod(shape) <= _MOST_OF_ALL
    size = FIRST_ROUND if all_at_once else _SEARCHED
    rounds = Rounds.begin(preparation, size, rng=rng)
    heard = _Heard(rounds.evaluator.joint())
    evidence = Evidence(rounds.evaluator, tuple(range(len(shape))), heard)
    found = searched(search, evidence, preparation.mask, rng=rng)
    complete = preparation.mask is None and all_at_once and heard.num == math.prod(shape) and evidence.is_complete()
    candidates = all_joint_actions(shape) if complete else evidence.foremost(found, _MOST_OF_SEARCH)
    race = Race(candidates, float(settings.confidence or 0.0), settings.indifference)
    if complete:
        race.add(heard.in_printed_order(shape))
    entrants = (Entrant(race, None),)
    certainty = rounds.certainty(entrants, rounds.run(entrants))
    curve = evidence.curve()
    bound = None if complete else bound_of(evidence, race.best)
    record = Evidence(evidence.evaluator, evidence.which, heard) if complete else evidence
    race.note(record)
    if complete:
        bound = Bound(record.mean_of(race.best), record.mean_of(race.best), "exhaustive")
    return Decided(race.best, record.tables(race.best), *rounds.evaluator.account(), certainty, curve, bound)


def decide_alone(preparation: Preparation, *, rng: np.random.Generator) -> Decided:
    """For every sensor its own best course of those it may take; that all are, has the confidence asked for."""
    settings, options = preparation.settings, preparation.options
    rounds = Rounds.begin(preparation, FIRST_ROUND, rng=rng)
    each_sure = 1.0 - (1.0 - float(settings.confidence or 0.0)) / len(options)
    entrants = []
    for s, own in enumerate(options):
        allowed = all_joint_actions((len(own.courses),))[single_mask(preparation.mask, s, len(own.courses))]
        race = Race(allowed, each_sure, settings.indifference)
        race.add(rounds.evaluator.alone(s)(race.actions))
        entrants.append(Entrant(race, s))
    certainty = rounds.certainty(entrants, rounds.run(entrants))
    tables: list[RewardTable] = []
    for s, (race, _) in enumerate(entrants):
        evidence = Evidence(rounds.evaluator, (s,), rounds.evaluator.alone(s))
        race.note(evidence)
        tables.extend(evidence.tables(race.best))
    best = tuple(race.best[0] for race, _ in entrants)
    return Decided(best, tuple(tables), *rounds.evaluator.account(), certainty)


@dataclass(slots=True, eq=False)
class _Heard:
    """Sample rewards, kept as they are asked for."""

    rewards: SampleRewards
    actions: list[Ints] = field(default_factory=list)
    found: list[Floats] = field(default_factory=list)

    def __call__(self, actions: Ints) -> Floats:
        found = self.rewards(actions)
        if self.num <= _MOST_OF_ALL:
            self.actions.append(actions)
            self.found.append(found)
        return found

    @property
    def num(self) -> int:
        """Joint actions kept."""
        return sum(map(len, self.actions))

    def in_printed_order(self, shape: tuple[int, ...]) -> Floats:
        """(num_joint, num_samples) rewards, where every joint action was asked for once."""
        places = np.ravel_multi_index(tuple(np.concatenate(self.actions).T), shape)
        return np.asarray(np.concatenate(self.found)[np.argsort(places)])


def _wanted(going: Sequence[Entrant], sensor: int) -> Ints:
    """Courses of a sensor that some candidate takes; one, where no race asks for any."""
    columns = [race.candidates[:, 0 if own == sensor else sensor] for race, own in going if own in (None, sensor)]
    return np.unique(np.concatenate(columns)) if columns else np.zeros(1, np.int64)


def _only(own: Options, courses: Ints) -> Options:
    """The options that take some courses, which are numbered anew."""
    kept = np.isin(own.which, courses)
    actions = Actions(own.actions.columns, own.actions.values[kept])
    return Options(
        actions, np.ascontiguousarray(own.courses[courses]), np.searchsorted(courses, own.which[kept]), own.pose
    )
