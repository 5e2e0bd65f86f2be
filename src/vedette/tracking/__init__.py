"""Trackers of all sensors: local filters with fusion, one central filter, or a radio network; late scans; snapshots."""

from vedette.tracking.base import Stages, State, Tracker, TrackerInfo, stage_of
from vedette.tracking.belief_network import BeliefNetwork
from vedette.tracking.central import Central, CentralFilter
from vedette.tracking.delayed import Delay, Delayed
from vedette.tracking.distributed import Distributed
from vedette.tracking.late import Instant, LateInfo, LateScans, SensorScan, Timeline
from vedette.tracking.network import Network
from vedette.tracking.program import ProgramFilter
from vedette.tracking.scan_network import ScanNetwork
from vedette.tracking.searching import Searching
from vedette.tracking.snapshots import load_snapshot, save_snapshot

__all__ = [
    "BeliefNetwork",
    "Central",
    "CentralFilter",
    "Delay",
    "Delayed",
    "Distributed",
    "Instant",
    "LateInfo",
    "LateScans",
    "Network",
    "ProgramFilter",
    "ScanNetwork",
    "Searching",
    "SensorScan",
    "Stages",
    "State",
    "Timeline",
    "Tracker",
    "TrackerInfo",
    "load_snapshot",
    "save_snapshot",
    "stage_of",
]
