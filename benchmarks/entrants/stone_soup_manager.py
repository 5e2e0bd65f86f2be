"""Stone Soup's sensor managers with its reward of uncertainty as an entrant; for the Python that has `stonesoup`.

    vedette benchmark --planner "stone-soup=PYTHON benchmarks/entrants/stone_soup_manager.py" --timeout 60

Every joint action by `BruteForceSensorManager` where there are few, otherwise `GreedySensorManager`, each sensor by
itself. The reward is how much a measurement at the end of the horizon takes off the covariances of the tracks that are
then in view; it knows no births, no missed detections, and no track that may not exist.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from lines import Told, noise_std, sees, serve
from stonesoup.base import Property
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.sensor.sensor import Sensor
from stonesoup.sensormanager.action import Action
from stonesoup.sensormanager.base import BruteForceSensorManager, GreedySensorManager
from stonesoup.sensormanager.reward import UncertaintyRewardFunction
from stonesoup.types.detection import TrueDetection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import ExtendedKalmanUpdater

BEGAN = datetime.datetime(2000, 1, 1)
PLACES, ORDER = (0, 2), [0, 2, 1, 3]
MOST_JOINT = 100


class Course(Action):
    """One of the courses that the scene offers; `target_value` is its number."""


class Listed(Sensor):
    """A sensor whose actions are the courses of a list."""

    about: dict = Property(doc="what the scene says of it")
    ends: list = Property(doc="poses at the ends of its courses")
    allowed: list = Property(doc="which of them it may take")
    taken: int = Property(default=0, doc="the course that it takes")

    def actions(self, timestamp: Any, start_timestamp: Any = None) -> Any:
        return [[Course(end_time=timestamp, target_value=k) for k, may in enumerate(self.allowed) if may]]

    def add_actions(self, actions: Any) -> bool:
        self.taken = actions[0].target_value
        return True

    def act(self, timestamp: Any, **kwargs: Any) -> None:
        self.timestamp = timestamp

    def __deepcopy__(self, memo: Any) -> Listed:
        return Listed(self.about, self.ends, self.allowed, self.taken)

    @property
    def measurement_model(self) -> Any:
        return self._model([0.0, 0.0])

    def _model(self, place: list[float]) -> Any:
        pose = self.ends[self.taken]
        noise = np.diag(np.square(noise_std(self.about, pose, place)))
        if self.about["measurement"]["kind"] == "position":
            return LinearGaussian(4, PLACES, noise)
        return CartesianToBearingRange(4, PLACES, noise, translation_offset=np.array(pose[:2]).reshape(2, 1))

    def measure(self, ground_truths: Any, noise: Any = True, **kwargs: Any) -> Any:
        found = set()
        for truth in ground_truths:
            place = [float(truth.state_vector[0, 0]), float(truth.state_vector[2, 0])]
            if sees(self.about, self.ends[self.taken], place):
                model = self._model(place)
                measured = model.function(truth, noise=False)
                found.add(
                    TrueDetection(measured, timestamp=truth.timestamp, measurement_model=model, groundtruth_path=truth)
                )
        return found


def begin(told: Told) -> Callable[[Told], Told]:
    scene = told["scene"]
    horizon = scene["horizon"][0] * scene["horizon"][1]
    transition = CombinedLinearGaussianTransitionModel([ConstantVelocity(scene["motion"]["sigma_v"] ** 2)] * 2)
    reward = UncertaintyRewardFunction(ExtendedKalmanPredictor(transition), ExtendedKalmanUpdater(None))
    asked_for = [0]

    def counted(*config: Any) -> float:
        asked_for[0] += 1
        return float(reward(*config))

    def plan(asked: Told) -> Told:
        now = BEGAN + datetime.timedelta(seconds=asked["time"])
        tracks = {track_of(each, now) for each in asked["estimates"]}
        sensors = [
            Listed(about, [course[-1] for course in own["courses"]], own["allowed"])
            for about, own in zip(scene["sensors"], asked["sensors"], strict=True)
        ]
        few = math.prod(len(own["courses"]) for own in asked["sensors"]) <= MOST_JOINT
        manager = (BruteForceSensorManager if few else GreedySensorManager)(set(sensors), reward_function=counted)
        for sensor in sensors:
            sensor.timestamp = now
        asked_for[0] = 0
        (chosen,) = manager.choose_actions(tracks, now + datetime.timedelta(seconds=horizon))
        numbers = [chosen[sensor][0].target_value for sensor in sensors]
        return {"actions": numbers, "counts": {"rewards": asked_for[0]}}

    return plan


def track_of(told: Told, now: datetime.datetime) -> Any:
    mean, cov = np.array(told["mean"])[ORDER].reshape(4, 1), np.array(told["cov"])[np.ix_(ORDER, ORDER)]
    return Track([GaussianState(mean, cov, timestamp=now)])


if __name__ == "__main__":
    serve(begin)
