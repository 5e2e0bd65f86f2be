"""Small scenes for the filters, each as the library's models and as the oracle's plain functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import reference
from densities.examples import plain_glmb as plain_glmb
from densities.examples import plain_lmb as plain_lmb
from reference import Floats
from reference.glmb import Model
from vedette import models
from vedette.densities import LMB
from vedette.filters import DeltaGlmbFilter, Limits, LmbFilter

DT = 1.5
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)


@models.model_function("prob_survival")
def surviving_near_the_origin(state, dt, params):
    return params[0] * math.exp(-0.5 * (state[0] * state[0] + state[1] * state[1]) / (params[1] * params[1]))


@dataclass(frozen=True)
class Scene:
    """Models, births by step, scans and pose; `plain` is the oracle's side of the same."""

    motion: models.MotionModel
    survival: models.SurvivalModel
    births: models.BirthModel
    sensor: models.SensorModel
    pose: Floats
    scans: list[Floats]
    plain: Model

    def plain_births(self, step: int) -> reference.Lmb:
        if not self.births.is_active(step):
            return {}
        sites = zip(self.births.existence, self.births.means, self.births.covs, strict=True)
        return {(step, i): (float(r), [(1.0, mean, cov)]) for i, (r, mean, cov) in enumerate(sites)}

    @property
    def targets(self) -> models.TargetModel:
        return models.TargetModel(self.motion, self.survival, self.births)

    def glmb_filter(self, **options: Any) -> DeltaGlmbFilter:
        options.setdefault("limits", Limits.none())
        return DeltaGlmbFilter(self.targets, self.sensor, **options)

    def lmb_filter(self, **options: Any) -> LmbFilter:
        options.setdefault("limits", Limits.none())
        return LmbFilter(self.targets, self.sensor, **options)


def cv_matrices(sigma: float) -> tuple[Floats, Floats]:
    """Transition matrix and process noise of constant velocity over DT."""
    eye, zero = np.eye(2), np.zeros((2, 2))
    transition = np.block([[eye, DT * eye], [zero, eye]])
    noise = sigma**2 * np.block([[DT**4 / 4 * eye, DT**3 / 2 * eye], [DT**3 / 2 * eye, DT**2 * eye]])
    return transition, noise


def _turn(state: Floats) -> Floats:
    px, py, vx, vy, rate = state
    sine, cosine = math.sin(rate * DT), math.cos(rate * DT)
    return np.array(
        [
            px + (sine * vx - (1.0 - cosine) * vy) / rate,
            py + ((1.0 - cosine) * vx + sine * vy) / rate,
            cosine * vx - sine * vy,
            sine * vx + cosine * vy,
            rate,
        ]
    )


def _turn_noise(sigma_v: float, sigma_rate: float) -> Floats:
    noise = np.zeros((5, 5))
    noise[:4, :4] = cv_matrices(sigma_v)[1]
    noise[4, 4] = (DT * sigma_rate) ** 2
    return noise


def _polar(pose: Floats) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
    def measure(state: Floats) -> Floats:
        dx, dy = state[0] - pose[0], state[1] - pose[1]
        return np.array([math.atan2(dy, dx), math.hypot(dx, dy)])

    def jacobian(state: Floats) -> Floats:
        dx, dy = state[0] - pose[0], state[1] - pose[1]
        square = dx * dx + dy * dy
        rows = np.zeros((2, len(state)))
        rows[0, :2] = -dy / square, dx / square
        rows[1, :2] = dx / math.sqrt(square), dy / math.sqrt(square)
        return rows

    return measure, jacobian


def linear_scene(
    existence: float = 0.3, prob_survival: float = 0.9, prob_detection: float = 0.85, method: str = "ekf"
) -> Scene:
    """Two sites a stone's throw apart seen in position: every measurement may be anyone's."""
    transition, noise = cv_matrices(3.0)
    rows = np.eye(2, 4)
    means = np.array([[100.0, 50.0, 5.0, -3.0], [130.0, 60.0, -4.0, 2.0]])
    covs = np.stack([np.diag([20.0, 15.0, 5.0, 5.0]) ** 2, np.diag([10.0, 25.0, 6.0, 4.0]) ** 2])
    scans = [
        np.array([[112.0, 52.0], [131.0, 48.0]]),
        np.array([[120.0, 49.0], [122.0, 61.0]]),
        np.array([[119.0, 57.0]]),
    ]
    return Scene(
        models.constant_velocity(3.0, method=method),
        models.constant_survival(prob_survival),
        models.BirthModel(np.array([existence, 0.2]), means, covs, steps=frozenset({1, 2})),
        models.SensorModel(
            models.position(),
            models.constant_noise([12.0, 9.0]),
            models.constant_detection(prob_detection),
            models.region_clutter(200.0, REGION, "position"),
            method=method,
            detection_at="centre",
        ),
        np.zeros(3),
        scans,
        Model(
            transition=lambda x: transition @ x,
            transition_jacobian=lambda x: transition,
            process_noise_cov=lambda x: noise,
            prob_survival=lambda x: prob_survival,
            measurement=lambda x: x[:2],
            measurement_jacobian=lambda x: rows,
            measurement_noise_cov=lambda x: np.diag([12.0, 9.0]) ** 2,
            prob_detection=lambda x: prob_detection,
            clutter_intensity=lambda z: 200.0 / 4e6,
            angular=(False, False),
            method=method,
        ),
    )


def polar_scene(method: str) -> Scene:
    """Targets due west of a sensor, where the bearing jumps; noise, detection and survival depend on where they are.

    The extended filter moves them at constant velocity, the sigma-point filters in turns.
    """
    pose = np.array([-300.0, 100.0, 0.7])
    measure, jacobian = _polar(pose)
    turning = method != "ekf"
    means = np.array([[-700.0, 95.0, 6.0, 4.0, 0.04], [-720.0, 112.0, -5.0, -6.0, -0.03]])
    covs = np.stack([np.diag([15.0, 12.0, 4.0, 4.0, 0.05]) ** 2, np.diag([12.0, 14.0, 3.0, 5.0, 0.04]) ** 2])
    dim = 5 if turning else 4
    transition, noise = cv_matrices(2.0)
    motion = models.constant_velocity(2.0)
    if turning:
        motion = models.coordinated_turn(2.0, 0.01, method=method)
        noise = _turn_noise(2.0, 0.01)

    def noise_cov(state: Floats) -> Floats:
        distance = math.hypot(state[0] - pose[0], state[1] - pose[1])
        return np.diag([0.02 + 5e-5 * distance, 8.0 + 2e-5 * distance**2]) ** 2

    def clutter_intensity(measurement: Floats) -> float:
        return 300.0 * float(measurement[1]) / 4e6

    scans = [
        np.array([[3.12, 402.0], [-3.11, 421.0]]),
        np.array([[-3.135, 409.0], [3.1, 417.0]]),
        np.array([[-3.12, 415.0]]),
    ]
    return Scene(
        motion,
        models.SurvivalModel(surviving_near_the_origin, np.array([0.97, 2000.0])),
        models.BirthModel(np.array([0.3, 0.2]), means[:, :dim], covs[:, :dim, :dim], steps=frozenset({1, 2})),
        models.SensorModel(
            models.bearing_range(),
            models.range_dependent_noise(8.0, 2e-5, 0.02, 5e-5),
            models.gaussian_detection(900.0),
            models.region_clutter(300.0, REGION, "bearing_range"),
            method=method,
            detection_at="centre",
        ),
        pose,
        scans,
        Model(
            transition=_turn if turning else lambda x: transition @ x,
            transition_jacobian=lambda x: transition,
            process_noise_cov=lambda x: noise,
            prob_survival=lambda x: 0.97 * math.exp(-0.5 * float(x[:2] @ x[:2]) / 2000.0**2),
            measurement=measure,
            measurement_jacobian=jacobian,
            measurement_noise_cov=noise_cov,
            prob_detection=lambda x: math.exp(-0.5 * float((x[:2] - pose[:2]) @ (x[:2] - pose[:2])) / 900.0**2),
            clutter_intensity=clutter_intensity,
            angular=(True, False),
            method=method,
        ),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "linear": linear_scene,
    "linear ukf": lambda: linear_scene(method="ukf"),
    "ekf": lambda: polar_scene("ekf"),
    "ukf": lambda: polar_scene("ukf"),
    "ckf": lambda: polar_scene("ckf"),
}


def assert_same_mixtures(got: reference.Mixture, expected: reference.Mixture, tolerance: float = 1e-10) -> None:
    """Component by component, in any order; states relative to their standard deviations."""
    assert len(got) == len(expected)
    for pair in zip(sorted(got, key=_place), sorted(expected, key=_place), strict=True):
        (w, m, c), (expected_w, expected_m, expected_c) = pair
        stds = np.sqrt(np.diagonal(expected_c))
        assert abs(w - expected_w) <= tolerance
        np.testing.assert_allclose(m / stds, expected_m / stds, rtol=0.0, atol=10.0 * tolerance)
        np.testing.assert_allclose(c / np.outer(stds, stds), expected_c / np.outer(stds, stds), atol=10.0 * tolerance)


def assert_same_lmb(got: LMB, expected: reference.Lmb, tolerance: float = 1e-10) -> None:
    """The same labels, existences and mixtures, in which equal components are one."""
    found = plain_lmb(got)
    assert found.keys() == expected.keys()
    for label, (existence, mixture) in expected.items():
        assert abs(found[label][0] - existence) <= tolerance
        assert_same_mixtures(together(found[label][1]), together(mixture))


def together(mixture: reference.Mixture) -> reference.Mixture:
    """The same mixture with equal components added up."""
    places: dict[tuple[float, ...], tuple[float, Floats, Floats]] = {}
    for component in mixture:
        weight, mean, cov = component
        place = _place(component)
        places[place] = (weight + places[place][0] if place in places else weight, mean, cov)
    return list(places.values())


def _place(component: tuple[float, Floats, Floats]) -> tuple[float, ...]:
    return tuple(np.round(component[1], 5).tolist())


def _key(tracks: dict[reference.Label, reference.Mixture]) -> Any:
    """Tells hypotheses apart: their labels and, for its history, the rounded first mean of each track."""
    return tuple((label, tuple(np.round(mixture[0][1], 4).tolist())) for label, mixture in sorted(tracks.items()))


def assert_same_glmb(got: reference.Glmb, expected: reference.Glmb, tolerance: float = 1e-10) -> None:
    """The same hypotheses (labels and histories), their weights, and every track's mixture."""
    got_by_key = {_key(tracks): (weight, tracks) for weight, tracks in got}
    expected_by_key = {_key(tracks): (weight, tracks) for weight, tracks in expected}
    assert len(got_by_key) == len(got)
    assert len(expected_by_key) == len(expected)
    assert got_by_key.keys() == expected_by_key.keys()
    for key, (weight, tracks) in expected_by_key.items():
        assert abs(got_by_key[key][0] - weight) <= tolerance
        for label, mixture in tracks.items():
            assert_same_mixtures(got_by_key[key][1][label], mixture, tolerance)
