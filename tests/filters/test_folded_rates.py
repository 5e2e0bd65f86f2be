"""Range rates that are folded at an ambiguity: in every filter, births, simulated scans and clutter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filters.members import BELIEFS, arrays, believed, existences, given, make, step
from vedette import models
from vedette.densities import LMB
from vedette.errors import InputError
from vedette.models.measurement import wrap_periodic
from vedette.simulation import simulate_scan
from vedette.tracking.birth_velocities import with_velocities

pytestmark = pytest.mark.lanes

every_kind = pytest.mark.parametrize("kind", BELIEFS)
NOBODY = models.BirthModel.none(4)
SURE = models.DetectionModel(given, np.ones(1))
STDS = [0.02, 3.0, 0.4]
MEAN, COV = np.array([60.0, 30.0, 9.0, 6.0]), np.diag([16.0, 9.0, 0.5, 0.5])
LARGEST = 5.0  # m/s, far below the range rate of the target, 10.7


def doppler(folded: float | None, stds: Any = STDS, **parts: Any) -> dict[str, Any]:
    """Parts of a sensor; false measurements have range rates up to the ambiguity, or 300 m/s."""
    most = 300.0 if folded is None else folded
    chosen: dict[str, Any] = {
        "measurement": models.bearing_range_rate(folded),
        "noise": models.constant_noise(stds),
        "clutter": models.around_sensor(2.0, "bearing_range_rate", radius=150.0, max_range_rate=most),
    }
    return chosen | parts


def close(one: Any, other: Any, rtol: float = 1e-10, atol: float = 1e-12) -> None:
    for mine, theirs in zip(arrays(one), arrays(other), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=rtol, atol=atol)


def measured(state: Any, off: Any = (0.01, 2.0, 0.5)) -> Any:
    """Of a target, with that noise."""
    return models.bearing_range_rate().measure([state], np.zeros(3)) + off


@every_kind
def test_an_interval_beyond_all_speeds_changes_nothing(kind: Any) -> None:
    belief = other = None
    filter, plain = make(kind, **doppler(300.0)), make(kind, **doppler(None))
    for number in (1, 2, 3):
        scan = np.concatenate([measured([10.0 + number, 10.0, 1.0, 0.0]), [[2.0, 40.0, -20.0]]])
        belief, _ = step(filter, scan, belief, number=number)
        other, _ = step(plain, scan, other, number=number)
        close(belief, other)


@every_kind
@pytest.mark.parametrize("turns", [-2, 0, 1])
def test_an_update_is_an_extended_kalman_filter_with_the_innovation_wrapped(kind: Any, turns: int) -> None:
    parts = doppler(LARGEST, birth=NOBODY, detection=SURE, survival=models.constant_survival(1.0))
    parts["clutter"] = models.around_sensor(1e-9, "bearing_range_rate", radius=150.0, max_range_rate=LARGEST)
    model, z = parts["measurement"], measured(MEAN)[0] + [0.0, 0.0, turns * 2.0 * LARGEST]
    found, _ = step(make(kind, **parts), [z], believed(kind, 0.999, [MEAN], [COV]), dt=0.0)
    slope = np.empty((3, 4))
    model.jacobian(MEAN, np.zeros(3), model.params, slope)
    innovation = z - model.measure([MEAN], np.zeros(3))[0]
    innovation[2] = math.remainder(innovation[2], 2.0 * LARGEST)
    assert innovation[2] == pytest.approx(0.5)
    gain = COV @ slope.T @ np.linalg.inv(slope @ COV @ slope.T + np.diag(np.square(STDS)))
    tracks = found.tracks if hasattr(found, "tracks") else found
    heaviest = np.argmax(getattr(tracks, "log_weights", np.zeros(1)))
    np.testing.assert_allclose(tracks.means[heaviest], MEAN + gain @ innovation, rtol=1e-9)
    np.testing.assert_allclose(tracks.covs[heaviest], COV - gain @ slope @ COV, rtol=1e-9, atol=1e-9)


@every_kind
@pytest.mark.parametrize("stds", [STDS, [0.4, 3.0, 0.4]], ids=["straight", "bent"])
@pytest.mark.parametrize("own_noise", [False, True])
def test_a_range_rate_that_may_be_one_of_several_is_none(kind: Any, stds: Any, own_noise: bool) -> None:
    """With a velocity that is not known well, all is as of a sensor that measures no range rates."""
    cov = np.diag([16.0, 9.0, 25.0, 25.0]) if stds is STDS else np.diag([900.0, 900.0, 25.0, 25.0])
    prior = believed(kind, 0.6, [MEAN], [cov])
    scan = np.concatenate([measured(MEAN), [[2.0, 40.0, -3.0]]])
    plain: dict[str, Any] = {
        "measurement": models.bearing_range(),
        "noise": models.constant_noise(stds[:2]),
        "clutter": models.around_sensor(2.0, "bearing_range", radius=150.0),
    }
    folded, other = make(kind, birth=NOBODY, **doppler(LARGEST, stds)), make(kind, birth=NOBODY, **plain)
    rows: Any = scan
    fewer: Any = scan[:, :2]
    if own_noise:
        rows = models.ScanRows(scan, np.tile(stds, (2, 1)))
        fewer = models.ScanRows(fewer, np.tile(stds[:2], (2, 1)))
    found, expected = step(folded, rows, prior, dt=0.0)[0], step(other, fewer, prior, dt=0.0)[0]
    np.testing.assert_allclose(existences(found), existences(expected), rtol=1e-6)
    close(found, expected, 1e-5, 1e-5)


def test_births_take_no_velocity_from_one_of_several_range_rates() -> None:
    std = np.array([10.0, 10.0, 4.0, 4.0])
    births = LMB.from_bernoullis([(1, 0)], [0.1], [[60.0, 30.0, 0.0, 0.0]], [np.diag(std**2)])
    scan = [measured([60.0, 30.0, 3.0, 2.0], 0.0)]
    for folded, changed in ((5.0, False), (11.0, False), (12.5, True), (None, True)):
        sensor = models.SensorModel(detection=models.constant_detection(0.9), **doppler(folded))
        found = with_velocities(births, std, [sensor], scan, [np.zeros(3)])
        assert bool(found.tracks.means[0, 2:].any()) is changed
        assert bool(np.any(found.tracks.covs != births.tracks.covs)) is changed
    same = with_velocities(
        births,
        std,
        [models.SensorModel(detection=models.constant_detection(0.9), **doppler(None))],
        scan,
        [np.zeros(3)],
    )
    close(found, same)


def test_simulated_range_rates_are_folded() -> None:
    states = np.hstack([np.random.default_rng(1).uniform(-90.0, 90.0, (40, 2)), np.full((40, 2), 11.0)])
    scans = []
    for folded in (None, LARGEST):
        parts = doppler(folded, detection=SURE)
        parts["clutter"] = models.around_sensor(0.0, "bearing_range_rate", radius=150.0)
        rng = np.random.default_rng(2)
        scans.append(simulate_scan(states, np.zeros(3), models.SensorModel(**parts), rng=rng).measurements)
    plain, folded_scan = scans
    assert np.abs(plain[:, 2]).max() > 10.0
    np.testing.assert_allclose(folded_scan[:, :2], plain[:, :2], rtol=1e-12)
    turns = (plain[:, 2] - folded_scan[:, 2]) / (2.0 * LARGEST)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert (np.abs(folded_scan[:, 2]) <= LARGEST).all()


def test_scans_outside_the_interval_are_folded_as_they_come() -> None:
    periods = models.bearing_range_rate(LARGEST).periods
    assert periods.tolist() == [2.0 * math.pi, math.inf, 10.0]
    np.testing.assert_allclose(
        wrap_periodic(np.array([[4.0, 700.0, -5.0]]), periods), [[4.0 - 2 * math.pi, 700.0, 5.0]]
    )


@pytest.mark.parametrize("bad", [0.0, -3.0, math.nan])
def test_a_bad_ambiguity_is_refused(bad: float) -> None:
    with pytest.raises(InputError, match="max_unambiguous_range_rate: expected"):
        models.bearing_range_rate(bad)


def test_bad_periods_are_refused() -> None:
    model = models.bearing_range_rate()
    for periods in ([1.0, math.inf, 3.0], [2.0 * math.pi, math.inf, 0.0]):
        with pytest.raises(InputError, match=r"MeasurementModel\.periods: expected numbers above 0"):
            models.MeasurementModel(3, model.function, components=model.components, periods=np.array(periods))
