"""Pairwise comparisons of strategies: a verdict, the paired difference and a sentence for each pair."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vedette.evaluation import Comparison, PairedDifference, holm
from vedette.evaluation.figures.style import strategy_label
from vedette.evaluation.health import percent
from vedette.evaluation.statistics import CONFIDENCE
from vedette.internal.text import with_minus, with_unit

Verdict = Literal["better", "worse", "unclear", "unknown"]


@dataclass(frozen=True, slots=True)
class PairwiseComparison:
    """Comparison of one strategy with another."""

    # of `first` against `second`: better, worse, unclear (no significant difference), or unknown (one run). It is
    # corrected for the number of pairs (Holm)
    verdict: Verdict
    first: str  # names of the strategies
    second: str
    sentence: str  # the finding with its numbers
    mean: float  # paired difference in mean OSPA, second minus first, with its 95 % interval, or NaN for one run
    low: float
    high: float
    difference: str  # the same as text: "+1.20 (+0.80 to +1.60)"
    win_rate: str  # share of the runs in which `first` is better: "93 %", or "unknown" for one run


def compare_with_first(comparison: Comparison) -> tuple[PairwiseComparison, ...]:
    """Compare the first strategy with each of the others."""
    return _compare_pairs(comparison, [(comparison.strategies[0], other) for other in comparison.strategies[1:]])


def all_pairs(comparison: Comparison) -> tuple[PairwiseComparison, ...]:
    """Compare every strategy with every later one."""
    names = comparison.strategies
    return _compare_pairs(comparison, [(first, second) for i, first in enumerate(names) for second in names[i + 1 :]])


def _compare_pairs(comparison: Comparison, pairs: Sequence[tuple[str, str]]) -> tuple[PairwiseComparison, ...]:
    """Compare pairs in mean OSPA over the counted scans of paired runs, corrected for their number by Holm's method."""
    differences = [comparison.difference(second, first) for first, second in pairs]
    p_values = holm(np.array([paired.p_value for paired in differences]))
    return tuple(
        _comparison(pair, paired, float(p_value), len(pairs), comparison.unit)
        for pair, paired, p_value in zip(pairs, differences, p_values, strict=True)
    )


def _comparison(
    pair: tuple[str, str], paired: PairedDifference, p_value: float, number: int, unit: str
) -> PairwiseComparison:
    verdict, names = _verdict(paired, p_value), (strategy_label(pair[0]), strategy_label(pair[1]))
    sentence = _SENTENCES[verdict](*names, paired, unit)
    sentence = sentence[0].upper() + sentence[1:]
    if number > 1 and verdict != "unknown":
        p_text = "< 0.001" if p_value < 0.001 else f"= {p_value:.2g}"
        sentence = f"{sentence[:-1]} (p {p_text} among {number} comparisons)."
    mean, low, high = (float(each) for each in (paired.summary.mean, paired.summary.low, paired.summary.high))
    share = "unknown" if verdict == "unknown" else percent(paired.win_rate)
    interval = "" if verdict == "unknown" else f" ({low:+.2f} to {high:+.2f})"
    return PairwiseComparison(verdict, *names, sentence, mean, low, high, with_minus(f"{mean:+.2f}{interval}"), share)


def _verdict(paired: PairedDifference, p_value: float) -> Verdict:
    if paired.summary.num_runs < 2:
        return "unknown"
    if p_value > 1.0 - CONFIDENCE:
        return "unclear"
    return "better" if float(paired.summary.mean) > 0.0 else "worse"


def _significant(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    ends = float(paired.summary.low), float(paired.summary.high)
    is_smaller = float(paired.summary.mean) > 0.0
    interval = _range(*ends, unit) if is_smaller else _range(-ends[1], -ends[0], unit)
    size = with_unit(f"{abs(float(paired.summary.mean)):.2f}", unit)
    return (
        f"{first} has a {'smaller' if is_smaller else 'larger'} mean OSPA than {second}, by {size} (95 % interval "
        f"{interval}, {_runs(paired)}). It is smaller in {'' if is_smaller else 'only '}{_share(paired)}."
    )


def _unclear(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    difference = with_unit(with_minus(f"{float(paired.summary.mean):.2f}"), unit)
    interval = _range(float(paired.summary.low), float(paired.summary.high), unit)
    return (
        f"{first} and {second} do not differ significantly in mean OSPA. {second} minus {first}: {difference} "
        f"(95 % interval {interval}, {_runs(paired)}). {first} is smaller in {_share(paired)}."
    )


def _unknown(first: str, second: str, paired: PairedDifference, unit: str) -> str:
    difference = with_unit(with_minus(f"{float(paired.summary.mean):.2f}"), unit)
    return f"One run proves nothing. {second} minus {first}: {difference} in mean OSPA."


_SENTENCES = {"better": _significant, "worse": _significant, "unclear": _unclear, "unknown": _unknown}


def _range(low: float, high: float, unit: str) -> str:
    return with_unit(with_minus(f"{low:.2f} to {high:.2f}"), unit)


def _runs(paired: PairedDifference) -> str:
    return f"{paired.summary.num_runs} paired runs{', bootstrap' if paired.is_skewed else ''}"


def _share(paired: PairedDifference) -> str:
    tied = f", equal in {percent(paired.tie_rate)}" if paired.tie_rate > 0.0 else ""
    return f"{percent(paired.win_rate)} of the runs{tied}"
