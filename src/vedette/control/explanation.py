"""Explanation of a plan: contributions of targets and sensors to its reward, and the margin to the runner-up."""

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats, Ints

_WIDTH = 80
_MOST_ROWS = 10
_SAME = 1e-9


@dataclass(frozen=True, slots=True)
class Bound:
    """Upper bound on the reward of the best joint action, on the same samples.

    Attributes:
        upper: no joint action has a larger mean reward. It is inf if some target has no bound.
        reward: mean reward of the choice.
        kind: "exhaustive": every joint action was evaluated. "by target": the sum over targets of the best joint action
            for each. "relaxed": by a mixture of courses of each sensor.
        unbounded: number of targets without a bound, because too many sensors may see them.
    """

    upper: float
    reward: float
    kind: str
    unbounded: int = 0

    @property
    def gap(self) -> float:
        """Largest possible improvement, in units of the reward."""
        return self.upper - self.reward

    @property
    def is_close(self) -> bool:
        """True if the gap is at most a fifth of the reward. Texts and tables leave out looser bounds."""
        return self.relative <= 0.2

    @property
    def relative(self) -> float:
        """The gap relative to the magnitude of the bound or of the reward, whichever is larger, or 0 for no gap."""
        scale = max(abs(self.upper), abs(self.reward))
        return self.gap / scale if self.gap > 0.0 else 0.0

    def __str__(self) -> str:
        if self.kind == "exhaustive":
            return "the best of all joint actions"
        if self.unbounded:
            return f"no bound: {self.unbounded} targets may be seen in too many ways"
        return f"at most {self.gap:.4g} ({100.0 * self.relative:.2g} %) below the best" if self.is_close else ""


class TargetGains(NamedTuple):
    """Gain of the reward from each target, in units of the reward."""

    labels: Ints  # (num_targets, 2)
    existence: Floats  # (num_targets,) from existence after all scans, with the density without scans
    localisation: Floats  # (num_targets,) the remaining gain: from the density after all scans

    @property
    def total(self) -> Floats:
        """Sum (num_targets,) of both gains."""
        return self.existence + self.localisation


class RunnerUp(NamedTuple):
    """The best of the other joint actions that were evaluated."""

    actions: tuple[int, ...]  # for each sensor, the index of its action
    text: str  # actions of the sensors that differ from the choice
    margin: float  # difference of the mean rewards
    standard_error: float | None  # of the margin, from paired differences; None with a single sample

    @property
    def in_standard_errors(self) -> float | None:
        """The margin in standard errors, inf if it is equal in all samples, and None without standard error."""
        return _ratio(self.margin, self.standard_error)


class Counterfactual(NamedTuple):
    """Reward if one sensor had taken another action and the others had kept theirs."""

    sensor: int
    action: str
    reward: float
    difference: float  # this reward minus that of the choice
    standard_error: float | None  # of the difference, from paired differences; None with a single sample

    @property
    def in_standard_errors(self) -> float | None:
        """The difference in standard errors, or None without standard error."""
        return _ratio(self.difference, self.standard_error)

    def __str__(self) -> str:
        off = f"{self.difference:+.4g}" + ("" if self.standard_error is None else f" +- {self.standard_error:.2g}")
        return f"sensor {self.sensor + 1} with {self.action}: reward {self.reward:.4g} ({off})"


@dataclass(frozen=True, slots=True, repr=False)
class Explanation:
    """Explanation of a plan. Rewards are means over the samples. `missing` gives the reason for a field that is None.

    `baseline` plus the sum of `of_targets.total` plus `of_undetected` less `price` equals `reward`, and so does
    `baseline` plus the sum of `of_sensors`. The reward of an independent decision is the sum of the rewards that the
    sensors decided on, with what each of them assumes about the others.

    Attributes:
        planner: name of the planner.
        chosen: the action of each sensor, as text.
        reward: reward of the choice.
        standard_error: standard error of the reward, or None with a single sample.
        evaluations: number of joint actions evaluated, or for an independent decision, of actions.
        baseline: the reward without any scan. If sensors assume that the others stay, the sum of rewards with these
            alone.
        of_targets: gains from each target of the fused belief.
        of_undetected: gain from undetected targets.
        of_sensors: (num_sensors,) contribution of each sensor to the gain, less its price: half of what it adds to the
            sensors before it and half of what it adds to those after it (a Shapley value on two orders).
        reward_without_sensor: (num_sensors,) the reward had the sensor not scanned, at no price, given the other
            sensors' choices.
        runner_up: the best other joint action that was evaluated.
        bound: upper bound on the best reward, or None if no bound is available.
        missing: reasons for fields that are None, by name.
        price: of all chosen actions, which is subtracted from the gain.
        answer: function behind `counterfactual`, or None without the evidence.
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
    reward_without_sensor: Floats | None
    runner_up: RunnerUp | None
    bound: Bound | None
    missing: dict[str, str]
    price: float = 0.0
    answer: Callable[[int, int | None, dict[str, float]], Counterfactual] | None = field(
        default=None, repr=False, compare=False
    )

    @classmethod
    def nothing(cls, planner: str, chosen: tuple[str, ...], reason: str) -> "Explanation":
        """Return the explanation of a plan that was not made on rewards."""
        nothing = (None,) * 7
        return cls(planner, chosen, None, None, 0, *nothing, dict.fromkeys(EXPLAINED, reason))

    def counterfactual(self, sensor: int, action: int | None = None, **columns: float) -> Counterfactual:
        """Return the reward if one sensor had taken another action, given the other sensors' choices.

        Args:
            sensor: its index, from 0.
            action: index of the action, if no columns are given.
            columns: the numbers of an action, as in `heading_deg=60.0`. Omitted ones are as chosen. Angles in degrees
                are compared modulo full turns.

        Raises:
            InputError: no such sensor or action, or a plan without its evidence: one that was chosen without rewards,
                read from a record or unpickled.
            NumericalError: a reward that is not finite.
        """
        if self.answer is None:
            reason = self.missing.get("reward", "this plan has left its evidence behind, as it was kept or sent")
            raise InputError(f"had: expected a plan as its planner returned it; {reason}")
        return self.answer(sensor, action, columns)

    def without_evidence(self) -> "Explanation":
        """Return a copy for storage, which cannot answer `counterfactual`."""
        values = {name: getattr(self, name) for name in self.__slots__ if name != "answer"}
        return Explanation(**values)

    def __repr__(self) -> str:
        lines = [*_of_choice(self), *_of_targets(self), *_of_sensors(self)]
        reasons: dict[str, list[str]] = {}
        for name, reason in self.missing.items():
            reasons.setdefault(reason, []).append(name)
        lines += [f"no {', '.join(names)}: {reason}" for reason, names in reasons.items()]
        return "\n".join(part for line in lines for part in _wrapped(line))


# Fields that may be None, with a reason.
EXPLAINED = ("reward", "baseline", "of_targets", "of_undetected", "of_sensors", "reward_without_sensor", "runner_up")


def _ratio(difference: float, error: float | None) -> float | None:
    if error is None:
        return None
    if error == 0.0 or np.isnan(error):
        return math.copysign(math.inf, difference) if difference != 0.0 else 0.0
    return difference / error


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, _WIDTH, subsequent_indent="  ") if len(line) > _WIDTH else [line]


def with_error(value: float, error: float | None, sign: str = "+-") -> str:
    """Return a value with its error as text, such as `1.234 +- 0.05`."""
    return f"{value:.4g}" + ("" if error is None else f" {sign} {error:.2g}")


def number_text(value: float, scale: float) -> str:
    """Return a number with four digits, or 0 if it is rounding error relative to the scale."""
    return "0" if abs(value) <= _SAME * abs(scale) else f"{value:.4g}"


def _of_choice(explanation: Explanation) -> list[str]:
    if explanation.reward is None:
        return [f"{explanation.planner}: {'; '.join(explanation.chosen)}"]
    start = (
        ""
        if explanation.baseline is None
        else f"; {number_text(explanation.baseline, explanation.reward)} without any scan"
    )
    lines = [f"{explanation.planner}: reward {with_error(explanation.reward, explanation.standard_error)}{start}"]
    bound = str(explanation.bound or "")
    lines.append("; ".join(filter(None, [f"{pluralise(explanation.evaluations, 'choice')} evaluated", bound])))
    if explanation.runner_up is not None:
        lines.append(
            f"runner-up: {margin_text(explanation.runner_up, explanation.reward)}: {explanation.runner_up.text}"
        )
    return lines


def margin_text(runner_up: RunnerUp, reward: float, sign: str = "+-", brackets: tuple[str, str] = (" (", ")")) -> str:
    """Return the margin as text, such as `less by 0.12 +- 0.03 (4 standard errors)`."""
    if abs(runner_up.margin) <= _SAME * max(1.0, abs(reward)):
        return "as good"
    ratio = runner_up.in_standard_errors
    apart = "" if ratio is None or np.isinf(ratio) else f"{ratio:.2g} standard errors".join(brackets)
    return f"less by {with_error(runner_up.margin, runner_up.standard_error, sign)}{apart}"


def _of_targets(explanation: Explanation) -> list[str]:
    gains = explanation.of_targets
    if gains is None:
        return []
    lines = [f"{'target':18s}{'gain':>12s}{'existence':>14s}{'localisation':>15s}"]
    order, rest = _most(gains.total)
    names = {i: ".".join(map(str, gains.labels[i].tolist())) for i in order}
    rows = [([i], names[i]) for i in order] + ([(rest, f"{len(rest)} more")] if rest else [])
    scale = float(np.abs(gains.total).max(initial=0.0))
    for which, name in rows:
        total, existence, localisation = (
            number_text(float(part[which].sum()), scale) for part in (gains.total, gains.existence, gains.localisation)
        )
        lines.append(f"{name:18s}{total:>12s}{existence:>14s}{localisation:>15s}")
    if explanation.of_undetected:
        gained = float(gains.total.sum()) + explanation.of_undetected
        share = f"  {explanation.of_undetected / gained:.0%} of what is gained" if gained > 0.0 else ""
        lines.append(f"{'not found before':18s}{explanation.of_undetected:12.4g}{share}")
    if explanation.price:
        lines.append(f"{'price':18s}{-explanation.price:12.4g}")
    return lines


def _of_sensors(explanation: Explanation) -> list[str]:
    shares, without = explanation.of_sensors, explanation.reward_without_sensor
    if shares is None or without is None:
        return []
    lines = [f"{'sensor':8s}{'share':>12s}{'without it':>14s}  action"]
    order, rest = _most(shares)
    for s in sorted(order):
        row = f"{s + 1:<8d}{shares[s]:12.4g}{without[s]:14.4g}  {explanation.chosen[s]}"
        lines.append(row if len(row) <= _WIDTH else f"{row[: _WIDTH - 3]}...")
    if rest:
        lines.append(f"{f'{len(rest)} more':8s}{float(shares[rest].sum()):12.4g}")
    return lines


def _most(values: Sequence[float] | np.ndarray) -> tuple[list[int], list[int]]:
    """Return the indices of the largest values in magnitude, and the indices of the others."""
    order = np.argsort(-np.abs(np.asarray(values)), kind="stable").tolist()
    return order[:_MOST_ROWS], order[_MOST_ROWS:]
