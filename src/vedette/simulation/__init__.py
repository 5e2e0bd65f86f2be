"""The world that the program does not get to see: truth, platforms, scans, and the loop."""

from vedette.simulation.cleaning import Cleaning, CleaningCounts, RecordedTrack
from vedette.simulation.recorded import RecordedTargets
from vedette.simulation.scans import CLUTTER, Scan, simulate_scan
from vedette.simulation.truth import ScriptedTargets, TargetSource, Truth

__all__ = [
    "CLUTTER",
    "Cleaning",
    "CleaningCounts",
    "RecordedTargets",
    "RecordedTrack",
    "Scan",
    "ScriptedTargets",
    "TargetSource",
    "Truth",
    "simulate_scan",
]
