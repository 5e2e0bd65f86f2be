"""What sensors are like, by their recorded scans alone: biases, noise, detection, clutter."""

from vedette.calibration.calibrating import Calibration, Found, calibrate
from vedette.calibration.parameters import Parameter, Problem

__all__ = ["Calibration", "Found", "Parameter", "Problem", "calibrate"]
