"""Recorded data: reports of targets and their cleaning, scans of sensors, longitude and latitude."""

from vedette.recorded.cleaning import Cleaning, CleaningCounts, RecordedTrack
from vedette.recorded.conventions import Conventions
from vedette.recorded.detections import table_of_detections
from vedette.recorded.geography import Origin
from vedette.recorded.instants import RecordedScans, Site, without_biases
from vedette.recorded.scans import parse_scans
from vedette.recorded.tables import read_table, table_of
from vedette.recorded.targets import RecordedTargets
from vedette.recorded.tracking import Tracking

__all__ = [
    "Cleaning",
    "CleaningCounts",
    "Conventions",
    "Origin",
    "RecordedScans",
    "RecordedTargets",
    "RecordedTrack",
    "Site",
    "Tracking",
    "parse_scans",
    "read_table",
    "table_of",
    "table_of_detections",
    "without_biases",
]
