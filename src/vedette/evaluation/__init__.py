"""Runs of scenarios and their evaluation: metrics, statistics over paired runs, tables.

Figures are in `vedette.evaluation.figures`.
"""

from vedette.evaluation.comparison import Comparison, compare, decided_actions
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.metrics.consistency import AverageNees, average_nees, nees, nees_interval
from vedette.evaluation.metrics.matching import Matching, match_run
from vedette.evaluation.metrics.point_gospa import GospaResult, GospaSeries, gospa, gospa_distance, gospa_of_run
from vedette.evaluation.metrics.point_ospa import OspaResult, ospa, ospa_of_run
from vedette.evaluation.metrics.run import Metric, RunMetrics, measure
from vedette.evaluation.metrics.track_ospa import TrackSet, ospa2, ospa2_of_run
from vedette.evaluation.metrics.tracked_fraction import TimeToTrack, TrackedFraction, targets_in_view
from vedette.evaluation.metrics.trajectories import Continuity, continuity, continuity_of_run
from vedette.evaluation.rewards import MeanRewards, mean_rewards
from vedette.evaluation.runs import custom_metrics, measure_run, run_scenario, track_recording, trajectory_errors
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
    "TimeToTrack",
    "TrackSet",
    "TrackedFraction",
    "average_nees",
    "compare",
    "continuity",
    "continuity_of_run",
    "custom_metrics",
    "decided_actions",
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
    "paired_difference",
    "run_scenario",
    "strategy_csv",
    "strategy_markdown",
    "strategy_rows",
    "summarise",
    "targets_in_view",
    "track_recording",
    "trajectory_errors",
]
