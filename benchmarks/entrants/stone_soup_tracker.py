"""Stone Soup's trackers as an entrant; for the Python that `stonesoup` is installed for.

    vedette benchmark --tracker "stone-soup=PYTHON benchmarks/entrants/stone_soup_tracker.py gnn"

`gnn` (nearest neighbours, assigned in two dimensions) or `jpda`. Scans of several sensors are taken one after the other
at their time. Tracks begin with six measurements that fit and end three scans after the last: Stone Soup's trackers
know neither births nor where a sensor cannot see, so that a target out of view is missed as if it were in it. Targets
that turn are followed as if they went straight with more noise.
"""

from __future__ import annotations

import datetime
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from lines import Told, clutter_density, noise_std, place_of, serve
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeDeleter
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator, SimpleMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types.array import StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import ExtendedKalmanUpdater

BEGAN = datetime.datetime(2000, 1, 1)
PLACES, ORDER = (0, 2), [0, 2, 1, 3]  # of [px, vx, py, vy]; of [px, py, vx, vy] in it
TURNING = 8.0  # m/s^1.5, of targets that turn
POINTS, PATIENCE = 6, 3.0  # measurements that begin a track, scans without one that end it


def begin(told: Told) -> Callable[[Told], Told]:
    scene = told["scene"]
    period, motion = scene["time"]["step_period"], scene["motion"]
    noise = max(motion["sigma_v"], TURNING if motion["kind"] == "coordinated_turn" else 0.0) ** 2
    transition = CombinedLinearGaussianTransitionModel([ConstantVelocity(noise)] * 2)
    predictor, updater = ExtendedKalmanPredictor(transition), ExtendedKalmanUpdater(None)
    near = GNNWith2DAssignment(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3.0))
    birth = scene["birth"]
    speed = (birth["from_measurements"] or birth["sites"][0])["std"][2]
    spread = np.diag([0.0, speed**2, 0.0, speed**2])
    first = SimpleMeasurementInitiator(GaussianState(np.zeros((4, 1)), spread, timestamp=BEGAN), None)
    patience = UpdateTimeDeleter(datetime.timedelta(seconds=PATIENCE * period + 1e-3))
    early = UpdateTimeDeleter(datetime.timedelta(seconds=1.5 * period))
    initiator = MultiMeasurementInitiator(None, early, near, updater, initiator=first, min_points=POINTS)
    tracks: set[Any] = set()

    def associator(sensor: Told) -> Any:
        if sys.argv[1:] != ["jpda"]:
            return near
        density = clutter_density(sensor, scene["region"])
        seen = sensor["detection"].get("probability", 0.95)
        return JPDA(PDAHypothesiser(predictor, updater, clutter_spatial_density=density, prob_detect=min(seen, 0.99)))

    def step(asked: Told) -> Told:
        now = BEGAN + datetime.timedelta(seconds=asked["time"])
        for sensor, scan in zip(scene["sensors"], asked["scans"], strict=True):
            if scan is None:
                continue
            found = {detection(sensor, scan["pose"], row, now) for row in scan["measurements"]}
            taken = set()
            for track, hypotheses in associator(sensor).associate(tracks, found, now).items():
                taken |= append(track, hypotheses, updater)
            tracks.update(initiator.initiate(found - taken, now))
        tracks.difference_update(patience.delete_tracks(tracks))
        return {"estimates": [told_of(track) for track in tracks]}

    return step


def detection(sensor: Told, pose: list[float], row: list[float], now: datetime.datetime) -> Any:
    """A measurement with the model of where it was taken."""
    noise = np.diag(np.square(noise_std(sensor, pose, place_of(sensor, pose, row))))
    if sensor["measurement"]["kind"] == "position":
        model: Any = LinearGaussian(4, PLACES, noise)
    else:
        model = CartesianToBearingRange(4, PLACES, noise, translation_offset=np.array(pose[:2]).reshape(2, 1))
    return Detection(np.array(row).reshape(2, 1), timestamp=now, measurement_model=model)


def append(track: Any, hypotheses: Any, updater: Any) -> set[Any]:
    """Take a track on by its association: one measurement, or many with their probabilities; returns those taken."""
    if hasattr(hypotheses, "measurement"):
        track.append(updater.update(hypotheses) if hypotheses else hypotheses.prediction)
        return {hypotheses.measurement} if hypotheses else set()
    states = [updater.update(each) if each else each.prediction for each in hypotheses]
    weights = np.array([float(each.probability) for each in hypotheses])
    means = StateVectors([state.state_vector for state in states])
    mean, cov = gm_reduce_single(means, np.stack([state.covar for state in states], axis=2), weights)
    seen = [each for each in hypotheses if each]
    if seen:
        track.append(GaussianStateUpdate(mean, cov, hypotheses, seen[0].measurement.timestamp))
    else:
        track.append(states[0])
    likely = max(hypotheses, key=lambda each: float(each.probability))
    return {each.measurement for each in seen} if likely else set()


def told_of(track: Any) -> Told:
    mean, cov = np.asarray(track.mean, float).ravel()[ORDER], np.asarray(track.covar, float)[np.ix_(ORDER, ORDER)]
    return {"state": mean.tolist(), "cov": cov.tolist(), "label": track.id}


if __name__ == "__main__":
    serve(begin)
