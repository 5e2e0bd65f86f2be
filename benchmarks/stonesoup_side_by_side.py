"""Stone Soup's GNN and JPDA trackers beside ours, on detections of its own simulators, by its own metrics.

    python benchmarks/stonesoup_side_by_side.py [--runs N] [--steps N] [--clutter RATE] [--detection P] [--range]

`MultiTargetGroundTruthSimulator` and `SimpleDetectionSimulator` make the targets and the detections, positions or
(`--range`) bearings and ranges; all trackers get the same sets and models, of detection and clutter the same numbers.
Theirs start tracks with a `MultiMeasurementInitiator`, as their examples do. OSPA (50 m, order 1) is of `MultiManager`
and `OSPAMetric`: of whole tracks, with what they began with before they were confirmed, and of what a tracker said at
each time. Of the latter the median and the worst run, and the share of runs that end with a lost target, stand beside
it. The seconds are CPU time of the tracker alone. Prints the table of docs/stonesoup.md.
"""

from __future__ import annotations

import argparse
import datetime
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.gater.distance import DistanceGater
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator, SimpleMeasurementInitiator
from stonesoup.measures import Euclidean, Mahalanobis
from stonesoup.metricgenerator.manager import MultiManager
from stonesoup.metricgenerator.ospametric import OSPAMetric
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.simulator.simple import MultiTargetGroundTruthSimulator, SimpleDetectionSimulator
from stonesoup.tracker.simple import MultiTargetMixtureTracker, MultiTargetTracker
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from vedette.evaluation import gospa
from vedette.evaluation.tail_summary import summarise_tail, tail_header
from vedette.stonesoup import LabelledTracker, convert

START = datetime.datetime(2026, 1, 1)
SIDE, CUTOFF, SPEED = 1000.0, 50.0, 5.0  # m, m, m/s
PLACES = (0, 2)
Scans = list[tuple[datetime.datetime, set[Any]]]


class Scene(NamedTuple):
    """What all trackers are told, and the detections."""

    motion: Any
    measurement: Any
    detector: Any
    scans: Scans
    truths: set[Any]
    clutter: float  # detections a scan
    detection: float


def simulated(options: argparse.Namespace, seed: int) -> Scene:
    """A run of the simulators."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1)] * 2, seed=seed)
    kinds = (LinearGaussian, [10.0, 10.0], [[-SIDE, SIDE], [-SIDE, SIDE]])
    if options.range:
        kinds = (CartesianToBearingRange, [0.01, 10.0], [[-np.pi, np.pi], [0.0, 1.4 * SIDE]])
    kind, stds, bounds = kinds
    measurement = kind(ndim_state=4, mapping=PLACES, noise_covar=np.diag(np.square(stds)), seed=seed)
    spread = np.diag([(0.5 * SIDE) ** 2, SPEED**2, (0.5 * SIDE) ** 2, SPEED**2])
    truth = MultiTargetGroundTruthSimulator(
        motion,
        GaussianState(np.zeros((4, 1)), spread, timestamp=START),
        number_steps=options.steps,
        birth_rate=0.1,
        death_probability=0.01,
        initial_number_targets=8,
        seed=seed,
    )
    detector = SimpleDetectionSimulator(
        truth, measurement, np.array(bounds), options.detection, options.clutter, seed=seed + 10_000
    )
    scans, truths = [], set()
    for now, found in detector:
        scans.append((now, set(found)))
        truths |= set(truth.groundtruth_paths)
    return Scene(motion, measurement, detector, scans, truths, options.clutter, options.detection)


def prior() -> Any:
    """Of a new track: where it was measured, at rest within the spread of speeds."""
    return GaussianState(np.zeros((4, 1)), np.diag([400.0, SPEED**2, 400.0, SPEED**2]), timestamp=START)


def theirs(scene: Scene, joint: bool) -> Any:
    """One of Stone Soup's trackers."""
    predictor, updater = ExtendedKalmanPredictor(scene.motion), ExtendedKalmanUpdater(scene.measurement)
    near = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4.0)
    nearest, deleter = GNNWith2DAssignment(near), UpdateTimeStepsDeleter(3)
    first = SimpleMeasurementInitiator(prior(), scene.measurement)
    start = MultiMeasurementInitiator(
        prior(), UpdateTimeStepsDeleter(2), nearest, updater, scene.measurement, initiator=first, min_points=3
    )
    if not joint:
        return MultiTargetTracker(start, deleter, scene.scans, nearest, updater)
    likely = PDAHypothesiser(predictor, updater, float(scene.detector.clutter_spatial_density), scene.detection)
    gated = DistanceGater(likely, Mahalanobis(), gate_threshold=4.0)
    return MultiTargetMixtureTracker(start, deleter, scene.scans, JPDA(gated), updater)


def ours(scene: Scene, kind: Any) -> Any:
    """Our tracker of a kind of filter, told the same."""
    models = convert(
        scene.motion,
        [scene.measurement],
        births=prior(),
        clutter=scene.detector,
        prob_detection=scene.detection,
        prob_survival=0.99,
    )
    return LabelledTracker(scene.scans, models, models.tracker(kind))


TRACKERS: dict[str, Callable[[Scene], Any]] = {
    "Stone Soup, GNN": lambda scene: theirs(scene, False),
    "Stone Soup, JPDA": lambda scene: theirs(scene, True),
    "Vedette, LMB": lambda scene: ours(scene, "lmb"),
    "Vedette, GLMB": lambda scene: ours(scene, "glmb"),
}


def scored(scene: Scene, tracker: Any) -> tuple[float, float, float, float]:
    """Mean OSPA of whole tracks and of what was said at the time; 1 if a target is lost at the end, else 0; CPU s."""
    begun, tracks, said = time.process_time(), set[Any](), dict[str, Track]()
    for now, current in tracker:
        tracks |= current
        for track in current:
            if track[-1].timestamp == now:
                said.setdefault(track.id, Track(id=track.id)).append(track[-1])
    seconds = time.process_time() - begun
    latest = set(said.values())
    return ospa_of(scene, tracks), ospa_of(scene, latest), ends_lost(scene, latest), seconds


def ends_lost(scene: Scene, tracks: set[Any]) -> float:
    """1 if a target of the last scan has no track within the cutoff, else 0."""
    end = scene.scans[-1][0]
    found, true = (
        np.array([path[-1].state_vector[PLACES, 0] for path in paths if path[-1].timestamp == end], float).reshape(
            -1, 2
        )
        for paths in (tracks, scene.truths)
    )
    return float(gospa(found, true, cutoff=CUTOFF, order=1.0).num_missed > 0)


def ospa_of(scene: Scene, tracks: set[Any]) -> float:
    """By Stone Soup's metric manager."""
    metric = OSPAMetric(p=1, c=CUTOFF, tracks_key="tracks", truths_key="truths", measure=Euclidean(PLACES))
    manager = MultiManager([metric])
    manager.add_data({"tracks": tracks, "truths": scene.truths})
    values = [one.value for one in manager.generate_metrics()[metric.generator_name]["OSPA distances"].value]
    return float(np.mean(values))


def rows(options: argparse.Namespace) -> Iterator[str]:
    """Of the table, one a tracker: OSPA of both kinds; the tail of the second, its difference from GNN; ms a scan."""
    found: dict[str, list[tuple[float, float, float, float]]] = {name: [] for name in TRACKERS}
    for seed in range(-1, options.runs):  # the first is to load what is compiled
        scene = simulated(options, seed + 1)
        for name, tracker in TRACKERS.items():
            if seed < 0 and not name.startswith("Vedette"):
                continue
            one = scored(scene, tracker(scene))
            if seed >= 0:
                found[name].append(one)
    names = [
        "OSPA of whole tracks (m)",
        "OSPA at the time (m)",
        *tail_header("m"),
        "less than GNN (m)",
        "CPU, ms per scan",
    ]
    yield "| tracker | " + " | ".join(names) + " |"
    yield "| --- |" + " ---: |" * len(names)
    base = np.array(found["Stone Soup, GNN"])[:, 1]
    for name, each in found.items():
        whole, now, lost, seconds = np.array(each).T
        cells = [_with_error(whole), _with_error(now), *summarise_tail(now, lost).cells(), _with_error(base - now)]
        yield f"| {name} | {' | '.join(cells)} | {1e3 * seconds.mean() / options.steps:.2f} |"


def _with_error(values: np.ndarray) -> str:
    return f"{values.mean():.2f} ± {np.std(values, ddof=1) / np.sqrt(len(values)):.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--clutter", type=float, default=10.0, help="detections a scan")
    parser.add_argument("--detection", type=float, default=0.9, help="probability of detection")
    parser.add_argument("--range", action="store_true", help="bearings and ranges in place of positions")
    for line in rows(parser.parse_args()):
        print(line, flush=True)


if __name__ == "__main__":
    main()
