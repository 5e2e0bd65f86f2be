"""Covariances that errors of a sensor's own pose add: against differences of the measurement models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT
from vedette.kernels.base.types import OWN_HEIGHT, OWN_VELOCITY, Floats
from vedette.models.pose_noise import PoseStds, pose_noise, pose_stds_of

PLACES = {"x": 0, "y": 1, "height": OWN_HEIGHT, "vx": OWN_VELOCITY, "vy": OWN_VELOCITY + 1}
KINDS = ("bearing_range", "bearing_range_rate", "bearing_range_elevation", "bearing_range_altitude")


def slope(model: models.MeasurementModel, state: Floats, pose: Floats, name: str) -> Floats:
    """Derivative of a measurement by a part of the reported pose; the difference of the measured and predicted one."""
    if name == "heading":
        return np.array([1.0, *np.zeros(model.meas_dim - 1)])
    step = np.zeros(len(pose))
    step[PLACES[name]] = 1e-2
    return ((model.measure([state], pose + step) - model.measure([state], pose - step)) / 2e-2)[0]


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_that_of_the_derivatives_by_the_pose(kind: str) -> None:
    rng, model = np.random.default_rng(1), getattr(models, kind)()
    fields = pose_stds_of(COMPONENTS[kind], kind in HEIGHT_DEPENDENT)
    for _ in range(10):
        pose = np.concatenate([rng.uniform(-500.0, 500.0, 2), np.zeros(8), [40.0]])
        state = np.array([*rng.uniform(-4000.0, 4000.0, 2), 0.0, 0.0, rng.uniform(100.0, 900.0), 0.0])
        stds = {name: rng.uniform(0.1, 2.0) for name in fields}
        measured = model.measure([state], pose)[0]
        expected = sum(
            std**2 * np.outer(own, own) for name, std in stds.items() for own in [slope(model, state, pose, name)]
        )
        if kind == "bearing_range_rate":  # which leaves out the turn of the line of sight, here at rest
            assert not model.measure([state], pose)[0, 2]
        found = pose_noise(measured.tolist(), COMPONENTS[kind], pose.tolist(), PoseStds(**stds))
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-9)


def test_which_parts_count() -> None:
    assert pose_stds_of(COMPONENTS["position"], False) == ()
    assert pose_stds_of(COMPONENTS["range_only"], False) == ()
    assert pose_stds_of(COMPONENTS["bearing_only"], False) == ("heading",)
    assert pose_stds_of(COMPONENTS["bearing_range_rate"], False) == ("heading", "x", "y", "vx", "vy")
    assert pose_stds_of(COMPONENTS["bearing_slant_range"], True) == ("heading", "x", "y", "height")
    found = pose_noise([0.3], ("bearing",), [0.0, 0.0, 0.0], PoseStds(heading=0.02))
    np.testing.assert_allclose(found, [[4e-4]])


MORE = np.array([[0.04, 0.3], [0.3, 9.0]])
BASE = np.array([[0.01, 0.002], [0.002, 4.0]])


@pytest.mark.parametrize(
    ("stds", "expected"),
    [
        ((0.0, 0.0), BASE + MORE),
        ((0.2, 3.0), np.diag([0.04, 9.0]) + MORE),
        ((0.2, 0.0), [[0.08, 0.3], [0.3, 13.0]]),
    ],
)
def test_it_is_added_to_the_noise_of_the_row_or_the_model(stds: tuple[float, float], expected: Any) -> None:
    row = models.ScanRows([[1.0, 500.0]], [stds], added_noise=[MORE])
    np.testing.assert_allclose(row.covs(BASE[np.newaxis]), [expected], rtol=1e-12)


def test_a_component_that_is_added_alone_leaves_the_others_to_the_model() -> None:
    row = models.ScanRows([[1.0, 500.0]], [[0.0, 0.0]], added_noise=[np.diag([0.04, 0.0])])
    np.testing.assert_allclose(row.covs(BASE[np.newaxis]), [BASE + np.diag([0.04, 0.0])])


def test_covariances_below_0_are_refused() -> None:
    with pytest.raises(InputError, match="added_noise: expected symmetric positive definite"):
        models.ScanRows([[1.0, 500.0]], [[1.0, 1.0]], added_noise=[-MORE])
    with pytest.raises(InputError, match="noise: expected symmetric positive definite"):
        models.ScanRows([[1.0, 500.0]], [-MORE])


def test_an_altitude_above_the_slant_range_leaves_a_distance_on_the_ground() -> None:
    """A target is at most 45 degrees above the sensor, so that the bearing's noise is bounded."""
    added = pose_noise(
        [0.4, 500.0, 900.0], COMPONENTS["bearing_range_altitude"], [0.0, 0.0, 0.0], PoseStds(x=1.0, y=1.0)
    )
    assert added[0, 0] == pytest.approx(2.0 / 500.0**2)
