"""Metrics of estimates against the truth: distances between sets of points and of tracks, breaks, consistency."""

from vedette.evaluation.metrics.consistency import AverageNees, average_nees, nees, nees_interval
from vedette.evaluation.metrics.matching import Matching, match_run
from vedette.evaluation.metrics.point_gospa import GospaResult, GospaSeries, gospa, gospa_distance, gospa_of_run
from vedette.evaluation.metrics.point_ospa import OspaResult, ospa, ospa_of_run
from vedette.evaluation.metrics.run import Metric, RunMetrics, measure
from vedette.evaluation.metrics.serialization import decode_metrics, encode_metrics, has_metrics
from vedette.evaluation.metrics.time_to_track import TimeToTrack
from vedette.evaluation.metrics.track_ospa import TrackSet, ospa2, ospa2_of_run
from vedette.evaluation.metrics.tracked_fraction import TrackedFraction, targets_in_view
from vedette.evaluation.metrics.trajectories import Continuity, continuity, continuity_of_run

__all__ = [
    "AverageNees",
    "Continuity",
    "GospaResult",
    "GospaSeries",
    "Matching",
    "Metric",
    "OspaResult",
    "RunMetrics",
    "TimeToTrack",
    "TrackSet",
    "TrackedFraction",
    "average_nees",
    "continuity",
    "continuity_of_run",
    "decode_metrics",
    "encode_metrics",
    "gospa",
    "gospa_distance",
    "gospa_of_run",
    "has_metrics",
    "match_run",
    "measure",
    "nees",
    "nees_interval",
    "ospa",
    "ospa2",
    "ospa2_of_run",
    "ospa_of_run",
    "targets_in_view",
]
