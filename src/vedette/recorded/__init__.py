"""Recorded data: reports of targets and their cleaning, scans of sensors, longitude and latitude."""

from vedette.recorded.cleaning import Cleaning, CleaningCounts, RecordedTrack
from vedette.recorded.conventions import Conventions
from vedette.recorded.detections import table_of_detections
from vedette.recorded.files import read_table
from vedette.recorded.geography import Origin
from vedette.recorded.scan_times import RecordedScans, RecordedSensor, remove_biases
from vedette.recorded.scans import parse_scans
from vedette.recorded.tables import as_table
from vedette.recorded.targets import RecordedTargets
from vedette.recorded.tracking import Tracking

__all__ = [
    "Cleaning",
    "CleaningCounts",
    "Conventions",
    "Origin",
    "RecordedScans",
    "RecordedSensor",
    "RecordedTargets",
    "RecordedTrack",
    "Tracking",
    "as_table",
    "parse_scans",
    "read_table",
    "remove_biases",
    "table_of_detections",
]
