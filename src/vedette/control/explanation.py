"""Why a plan is what it is: what targets and sensors contribute to its reward, and how near the next best came."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vedette.control.explained_text import text_of
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints

if TYPE_CHECKING:
    from vedette.control.plan import Bound


class TargetGains(NamedTuple):
    """What the reward gains by each target, in its own unit."""

    labels: Ints  # (num_targets, 2)
    existence: Floats  # (num_targets,) by the existence after all scans, with the density that there is without
    localisation: Floats  # (num_targets,) by the rest: the density after all scans

    @property
    def total(self) -> Floats:
        """(num_targets,) both together."""
        return self.existence + self.localisation


class RunnerUp(NamedTuple):
    """The best of the other joint actions that were evaluated."""

    actions: tuple[int, ...]  # for each sensor, the index among its actions
    text: str  # those of the sensors that would do something else
    margin: float  # by how much its mean reward is smaller
    standard_error: float | None  # of the margin, from differences sample by sample; None with a single sample

    @property
    def in_standard_errors(self) -> float | None:
        """The margin in its standard errors, inf where all samples agree on it; None without standard error."""
        return _ratio(self.margin, self.standard_error)


class Had(NamedTuple):
    """What would have been had a sensor done something else, the others as chosen."""

    sensor: int
    action: str
    reward: float
    difference: float  # of this reward from that of the choice
    standard_error: float | None  # of the difference, from differences sample by sample; None with a single sample

    @property
    def in_standard_errors(self) -> float | None:
        """The difference in its standard errors; None without standard error."""
        return _ratio(self.difference, self.standard_error)

    def __str__(self) -> str:
        off = f"{self.difference:+.4g}" + ("" if self.standard_error is None else f" +- {self.standard_error:.2g}")
        return f"sensor {self.sensor + 1} with {self.action}: reward {self.reward:.4g} ({off})"


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a plan is what it is. Rewards are means over the samples; a field is None where `missing` says why.

    `baseline`, the sum of `of_targets.total` and `of_undetected` add up to `reward`; so do `baseline` and `of_sensors`.
    An independent decision is explained as one: its reward is the sum of the sensors' own.

    Attributes:
        planner: name of the planner.
        chosen: what each sensor does, in words.
        reward: of the choice.
        standard_error: of that; None with a single sample.
        evaluations: how many joint actions were evaluated; of an independent decision, actions.
        baseline: the reward without any scan.
        of_targets: what is gained by each target of the fused belief.
        of_undetected: what is gained by targets that were not found before.
        of_sensors: (num_sensors,) the sensors' shares in what is gained: half of what each adds to those before it and
            half of what it adds to those after it (a Shapley value on two orders).
        without: (num_sensors,) the reward had the sensor not scanned, the others as chosen.
        runner_up: the best other joint action that was evaluated.
        bound: how far from the best the choice can be; None where nothing is known of that.
        missing: why fields are None, by name.
        answer: behind `had`; None once the evidence is gone.
    """

    planner: str
    chosen: tuple[str, ...]
    reward: float | None
    standard_error: float | None
    evaluations: int
    baseline: float | None
    of_targets: TargetGains | None
    of_undetected: float | None
    of_sensors: Floats | None
    without: Floats | None
    runner_up: RunnerUp | None
    bound: Bound | None
    missing: dict[str, str]
    answer: Callable[[int, int | None, dict[str, float]], Had] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def nothing(cls, planner: str, chosen: tuple[str, ...], why: str) -> Explanation:
        """Of a plan that was not made on rewards."""
        nothing = (None,) * 7
        return cls(planner, chosen, None, None, 0, *nothing, dict.fromkeys(EXPLAINED, why))

    def had(self, sensor: int, action: int | None = None, **columns: float) -> Had:
        """What would have been had a sensor done something else, the others as chosen.

        Args:
            sensor: its number, from 0.
            action: the index among its actions, where no columns are given.
            columns: the numbers of an action, as in `heading_deg=60.0`; those left out are as chosen. Degrees count up
                to whole turns.

        Raises:
            InputError: no such sensor or action, or a plan without its evidence: one that chose without rewards, was
                read from a record or unpickled.
            NumericalError: a reward that is not finite.
        """
        if self.answer is None:
            why = self.missing.get("reward", "this plan has left its evidence behind, as it was kept or sent")
            raise InputError(f"had: expected a plan as its planner returned it; {why}")
        return self.answer(sensor, action, columns)

    def without_evidence(self) -> Explanation:
        """The same to be kept: it cannot answer `had`."""
        values = {name: getattr(self, name) for name in self.__slots__ if name != "answer"}
        return Explanation(**values)

    def __str__(self) -> str:
        return text_of(self)


# The fields that may be None with a reason.
EXPLAINED = ("reward", "baseline", "of_targets", "of_undetected", "of_sensors", "without", "runner_up")


def _ratio(difference: float, error: float | None) -> float | None:
    if error is None:
        return None
    if error == 0.0 or np.isnan(error):
        return math.copysign(math.inf, difference) if difference != 0.0 else 0.0
    return difference / error
