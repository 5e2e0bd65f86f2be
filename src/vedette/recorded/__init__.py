"""Targets recorded in the world: readers of reports, their cleaning, longitude and latitude."""

from vedette.recorded.cleaning import Cleaning, CleaningCounts, RecordedTrack
from vedette.recorded.geography import Origin
from vedette.recorded.targets import RecordedTargets

__all__ = ["Cleaning", "CleaningCounts", "Origin", "RecordedTargets", "RecordedTrack"]
