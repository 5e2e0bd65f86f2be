"""Stone Soup's trackers on the scans of several radars from a file; for the Python that it is installed for.

    PYTHON benchmarks/solent_peer.py SCANS.npz FOUND.npz    # as `benchmarks/solent.py` calls it

`SCANS.npz` holds `times` (s, of the steps), and of every scan in order of time `steps`, `poses` (x, y) and `noise`
(standard deviations of bearing, rad, and range, m), and its measurements as `scan_N`. `FOUND.npz` gets the `names` of
the trackers and of each the CPU `seconds` and the positions at each step as `NAME_STEP`, predicted from the last scan.
"""

from __future__ import annotations

import datetime
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator, SimpleMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.tracker.simple import MultiTargetMixtureTracker, MultiTargetTracker
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater

BEGAN = datetime.datetime(2016, 1, 12, 13, 32)
ACCELERATION, SPEED = 0.15, 5.0  # m/s^2 held over a second, m/s: as the scene tells our filters
DETECTION, CLUTTER, SIDE = 0.9, 5.0, 5000.0  # of the shore radar; m
PLACES = (0, 2)  # of the position in a state [px, vx, py, vy]
PATIENCE = datetime.timedelta(seconds=30)  # without a measurement a track ends

Scans = list[tuple[datetime.datetime, set[Any]]]


def detections(given: Any) -> Scans:
    """The scans, each measurement with the model of where it was taken."""
    found = []
    for n, step in enumerate(given["steps"].tolist()):
        now = BEGAN + datetime.timedelta(seconds=given["times"][step])
        model = CartesianToBearingRange(
            ndim_state=4,
            mapping=PLACES,
            noise_covar=np.diag(given["noise"][n] ** 2),
            translation_offset=given["poses"][n].reshape(2, 1),
        )
        rows = given[f"scan_{n}"]
        found.append((now, {Detection(row.reshape(2, 1), timestamp=now, measurement_model=model) for row in rows}))
    return found


def trackers(scans: Scans) -> Iterator[tuple[str, Any]]:
    """Two of them: nearest neighbours, and joint probabilities."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(ACCELERATION**2)] * 2)
    predictor, updater = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater(None)
    near = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4.0)
    nearest, deleter = GNNWith2DAssignment(near), UpdateTimeDeleter(PATIENCE)
    prior = GaussianState(np.zeros((4, 1)), np.diag([0.0, SPEED**2, 0.0, SPEED**2]), timestamp=BEGAN)

    def initiator() -> Any:
        first = SimpleMeasurementInitiator(prior, None)
        early = UpdateTimeDeleter(datetime.timedelta(seconds=12))
        return MultiMeasurementInitiator(prior, early, nearest, updater, initiator=first, min_points=5)

    yield "nearest neighbours", MultiTargetTracker(initiator(), deleter, scans, nearest, updater)
    likely = PDAHypothesiser(
        predictor, updater, clutter_spatial_density=CLUTTER / (2.0 * np.pi * SIDE), prob_detect=DETECTION
    )
    yield "JPDA", MultiTargetMixtureTracker(initiator(), deleter, scans, JPDA(likely), updater)


def positions(tracks: set[Any], now: datetime.datetime) -> np.ndarray:
    """(n, 2) of all tracks, moved on to a time by their velocities."""
    rows = []
    for track in tracks:
        x, vx, y, vy = np.asarray(track.state.mean, float).ravel()
        late = (now - track.state.timestamp).total_seconds()
        rows.append((x + late * vx, y + late * vy))
    return np.array(rows).reshape(-1, 2)


def main() -> None:
    found: dict[str, Any] = {"names": []}
    with np.load(sys.argv[1]) as given:
        scans, steps, times = detections(given), given["steps"].tolist(), given["times"].tolist()
    for name, tracker in trackers(scans):
        begun, at, tracks = time.process_time(), -1, set[Any]()
        for step, (_, current) in zip(steps, tracker, strict=True):
            for k in range(at + 1, step):  # between scans
                found[f"{name}_{k}"] = positions(tracks, BEGAN + datetime.timedelta(seconds=times[k]))
            tracks, at = set(current), step
            found[f"{name}_{at}"] = positions(tracks, BEGAN + datetime.timedelta(seconds=times[at]))
        for k in range(at + 1, len(times)):
            found[f"{name}_{k}"] = positions(tracks, BEGAN + datetime.timedelta(seconds=times[k]))
        found["names"].append(name)
        found[f"{name}_seconds"] = time.process_time() - begun
    np.savez(sys.argv[2], **found)


if __name__ == "__main__":
    main()
