"""A tracker and a sensor manager of Stone Soup's kinds on what is here; its models, scans and truth converted."""

from vedette.internal.extras import require_packages

require_packages("vedette.stonesoup", "stonesoup")

from vedette.stonesoup.converting import Converted, convert
from vedette.stonesoup.manager import PlanningSensorManager
from vedette.stonesoup.motions import Layout, motion_of
from vedette.stonesoup.scans import ScansOf, truth_of
from vedette.stonesoup.sensors import clutter_of, detection_of, measurement_of, noise_of, pose_of
from vedette.stonesoup.tracker import LabelledTracker

__all__ = [
    "Converted",
    "LabelledTracker",
    "Layout",
    "PlanningSensorManager",
    "ScansOf",
    "clutter_of",
    "convert",
    "detection_of",
    "measurement_of",
    "motion_of",
    "noise_of",
    "pose_of",
    "truth_of",
]
