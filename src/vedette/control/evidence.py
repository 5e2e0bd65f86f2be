"""The rewards on which a decision was made, as tables over the actions in printed order."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.contributions import Contributions, contributions_of
from vedette.control.evaluator import Evaluator
from vedette.control.explanation import Bound
from vedette.control.plan import RewardTable, SearchCurve
from vedette.control.pseudo_posterior_rewards import SampleRewards
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints

# Maximum number of entries of a joint table; a larger one would take more memory than all evaluated rewards.
MAX_TABLE = 2_000_000

# Maximum number of axes of a NumPy array.
_MAX_AXES = 32

# Number of rewards evaluated at a time, to bound the memory of an exhaustive search.
_BLOCK = 4_000_000


@dataclass(slots=True, eq=False)
class Evidence:
    """Mean rewards of the joint actions of some sensors: every one that was evaluated."""

    evaluator: Evaluator  # source of the rewards
    which: tuple[int, ...]  # the sensors
    rewards: SampleRewards  # function that returns their sample rewards
    keeps: bool = False  # whether `evaluate` keeps the rewards of all samples
    shape: tuple[int, ...] = field(init=False)  # number of distinct courses of each of the sensors
    _noted: list[tuple[Ints, Floats, Floats]] = field(default_factory=list)  # joint actions, means, errors
    _samples: list[tuple[Ints, Floats]] = field(default_factory=list)
    _evaluations: list[int] = field(default_factory=list)
    _best: list[float] = field(default_factory=list)
    upper_limit: list[Bound] = field(default_factory=list)  # cached result of `vedette.control.problem.upper_limit`
    _is_complete: bool = False

    def __post_init__(self) -> None:
        shape = self.evaluator.joint_shape()
        self.shape = tuple([shape[s] for s in self.which])

    def evaluate(self, actions: Ints) -> Floats:
        """Return mean rewards (num,) of joint actions (num, num_sensors), or -inf if one is not finite.

        Raises `InputError` for invalid joint actions.
        """
        checked = np.array(actions, order="C")
        fits = checked.ndim == 2 and checked.shape[1] == len(self.which) and checked.dtype.kind in "iu"
        if not fits or not ((checked >= 0) & (checked < self.shape)).all():
            raise InputError(f"joint actions: expected rows of whole numbers below {self.shape}; got {actions!r}")
        checked = checked.astype(np.int64)
        size = max(1, _BLOCK // self.evaluator.settings.num_samples)
        means = [np.empty(0)]
        for first in range(0, len(checked), size):
            part = checked[first : first + size]
            rewards = self.rewards(part)
            if self.keeps:
                self._samples.append((part, rewards))
            means.append(self.note(part, rewards))
        return np.asarray(np.concatenate(means))

    def samples(self) -> Floats | None:
        """Return kept rewards (num_joint, num_samples) in printed order, or None unless each was evaluated once."""
        num = sum(len(actions) for actions, _ in self._samples)
        if num != math.prod(self.shape) or not self.is_complete():
            return None
        places = np.concatenate([np.ravel_multi_index(tuple(actions.T), self.shape) for actions, _ in self._samples])
        return np.asarray(np.concatenate([rewards for _, rewards in self._samples])[np.argsort(places)])

    def note(self, actions: Ints, rewards: Floats) -> Floats:
        """Store rewards (num, num_samples) and return their means, -inf if one is not finite."""
        num = rewards.shape[1]
        with np.errstate(invalid="ignore"):
            mean = np.asarray(rewards.mean(axis=1))
            error = rewards.std(axis=1, ddof=1) / math.sqrt(num) if num > 1 else np.zeros(len(rewards))
        bad = ~np.isfinite(mean)
        if bad.any():
            mean, error = np.where(bad, math.nan, mean), np.where(bad, math.nan, error)
            first = self._named(actions[int(np.flatnonzero(bad)[0])])
            self.evaluator.notes[f"joint actions without a finite reward were left out, the first: {first}"] = None
        self._noted.append((actions, mean, error))
        ranked = np.where(bad, -math.inf, mean)
        self.progress(len(actions), float(ranked.max(initial=-math.inf)))
        return ranked

    def progress(self, num_evaluated: int, best: float) -> None:
        """Add a step to the search curve: `num_evaluated` more joint actions, the best with reward `best`."""
        self._evaluations.append(num_evaluated + (self._evaluations[-1] if self._evaluations else 0))
        self._best.append(max(best, self._best[-1] if self._best else -math.inf))

    @property
    def best(self) -> float:
        """The largest mean reward found."""
        return self._best[-1]

    def _all(self) -> tuple[Ints, Floats, Floats]:
        """Return joint actions, means and standard errors in order of evaluation."""
        actions, means, errors = zip(*self._noted, strict=True)
        return np.concatenate(actions), np.concatenate(means), np.concatenate(errors)

    def is_complete(self) -> bool:
        """Return True if every joint action was evaluated."""
        if not self._is_complete:
            num_joint, evaluated = math.prod(self.shape), [entry[0] for entry in self._noted]
            if sum(map(len, evaluated)) >= num_joint:
                places = np.ravel_multi_index(tuple(np.concatenate(evaluated).T), self.shape)
                self._is_complete = bool(np.bincount(places, minlength=num_joint).all())
        return self._is_complete

    def mean_of(self, choice: Sequence[int]) -> float:
        """Return the mean reward of a joint action that was evaluated."""
        for actions, means, _ in self._noted:
            at = np.flatnonzero((actions == np.array(choice)).all(axis=1))
            if len(at):
                return float(means[at[0]])
        raise InputError(f"joint action: expected one that was evaluated; got {choice!r}")

    @property
    def num_evaluated(self) -> int:
        """Number of joint actions evaluated, including those of compiled ascents."""
        return self._evaluations[-1] if self._evaluations else 0

    def best_other(self, choice: Sequence[int]) -> tuple[tuple[int, ...], float] | None:
        """Return the best stored joint action other than the choice, and its mean reward, or None if there is none.

        Of equal ones the first evaluated.
        """
        actions, means, _ = self._all()
        others = np.where((actions == np.array(choice)).all(axis=1) | np.isnan(means), -math.inf, means)
        at = int(np.argmax(others))
        return (tuple(actions[at].tolist()), float(others[at])) if others[at] > -math.inf else None

    def top_actions(self, choice: Sequence[int], max_actions: int) -> Ints:
        """Return (num, num_sensors) up to `max_actions` best joint actions by mean, the choice first among equals.

        They are in printed order, without joint actions that have no finite mean, except the choice.
        """
        evaluated, means, _ = self._all()
        actions, places = np.unique(evaluated, axis=0, return_index=True)
        means = means[places]
        own = (actions == np.array(choice)).all(axis=1)
        order = np.lexsort((~own, np.where(np.isnan(means), math.inf, -means)))
        order = order[own[order] | np.isfinite(means[order])][:max_actions]
        return np.ascontiguousarray(actions[np.sort(order)])

    def curve(self) -> SearchCurve:
        """Return the progress of the search."""
        return SearchCurve(np.array(self._evaluations, np.int64), np.array(self._best))

    def _named(self, courses: Ints) -> str:
        options = [self.evaluator.options[s] for s in self.which]
        named = (
            f"{own.actions.text(own.first_action(course))} of sensor {s + 1}"
            for s, own, course in zip(self.which, options, courses.tolist(), strict=True)
        )
        return " and ".join(named)

    def holds(self, choice: Sequence[int]) -> bool:
        """Return True if this joint action has been evaluated."""
        evaluated = [actions for actions, _, _ in self._noted]
        return bool(evaluated) and bool((np.concatenate(evaluated) == np.array(choice)).all(axis=1).any())

    def tables(self, choice: Sequence[int]) -> tuple[RewardTable, ...]:
        """Return one table of all evaluated rewards, with gaps elsewhere.

        If it would be too large, return one line per sensor: its actions, with the others at their `choice`.
        """
        num_entries = math.prod([len(self.evaluator.options[s].which) for s in self.which])
        actions, means, errors = self._all()
        if num_entries <= MAX_TABLE and len(self.which) <= _MAX_AXES:
            return (self._table(self.which, actions, means, errors),)
        off = actions != np.array(choice, np.int64)
        num_off, first_off = off.sum(axis=1), off.argmax(axis=1)
        tables = []
        for axis, s in enumerate(self.which):
            rows = (num_off == 0) | ((num_off == 1) & (first_off == axis))
            tables.append(self._table((s,), actions[rows, axis : axis + 1], means[rows], errors[rows]))
        return tuple(tables)

    def _table(self, sensors: tuple[int, ...], actions: Ints, means: Floats, errors: Floats) -> RewardTable:
        """Return rewards of joint actions (num, num of `sensors`), as course indices, as a table over the actions."""
        columns_of, shape, filled = [], [], []
        for s in sensors:
            own = self.evaluator.options[s]
            columns_of.append(own.which)
            shape.append(len(own.courses))
        spread = np.ix_(*columns_of)
        # The first evaluation is used: a later one, along a line, may differ from it in the last digit.
        places = np.ravel_multi_index(tuple(actions[::-1].T), shape)
        for values in (means, errors):
            table = np.full(shape, math.nan)
            table.flat[places] = values[::-1]  # of equal places the last value stays
            filled.append(table[spread])
        return RewardTable(sensors, *filled)


class Part(NamedTuple):
    """A decision made as a unit: that of all sensors together, or of one sensor alone."""

    evidence: Evidence
    chosen: tuple[int, ...]  # courses of its sensors
    additive: AdditiveRewards | None  # its rewards, if they are sums over labels
    others: tuple[int, ...] | None = None  # courses that one sensor assumes for all; None: `additive` is its own

    @classmethod
    def together(cls, evidence: Evidence, chosen: Sequence[int]) -> "Part":
        """Return the decision of all sensors."""
        return cls(evidence, tuple(chosen), evidence.evaluator.additive)

    @classmethod
    def alone(cls, evidence: Evidence, course: int, others: tuple[int, ...] | None = None) -> "Part":
        """Return the decision of the one sensor of the evidence. others: as in `Evaluator.alone`."""
        additive, (sensor,) = evidence.evaluator.additive, evidence.which
        own = additive if additive is None or others is not None else additive.alone(sensor)
        return cls(evidence, (course,), own, others)

    def shares(self) -> Contributions | None:
        """Return the contributions to its reward, or None if rewards are not sums over labels."""
        if self.additive is None:
            return None
        joint, sensors = np.array(self.chosen), np.arange(len(self.chosen))
        if self.others is not None:
            joint, sensors = np.array(self.others), np.array(self.evidence.which)
            joint[sensors] = self.chosen
        return contributions_of(self.additive, joint, sensors)
