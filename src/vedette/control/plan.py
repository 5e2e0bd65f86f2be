"""The plan that a planner returns, with the evidence of the decision."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from vedette.control.explanation import Bound, Explanation
from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr, TabularRepr
from vedette.internal.text import elided, pluralise
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Actions

_MOST_TOLD = 4


@dataclass(frozen=True, slots=True, repr=False)
class RewardTable(SummaryRepr):
    """Expected reward of each action, or of each joint action, of some sensors (paper eq. 15 and 17).

    Attributes:
        sensors: the sensors whose actions index the axes of the table, in axis order.
        mean: (num_actions of sensors[0], ...) mean reward over the samples, one axis per sensor. NaN if a search did
            not evaluate the action.
        standard_error: same shape, standard error of that mean, 0 with a single sample, and NaN if the mean is NaN.
    """

    sensors: tuple[int, ...]
    mean: Floats
    standard_error: Floats

    def validate(self) -> None:
        """Raise `InputError` unless there is one axis per sensor, and each entry is a reward with error or a gap."""
        if self.mean.ndim != len(self.sensors) or self.mean.shape != self.standard_error.shape:
            raise InputError(
                f"reward table: expected one axis for each of the sensors {self.sensors}; got a mean of shape "
                f"{self.mean.shape} and a standard error of shape {self.standard_error.shape}"
            )
        evaluated = np.isfinite(self.mean) & np.isfinite(self.standard_error) & (self.standard_error >= 0.0)
        gap = np.isnan(self.mean) & np.isnan(self.standard_error)
        if not (evaluated | gap).all() or not evaluated.any():
            raise InputError(
                f"reward table of sensors {self.sensors}: expected finite rewards with errors of 0 or more, "
                "NaN in both where nothing was evaluated, and at least one that was"
            )


class SamplingOutcome(NamedTuple):
    """Why the sampling of a decision with a confidence stopped, and the confidence reached.

    A decision of several parts, one per sensor, is as certain as the least certain part.
    """

    reason: Literal["one left", "indifferent", "no samples", "max_samples", "max_seconds"]
    # one left: all others are worse; indifferent: no remaining one can be better by more than the indifference;
    # no samples: the reward needs none; the other two: the limit of samples or time was reached
    confidence: float  # that the choice is within the indifference of the best candidate
    samples: int  # over all rounds, including those of a search
    candidates: tuple[int, ...]  # remaining in each table: joint decisions have one, independent one per sensor
    started: tuple[int, ...]  # candidates at the beginning of each table

    @property
    def certain(self) -> bool:
        """Whether sampling ended because the choice was certain."""
        return self.reason in ("one left", "indifferent", "no samples")

    def __str__(self) -> str:
        if self.reason == "no samples":
            return "certain: the reward needs no samples"
        level = f"{100.0 * self.confidence:.3g} %"
        candidates_left = (
            f"{' + '.join(map(str, self.candidates))} of {' + '.join(map(str, self.started))} candidates left"
        )
        spent = f"after {self.samples} samples, {candidates_left}"
        if self.certain:
            return f"certain at {level} {spent}"
        ended = {"max_samples": "samples ran out", "max_seconds": "time ran out"}[self.reason]
        return f"not certain, {ended}: {level} {spent}"


class SearchCurve(NamedTuple):
    """Progress of a search, step by step."""

    evaluations: Ints  # (num_steps,) joint actions evaluated by then, increasing
    best: Floats  # (num_steps,) the best mean reward found by then


@dataclass(frozen=True, slots=True, repr=False)
class Plan(TabularRepr):
    """One decision: the chosen action of each sensor, and the evaluated alternatives.

    Attributes:
        planner: name of the planner.
        actions: for each sensor, its possible actions, in printed order.
        chosen: for each sensor, the index of its chosen action in `actions`.
        tables: independent decisions: one 1-D table per sensor. Joint decisions: one table with one axis per sensor (if
            that would be too large, one 1-D table per sensor, the others at their chosen actions). Random and fixed
            control: none. Means are over the samples that an action got: with `PlanningSettings.confidence` those that
            were excluded early got fewer than the choice, so that the largest mean need not be the choice's.
        counts: numbers of filter steps, fusions and rewards evaluated.
        notes: notes for readers, such as that rewards were evaluated one by one.
        curve: of a joint decision, the progress of the search, else None.
        bound: of a joint decision, the upper bound on its reward, or None if no bound is available.
        sequence: of a decision over several periods, for each sensor the rows (num_decisions, num_columns) of all
            chosen actions, the first of which is to be taken, else empty.
        certainty: why sampling stopped, if a confidence was required, else None.
        explanation: the explanation, if it was computed for storage. See `explain`.
        analysis: computes `explain` from the evidence. None without it (`without_evidence`, a pickle, a record).
    """

    planner: str
    actions: tuple[Actions, ...]
    chosen: tuple[int, ...]
    tables: tuple[RewardTable, ...]
    counts: dict[str, int]
    notes: tuple[str, ...] = ()
    curve: SearchCurve | None = None
    bound: Bound | None = None
    certainty: SamplingOutcome | None = None
    explanation: Explanation | None = None
    analysis: Callable[[], Explanation] | None = field(default=None, repr=False, compare=False)
    sequence: tuple[Floats, ...] = ()

    def explain(self) -> Explanation:
        """Return the explanation of the plan: contributions of targets and sensors to its reward, and the runner-up.

        It is computed on the first call. The explanation of a plan that was not made on rewards has little content, and
        says so.

        Raises:
            InputError: a plan that was stored or sent without its explanation, or made by a planner that gives none.
        """
        if self.analysis is not None:
            return self.analysis()
        if self.explanation is not None:
            return self.explanation
        chosen = tuple(own.text(index) for own, index in zip(self.actions, self.chosen, strict=True))
        if self.certainty is not None:
            return Explanation.nothing(self.planner, chosen, f"it was decided in rounds of samples: {self.certainty}")
        if self.tables:
            raise InputError(
                "plan: expected one as its planner returned it, or kept with its explanation; this one has left its "
                "evidence behind"
            )
        return Explanation.nothing(self.planner, chosen, f"{self.planner} does not choose by rewards")

    def without_evidence(self, *, explained: bool) -> "Plan":
        """Return the plan for storage, without its evidence, which takes memory. `explained`: with its explanation."""
        explanation = self.explanation
        if explained and self.analysis is not None:
            explanation = self.analysis().without_evidence()
        return replace(self, explanation=explanation, analysis=None)

    @property
    def num_sensors(self) -> int:
        """Number of sensors that the plan controls."""
        return len(self.actions)

    def to_table(self) -> dict[str, list[Any]]:
        """Return one row per sensor: `sensor` (from 0), `action`, `num_actions`, and the numbers of the action.

        A number that a sensor's actions do not have is None.
        """
        rows = zip(self.actions, self.chosen_actions, strict=True)
        chosen = [dict(zip(own.columns, row.tolist(), strict=True)) for own, row in rows]
        table: dict[str, list[Any]] = {"sensor": list(range(self.num_sensors)), "action": list(self.chosen)}
        table["num_actions"] = [len(own) for own in self.actions]
        return table | {name: [row.get(name) for row in chosen] for name in dict.fromkeys(n for r in chosen for n in r)}

    def _summary(self) -> str:
        rewards = self.expected_rewards
        worth = f", expected reward {rewards[0][0]:.4g} ± {rewards[0][1]:.2g}" if len(rewards) == 1 else ""
        return f"of {elided(self.planner)} for {pluralise(self.num_sensors, 'sensor')}{worth}"

    def _detail(self) -> str:
        texts = [own.text(index) for own, index in zip(self.actions, self.chosen, strict=True)][:_MOST_TOLD]
        more = self.num_sensors - len(texts)
        lines = [f"sensor {number}: {text}" for number, text in enumerate(texts, start=1)]
        return "; ".join(lines + ([f"{more} more"] if more else []))

    @property
    def chosen_actions(self) -> tuple[Floats, ...]:
        """The row of each sensor's chosen action."""
        return tuple(own.values[index] for own, index in zip(self.actions, self.chosen, strict=True))

    @property
    def expected_rewards(self) -> tuple[tuple[float, float], ...]:
        """Mean reward and standard error of the choice in each table: one per sensor, or one if joint."""
        at = [tuple(self.chosen[sensor] for sensor in table.sensors) for table in self.tables]
        return tuple(
            (float(table.mean[index]), float(table.standard_error[index]))
            for table, index in zip(self.tables, at, strict=True)
        )

    def validate(self) -> None:
        """Raise `InputError` unless the tables match the actions and contain the choice."""
        if len(self.chosen) != self.num_sensors:
            raise InputError(
                f"plan.chosen: expected one index for each of {self.num_sensors} sensors; got {self.chosen}"
            )
        for sensor, (own, index) in enumerate(zip(self.actions, self.chosen, strict=True)):
            if not 0 <= index < len(own):
                raise InputError(f"plan.chosen[{sensor}]: expected an index of {len(own)} actions; got {index}")
        for table in self.tables:
            self._check_table(table)

    def _check_table(self, table: RewardTable) -> None:
        table.validate()
        if not all(0 <= sensor < self.num_sensors for sensor in table.sensors):
            raise InputError(f"plan.tables: expected sensors below {self.num_sensors}; got {table.sensors}")
        expected = tuple(len(self.actions[sensor]) for sensor in table.sensors)
        if table.mean.shape != expected:
            raise InputError(f"plan.tables: expected shape {expected} for {table.sensors}; got {table.mean.shape}")
        choice = tuple(self.chosen[sensor] for sensor in table.sensors)
        if np.isnan(table.mean[choice]):
            raise InputError(
                f"plan.tables: expected a reward of the chosen actions {choice} of {table.sensors}; got none"
            )
