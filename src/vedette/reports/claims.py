"""What a comparison shows, in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vedette.evaluation import Comparison, PairedDifference
from vedette.evaluation.figures.style import strategy_label
from vedette.evaluation.health import percent
from vedette.text import amount, with_minus

Verdict = Literal["better", "worse", "untold", "unknown"]


@dataclass(frozen=True, slots=True)
class Claim:
    """One strategy against another.

    Attributes:
        verdict: of `first` against `second`: better, worse, not told apart, or unknown for want of runs.
        first, second: names of the strategies.
        sentence: the finding with its numbers.
        difference: second minus first, with its interval: "+1.20 (+0.80 to +1.60)".
        share_won: of the runs, by `first`: "93 %"; "unknown" for want of runs.
    """

    verdict: Verdict
    first: str
    second: str
    sentence: str
    difference: str
    share_won: str


def claims(comparison: Comparison) -> tuple[Claim, ...]:
    """The first strategy against each of the others."""
    return tuple(claim(comparison, comparison.strategies[0], other) for other in comparison.strategies[1:])


def all_pairs(comparison: Comparison) -> tuple[Claim, ...]:
    """Every strategy against every later one."""
    names = comparison.strategies
    return tuple(claim(comparison, first, second) for i, first in enumerate(names) for second in names[i + 1 :])


def claim(comparison: Comparison, first: str, second: str) -> Claim:
    """One strategy against another, run by run, in mean OSPA over the counted scans."""
    paired = comparison.difference(second, first)
    verdict, names = _verdict(paired), (strategy_label(first), strategy_label(second))
    sentence = _SENTENCES[verdict](*names, paired, comparison.unit)
    sentence = sentence[0].upper() + sentence[1:]
    mean, low, high = (float(each) for each in (paired.summary.mean, paired.summary.low, paired.summary.high))
    share = "unknown" if verdict == "unknown" else percent(paired.share_won)
    interval = "" if verdict == "unknown" else f" ({low:+.2f} to {high:+.2f})"
    return Claim(verdict, *names, sentence, with_minus(f"{mean:+.2f}{interval}"), share)


def _verdict(paired: PairedDifference) -> Verdict:
    if paired.summary.num_runs < 2:
        return "unknown"
    if float(paired.summary.low) > 0.0:
        return "better"
    return "worse" if float(paired.summary.high) < 0.0 else "untold"


def _better(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    less = amount(f"{float(paired.summary.mean):.2f}", unit)
    return (
        f"{first} has {less} less mean OSPA than {second} (95 % confidence interval of the "
        f"paired difference {_interval(paired, unit)}, {_runs(paired)}), and is better in {_share(paired)}."
    )


def _worse(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    low, high = -float(paired.summary.high), -float(paired.summary.low)
    more = amount(f"{-float(paired.summary.mean):.2f}", unit)
    return (
        f"{first} has {more} more mean OSPA than {second} (95 % confidence interval of "
        f"the paired difference {_range(low, high, unit)}, {_runs(paired)}), and is better in {_share(paired)} only."
    )


def _untold(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    difference = amount(with_minus(f"{float(paired.summary.mean):.2f}"), unit)
    return (
        f"{first} and {second} are not told apart: the paired difference in mean OSPA, {second} minus {first}, is "
        f"{difference}, but its 95 % confidence interval, {_interval(paired, unit)}, "
        f"holds 0 ({_runs(paired)}); {first} is better in {_share(paired)}."
    )


def _unknown(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    difference = amount(with_minus(f"{float(paired.summary.mean):.2f}"), unit)
    return (
        f"{first} and {second} have one run in common, and one run tells nothing apart: the difference in mean OSPA, "
        f"{second} minus {first}, is {difference} in it."
    )


_SENTENCES = {"better": _better, "worse": _worse, "untold": _untold, "unknown": _unknown}


def _interval(paired: PairedDifference, unit: str) -> str:
    return _range(float(paired.summary.low), float(paired.summary.high), unit)


def _range(low: float, high: float, unit: str) -> str:
    return amount(with_minus(f"{low:.2f} to {high:.2f}"), unit)


def _runs(paired: PairedDifference) -> str:
    return f"{paired.summary.num_runs} paired runs"


def _share(paired: PairedDifference) -> str:
    tied = f", equal in {percent(paired.share_tied)}" if paired.share_tied > 0.0 else ""
    return f"{percent(paired.share_won)} of the runs{tied}"
