"""What a planner decided, with the evidence it decided on."""

from __future__ import annotations

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
        sensors: the sensors whose actions are the axes of the table, in axis order.
        mean: (num_actions of sensors[0], ...) mean reward over the samples; one axis a sensor. NaN where a search did
            not evaluate the action.
        standard_error: same shape; standard error of that mean, 0 with a single sample; NaN where the mean is.
    """

    sensors: tuple[int, ...]
    mean: Floats
    standard_error: Floats

    def validate(self) -> None:
        """Raise `InputError` unless there is one axis a sensor, and every entry is a reward with its error or a gap."""
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
    """How a decision that takes as many samples as it needs came to its end.

    A decision of several parts, one a sensor, is as certain as the least certain part.
    """

    reason: Literal["one left", "indifferent", "no samples", "max_samples", "max_seconds"]
    # one left: all others are worse; indifferent: none that is left can be better by more than the indifference;
    # no samples: the reward needs none; the other two: samples or time ran out before
    confidence: float  # with which the choice is within the indifference of the best candidate
    samples: int  # of all rounds, those of a search included
    candidates: tuple[int, ...]  # left at the end, of each table: joint decisions have one, independent one a sensor
    started: tuple[int, ...]  # candidates at the beginning, likewise

    @property
    def certain(self) -> bool:
        """Whether it ended because the choice was certain."""
        return self.reason in ("one left", "indifferent", "no samples")

    def __str__(self) -> str:
        if self.reason == "no samples":
            return "certain: the reward needs no samples"
        level = f"{100.0 * self.confidence:.3g} %"
        left = f"{' + '.join(map(str, self.candidates))} of {' + '.join(map(str, self.started))} candidates left"
        spent = f"after {self.samples} samples, {left}"
        if self.certain:
            return f"certain at {level} {spent}"
        ended = {"max_samples": "samples ran out", "max_seconds": "time ran out"}[self.reason]
        return f"not certain, {ended}: {level} {spent}"


class SearchCurve(NamedTuple):
    """How a search went, step by step."""

    evaluations: Ints  # (num_steps,) joint actions evaluated by then, increasing
    best: Floats  # (num_steps,) the best mean reward found by then


@dataclass(frozen=True, slots=True, repr=False)
class Plan(TabularRepr):
    """One decision: the chosen action of each sensor, and what was evaluated to choose it.

    Attributes:
        planner: name of the planner.
        actions: for each sensor, what it could do, in printed order.
        chosen: for each sensor, the index of its chosen action in `actions`.
        tables: independent decisions: one 1-D table a sensor; joint decisions: one table with one axis a sensor (where
            that would be too large to hold, one 1-D table a sensor, the others at their chosen actions);
            random and fixed control: none. Means are over the samples that an action got: with
            `PlanningSettings.confidence` those that were excluded early got fewer than the choice, so that the largest
            mean need not be the choice's.
        counts: how many of each thing was evaluated.
        notes: what a reader must know, such as that rewards were taken one by one.
        curve: of a joint decision, how the search went; else None.
        bound: of a joint decision, how far from the best it can be; None where nothing is known of that.
        sequence: of a decision over several periods, for each sensor the rows (num_decisions, num_columns) of all the
            actions that were chosen, the first of which is to be taken; else empty.
        certainty: how the decision ended where it takes as many samples as it needs; else None.
        explanation: why it is what it is, where that has been worked out to be kept; see `explain`.
        questions: answers `explain` from the evidence; None without it (`without_evidence`, a pickle, a record).
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
    questions: Callable[[], Explanation] | None = field(default=None, repr=False, compare=False)
    sequence: tuple[Floats, ...] = ()

    def explain(self) -> Explanation:
        """Why it is what it is: what targets and sensors contribute to its reward, and how near the next best came.

        Worked out when it is first asked for. A plan that was not made on rewards has little to say, but says it.

        Raises:
            InputError: a plan that was kept or sent without its explanation, or made by a planner that gives none.
        """
        if self.questions is not None:
            return self.questions()
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

    def without_evidence(self, *, explained: bool) -> Plan:
        """The plan to be kept: without its evidence, which takes memory; with its explanation where that is wanted."""
        kept = self.explanation
        if explained and self.questions is not None:
            kept = self.questions().without_evidence()
        return replace(self, explanation=kept, questions=None)

    @property
    def num_sensors(self) -> int:
        """Number of sensors that the plan steers."""
        return len(self.actions)

    def to_table(self) -> dict[str, list[Any]]:
        """A row a sensor, by columns: `sensor` (from 0), `action`, of `num_actions`, and its numbers by their names.

        A number that a sensor's actions do not have is None.
        """
        chosen = [dict(zip(own.columns, row, strict=True)) for own, row in zip(self.actions, self._rows(), strict=True)]
        table: dict[str, list[Any]] = {"sensor": list(range(self.num_sensors)), "action": list(self.chosen)}
        table["num_actions"] = [len(own) for own in self.actions]
        return table | {name: [row.get(name) for row in chosen] for name in dict.fromkeys(n for r in chosen for n in r)}

    def _rows(self) -> list[list[float]]:
        return [row.tolist() for row in self.chosen_actions]

    def _summary(self) -> str:
        rewards = self.expected_rewards
        worth = f", expected reward {rewards[0][0]:.4g} ± {rewards[0][1]:.2g}" if len(rewards) == 1 else ""
        return f"of {elided(self.planner)} for {pluralise(self.num_sensors, 'sensor')}{worth}"

    def _detail(self) -> str:
        texts = [own.text(index) for own, index in zip(self.actions, self.chosen, strict=True)][:_MOST_TOLD]
        more = self.num_sensors - len(texts)
        told = [f"sensor {number}: {text}" for number, text in enumerate(texts, start=1)]
        return "; ".join(told + ([f"{more} more"] if more else []))

    @property
    def chosen_actions(self) -> tuple[Floats, ...]:
        """The chosen row of each sensor's actions."""
        return tuple(own.values[index] for own, index in zip(self.actions, self.chosen, strict=True))

    @property
    def expected_rewards(self) -> tuple[tuple[float, float], ...]:
        """Mean reward of the choice and its standard error, one a table: one a sensor, or one for a joint decision."""
        at = [tuple(self.chosen[sensor] for sensor in table.sensors) for table in self.tables]
        return tuple(
            (float(table.mean[index]), float(table.standard_error[index]))
            for table, index in zip(self.tables, at, strict=True)
        )

    def validate(self) -> None:
        """Raise `InputError` unless the tables fit the actions and hold the choice."""
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
