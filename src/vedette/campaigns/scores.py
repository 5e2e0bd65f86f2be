"""Scores of the strategies of a campaign: error, tracked share and computation time, as a table."""

from dataclasses import dataclass

import numpy as np

from vedette.campaigns.results import GroupComparison
from vedette.evaluation import Summary
from vedette.internal.text import markdown_table, named_in, with_error, with_minus

TRACKED_OF_ALL = "tracked_of_all"  # name of the metric in scenes and campaigns
_UNKNOWN = ""
_LEAST_SECONDS = 1e-4


@dataclass(frozen=True, slots=True)
class StrategyScore:
    """Score of one strategy over the paired runs of a setting, or of a published method."""

    label: str  # name of the strategy
    ospa: float  # mean over scans and runs, in the unit of the comparison
    standard_error: float | None  # standard error of `ospa` over the runs. None: not known
    worst: float | None  # largest mean over the scans of a run. None: not known
    difference: Summary | None  # paired difference to the first strategy. None: it is the first, or not paired with it
    cardinality_error: float  # mean number of estimates minus that of targets
    # mean share of all targets, in view or not, with an estimate within the cutoff. None: not measured
    tracked: float | None
    # wall time of a decision of all sensors, s: median over decisions and runs, and for a published method the
    # published value. None: no decisions
    decision_seconds: float | None
    num_runs: int  # number of runs


def score_strategies(group: GroupComparison) -> tuple[StrategyScore, ...]:
    """Return the scores of the strategies of a group, over its common runs, in its order. The first is the
    reference.
    """
    comparison, scores = group.comparison, []
    for label, ensemble in zip(group.labels, comparison.ensembles, strict=True):
        total, decisions = comparison.summary(label), ensemble.seconds.get("planning", ())
        has_tracked = TRACKED_OF_ALL in comparison.measures
        scores.append(
            StrategyScore(
                label=label,
                ospa=float(total.mean),
                standard_error=float(total.standard_error) if comparison.num_runs > 1 else None,
                worst=float(comparison.run_means(label).max()),
                difference=comparison.difference(label).summary if label != group.labels[0] else None,
                cardinality_error=float(comparison.summary(label, "cardinality_error").mean),
                tracked=float(comparison.summary(label, TRACKED_OF_ALL).mean) if has_tracked else None,
                decision_seconds=float(np.median(decisions)) if len(decisions) else None,
                num_runs=comparison.num_runs,
            )
        )
    return tuple(scores)


def score_header(unit: str, reference: str) -> tuple[str, ...]:
    """Return the column names of `score_row`."""
    names = (named_in("OSPA", unit), named_in("Worst run", unit), named_in(f"More than {reference}", unit))
    return ("Strategy", *names, "N error", "Tracked", "s a decision", "Runs")


def score_row(score: StrategyScore) -> tuple[str, ...]:
    """Return one row under `score_header`, with empty cells where values are not known."""
    more = score.difference
    return (
        score.label,
        with_minus(with_error(score.ospa, score.standard_error)),
        _UNKNOWN if score.worst is None else f"{score.worst:.2f}",
        _UNKNOWN if more is None else with_minus(with_error(float(more.mean), float(more.standard_error), "+")),
        with_minus(f"{score.cardinality_error:+.2f}"),
        _UNKNOWN if score.tracked is None else f"{100.0 * score.tracked:.1f} %",
        _UNKNOWN if score.decision_seconds is None else _seconds(score.decision_seconds),
        str(score.num_runs),
    )


def score_markdown(scores: tuple[StrategyScore, ...], unit: str, reference: str) -> str:
    """Return the table as Markdown."""
    return markdown_table(score_header(unit, reference), map(score_row, scores))


def _seconds(value: float) -> str:
    """Return a time with two significant digits, without an exponent."""
    if value < _LEAST_SECONDS:
        return f"<{_LEAST_SECONDS:g}"
    return f"{value:.2g}" if value < 10.0 else f"{value:.0f}"
