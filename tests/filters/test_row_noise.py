"""Scans whose rows bring their own noise and likelihood ratio, in every filter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filters.members import BELIEFS, CENTRAL, LABELLED, REGION, arrays, believed, birth, existences, given, make, step
from vedette import models
from vedette.errors import InputError
from vedette.models import ScanRows

pytestmark = pytest.mark.lanes

every_kind = pytest.mark.parametrize("kind", BELIEFS)
NOBODY = models.BirthModel.none(4)
SURE = models.DetectionModel(given, np.ones(1))
SCAN = np.array([[10.5, 9.0], [52.0, 47.0], [-40.0, 3.0]])
POLAR = np.array([[0.8, 14.5], [0.79, 70.0], [-2.0, 30.0]])


def polar(**parts: Any) -> dict[str, Any]:
    """Parts of a sensor of bearings and ranges, nearly as wide as the targets are far: some updates bend."""
    chosen: dict[str, Any] = {
        "measurement": models.bearing_range(),
        "noise": models.constant_noise([0.05, 2.0]),
        "clutter": models.measurement_space_clutter(2.0, [-np.pi, 0.0], [np.pi, 100.0]),
    }
    return chosen | parts


def close(one: Any, other: Any, rtol: float = 1e-10) -> None:
    for mine, theirs in zip(arrays(one), arrays(other), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=rtol, atol=1e-12)


@every_kind
@pytest.mark.parametrize(("scan", "stds", "parts"), [(SCAN, [3.0, 3.0], {}), (POLAR, [0.05, 2.0], polar())])
def test_rows_with_the_noise_of_the_model_change_nothing(kind: Any, scan: Any, stds: Any, parts: Any) -> None:
    filter = make(kind, **parts)
    belief = other = None
    for number in (1, 2, 3):
        belief, _ = step(filter, scan, belief, number=number)
        other, _ = step(filter, ScanRows(scan, np.tile(stds, (3, 1))), other, number=number)
        close(belief, other)


@every_kind
def test_rows_that_leave_the_noise_to_the_model_change_nothing(kind: Any) -> None:
    filter = make(kind)
    close(step(filter, SCAN)[0], step(filter, ScanRows(SCAN, np.zeros((3, 2))))[0])


@every_kind
@pytest.mark.parametrize(("scan", "stds", "parts"), [(SCAN, [1.0, 7.0], {}), (POLAR, [0.1, 5.0], polar())])
def test_one_noise_of_all_rows_is_that_of_another_model(kind: Any, scan: Any, stds: Any, parts: Any) -> None:
    """The gates of a model with little noise do not cut off rows with much."""
    rows = ScanRows(scan, np.tile(stds, (3, 1)))
    belief, other = (make(kind, **(parts | {"noise": models.constant_noise(each)})) for each in ([1e-3, 1e-3], stds))
    close(step(belief, rows)[0], step(other, scan)[0])


@every_kind
def test_a_correlated_row_updates_as_a_kalman_filter(kind: Any) -> None:
    prior, cov = np.array([10.0, 10.0, 1.0, 0.0]), np.diag([20.0, 30.0, 4.0, 4.0])
    noise, z = np.array([[9.0, -5.0], [-5.0, 4.0]]), np.array([12.0, 8.0])
    parts: dict[str, Any] = {"birth": NOBODY, "detection": SURE, "survival": models.constant_survival(1.0)}
    filter = make(kind, clutter=models.region_clutter(1e-9, REGION, "position"), **parts)
    found, _ = step(filter, ScanRows([z], [noise]), believed(kind, 0.999, [prior], [cov]), dt=0.0)
    gain = cov[:, :2] @ np.linalg.inv(cov[:2, :2] + noise)
    tracks = found.tracks if hasattr(found, "tracks") else found
    heaviest = np.argmax(getattr(tracks, "log_weights", np.zeros(1)))
    np.testing.assert_allclose(tracks.means[heaviest], prior + gain @ (z - prior[:2]), rtol=1e-9)
    np.testing.assert_allclose(tracks.covs[heaviest], cov - gain @ cov[:2], rtol=1e-9, atol=1e-9)


@every_kind
@pytest.mark.parametrize(("scan", "stds", "parts"), [(SCAN, [1.0, 7.0], {}), (POLAR, [0.1, 5.0], polar())])
def test_what_is_added_to_the_noise_of_the_model_is_another_model(kind: Any, scan: Any, stds: Any, parts: Any) -> None:
    rows = ScanRows(scan, np.zeros((3, 2)), added_noise=np.tile(0.75 * np.diag(np.square(stds)), (3, 1, 1)))
    half = np.multiply(0.5, stds)
    belief, other = (make(kind, **(parts | {"noise": models.constant_noise(each)})) for each in (half, stds))
    close(step(belief, rows)[0], step(other, scan)[0])


@pytest.mark.parametrize("kind", [*LABELLED, *CENTRAL])
def test_a_likelihood_ratio_divides_the_clutter(kind: Any) -> None:
    """Ten times as probable of a target is a tenth of the clutter, and of no other measurement."""
    prior = believed(kind, 0.5, [[10.0, 10.0, 0.0, 0.0]], [20.0 * np.eye(4)])
    scan, ratio = np.array([[13.0, 6.0]]), np.log(10.0)
    filter, other = (
        make(kind, birth=NOBODY, clutter=models.region_clutter(rate, REGION, "position")) for rate in (2.0, 0.2)
    )
    found = step(filter, ScanRows(scan, np.zeros((1, 2)), log_ratios=[ratio]), prior, dt=0.0)[0]
    np.testing.assert_allclose(existences(found), existences(step(other, scan, prior, dt=0.0)[0]), rtol=1e-10)


@every_kind
@pytest.mark.parametrize(
    ("third", "without", "dim"),
    [
        ("bearing_range_altitude", "bearing_slant_range", 6),
        ("bearing_range_elevation", "bearing_slant_range", 6),
        ("bearing_range_rate", "bearing_range", 4),
    ],
)
def test_a_row_without_its_third_component_is_that_of_a_sensor_without(
    kind: Any, third: str, without: str, dim: int
) -> None:
    motion = models.constant_velocity_height(1.0, 1.0) if dim == 6 else models.constant_velocity(1.0)
    scan = np.array([[0.8, 14.5, np.nan], [0.79, 71.0, np.nan], [-2.0, 30.0, np.nan]])
    born, found = birth(dim=dim, existence=np.array([0.3, 0.2])), []
    for name, stds in ((third, [0.05, 2.0, 0.5]), (without, [0.05, 2.0])):
        own = {
            "measurement": getattr(models, name)(),
            "noise": models.constant_noise(stds),
            "clutter": models.region_clutter(2.0, REGION, name),
        }
        rows = ScanRows(scan, np.zeros((3, 3))) if name == third else scan[:, :2]
        found.append(step(make(kind, motion=motion, birth=born, **own), rows)[0])
    close(found[0], found[1], rtol=1e-7)


@every_kind
def test_angles_of_rows_with_noise_are_wrapped(kind: Any) -> None:
    filter, stds, turn = (
        make(kind, **polar()),
        np.tile([0.02, 3.0], (3, 1)),
        np.outer([1.0, 1.0, -1.0], [2.0 * np.pi, 0.0]),
    )
    close(step(filter, ScanRows(POLAR - turn, stds))[0], step(filter, ScanRows(POLAR, stds))[0])
    with pytest.raises(InputError, match="radians"):
        step(filter, ScanRows(POLAR + 2.0 * turn, stds))


@pytest.mark.parametrize(
    ("covs", "expected"),
    [
        (np.ones((2, 2)), "shape"),
        ([[[1.0, 2.0], [2.0, 1.0]]] * 3, "positive definite"),
        ([[[1.0, 0.5], [0.2, 1.0]]] * 3, "symmetric"),
        ([[[-1.0, 0.0], [0.0, 1.0]]] * 3, "positive definite"),
        (np.full((3, 2), np.nan), "not NaN"),
        (np.full((3, 2), np.inf), "finite numbers, but for the variance of a component not measured"),
    ],
)
def test_bad_covariances_are_refused(covs: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        ScanRows(SCAN, covs)


def test_a_filter_refuses_rows_of_another_length_and_of_other_classes() -> None:
    filter = make(next(iter(BELIEFS)))
    with pytest.raises(InputError, match=r"scan: expected an array of shape .*; got shape \(3, 4\)"):
        step(filter, np.zeros((3, 4)))
    with pytest.raises(InputError, match=r"got shape \(3, 3\)"):
        step(filter, ScanRows(np.zeros((3, 3)), np.ones((3, 3))))
    with pytest.raises(InputError, match="class ratios of 0 classes, as the targets have; got those of 2"):
        step(filter, ScanRows(SCAN, class_ratios=np.zeros((3, 2))))
