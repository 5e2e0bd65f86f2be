"""Sensor calibration from recorded scans alone: biases, noise, detection, clutter."""

from vedette.calibration.bias_drift import (
    BiasEstimatorState,
    CalibrationWindow,
    OnlineBiasEstimator,
    calibrate_windows,
    warm_started,
)
from vedette.calibration.calibrating import Calibration, ParameterEstimate, calibrate
from vedette.calibration.parameters import Parameter, Problem

__all__ = [
    "BiasEstimatorState",
    "Calibration",
    "CalibrationWindow",
    "OnlineBiasEstimator",
    "Parameter",
    "ParameterEstimate",
    "Problem",
    "calibrate",
    "calibrate_windows",
    "warm_started",
]
