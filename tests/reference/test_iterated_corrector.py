"""The plain iterated corrector: exact where belief propagation is, and as good as the library on a published scene."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from reference import iterated_corrector as plain
from vedette.evaluation import ospa, run_scenario
from vedette.filters import Limits, MultiSensorLmbFilter
from vedette.kernels.base.types import Floats
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.loop import SCANS, TRUTH, run_stream, sensor_streams
from vedette.simulation.scans import simulate_scans

NUM_RUNS = 4
AXIS = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
STEP = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
PLACES = ((-80.0, -20.0), (-20.0, 80.0), (0.0, 0.0), (40.0, -60.0))
SENSORS = [plain.Sensor(*each, 5.0 / 200.0**2) for each in ((0.67, 4.0), (0.7, 3.0), (0.73, 2.0))]


def world(num_births: int = 4) -> plain.World:
    births = [
        plain.Track(0.03, np.ones(1), np.array([[*place, 0.0, 0.0]]), 100.0 * np.eye(4)[np.newaxis])
        for place in PLACES[:num_births]
    ]
    return plain.World(STEP, np.kron(AXIS, np.eye(2)), 0.95, births)


def enumerated(odds: Floats) -> Floats:
    """Marginals by the sum over all joint associations."""
    num, meas = odds.shape
    table = np.zeros((num, meas + 1))
    for choice in itertools.product(range(meas + 1), repeat=num):
        taken = [j for j in choice if j]
        if len(set(taken)) == len(taken):
            weight = math.prod(odds[i, j - 1] for i, j in enumerate(choice) if j)
            table[np.arange(num), choice] += weight
    return np.asarray(table / table.sum(axis=1, keepdims=True))


def test_marginals_of_one_track_and_of_one_measurement_are_exact() -> None:
    rng = np.random.default_rng(1)
    for odds in (rng.gamma(1.0, 3.0, (1, 4)), rng.gamma(1.0, 3.0, (4, 1))):
        np.testing.assert_allclose(plain.marginals(odds), enumerated(odds), rtol=1e-9)


def test_marginals_of_several_are_near() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        odds = rng.gamma(0.3, 5.0, (3, 3))
        assert np.abs(plain.marginals(odds) - enumerated(odds)).max() < 0.15


def test_a_lone_track_is_updated_as_the_library_does() -> None:
    scenario = load_scenario("three-positions")
    tracker = build_experiment(scenario).tracker
    central = MultiSensorLmbFilter(
        tracker.targets, tracker.sensors, Limits(min_existence=0.01, max_components=20, min_component_weight=1e-6)
    )
    scans = [np.array([[-79.0, -21.0]]), np.empty((0, 2)), np.array([[-82.0, -18.5]])]
    tracks = plain.step([], world(), SENSORS, scans, plain.Caps(existence=1e-4))
    belief, _ = central.step(central.initial(), scans, np.zeros((3, 3)), 1.0, 1, rng=np.random.default_rng(0))
    ours = belief.existence[belief.tracks.labels[:, 1] == 0]
    assert ours == pytest.approx([tracks[0].existence], rel=1e-6)


@pytest.mark.slow
def test_the_library_is_as_good_on_the_published_scene() -> None:
    scenario = load_scenario("three-positions")
    experiment, differences = build_experiment(scenario), []
    for run in range(NUM_RUNS):
        truth = experiment.targets.truth(experiment.times, rng=run_stream(0, run, TRUTH))
        rngs, errors = sensor_streams(0, run, SCANS, 3), []
        tracks: list[plain.Track] = []
        for k in range(truth.num_scans):
            _, states = truth.at(k)
            scans = simulate_scans(states, experiment.poses, experiment.tracker.sensors, rngs=rngs)
            tracks = plain.step(tracks, world(), SENSORS, [scan.measurements for scan in scans], plain.Caps())
            errors.append(ospa(plain.estimates(tracks), states, cutoff=5.0, order=2.0).total)
        ours = run_scenario(scenario, "stationary", seed=0, run=run).ospa[:, 0].mean()
        differences.append(np.mean(errors) - ours)
    assert abs(np.mean(differences)) < 0.08  # 0.02 with a standard error of 0.007 over five runs
