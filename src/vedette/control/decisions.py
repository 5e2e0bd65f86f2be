"""Decisions: rewards on samples and a search over them, with rounds of fresh samples if a confidence is required."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from vedette.control.constraints.mask import Mask
from vedette.control.decision_analysis import DecisionAnalysis
from vedette.control.evaluator import Evaluator
from vedette.control.evidence import Evidence, Part
from vedette.control.explanation import Bound
from vedette.control.inputs import single_mask, stationary_courses
from vedette.control.plan import Plan, RewardTable, SamplingOutcome
from vedette.control.preparation import Preparation
from vedette.control.problem import beyond_cutoff, searched, upper_bound
from vedette.control.racing import FIRST_ROUND, Race, next_total
from vedette.control.search.problem import JointSearch, all_joint_actions, first_best
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Actions, Options

# Maximum number of joint actions in a race if a search evaluates all of them; with more, only its best ones race.
_MOST_OF_ALL = 4096
_MOST_OF_SEARCH = 64

# Samples of a search that omits joint actions. In nine decisions of eight sensors 8 lost 0.3 % of the reward, 16
# and 40 lost 0.1 %, and 256 candidates gave no better result than 64.
_SEARCHED = 2 * FIRST_ROUND

# Maximum number of samples drawn at a time, to bound the memory of their pseudo-updates.
_BLOCK = 250


# What a sensor that decides alone assumes about the others: that they stay as they are, or that there are none.
OthersAssumption: TypeAlias = Literal["stay", "absent"]


@dataclass(slots=True)
class Deadline:
    """A time limit that starts at a moment on the clock, and remembers whether it was found to have passed."""

    began: float
    seconds: float | None
    has_passed: bool = False

    def __call__(self) -> bool:
        """Return True if the limit has passed now."""
        self.has_passed = self.seconds is not None and time.perf_counter() - self.began >= self.seconds
        return self.has_passed


@dataclass(slots=True, eq=False)
class Rounds:
    """Rounds of fresh samples, with counts over all rounds."""

    preparation: Preparation  # of the decision
    evaluator: Evaluator  # the first evaluator, of all courses, whose counts are those of all rounds
    num_samples: int  # number of samples drawn so far
    rng: np.random.Generator  # generator of the samples
    deadline: Deadline  # of searches and rounds
    # (num_sensors,) courses that sensors which decide alone assume for the others. None: no other sensors
    others: tuple[int, ...] | None = None

    @classmethod
    def begin(
        cls,
        preparation: Preparation,
        num_samples: int,
        others: tuple[int, ...] | None = None,
        *,
        rng: np.random.Generator,
    ) -> "Rounds":
        """Return rounds with an evaluator of all courses on `num_samples` samples."""
        deadline = Deadline(time.perf_counter(), preparation.settings.max_seconds)
        return cls(preparation, preparation.evaluator(num_samples, rng=rng), num_samples, rng, deadline, others)

    def _run(self, races: Sequence[Race]) -> Literal["max_samples", "max_seconds"] | None:
        """Run rounds, at least one, until all races are over, and return the reason if they were stopped before."""
        settings = self.preparation.settings
        max_samples = settings.max_samples - self.num_samples + races[0].num_samples
        while open_races := [race for race in races if race.verdict is None or race.num_samples == 0]:
            num_samples = open_races[0].num_samples
            if num_samples >= max_samples:
                return "max_samples"
            if num_samples > 0 and self.deadline():
                return "max_seconds"
            self._run_one(open_races, next_total(num_samples, max_samples) - num_samples)
        return None

    def _run_one(self, open_races: Sequence[Race], num_samples: int) -> None:
        """Run one round of `num_samples` samples."""
        sizes = [min(_BLOCK, num_samples - first) for first in range(0, num_samples, _BLOCK)]
        blocks = [self._rewards(open_races, size) for size in sizes]
        for place, race in enumerate(open_races):
            race.add(np.concatenate([block[place] for block in blocks], axis=1))
        self.num_samples += num_samples

    def _rewards(self, open_races: Sequence[Race], num_samples: int) -> list[Floats]:
        """Return for each race rewards (num_left, num_samples) of its remaining courses on newly drawn samples."""
        options = self.preparation.options
        courses_of = [_courses_in_races(open_races, s) for s in range(len(options))]
        others = None
        if self.others is not None:
            courses_of = [np.union1d(own, [other]) for own, other in zip(courses_of, self.others, strict=True)]
            others = [int(np.searchsorted(own, other)) for own, other in zip(courses_of, self.others, strict=True)]
        few = tuple(_only(own, courses) for own, courses in zip(options, courses_of, strict=True))
        evaluator = self.preparation.evaluator(num_samples, few, rng=self.rng)
        rewards = []
        for race in open_races:
            evaluate = evaluator.joint() if race.sensor is None else evaluator.alone(race.sensor, others)
            those = courses_of if race.sensor is None else [courses_of[race.sensor]]
            columns = [np.searchsorted(own, race.candidates[:, axis]) for axis, own in enumerate(those)]
            rewards.append(evaluate(np.stack(columns, axis=1)))
        for name, count in evaluator.counts.items():
            self.evaluator.counts[name] = self.evaluator.counts.get(name, 0) + count
        self.evaluator.notes.update(evaluator.notes)
        return rewards

    def certainty(self, races: Sequence[Race]) -> SamplingOutcome:
        """Run all races and return how they ended. Their error probabilities add up."""
        stopped = self._run(races)
        over: Literal["one left", "indifferent"] = "indifferent"
        if all(race.verdict == "one left" for race in races):
            over = "one left"
        confidence = max(0.0, 1.0 - sum(1.0 - race.reached for race in races))
        num_left, num_started = tuple(len(race.left) for race in races), tuple(len(race.actions) for race in races)
        return SamplingOutcome(stopped or over, confidence, self.num_samples, num_left, num_started)


def decide_jointly(
    name: str, preparation: Preparation, search: JointSearch, notes: Sequence[str], *, rng: np.random.Generator
) -> Plan:
    """Return the plan with the joint action that a search finds, or with a confidence, the winner of races.

    If the search evaluates all joint actions, all of them race from the first sample on. Otherwise its best ones race
    on fresh samples, because they were selected for high rewards on the samples of the search. So do those that a mask
    allows.
    """
    settings, races, mask = preparation.settings, preparation.races, preparation.mask
    num_joint = math.prod([len(own.courses) for own in preparation.options])
    size = FIRST_ROUND if num_joint <= _MOST_OF_ALL else _SEARCHED
    rounds = Rounds.begin(preparation, size if races else settings.num_samples, rng=rng)
    evaluator, keeps = rounds.evaluator, races and num_joint <= _MOST_OF_ALL
    evidence = Evidence(evaluator, tuple(range(len(preparation.options))), evaluator.joint(), keeps=keeps)
    best = searched(search, evidence, mask, late=rounds.deadline, rng=rng)
    if rounds.deadline.has_passed:
        notes = (*notes, f"the search ended with the best that it had found, as {settings.max_seconds:g} s were over")
    curve = evidence.curve()
    if not races:
        parts, bound = (Part.together(evidence, best),), upper_bound(evidence, best)
        return combine_parts(name, parts, notes, curve=curve, bound=bound, certainty=preparation.certainty)
    samples = evidence.samples() if mask is None else None
    candidates = evidence.top_actions(best, _MOST_OF_SEARCH) if samples is None else all_joint_actions(evidence.shape)
    race = Race(candidates, float(settings.confidence or 0.0), settings.indifference)
    if samples is not None:
        race.add(samples)
    certainty = rounds.certainty([race])
    if samples is None:
        bound = upper_bound(evidence, race.best)
        race.note(evidence)
    else:
        evidence = Evidence(evaluator, evidence.which, evidence.rewards)
        race.note(evidence)
        mean = evidence.mean_of(race.best)
        bound = Bound(mean, mean, "exhaustive")
    return _raced_plan(name, (Part.together(evidence, race.best),), notes, certainty, curve=curve, bound=bound)


def decide_independently(
    name: str,
    preparation: Preparation,
    others_assumption: OthersAssumption,
    notes: Sequence[str],
    *,
    rng: np.random.Generator,
) -> Plan:
    """Return the plan with the best feasible course of each sensor. The confidence is that all of them are best.

    others_assumption: what each sensor assumes about the others.
    """
    settings, options, races = preparation.settings, preparation.options, preparation.races
    others = stationary_courses(options, preparation.mask) if others_assumption == "stay" else None
    rounds = Rounds.begin(preparation, FIRST_ROUND if races else settings.num_samples, others, rng=rng)
    each_sure = 1.0 - (1.0 - float(settings.confidence or 0.0)) / len(options)
    parts, entered = [], []
    for s, own in enumerate(options):
        evidence = Evidence(rounds.evaluator, (s,), rounds.evaluator.alone(s, others))
        allowed = all_joint_actions((len(own.courses),))[single_mask(preparation.mask, s, len(own.courses))]
        if races:
            entered.append(Race(allowed, each_sure, settings.indifference, s))
            entered[s].add(evidence.rewards(allowed))
        best = 0 if races else int(allowed[first_best(evidence.evaluate(allowed)), 0])
        parts.append(Part.alone(evidence, best, others))
    if not races:
        return combine_parts(name, _active(parts, preparation.mask), notes, certainty=preparation.certainty)
    certainty = rounds.certainty(entered)
    for s, race in enumerate(entered):
        race.note(parts[s].evidence)
        parts[s] = parts[s]._replace(chosen=race.best)
    return _raced_plan(name, _active(parts, preparation.mask), notes, certainty)


def _active(parts: Sequence[Part], mask: Mask | None) -> Sequence[Part]:
    """Return the parts with those sensors off whose scans gain least, if only some sensors may scan."""
    if mask is None or mask.active is None:
        return parts
    joint, gains = [part.chosen[0] for part in parts], list[float]()
    for part, course, off in zip(parts, joint, mask.active.off, strict=True):
        scanning, silent = part.evidence.evaluate(np.array([[course], [off[course]]])).tolist()
        gains.append(scanning - silent)
    courses = mask.active.within_limit(joint, gains)
    return [part._replace(chosen=(course,)) for part, course in zip(parts, courses, strict=True)]


def _raced_plan(
    name: str, parts: Sequence[Part], notes: Sequence[str], certainty: SamplingOutcome, **fields: Any
) -> Plan:
    """Return the plan of a race, which cannot be explained.

    Candidates that left the race early have other samples than the choice.
    """
    return replace(combine_parts(name, parts, notes, (str(certainty),), certainty=certainty, **fields), analysis=None)


def combine_parts(
    name: str, parts: Sequence[Part], notes: Sequence[str], more_notes: Sequence[str] = (), **fields: Any
) -> Plan:
    """Return the plan of decisions made together or sensor by sensor, in the order of the sensors.

    notes, more_notes: notes before and after those of the decisions. fields: further fields of the plan.
    """
    evaluator = parts[0].evidence.evaluator
    courses, tables, actions, chosen = list[int](), list[RewardTable](), list[Actions](), list[int]()
    for part in parts:
        courses += part.chosen
        tables += part.evidence.tables(part.chosen)
    for own, course in zip(evaluator.options, courses, strict=True):
        actions.append(own.actions)
        chosen.append(own.first_action(course))
    return Plan(
        name,
        tuple(actions),
        tuple(chosen),
        tuple(tables),
        dict(evaluator.counts),
        (*notes, *evaluator.notes, *more_notes, *beyond_cutoff(evaluator, courses)),
        analysis=DecisionAnalysis(name, tuple(parts), fields.get("bound")),
        **fields,
    )


def _courses_in_races(open_races: Sequence[Race], sensor: int) -> Ints:
    """Return the courses of a sensor that some candidate takes. One course, if no race needs any."""
    races = [race for race in open_races if race.sensor in (None, sensor)]
    columns = [race.candidates[:, sensor if race.sensor is None else 0] for race in races]
    return np.unique(np.concatenate(columns)) if columns else np.zeros(1, np.int64)


def _only(own: Options, courses: Ints) -> Options:
    """Return the options restricted to some courses, which are renumbered."""
    in_courses = np.isin(own.which, courses)
    actions = Actions(own.actions.columns, own.actions.values[in_courses])
    which, chosen = np.searchsorted(courses, own.which[in_courses]), np.ascontiguousarray(own.courses[courses])
    prices, scans = own.prices[courses], own.scans[courses]
    return own._replace(actions=actions, courses=chosen, which=which, prices=prices, scans=scans)
