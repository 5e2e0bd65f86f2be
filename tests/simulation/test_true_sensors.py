"""Sensors that are not what the filters take them for, and sensors that scan at some steps alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError
from vedette.recorded import RecordedSensor, remove_biases
from vedette.recorded.scan_times import RecordedScan, group_by_time
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.overrides import replace_fields
from vedette.simulation import CLUTTER, Experiment, TrueSensor, simulate_scan
from vedette.simulation.loop import simulate
from vedette.simulation.replay import scans_of
from vedette.tracking import State, TrackerInfo

POSE = np.array([100.0, -50.0, 0.3])
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
NEAR_THE_EDGE = np.tile([150.0, -50.0, 1.0, 0.0], (400, 1))


def sensor(kind, **parts):
    own = {
        "measurement": {"position": models.position, "bearing_range": models.bearing_range}[kind](),
        "noise": models.constant_noise([5.0, 5.0] if kind == "position" else [0.05, 5.0]),
        "detection": models.limited_range(1.0, 50.0),
        "clutter": models.region_clutter(0.0, REGION, kind),
    }
    return models.SensorModel(**{**own, **parts})


@pytest.mark.parametrize("kind", ["position", "bearing_range"])
def test_detection_of_the_measurement(kind):
    """Targets at the very edge are seen where their noise brings them inside, and only there."""
    model = sensor(kind)
    of_state = simulate_scan(NEAR_THE_EDGE, POSE, model, rng=np.random.default_rng(1))
    of_measured = simulate_scan(
        NEAR_THE_EDGE, POSE, TrueSensor(model, detection_of="measurement"), rng=np.random.default_rng(1)
    )
    assert len(of_state.measurements) == 400
    measured = of_state.measurements
    distances = np.hypot(*(measured - POSE[:2]).T) if kind == "position" else measured[:, 1]
    kept = distances <= 50.0
    assert 150 < kept.sum() < 250
    np.testing.assert_array_equal(np.sort(of_measured.origins), np.sort(of_state.origins[kept]))


def test_the_first_scan_may_be_of_its_own():
    true = TrueSensor(sensor("position"), first_detection=models.constant_detection(0.0))
    assert len(simulate_scan(NEAR_THE_EDGE, POSE, true.at_first_scan(), rng=np.random.default_rng(1)).origins) == 0
    assert len(simulate_scan(NEAR_THE_EDGE, POSE, true, rng=np.random.default_rng(1)).origins) == 400


@pytest.mark.parametrize("kind", ["position", "bearing_range"])
def test_what_a_bias_adds_is_what_reading_takes_off(kind):
    """Biased scans without their biases are those of a sensor that has none, from where it is in truth."""
    rng = np.random.default_rng(4)
    states = np.column_stack([rng.uniform(-300.0, 300.0, (50, 2)), rng.uniform(-9.0, 9.0, (50, 2))])
    measured = {"range": 30.0, "bearing": 0.1} if kind == "bearing_range" else {}
    bias = models.Bias(clock=0.5, x=20.0, y=-10.0, **measured)
    model = sensor(kind, detection=models.limited_range(1.0, 250.0))
    scan = simulate_scan(states, POSE, TrueSensor(model, bias=bias), rng=np.random.default_rng(1))
    recording = group_by_time(
        [RecordedScan(7.0, 0, scan.measurements, POSE)], POSE[np.newaxis], 0.0, False, (), ("east",)
    )
    read = remove_biases(recording, [RecordedSensor("radar", kind, tuple(POSE), bias)])
    earlier, true_pose = states.copy(), read.poses[0, 0]
    earlier[:, :2] -= 0.5 * states[:, 2:]
    plain = simulate_scan(earlier, true_pose, model, rng=np.random.default_rng(1))
    assert 10 < len(plain.origins) < 50
    np.testing.assert_array_equal(scan.origins, plain.origins)
    np.testing.assert_allclose(true_pose, POSE if kind == "position" else POSE - [20.0, -10.0, 0.0])
    np.testing.assert_allclose(np.asarray(read.scans[0][0]), plain.measurements, rtol=0.0, atol=1e-12)
    assert read.start == 6.5


def test_what_filters_take_off_is_no_bias_any_more():
    scenario = load_scenario("paper-e")
    said: dict[str, Any] = {"sensors.0.bias.range": 20.0, "sensors.0.bias.clock": 0.5}
    said["sensors.1.bias.bearing_deg"] = 1.0
    assert build_experiment(replace_fields(scenario, said)).true_sensors == ()
    true = {
        "sensors.0.true_parameters": {"bias": {"range": 50.0}},
        "sensors.1.true_parameters": {"bias": {"bearing_deg": 3.0}},
    }
    first, second = build_experiment(replace_fields(scenario, said | true)).true_sensors
    assert first.bias == models.Bias(range=30.0, clock=-0.5)
    assert second.bias.bearing == pytest.approx(np.radians(2.0))
    _, second = build_experiment(replace_fields(scenario, said | true | {"sensors.1.compass": True})).true_sensors
    assert second.bias.bearing == pytest.approx(-np.radians(2.0))  # a compass says it clockwise


def test_bad_true_sensors_are_named():
    bearing = models.SensorModel(
        models.bearing_only(),
        models.constant_noise([0.1]),
        models.constant_detection(0.9),
        models.region_clutter(1.0, REGION, "bearing_only"),
    )
    with pytest.raises(InputError, match="detection_of: expected state, as only a position"):
        TrueSensor(bearing, detection_of="measurement")
    with pytest.raises(InputError, match="detection_of: expected one of state, measurement; got both"):
        TrueSensor(bearing, detection_of="both")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="first_detection: expected a DetectionModel; got float"):
        TrueSensor(bearing, first_detection=1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"bias.range: expected 0, as no range is measured; got 3"):
        TrueSensor(bearing, bias=models.Bias(range=3.0))


@dataclass(frozen=True)
class Listener:
    """A tracker that keeps what it is handed, and takes a scan that is none for an empty one."""

    inner: Any
    heard: list[Any]

    @property
    def targets(self) -> Any:
        return self.inner.targets

    @property
    def sensors(self) -> Any:
        return self.inner.sensors

    def initial(self) -> State:
        return self.inner.initial()

    def step(self, state, scans, poses, time, *, rngs) -> tuple[State, TrackerInfo]:
        self.heard.append(scans)
        taken = [np.empty((0, 2)) if scan is None else scan for scan in scans]
        return self.inner.step(state, taken, poses, time, rngs=rngs)


@pytest.fixture(scope="module")
def whole() -> Experiment:
    return build_experiment(load_scenario("paper-e"))


def heard(experiment, **changes):
    """The scans that the tracker gets, and the record of the run."""
    listener = Listener(experiment.tracker, [])
    changed = replace(experiment, tracker=listener, times=experiment.times[:7], decision_steps=(), **changes)
    record = simulate(changed, None, seed=3, run=0, score=lambda truth, _: np.zeros((truth.num_scans, 3)))
    return listener.heard, record, changed


def test_a_sensor_that_does_not_scan_hands_over_nothing_and_the_others_scan_as_before(whole):
    every, _, _ = heard(whole)
    table = np.ones((2, 7), np.bool_)
    table[1] = [False, True, False, False, True, False, False]
    some, record, experiment = heard(whole, scans_at=table)
    assert [scans[1] is not None for scans in some] == table[1].tolist()
    for mine, before in zip(some, every, strict=True):
        np.testing.assert_array_equal(mine[0], before[0])
    drawn: Any = scans_of(record, experiment)
    for again, scans in zip(drawn, some, strict=True):
        assert (again[1] is None) == (scans[1] is None)
        if scans[1] is not None:
            np.testing.assert_array_equal(again[1].measurements, scans[1])


def test_true_sensors_that_are_as_known_change_nothing(whole):
    before, _, _ = heard(whole)
    now, _, _ = heard(whole, true_sensors=tuple(map(TrueSensor, whole.tracker.sensors)), scans_at=np.ones((2, 9), bool))
    for mine, same in zip(now, before, strict=True):
        for scan, other in zip(mine, same, strict=True):
            np.testing.assert_array_equal(scan, other)


def test_the_true_sensor_is_the_one_that_is_simulated(whole):
    known = whole.tracker.sensors
    blind = replace(known[0], detection=models.constant_detection(0.0))
    first = TrueSensor(blind, first_detection=models.constant_detection(1.0))
    later = np.ones((2, 7), np.bool_)
    later[0, :2] = False
    _, record, experiment = heard(whole, true_sensors=(first, TrueSensor(known[1])), scans_at=later)
    found: list[Any] = [
        None if scans[0] is None else int((scans[0].origins != CLUTTER).sum()) for scans in scans_of(record, experiment)
    ]
    assert found[:2] == [None, None]
    assert found[2] > 0
    assert found[3:] == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"true_sensors": (1, 2)}, r"true_sensors\[0\]: expected a TrueSensor; got 1"),
        ({"true_sensors": (TrueSensor(sensor("position")),)}, "true_sensors: expected 2, one for each sensor"),
        ({"true_sensors": (TrueSensor(sensor("position")),) * 2}, "angular flags .True, False., as the filter's"),
        ({"scans_at": np.ones((2, 3), bool)}, "scans_at: expected booleans of shape .2, 40 or more.; got shape .2, 3."),
        ({"scans_at": np.ones((2, 40))}, "scans_at: expected booleans .*; got float64"),
    ],
)
def test_parts_that_do_not_fit_are_named(whole, changes, message):
    with pytest.raises(InputError, match=message):
        replace(whole, **changes)
