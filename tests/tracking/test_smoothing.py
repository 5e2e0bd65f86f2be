"""Smoothed tracks against batch solutions, and lags against the whole run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from tracking.scenes import rngs, scans_of, sensor, targets
from vedette import models
from vedette.densities import Estimate, best_estimate
from vedette.errors import InputError
from vedette.filters import (
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    PhdFilter,
    SequentialLmbFilter,
)
from vedette.kernels.base.types import Floats
from vedette.tracking import Central, Distributed, FixedLagSmoother, TraceEntry, Tracker, smooth

TIMES = np.array([1.0, 1.5, 3.5, 4.0, 7.0, 7.0, 8.0, 12.0, 13.0])  # two scans at one time
PRIOR = np.diag([400.0, 400.0, 25.0, 25.0])
STDS = (5.0, 2.0)
WORLD = targets((0.5,))
SENSORS = tuple(sensor(std) for std in STDS)
LIMITS = Limits(max_components=1)
POSES = np.zeros((2, 3))


def transition(dt: float) -> tuple[Floats, Floats]:
    """F, and G with Q = G G', of constant velocity with process noise 1 m/s^1.5 (paper-notes 1)."""
    gain = np.array([[dt**2 / 2.0], [dt]])
    return np.asarray(np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2))), np.asarray(np.kron(gain, np.eye(2)))


def batch(times: Floats, rows: Sequence[Sequence[Floats | None]]) -> tuple[Floats, Floats]:
    """Means and covariances of the states at all times, given all measurements.

    By least squares for the first state and all accelerations, as Q has no inverse.
    """
    size = 4 + 2 * (len(times) - 1)
    states = np.zeros((len(times), 4, size))  # each a linear function of them
    states[0, :, :4] = np.eye(4)
    for k, dt in enumerate(np.diff(times)):
        f, gain = transition(dt)
        states[k + 1] = f @ states[k]
        states[k + 1, :, 4 + 2 * k : 6 + 2 * k] += gain
    precision, information = np.eye(size), np.zeros(size)
    precision[:4, :4] = np.linalg.inv(PRIOR)
    for own, scans in zip(states, rows, strict=True):
        for std, scan in zip(STDS, scans, strict=True):
            for place in () if scan is None else scan:
                precision += own[:2].T @ own[:2] / std**2
                information += own[:2].T @ place / std**2
    cov = np.linalg.inv(precision)
    return states @ (cov @ information), states @ cov @ states.transpose(0, 2, 1)


def trace_of(tracker: Tracker, times: Floats, rows: Sequence[Sequence[Floats | None]]) -> list[TraceEntry]:
    num = len(tracker.sensors)
    state, found = tracker.initial(), []
    for time, scans in zip(times.tolist(), rows, strict=True):
        state, _ = tracker.step(state, scans[:num], POSES[:num], time, rngs=rngs(num))
        found.append(TraceEntry(time, state.fused, best_estimate(state.fused, state.step)))
    return found


def rows_of(rng: np.random.Generator, lost: Sequence[int] = (), missed: Sequence[int] = ()) -> list[list[Any]]:
    """Scans of the sensors in turn, of a single target. lost: without a scan; missed: with an empty one."""
    state = np.array([10.0, -5.0, 3.0, 2.0])
    rows = []
    for i in range(len(TIMES)):
        state = state + np.array([1.0, 2.0, 0.0, 0.0])
        scan = (state[:2] + rng.normal(0.0, STDS[i % 2], 2))[None]
        here = None if i in lost else scan[:0] if i in missed else scan
        rows.append([here if s == i % 2 else None for s in range(2)])
    return rows


@pytest.mark.parametrize(("lost", "missed"), [((), ()), ((3, 4), ()), ((), (2, 5)), ((1,), (4,))])
@pytest.mark.parametrize("kind", [SequentialLmbFilter, MultiSensorGlmbFilter])
def test_a_single_target_has_the_batch_solution(kind: Any, lost: Sequence[int], missed: Sequence[int]) -> None:
    rows = rows_of(np.random.default_rng(3), lost, missed)
    trace = trace_of(Central(kind(WORLD, SENSORS, LIMITS)), TIMES, rows)
    means, covs = batch(TIMES, rows)
    found = smooth(trace, WORLD)
    assert [len(each.labels) for each in found] == [1] * len(TIMES)
    np.testing.assert_allclose(np.concatenate([each.means for each in found]), means, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.concatenate([each.covs for each in found]), covs, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", [LmbFilter, DeltaGlmbFilter, FactoredGlmbFilter])
def test_filters_of_one_sensor_have_the_batch_solution(kind: Any) -> None:
    rows = [[scans[0], None] for scans in rows_of(np.random.default_rng(4))]
    trace = trace_of(Distributed((kind(WORLD, SENSORS[0], LIMITS),)), TIMES, rows)
    means, covs = batch(TIMES, rows)
    found = smooth(trace, WORLD)
    first = next(i for i, each in enumerate(found) if len(each.labels))
    np.testing.assert_allclose(np.concatenate([each.means for each in found]), means[first:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.concatenate([each.covs for each in found]), covs[first:], rtol=1e-9, atol=1e-9)


def test_a_lag_has_the_batch_solution_of_the_scans_within_it() -> None:
    rows = rows_of(np.random.default_rng(5))
    trace = trace_of(Central(SequentialLmbFilter(WORLD, SENSORS, LIMITS)), TIMES, rows)
    found = smooth(trace, WORLD, lag_s=3.0)
    for i, time in enumerate(TIMES):
        end = int(np.searchsorted(TIMES, time + 3.0)) + 1
        means, covs = batch(TIMES[:end], rows[:end])
        np.testing.assert_allclose(found[i].means, means[i][None], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found[i].covs, covs[i][None], rtol=1e-9, atol=1e-9)


def same(one: Estimate, other: Estimate) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in ("labels", "means", "covs"))


def test_a_lag_longer_than_the_run_is_the_whole_run() -> None:
    trace = crowded(np.random.default_rng(6))[0]
    smoother = FixedLagSmoother(WORLD, 1000.0)
    assert all(smoother.add(*entry) == () for entry in trace)
    assert all(map(same, smoother.finish(), smooth(trace, WORLD)))


def test_a_smoother_keeps_only_the_scans_of_its_lag() -> None:
    trace = trace_of(Central(SequentialLmbFilter(WORLD, SENSORS, LIMITS)), TIMES, rows_of(np.random.default_rng(7)))
    smoother, final = FixedLagSmoother(WORLD, 2.0), 0
    for number, entry in enumerate(trace, start=1):
        final += len(smoother.add(*entry))
        assert final == np.sum(TIMES[:number] + 2.0 <= entry.time)
    assert final + len(smoother.finish()) == len(TIMES)


def crowded(rng: np.random.Generator) -> tuple[list[TraceEntry], Floats]:
    """A trace of 30 scans of two targets in clutter, and their true states (num_scans, 2, 4)."""
    world = replace(targets((0.5, 0.5)), survival=models.constant_survival(0.999))
    camera = sensor(5.0, 0.8, 1.0)
    f, gain = transition(1.0)
    state = world.birth.means + rng.multivariate_normal(np.zeros(4), PRIOR, 2)
    times, truth, rows = np.arange(1.0, 31.0), [], []
    for _ in times:
        truth.append(state)
        rows.append([*scans_of(state, [camera], POSES[:1], rng), None])
        state = state @ f.T + rng.standard_normal((2, 2)) @ gain.T
    return trace_of(Distributed((FactoredGlmbFilter(world, camera),)), times, rows), np.array(truth)


def errors_of(estimates: Sequence[Estimate], truth: Floats) -> tuple[list[float], list[float]]:
    """Squared distances of positions and NEES of the estimates, by their labels of birth."""
    squares, nees = [], []
    for estimate, states in zip(estimates, truth, strict=True):
        for (_, index), mean, cov in zip(estimate.labels.tolist(), estimate.means, estimate.covs, strict=True):
            change = mean - states[index]
            squares.append(float(change[:2] @ change[:2]))
            nees.append(float(change @ np.linalg.solve(cov, change)))
    return squares, nees


@pytest.mark.slow
def test_smoothed_covariances_are_consistent_and_errors_smaller() -> None:
    scenes, before, after = [], [], []
    for number in range(20):
        trace, truth = crowded(np.random.default_rng([8, number]))
        before += errors_of([entry.estimate for entry in trace], truth)[0]
        squares, nees = errors_of(smooth(trace, WORLD), truth)
        after += squares
        scenes.append(np.mean(nees))
    # errors of neighbouring scans are dependent, so count each scene as if it had six independent states
    low, high = chi2.ppf([0.005, 0.995], 20 * 6 * 4) / (20 * 6)
    assert low < np.mean(scenes) < high
    assert math.sqrt(np.mean(after)) < 0.8 * math.sqrt(np.mean(before))


def test_bad_input_names_what_was_expected() -> None:
    rows = rows_of(np.random.default_rng(9))[:2]
    trace = trace_of(Central(SequentialLmbFilter(WORLD, SENSORS, LIMITS)), TIMES[:2], rows)
    with pytest.raises(InputError, match="lag_s"):
        smooth(trace, WORLD, lag_s=0.0)
    with pytest.raises(InputError, match="targets"):
        smooth(trace, None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"time: expected one from that of the last scan on, 1.5 s; got 1"):
        smooth(trace[::-1], WORLD)
    phd = PhdFilter(WORLD, SENSORS[0])
    with pytest.raises(InputError, match="density: expected one with labels"):
        FixedLagSmoother(WORLD).add(0.0, phd.initial(), trace[0].estimate)  # type: ignore[arg-type]
