"""The tracker in Stone Soup's own machinery: its Kalman filter, metric manager and plotter."""

from __future__ import annotations

import datetime
import itertools
import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stonesoup")

from stonesoup.dataassociator.neighbour import NearestNeighbour
from stonesoup.dataassociator.tracktotrack import TrackToTruth
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.measures import Euclidean, Mahalanobis
from stonesoup.metricgenerator.manager import MultiManager
from stonesoup.metricgenerator.ospametric import OSPAMetric
from stonesoup.metricgenerator.tracktotruthmetrics import SIAPMetrics
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import KnownTurnRate
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection, MissedDetection
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.types.state import GaussianState, StateVector
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

from stone_soup_scene import MEASUREMENT, MOTION, PRIOR, SECOND, START, simulated
from vedette.errors import InputError
from vedette.evaluation import ospa
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.models import BirthModel, measurement_space_clutter
from vedette.recorded import Conventions, RecordedSensor, parse_scans, table_of_detections
from vedette.stonesoup import LabelledTracker, ScanConverter, convert, convert_modes, convert_truth
from vedette.tracking import Distributed

BOX = measurement_space_clutter(1e-6, [-1e4, -1e4], [1e4, 1e4])
SITE = GaussianState([50.0, 1.0, -20.0, -2.0], np.diag([400.0, 9.0, 400.0, 9.0]))
BORN = BirthModel(
    np.array([0.9]),
    np.array([[50.0, -20.0, 1.0, -2.0]]),
    np.array([np.diag([400.0, 400.0, 9.0, 9.0])]),
    frozenset({1}),
)


def of_one_target(num_scans: int) -> list[tuple[datetime.datetime, set[Any]]]:
    rng, state, found = np.random.default_rng(4), np.array([60.0, 2.0, -10.0, -1.0]), []
    for k in range(num_scans):
        now = START + k * 1.5 * SECOND
        place = state[[0, 2]] + rng.normal(size=2) * 5.0
        found.append((now, {Detection(StateVector(place), timestamp=now, measurement_model=MEASUREMENT)}))
        state = state + 1.5 * np.array([state[1], 0.0, state[3], 0.0])
    return found


def test_one_target_is_tracked_as_by_their_kalman_filter() -> None:
    scans = of_one_target(25)
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX, prob_detection=1.0, prob_survival=1.0)
    ours = LabelledTracker(scans, models)
    predictor, updater = KalmanPredictor(MOTION), KalmanUpdater(MEASUREMENT)
    associator = NearestNeighbour(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=1e3))
    theirs = Track([GaussianState(SITE.mean, SITE.covar, timestamp=START)])
    track = None
    for (_, tracks), (now, found) in zip(ours, scans, strict=True):
        hypothesis = associator.associate({theirs}, found, now)[theirs]
        theirs.append(updater.update(hypothesis))
        track = next(iter(tracks))
        np.testing.assert_allclose(np.asarray(track.mean, float), np.asarray(theirs.mean, float), atol=1e-9)
        np.testing.assert_allclose(track.covar, theirs.covar, atol=1e-9)
        assert track[-1].hypothesis.measurement is next(iter(found))
        if len(track) > 1:
            prediction = track[-1].hypothesis.prediction
            np.testing.assert_allclose(np.asarray(prediction.mean, float), hypothesis.prediction.mean, atol=1e-9)
            np.testing.assert_allclose(prediction.covar, hypothesis.prediction.covar, atol=1e-9)
    assert track is not None
    assert (track.id, len(track)) == ("1.0", 25)
    assert track[0].hypothesis.prediction is None
    assert isinstance(track[-1], GaussianStateUpdate)
    assert isinstance(track[-1].hypothesis.prediction, GaussianStatePrediction)


def test_a_track_has_the_probabilities_of_its_modes() -> None:
    modes = convert_modes(
        [MOTION, KnownTurnRate(np.array([2.0, 2.0]), math.radians(20.0))], stay_s=[40.0, 10.0], names=("cruise", "left")
    )
    scans, state = [], np.array([60.0, 8.0, -10.0, 0.0])
    for k in range(30):
        place = state[[0, 2]] + np.random.default_rng(k).normal(size=2)
        now = START + k * SECOND
        scans.append((now, {Detection(StateVector(place), timestamp=now, measurement_model=MEASUREMENT)}))
        turn = math.radians(20.0) if k >= 15 else 0.0
        vx, vy = state[1], state[3]
        vx, vy = vx * math.cos(turn) - vy * math.sin(turn), vx * math.sin(turn) + vy * math.cos(turn)
        state = np.array([state[0] + vx, vx, state[2] + vy, vy])
    models = convert(modes, [MEASUREMENT], births=BORN, clutter=BOX, prob_detection=1.0, prob_survival=1.0)
    turning = []
    for _, (track,) in LabelledTracker(scans, models):
        assert set(track.metadata["modes"]) == {"cruise", "left"}
        turning.append(track.metadata["modes"]["left"])
    assert turning[0] == 0.0  # not drawn yet
    assert max(turning[5:15]) < 0.5
    assert turning[-1] > 0.7


@pytest.mark.parametrize("kind", ["lmb", "glmb"])
def test_their_metric_manager_and_plotter_take_the_tracks(kind: Any) -> None:
    truth, detector, models = simulated()
    tracker, tracks, times, counts = LabelledTracker(detector, models, models.tracker(kind)), set(), [], []
    there: set[Any] = set()
    for time, current in tracker:
        tracks |= current
        there |= set(truth.groundtruth_paths)
        times.append(time)
        counts.append(len(current))
        assert current == tracker.tracks
        assert all(0.1 < track.metadata["existence"] <= 1.0 for track in current)
    assert len({track.id for track in tracks}) == len(tracks)
    measured = OSPAMetric(p=1, c=50.0, tracks_key="tracks", truths_key="truths", measure=Euclidean([0, 2]))
    siap = SIAPMetrics(
        position_measure=Euclidean((0, 2)),
        velocity_measure=Euclidean((1, 3)),
        generator_name="siap",
        tracks_key="tracks",
        truths_key="truths",
    )
    manager = MultiManager([measured, siap], TrackToTruth(association_threshold=30.0))
    manager.add_data({"tracks": tracks, "truths": there})
    made = manager.generate_metrics()
    by_time = made[measured.generator_name]["OSPA distances"].value
    assert len(by_time) == len(times)
    assert 0.0 < np.mean([metric.value for metric in by_time[5:]]) < 15.0
    assert made["siap"]["SIAP Completeness"].value > 0.9

    # OSPA of this library, of what `convert_truth` and the tracks say, is the same.
    ours = convert_truth(there, times, models.layout)
    for k, time in enumerate(times):
        _, states = ours.at(k)
        found = [track[time].state_vector for track in tracks if any(state.timestamp == time for state in track)]
        places = models.layout.states(np.array(found, float).reshape(-1, 4))[:, :2]
        assert ospa(places, states[:, :2], cutoff=50.0, order=1).total == pytest.approx(by_time[k].value, abs=1e-9)


def test_their_plotters_draw_the_tracks() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from stonesoup.plotter import Plotter, Plotterly

    _, detector, models = simulated(10)
    tracks = set().union(*(current for _, current in LabelledTracker(detector, models)))
    plotter = Plotter()
    plotter.plot_tracks(tracks, [0, 2], uncertainty=True)
    assert len(plotter.ax.lines) >= len(tracks)
    matplotlib.pyplot.close(plotter.fig)
    page = Plotterly()
    page.plot_tracks(tracks, [0, 2])
    assert len(page.fig.data) >= len(tracks)


def test_two_radars_by_their_names_or_models() -> None:
    """Each sees one target from its own side; scans come together, by names, or one by one, by their models."""
    places = {"west": (-400.0, 0.0), "south": (50.0, -500.0)}
    radars = {
        name: CartesianToBearingRange(
            4,
            (0, 2),
            np.diag([0.01**2, 5.0**2]),
            translation_offset=np.array([[x], [y]]),
            rotation_offset=StateVector([[0.0], [0.0], [turn]]),
        )
        for (name, (x, y)), turn in zip(places.items(), (2.0, -1.0), strict=True)
    }
    clutter = measurement_space_clutter(1e-6, [-math.pi, 0.0], [math.pi, 3e3], angular=[True, False])
    models = convert(MOTION, radars, births=BORN, clutter=clutter, prob_detection=0.99)
    together, apart = [], []
    for k, (now, found) in enumerate(of_one_target(12)):
        state = next(iter(found)).state_vector
        both = set()
        for name, radar in radars.items():
            whole = GaussianState([state[0], 0.0, state[1], 0.0], np.eye(4))
            seen = Detection(radar.function(whole, noise=False), timestamp=now, measurement_model=radar)
            apart.append((now, {seen}))
            both.add(Detection(seen.state_vector, timestamp=now, metadata={"sensor": name}))
        together.append((now, both))
        assert k == len(together) - 1
    ends = []
    for given, every in ((together, True), (apart, False)):
        tracker = LabelledTracker(given, models, every_sensor_scans=every)
        *_, (_, tracks) = tracker
        (track,) = tracks
        assert len(track) == 12
        ends.append(track)
    np.testing.assert_allclose(np.asarray(ends[1].mean, float), np.asarray(ends[0].mean, float), atol=0.5)
    fused = models.tracker("lmb", fusion=ParallelUpdate(), feedback=True)
    assert isinstance(fused, Distributed)
    *_, (_, tracks) = LabelledTracker(together, models, fused)
    (track,) = tracks
    np.testing.assert_allclose(np.asarray(track.mean, float), np.asarray(ends[0].mean, float), atol=0.5)


def test_scans_are_those_of_the_table_of_detections() -> None:
    radar = CartesianToBearingRange(
        4,
        (0, 2),
        np.diag([0.01**2, 5.0**2]),
        translation_offset=np.array([[10.0], [20.0]]),
        rotation_offset=StateVector([[0.0], [0.0], [2.0]]),
    )
    rng, given = np.random.default_rng(2), []
    for k in range(6):
        rows = np.column_stack([rng.uniform(-math.pi, math.pi, 3), rng.uniform(0.0, 900.0, 3)])
        found = {Detection(StateVector(row), timestamp=START, measurement_model=radar) for row in rows}
        given.append((START.replace(tzinfo=datetime.UTC) + k * SECOND, found))
    clutter = measurement_space_clutter(1.0, [-math.pi, 0.0], [math.pi, 3e3], angular=[True, False])
    reader = ScanConverter(convert(MOTION, {"radar": radar}, births=PRIOR, clutter=clutter))
    table = table_of_detections(given, ("bearing", "range"), sensor="radar")
    recording = parse_scans(table, [RecordedSensor("radar", "bearing_range", (0.0, 0.0, 0.0))], Conventions({}, {}))
    for k, (time, found) in enumerate(given):
        scan = reader.at(time, found)
        assert scan.time == recording.times[k]
        np.testing.assert_allclose(scan.poses[0, :2], recording.poses[k, 0, :2])
        np.testing.assert_allclose(np.asarray(scan.scans[0]), np.asarray(recording.scans[k][0]), rtol=1e-12)


def test_a_set_has_no_order_but_tracks_have() -> None:
    ends = []
    for _ in range(2):
        _, detector, models = simulated(12)
        *_, (_, tracks) = LabelledTracker(detector, models)
        ends.append(sorted((track.id, *np.ravel(track.mean).astype(float)) for track in tracks))
    assert ends[0] == ends[1]


def test_a_detection_that_no_scan_explains_is_missed() -> None:
    scans = of_one_target(4)
    scans[3] = (scans[3][0], set())
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX, prob_detection=0.9)
    *_, (_, tracks) = LabelledTracker(scans, models)
    (track,) = tracks
    assert isinstance(track[-1].hypothesis.measurement, MissedDetection)


def test_the_tracker_can_be_driven_by_hand() -> None:
    scans = of_one_target(3)
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX)
    by_hand = LabelledTracker(None, models)
    for now, found in scans:
        time, tracks = by_hand.update_tracker(now, found)
        assert time == now
    assert [len(track) for track in tracks] == [3]


def test_truth_goes_by_times() -> None:
    truth, _, models = simulated(8)
    pairs = [(time, set(paths)) for time, paths in truth]
    times = [time for time, _ in pairs]
    paths = set().union(*(found for _, found in pairs))
    made = convert_truth(paths, times, models.layout)
    assert made.times.tolist() == list(range(8))
    for k, (time, found) in enumerate(pairs):
        _, states = made.at(k)
        alive = [path for path in found if any(state.timestamp == time for state in path)]
        theirs = models.layout.states([np.ravel(path[time].state_vector).astype(float) for path in alive])
        assert sorted(map(tuple, states)) == sorted(map(tuple, theirs))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"models": 3}, r"models: expected what convert\(\) made; got int"),
        (
            {"end_threshold": 0.7},
            "end_threshold: expected 0 <= end_threshold <= existence_threshold < 1; got 0.7 and 0.5",
        ),
        ({"tracker": "other"}, "tracker: expected one of models.targets and models.sensors"),
    ],
)
def test_parts_that_do_not_fit_are_refused(given: dict[str, Any], message: str) -> None:
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX)
    other = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX).tracker()
    given = {"detector": [], "models": models} | given
    if given.get("tracker") == "other":
        given["tracker"] = other
    with pytest.raises(InputError, match=message):
        LabelledTracker(**given)


@pytest.mark.parametrize(
    ("detection", "message"),
    [
        (Detection(StateVector([1.0, 2.0])), 'metadata."sensor".: expected one of a, b, or the measurement_model'),
        (
            Detection(StateVector([1.0, 2.0, 3.0]), metadata={"sensor": "b"}),
            r"detection 1, state_vector: expected 2 finite numbers \(x, y\)",
        ),
        (
            Detection(StateVector([math.nan, 2.0]), metadata={"sensor": "b"}),
            r"detection 1, state_vector: expected 2 finite numbers",
        ),
    ],
)
def test_detections_of_nobody_are_named(detection: Any, message: str) -> None:
    sensors = {name: LinearGaussian(4, (0, 2), np.eye(2)) for name in "ab"}
    models = convert(MOTION, sensors, births=BORN, clutter=BOX)
    with pytest.raises(InputError, match=message):
        LabelledTracker([], models).update_tracker(START, {detection})


def test_time_does_not_go_back() -> None:
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX)
    tracker = LabelledTracker([], models)
    tracker.update_tracker(START, set())
    with pytest.raises(InputError, match="time: expected one from that of the last scan on"):
        tracker.update_tracker(START - SECOND, set())


def test_filters_of_ones_own_are_taken() -> None:
    models = convert(MOTION, [MEASUREMENT], births=BORN, clutter=BOX)
    own = Distributed((LmbFilter(models.targets, models.sensors[0]),))
    *_, (_, tracks) = LabelledTracker(of_one_target(5), models, own)
    assert [len(track) for track in tracks] == [5]
    assert len(list(itertools.chain(*tracks))) == 5
