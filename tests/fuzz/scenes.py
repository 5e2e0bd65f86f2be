"""Random filters, scans and beliefs at the edges of what is allowed."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette import models
from vedette.densities import GLMB, LMB, IidCluster, MultiBernoulli, Poisson
from vedette.filters import (
    BeliefPropagation,
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    Gibbs,
    Limits,
    LmbFilter,
    PhdFilter,
    RankedAssignment,
)

Rng = np.random.Generator

KINDS = ("ranked", "gibbs", "marginalised", "lmb", "phd", "cphd", "cbmember")
LABELLED = KINDS[:4]
SENSORS = ("position", "bearing_range", "bearing_only", "range_only")
METHODS = ("auto", "ukf", "ckf")


def one_of(rng: Rng, *values: Any) -> Any:
    return values[rng.integers(len(values))]


def some(rng: Rng, usual: float, low: float, high: float) -> float:
    """The usual number about half the time, else any magnitude between the two."""
    return usual if rng.random() < 0.5 else float(np.exp(rng.uniform(np.log(low), np.log(high))))


def time_step(rng: Rng) -> float:
    return some(rng, 1.0, 1e-9, 1e7)


def covariance(rng: Rng, dim: int) -> Any:
    """Of a condition up to 1e12, along the axes or not."""
    scale, spread = some(rng, 100.0, 1e-6, 1e8), rng.uniform(0.0, 12.0) if rng.random() < 0.5 else 0.0
    variances = scale * 10.0 ** (-spread * rng.random(dim))
    if rng.random() < 0.5:
        return np.diag(variances)
    turn = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
    cov = (turn * variances) @ turn.T
    return 0.5 * (cov + cov.T)


def states(rng: Rng, num: int, dim: int) -> Any:
    reach, speed = some(rng, 1e3, 1e-6, 1e9), some(rng, 10.0, 1e-9, 1e5)
    out = np.zeros((num, dim))
    out[:, :2] = rng.uniform(-reach, reach, (num, 2)) + (rng.integers(2) * reach)
    out[:, 2:4] = rng.uniform(-speed, speed, (num, 2))
    out[:, 4:] = rng.uniform(-1.0, 1.0, (num, dim - 4)) * some(rng, 0.1, 1e-12, 1e2)
    if num > 1 and rng.random() < 0.3:
        out[1] = out[0]
    return out


def _limits(rng: Rng) -> Limits:
    return Limits(
        max_hypotheses=one_of(rng, 1, 2, 5, 20, 60),
        min_relative_weight=one_of(rng, 0.0, 1e-6, 1e-6, 0.5),
        min_track_weight=one_of(rng, 0.0, 1e-5, 1.0),
        gate_probability=one_of(rng, 1.0, 1.0 - 1e-7, 0.99, 1e-6),
        min_log_clutter=one_of(rng, -60.0, -60.0, -700.0, 5.0),
        max_search_nodes=one_of(rng, 1, 50, 10_000),
        min_component_weight=one_of(rng, 0.0, 1e-5, 0.4),
        merge_distance=one_of(rng, 0.0, 2.0, 1e6),
        max_components=one_of(rng, 1, 1, 2, 6),
        min_existence=one_of(rng, 0.0, 1e-4, 0.4),
        max_labels=one_of(rng, 1, 4, 12),
        max_intensity_components=one_of(rng, 1, 5, 30),
        max_existence=one_of(rng, 0.999, 0.5, 1.0 - 2.0**-53),
    )


def _detection(rng: Rng) -> models.DetectionModel:
    prob = one_of(rng, 0.0, 1e-12, 0.1, 0.6, 0.9, 0.98, 1.0 - 1e-12, 1.0)
    kind = rng.integers(5)
    if kind == 0:
        return models.gaussian_detection(some(rng, 1e4, 1e-3, 1e9))
    if kind == 1:
        return models.limited_range(prob, some(rng, 1e3, 1e-3, 1e9))
    if kind == 2:
        return models.limited_sector(prob, some(rng, 1e3, 1e-3, 1e9), rng.uniform(1e-6, np.pi))
    return models.constant_detection(prob)


def _sensor(rng: Rng) -> models.SensorModel:
    kind = one_of(rng, *SENSORS)
    measurement = getattr(models, kind)()
    is_bearing = np.array({"position": [0, 0], "bearing_range": [1, 0], "bearing_only": [1], "range_only": [0]}[kind])
    rate = one_of(rng, 0.0, 1e-9, 1.0, 10.0, 300.0)
    reach = some(rng, 2e3, 1e-3, 1e10)
    if rng.random() < 0.5:
        clutter = models.region_clutter(rate, models.Region(-reach, reach, -reach, reach), kind)
    else:
        high = np.where(is_bearing, np.pi, reach)
        clutter = models.measurement_space_clutter(rate, -high, high, angular=is_bearing.astype(bool))
    if kind == "position" or rng.random() < 0.5:
        noise = models.constant_noise(
            [some(rng, 0.01 if bearing else 10.0, 1e-12, 3.0 if bearing else 1e6) for bearing in is_bearing]
        )
    else:
        grows = {"sigma_range": some(rng, 10.0, 1e-12, 1e6), "eta_range": one_of(rng, 0.0, 5e-5)}
        turns = {"sigma_bearing": some(rng, 0.02, 1e-12, 3.0), "eta_bearing": one_of(rng, 0.0, 5e-6)}
        parts = {"bearing_range": grows | turns, "bearing_only": turns, "range_only": grows}
        noise = models.range_dependent_noise(**parts[kind])
    return models.SensorModel(measurement, noise, _detection(rng), clutter, method=one_of(rng, *METHODS))


def _birth(rng: Rng, dim: int) -> models.BirthModel:
    num = int(rng.integers(1, 4))
    existence = [one_of(rng, 1e-12, 0.03, 0.3, 0.9, 1.0 - 1e-12) for _ in range(num)]
    steps = one_of(rng, None, None, frozenset([1]), frozenset([1, 2]))
    covs = np.stack([covariance(rng, dim) for _ in range(num)])
    return models.BirthModel(np.array(existence), states(rng, num, dim), covs, steps)


def world(rng: Rng) -> models.TargetModel:
    """What all sensors of an episode share."""
    sigma, method = one_of(rng, 0.0, some(rng, 5.0, 1e-12, 1e6)), one_of(rng, *METHODS)
    if rng.random() < 0.7:
        motion = models.constant_velocity(sigma, method=method)
    else:
        motion = models.coordinated_turn(sigma, one_of(rng, 0.0, some(rng, 0.01, 1e-12, 10.0)), method=method)
    survival = models.constant_survival(one_of(rng, 0.0, 1e-9, 0.5, 0.99, 0.99, 1.0))
    return models.TargetModel(motion, survival, _birth(rng, motion.state_dim))


def make_filter(rng: Rng, kind: str, targets: models.TargetModel) -> Any:
    """A filter of the kind, with a sensor and limits of its own."""
    args = (targets, _sensor(rng), Limits() if rng.random() < 0.3 else _limits(rng))
    if kind in ("ranked", "gibbs", "marginalised"):
        drawn = Gibbs(int(rng.integers(1, 40)))
        return DeltaGlmbFilter(
            *args, drawn if kind == "gibbs" else one_of(rng, RankedAssignment(), drawn), kind == "marginalised"
        )
    if kind == "lmb":
        return LmbFilter(*args, one_of(rng, RankedAssignment(), RankedAssignment(), BeliefPropagation()))
    return {"phd": PhdFilter, "cphd": CphdFilter, "cbmember": CbMemberFilter}[kind](*args)


def first_belief(rng: Rng, kind: str, local: Any) -> Any:
    """No target; or some that were there before step 1, certain ones among them."""
    dim = local.targets.state_dim
    if rng.random() < 0.6:
        return local.initial()
    num = int(rng.integers(1, 4))
    means, covs = states(rng, num, dim), np.stack([covariance(rng, dim) for _ in range(num)])
    existence = np.array([one_of(rng, 0.0, 1e-12, 0.3, 0.9, 1.0 - 1e-12, 1.0) for _ in range(num)])
    labels = np.column_stack([np.zeros(num, np.int64), np.arange(num)])
    if kind == "phd":
        return Poisson.from_gaussians(existence + 1e-9, means, covs)
    if kind == "cphd":
        return IidCluster.from_gaussians([0.25, 0.5, 0.25], np.full(num, 1.0 / num), means, covs)
    if kind == "cbmember":
        return MultiBernoulli.from_gaussians(existence, means, covs)
    lmb = LMB.from_bernoullis(labels, existence, means, covs)
    if kind == "lmb":
        return lmb
    return GLMB.from_hypotheses(lmb.tracks, [range(num), []], [0.75, 0.25])


def pose(rng: Rng) -> Any:
    reach = one_of(rng, 0.0, 1e3, 1e9)
    return np.array([*rng.uniform(-reach, reach, 2), rng.uniform(-np.pi, np.pi)])


def scan(rng: Rng, local: Any, at: Any) -> Any:
    """Measurements on the targets that births promise, beside them, anywhere, and repeats."""
    sensor, targets = local.sensor, local.targets
    rows = [np.empty((0, sensor.meas_dim))]
    if rng.random() < 0.8:
        seen = sensor.measurement.measure(targets.birth.means, at)
        off = one_of(rng, 0.0, 1.0, 1.0, 6.0) * rng.standard_normal(seen.shape)
        rows.append(
            seen + off * np.sqrt(np.diagonal(sensor.noise.covs(targets.birth.means, at, sensor.meas_dim), 0, 1, 2))
        )
    if rng.random() < 0.5:
        rows.append(
            sensor.clutter.sample(at, sensor.measurement, state_dim=targets.state_dim, rng=rng)[: rng.integers(1, 15)]
        )
    if rng.random() < 0.1:
        rows.append(rng.standard_normal((2, sensor.meas_dim)) * one_of(rng, 1e-300, 1e9, 1e300))
    table = np.concatenate(rows)
    # Angles are measured in (-pi, pi].
    table = np.where(sensor.measurement.angular, np.remainder(table + np.pi, 2.0 * np.pi) - np.pi, table)
    if len(table) and rng.random() < 0.2:
        table = np.concatenate([table, table[:1], table[:1] * (1.0 + 1e-15)])
    return table[rng.permutation(len(table))]


def wrong_scan(rng: Rng, meas_dim: int) -> Any:
    """What is no scan of such measurements."""
    return one_of(
        rng,
        np.full((1, meas_dim), np.nan),
        np.full((2, meas_dim), np.inf),
        [["a"] * meas_dim],
        np.zeros((2, meas_dim + 1)),
        np.zeros((1, 1, meas_dim)),
        np.zeros(meas_dim),
        [[0.0] * meas_dim, [0.0] * (meas_dim + 2)],
        None,
        "scan",
        [[None] * meas_dim],
        object(),
    )
