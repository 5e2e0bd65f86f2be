"""A scene of Stone Soup's own simulators, and what converts it."""

from __future__ import annotations

import datetime
from typing import Any

import numpy as np
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.simulator.simple import MultiTargetGroundTruthSimulator, SimpleDetectionSimulator
from stonesoup.types.state import GaussianState

from vedette.stonesoup import ConvertedModels, convert

START = datetime.datetime(2026, 1, 1)
SECOND = datetime.timedelta(seconds=1)
MOTION = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.05)] * 2)
MEASUREMENT = LinearGaussian(4, (0, 2), np.diag([25.0, 25.0]))
PRIOR = GaussianState([0.0] * 4, np.diag([100.0, 20.0, 100.0, 20.0]))


def simulated(num_steps: int = 30, seed: int = 2) -> tuple[Any, Any, ConvertedModels]:
    """Truth, detector and models of some targets in clutter; the same for a seed."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.05)] * 2, seed=seed)
    measurement = LinearGaussian(4, (0, 2), np.diag([25.0, 25.0]), seed=seed)
    truth = MultiTargetGroundTruthSimulator(
        motion,
        GaussianState([0.0] * 4, np.diag([1e4, 10.0, 1e4, 10.0]), timestamp=START),
        timestep=SECOND,
        number_steps=num_steps,
        birth_rate=0.1,
        death_probability=0.01,
        initial_number_targets=4,
        seed=seed,
    )
    bounds = np.array([[-1500.0, 1500.0], [-1500.0, 1500.0]])
    detector = SimpleDetectionSimulator(truth, measurement, bounds, clutter_rate=5.0, seed=seed + 1)
    return truth, detector, convert(motion, [measurement], births=PRIOR, clutter=detector)
