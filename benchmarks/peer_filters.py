"""Filters of other libraries on scans from a file; for the Python that they are installed for, without Vedette.

    PYTHON benchmarks/peer_filters.py OPTIONS SCANS.npz FOUND.npz    # as `benchmarks/peers.py` calls it

`SCANS.npz` holds an array of positions for each step and sensor, named STEP_SENSOR. `FOUND.npz` gets the names of the
filters and of each the CPU seconds of its steps and the estimated positions after each. A run ends after a step that
takes longer than the patience.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

# As in `vedette.scenarios.GeneratedCrowd` and in `benchmarks/peers.py`.
CROWD = {"deviation": 5.0, "detection": 0.95, "survival": 0.99, "acceleration": 0.3, "clutter": 0.3, "speed": 3.0}
BOX = {"deviation": 1.0, "detection": 0.98, "survival": 0.99, "acceleration": 3.0, "clutter": 1.0, "speed": 10.0}
# Of a birth at a measurement of the scan before, in the crowd: the expected births are shared by all measurements.
BIRTHS, MOST_EXISTENCE = 0.02, 0.03

Step = Callable[[Sequence[np.ndarray], int], tuple[float, np.ndarray]]


def motion_noise(acceleration: float) -> np.ndarray:
    """Of (px, py, vx, vy) over 1 s: an acceleration that is constant over the second."""
    gain = np.array([[0.5, 0.0], [0.0, 0.5], [1.0, 0.0], [0.0, 1.0]])
    return acceleration**2 * gain @ gain.T


TRANSITION = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
POSITION = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0]])


def birth_covariance(about: dict[str, float]) -> np.ndarray:
    return np.diag([about["deviation"] ** 2] * 2 + [about["speed"] ** 2] * 2)


# Rust


def rust(options: dict[str, Any]) -> Iterator[tuple[str, Callable[[], Step]]]:
    """LMB filters; of the crowd with births put among its tracks from outside, as it takes fixed places alone."""
    import multisensor_lmb_filters_rs as peer

    crowded = options["scene"] == "crowd"
    about, half = (CROWD if crowded else BOX), options["half"]
    clutter = about["clutter"] * options["number"] if crowded else about["clutter"]
    motion = peer.MotionModel(TRANSITION, motion_noise(about["acceleration"]), np.zeros(4), about["survival"])
    noise = about["deviation"] ** 2 * np.eye(2)
    sensor = peer.SensorModel(POSITION, noise, about["detection"], clutter, (2.0 * half) ** 2)
    grid = [] if crowded else [(x, y) for x in (-75.0, -25.0, 25.0, 75.0) for y in (-75.0, -25.0, 25.0, 75.0)]
    covariance = np.diag([2500.0, 2500.0, 100.0, 100.0])
    places = [peer.BirthLocation(i, np.array([x, y, 0.0, 0.0]), covariance) for i, (x, y) in enumerate(grid)]
    births = peer.BirthModel(places, 0.01, 0.01)
    loopy = peer.AssociatorConfig.lbp(100, 1e-6)
    limits = peer.FilterThresholds(1e-4, 1e-4, 5, 3, 4.0) if crowded else peer.FilterThresholds(1e-3, 1e-4, 100, 3)
    if crowded:
        yield "LMB", lambda: _rust_crowd(peer, peer.FilterLmb(motion, sensor, births, loopy, limits, 0), about)
        return
    of_all = peer.SensorConfigMulti([sensor] * 8)
    for name, kind in (("GCI", peer.FilterGaLmb), ("sequential", peer.FilterIcLmb)):
        yield name, lambda kind=kind: _rust_box(kind(motion, of_all, births, loopy, limits, 0))  # type: ignore[misc]


def _rust_box(tracker: Any) -> Step:
    def step(scans: Sequence[np.ndarray], number: int) -> tuple[float, np.ndarray]:
        given = [list(scan) for scan in scans]
        start = time.process_time()
        found = tracker.step(given, number)
        return time.process_time() - start, np.array([track.mean[:2] for track in found]).reshape(-1, 2)

    return step


def _rust_crowd(peer: Any, tracker: Any, about: dict[str, float]) -> Step:
    covariance, before = [birth_covariance(about).tolist()], [np.empty((0, 2))]

    def step(scans: Sequence[np.ndarray], number: int) -> tuple[float, np.ndarray]:
        existence = min(MOST_EXISTENCE, BIRTHS * _expected(scans) / max(len(before[0]), 1))
        born = [
            peer._TrackData((number - 1, i), existence, [[*place.tolist(), 0.0, 0.0]], covariance, [1.0])
            for i, place in enumerate(before[0])
        ]
        tracker.set_tracks([*tracker.get_tracks(), *born])
        before[0], given = scans[0], list(scans[0])
        start = time.process_time()
        tracker.step(given, number)
        spent = time.process_time() - start
        # What it finds by itself, as many as are most probable, goes astray from about a hundred targets on.
        sure = [track for track in tracker.get_tracks() if track.existence > 0.5]
        return spent, np.array([track.mu[int(np.argmax(track.w))][:2] for track in sure]).reshape(-1, 2)

    return step


def _expected(scans: Sequence[np.ndarray]) -> float:
    """Targets behind a scan of a crowd: all but the false measurements."""
    return len(scans[0]) / (CROWD["detection"] + CROWD["clutter"])


# Stone Soup


def stone_soup(options: dict[str, Any]) -> Iterator[tuple[str, Callable[[], Step]]]:
    """Its GM-PHD filter, gated, with a birth component at each measurement of the scan before."""
    yield "GM-PHD", lambda: _gm_phd(options)


def _gm_phd(options: dict[str, Any]) -> Step:
    import datetime

    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.hypothesiser.gaussianmixture import GaussianMixtureHypothesiser
    from stonesoup.measures import Mahalanobis
    from stonesoup.mixturereducer.gaussianmixture import GaussianMixtureReducer
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import TaggedWeightedGaussianState
    from stonesoup.updater.kalman import KalmanUpdater
    from stonesoup.updater.pointprocess import PHDUpdater

    number, half = options["number"], options["half"]
    motion = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=TRANSITION, covariance_matrix=CovarianceMatrix(motion_noise(CROWD["acceleration"]))
    )
    measured = LinearGaussian(4, (0, 1), CovarianceMatrix(CROWD["deviation"] ** 2 * np.eye(2)))
    predictor, kalman = KalmanPredictor(motion), KalmanUpdater(measured)
    updater = PHDUpdater(
        kalman,
        clutter_spatial_density=CROWD["clutter"] * number / (2.0 * half) ** 2,
        prob_detection=CROWD["detection"],
        prob_survival=CROWD["survival"],
    )
    near = DistanceHypothesiser(predictor, kalman, Mahalanobis(), missed_distance=5.0)
    hypothesiser = GaussianMixtureHypothesiser(near, order_by_detection=True)
    reducer = GaussianMixtureReducer(prune_threshold=1e-4, pruning=True, merge_threshold=4.0, merging=True)
    began, covariance = datetime.datetime(2000, 1, 1), CovarianceMatrix(birth_covariance(CROWD))
    intensity: list[Any] = []
    before: list[np.ndarray] = [np.empty((0, 2))]

    def step(scans: Sequence[np.ndarray], order: int) -> tuple[float, np.ndarray]:
        now = began + datetime.timedelta(seconds=order)
        weight = BIRTHS * _expected(scans) / max(len(before[0]), 1)
        born = [
            TaggedWeightedGaussianState(
                StateVector([*place.tolist(), 0.0, 0.0]), covariance, weight=weight, tag=f"{order} {i}", timestamp=now
            )
            for i, place in enumerate(before[0])
        ]
        detections = {Detection(StateVector(place), timestamp=now, measurement_model=measured) for place in scans[0]}
        before[0] = scans[0]
        start = time.process_time()
        prior = [*intensity, *born]
        if prior and detections:
            updated = updater.update(hypothesiser.hypothesise(prior, detections, now))
            intensity[:] = reducer.reduce(updated)
        else:
            intensity[:] = prior
        spent = time.process_time() - start
        found = [np.asarray(part.state_vector, float).ravel()[:2] for part in intensity if float(part.weight) > 0.5]
        return spent, np.array(found).reshape(-1, 2)

    return step


PEERS = {"multisensor-lmb-filters-rs": rust, "Stone Soup": stone_soup}


def main() -> None:
    options = json.loads(sys.argv[1])
    with np.load(sys.argv[2]) as given:
        steps = 1 + max(int(name.split("_")[0]) for name in given)
        sensors = 1 + max(int(name.split("_")[1]) for name in given)
        scans = [[given[f"{k}_{s}"] for s in range(sensors)] for k in range(steps)]
    found: dict[str, Any] = {"names": []}
    for name, make in PEERS[options["peer"]](options):
        step, seconds = make(), []
        for k, of_all in enumerate(scans):
            spent, found[f"{name}_{k}"] = step(of_all, k + 1)
            seconds.append(spent)
            if spent > options["patience"]:
                break
        found["names"].append(name)
        found[f"{name}_seconds"] = np.array(seconds)
    np.savez(sys.argv[3], **found)


if __name__ == "__main__":
    main()
