"""All sensors' beliefs through time: each filters its own scans and they are fused, or one filter takes them all."""

from vedette.tracking.base import State, Tracker, TrackerInfo
from vedette.tracking.central import Central, CentralFilter
from vedette.tracking.distributed import Distributed
from vedette.tracking.stages import Stages, stage_of

__all__ = [
    "Central",
    "CentralFilter",
    "Distributed",
    "Stages",
    "State",
    "Tracker",
    "TrackerInfo",
    "stage_of",
]
