"""Trackers of all sensors: local filters with fusion, a central filter, a radio network; late scans, smoothing."""

from vedette.tracking.base import StageTimer, State, Tracker, TrackerInfo, failed_stage
from vedette.tracking.belief_network import BeliefNetwork
from vedette.tracking.central import Central, CentralFilter
from vedette.tracking.delays import Delay, DelayedScanTracker
from vedette.tracking.distributed import Distributed
from vedette.tracking.network import Network
from vedette.tracking.out_of_sequence import (
    OutOfSequenceInfo,
    OutOfSequenceTracker,
    SensorScan,
    Timeline,
    TimelineEntry,
)
from vedette.tracking.program import ProgramFilter
from vedette.tracking.scan_network import ScanNetwork
from vedette.tracking.smoothing import FixedLagSmoother, TraceEntry, smooth
from vedette.tracking.snapshots import load_snapshot, save_snapshot
from vedette.tracking.undetected import UndetectedTargetTracker
from vedette.tracking.views import ViewTracker

__all__ = [
    "BeliefNetwork",
    "Central",
    "CentralFilter",
    "Delay",
    "DelayedScanTracker",
    "Distributed",
    "FixedLagSmoother",
    "Network",
    "OutOfSequenceInfo",
    "OutOfSequenceTracker",
    "ProgramFilter",
    "ScanNetwork",
    "SensorScan",
    "StageTimer",
    "State",
    "Timeline",
    "TimelineEntry",
    "TraceEntry",
    "Tracker",
    "TrackerInfo",
    "UndetectedTargetTracker",
    "ViewTracker",
    "failed_stage",
    "load_snapshot",
    "save_snapshot",
    "smooth",
]
