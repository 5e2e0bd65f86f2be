"""Runs of scenarios and how good they were: metrics, statistics over paired runs, tables.

Figures are in `vedette.evaluation.figures`.
"""

from vedette.evaluation.comparison import Comparison, choices_of, compare
from vedette.evaluation.metrics import (
    AverageNees,
    Continuity,
    GospaResult,
    GospaSeries,
    Matching,
    Metric,
    OspaResult,
    RunMetrics,
    TrackSet,
    average_nees,
    continuity,
    continuity_of_run,
    gospa,
    gospa_distance,
    gospa_of_run,
    match_run,
    measure,
    nees,
    nees_interval,
    ospa,
    ospa2,
    ospa2_of_run,
    ospa_of_run,
)
from vedette.evaluation.runs import measure_run, own_metrics, run_scenario
from vedette.evaluation.statistics import PairedDifference, Summary, paired_difference, summarise
from vedette.evaluation.tables import decision_rows, strategy_csv, strategy_markdown, strategy_rows

__all__ = [
    "AverageNees",
    "Comparison",
    "Continuity",
    "GospaResult",
    "GospaSeries",
    "Matching",
    "Metric",
    "OspaResult",
    "PairedDifference",
    "RunMetrics",
    "Summary",
    "TrackSet",
    "average_nees",
    "choices_of",
    "compare",
    "continuity",
    "continuity_of_run",
    "decision_rows",
    "gospa",
    "gospa_distance",
    "gospa_of_run",
    "match_run",
    "measure",
    "measure_run",
    "nees",
    "nees_interval",
    "ospa",
    "ospa2",
    "ospa2_of_run",
    "ospa_of_run",
    "own_metrics",
    "paired_difference",
    "run_scenario",
    "strategy_csv",
    "strategy_markdown",
    "strategy_rows",
    "summarise",
]
