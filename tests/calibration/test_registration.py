"""The first guess of biases: exact where nothing is noise, and its derivatives against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.calibration.registration import BIASES, MatchedMeasurements, _linearised, _pieces, register
from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedSensor

HEIGHT = 60.0  # m, of radar e
SITES = (
    RecordedSensor("a", "bearing_range", (-3000.0, -2000.0, 0.0)),
    RecordedSensor("b", "bearing_range", (2500.0, 0.0, 0.0)),
    RecordedSensor("c", "position", (0.0, 0.0, 0.0)),
    RecordedSensor("d", "bearing_only", (0.0, 4000.0, 0.0)),
    RecordedSensor("e", "bearing_range_elevation", (-2500.0, 1500.0, *(0.0,) * 8, HEIGHT)),
    RecordedSensor("f", "bearing_range_altitude", (3000.0, 2000.0, 0.0)),
)
STATES = np.array(
    [
        [0.0, 500.0, 30.0, -20.0, 2000.0, 3.0],
        [1500.0, -2500.0, -10.0, 40.0, 900.0, 0.0],
        [-500.0, 2500.0, 25.0, 10.0, 3000.0, -5.0],
    ]
)
TRUE = np.zeros((6, 7))
TRUE[0, :2] = 300.0, 0.03
TRUE[1, :3] = -150.0, -0.02, 0.5
TRUE[2, 2:5] = -0.4, 80.0, -50.0
TRUE[3, 1:3] = 0.01, 0.3
TRUE[4] = 70.0, -0.01, 0.2, 0.0, 0.0, 0.02, 0.0
TRUE[5] = -90.0, 0.015, -0.2, 0.0, 0.0, 0.0, 40.0
ASKED = TRUE != 0.0
UNKNOWN = np.array([1000.0, 0.2, 5.0, 1000.0, 1000.0, 0.2, 1000.0]) * np.ones((6, 1))
STDS = np.array([[0.05, 300.0, 1.0]] * 4 + [[0.05, 300.0, 0.05], [0.05, 300.0, 300.0]])
STDS[2, 0] = 300.0  # x


def pairs_of(seconds: float = 200.0) -> MatchedMeasurements:
    """What each sensor measures of each target, without noise, and tracks that are a little off."""
    rows = list[list[float]]()
    for s, site in enumerate(SITES):
        for time in np.arange(1.0 + s, seconds, 4.0 + s).tolist():
            for k, state in enumerate(STATES):
                x, y, z = state[[0, 1, 4]] + (time - TRUE[s, 2]) * state[[2, 3, 5]]
                own = HEIGHT if s == 4 else 0.0
                dx, dy, up = x - site.pose[0], y - site.pose[1], z - own
                measured = [math.atan2(dy, dx) + TRUE[s, 1], math.hypot(dx, dy) + TRUE[s, 0], math.nan]
                if site.kind == "position":
                    measured[:2] = x + TRUE[s, 3], y + TRUE[s, 4]
                elif site.kind == "bearing_only":
                    measured[1] = math.nan
                elif s >= 4:
                    measured[1] = math.hypot(dx, dy, up) + TRUE[s, 0]
                    measured[2] = math.atan2(up, math.hypot(dx, dy)) + TRUE[s, 5] if s == 4 else z + TRUE[s, 6]
                    if len(rows) % 5 == 0:
                        measured[2] = math.nan  # a row without it
                track = [x + 40.0, y - 30.0, state[2] + 3.0, state[3], z + 50.0, state[5]]
                rows.append([time, s, k, *measured, *site.pose[:2], own, *track])
    table, none = np.array(rows), np.zeros(6, np.int64)
    whole = table[:, 1:3].astype(np.int64)
    return MatchedMeasurements(
        table[:, 0], whole[:, 0], whole[:, 1], table[:, 3:6], table[:, 6:9], table[:, 9:], none[:, None], none, none
    )


def test_without_noise_the_biases_are_estimated() -> None:
    found = register(pairs_of(), SITES, ASKED, UNKNOWN * 1e3, STDS, 7.0)
    np.testing.assert_allclose(found.biases[:, 0], TRUE[:, 0], atol=1.0)
    np.testing.assert_allclose(found.biases[:, 1], TRUE[:, 1], atol=1e-4)
    np.testing.assert_allclose(found.biases[:, 2], TRUE[:, 2], atol=0.02)
    np.testing.assert_allclose(found.biases[:, [3, 4, 6]], TRUE[:, [3, 4, 6]], atol=1.0)
    np.testing.assert_allclose(found.biases[:, 5], TRUE[:, 5], atol=1e-4)
    assert (found.stds[:3] <= 0.011 * STDS[:3]).all()


def test_what_is_not_asked_stays() -> None:
    asked = ASKED.copy()
    asked[1] = False
    assert (register(pairs_of(), SITES, asked, UNKNOWN, STDS, 7.0).biases[1] == 0.0).all()


@pytest.mark.parametrize("what", ["states", *BIASES])
def test_derivatives_are_those_of_differences(what: str) -> None:
    pairs = pairs_of(40.0)
    pieces, middles, states = _pieces(pairs, 30.0)
    rng = np.random.default_rng(0)
    biases = TRUE + rng.normal(size=TRUE.shape) * [50.0, 0.01, 0.3, 20.0, 20.0, 0.01, 20.0]

    def residuals(biases: Floats, states: Floats) -> Floats:
        return _linearised(pairs, SITES, biases, pieces, middles, states)[0]

    _, own, of_bias = _linearised(pairs, SITES, biases, pieces, middles, states)
    step = 1e-4 if what in ("bearing", "elevation") else 1e-2
    for i in range(6) if what == "states" else [BIASES.index(what)]:
        up, down = (biases.copy(), states.copy()), (biases.copy(), states.copy())
        at = what == "states"
        up[at][:, i] += step
        down[at][:, i] -= step
        slope = -(residuals(*up) - residuals(*down)) / (2.0 * step)
        exact = own[:, :, i] if what == "states" else of_bias[:, :, i]
        np.testing.assert_allclose(exact, slope, rtol=1e-4, atol=1e-7)
