"""A Stone Soup tracker and sensor manager based on Vedette. It converts Stone Soup models, scans and truth."""

from vedette.internal.extras import require_packages

require_packages("vedette.stonesoup", "stonesoup")

from vedette.stonesoup.converting import ConvertedModels, convert
from vedette.stonesoup.manager import PlanningSensorManager
from vedette.stonesoup.motions import StateLayout, convert_modes, convert_motion
from vedette.stonesoup.scans import ScanConverter, convert_truth
from vedette.stonesoup.sensors import (
    convert_clutter,
    convert_detection,
    convert_measurement,
    convert_noise,
    convert_pose,
)
from vedette.stonesoup.tracker import LabelledTracker

__all__ = [
    "ConvertedModels",
    "LabelledTracker",
    "PlanningSensorManager",
    "ScanConverter",
    "StateLayout",
    "convert",
    "convert_clutter",
    "convert_detection",
    "convert_measurement",
    "convert_modes",
    "convert_motion",
    "convert_noise",
    "convert_pose",
    "convert_truth",
]
