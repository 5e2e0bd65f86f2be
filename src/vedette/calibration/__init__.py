"""What sensors are like, by their recorded scans alone: biases, noise, detection, clutter."""

from vedette.calibration.calibrating import Calibration, Found, calibrate
from vedette.calibration.drifting import BiasFollower, Followed, Window, calibrate_windows, starting_from
from vedette.calibration.parameters import Parameter, Problem

__all__ = [
    "BiasFollower",
    "Calibration",
    "Followed",
    "Found",
    "Parameter",
    "Problem",
    "Window",
    "calibrate",
    "calibrate_windows",
    "starting_from",
]
