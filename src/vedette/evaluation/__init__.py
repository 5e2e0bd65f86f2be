"""Runs of scenarios and how good they were: metrics, statistics over paired runs, tables.

Figures are in `vedette.evaluation.figures`.
"""

from vedette.evaluation.comparison import Comparison, choices_of, compare
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.metrics import (
    AverageNees,
    Continuity,
    GospaResult,
    GospaSeries,
    Matching,
    Metric,
    OspaResult,
    RunMetrics,
    TrackedShare,
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
    seen_targets,
)
from vedette.evaluation.rewards import MeanRewards, mean_rewards
from vedette.evaluation.runs import measure_run, own_metrics, run_scenario
from vedette.evaluation.statistics import PairedDifference, Summary, holm, paired_difference, summarise
from vedette.evaluation.tables import decision_rows, strategy_csv, strategy_markdown, strategy_rows

__all__ = [
    "AverageNees",
    "Comparison",
    "Continuity",
    "Ensemble",
    "GospaResult",
    "GospaSeries",
    "Matching",
    "MeanRewards",
    "Metric",
    "OspaResult",
    "PairedDifference",
    "RunMetrics",
    "Summary",
    "TrackSet",
    "TrackedShare",
    "average_nees",
    "choices_of",
    "compare",
    "continuity",
    "continuity_of_run",
    "decision_rows",
    "gospa",
    "gospa_distance",
    "gospa_of_run",
    "holm",
    "match_run",
    "mean_rewards",
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
    "seen_targets",
    "strategy_csv",
    "strategy_markdown",
    "strategy_rows",
    "summarise",
]
