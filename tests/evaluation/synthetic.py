"""Runs that look like real ones, made without any filter: the paper's layout, noisy estimates, plausible rewards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.densities.estimates import Estimate
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.rewards import MeanRewards, mean_rewards
from vedette.kernels.base.types import Floats
from vedette.platforms import Actions
from vedette.simulation.health import Health
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.truth import Truth

TARGETS = np.array([[-55.0, 875, 15, -6], [-180, -205, -5.5, -19], [-320, 485, 5.5, -5.5], [340, -5, 10, 6]])
SENSORS = np.array([[-745.0, 830.0, 0.0], [-580.0, 220.0, 0.0]])
DEGREES = np.arange(-180.0, 181.0, 30.0)
ACTIONS = Actions(("heading_deg",), DEGREES[:, np.newaxis])
DECISION_STEPS = (9, 19, 29)
SPEED = 50.0
NOISE = {"jdm": 6.0, "idm": 6.5, "random": 14.0, "constant": 12.0}


def make_truth(num_scans: int = 40) -> Truth:
    """Four targets at constant velocity; the third is born at the tenth scan."""
    times = np.arange(1.0, num_scans + 1)
    rows = [
        (target, np.r_[state[:2] + state[2:] * (time - 1), state[2:]])
        for time in times
        for target, state in enumerate(TARGETS)
        if target != 2 or time >= 10
    ]
    counts = [4 if time >= 10 else 3 for time in times]
    ids = np.array([target for target, _ in rows], np.int64)
    return Truth(times, np.concatenate([[0], np.cumsum(counts)]), ids, np.array([state for _, state in rows]))


def make_plan(planner: str, rng: np.random.Generator, num_sensors: int = 2) -> Plan:
    """A plan of the kind that the named planner makes, with smooth rewards."""
    peaks = np.deg2rad([-40.0, 20.0, 120.0])[:num_sensors]
    curves = [2.0 + np.cos(np.deg2rad(DEGREES) - peak) + 0.05 * rng.standard_normal(len(ACTIONS)) for peak in peaks]
    errors = [np.full(len(ACTIONS), 0.12)] * num_sensors
    if planner == "idm":
        tables = tuple(RewardTable((sensor,), curve, errors[sensor]) for sensor, curve in enumerate(curves))
        chosen = tuple(int(curve.argmax()) for curve in curves)
    elif planner == "jdm":
        joint = curves[0].reshape(-1, *(1,) * (num_sensors - 1))
        for axis, curve in enumerate(curves[1:], start=1):
            joint = joint + curve.reshape(*(1,) * axis, -1, *(1,) * (num_sensors - 1 - axis))
        tables = (RewardTable(tuple(range(num_sensors)), joint, np.full(joint.shape, 0.12)),)
        chosen = tuple(int(index) for index in np.unravel_index(joint.argmax(), joint.shape))
    else:
        tables, chosen = (), tuple(int(index) for index in rng.integers(0, len(ACTIONS) - 1, num_sensors))
    return Plan(planner, (ACTIONS,) * num_sensors, chosen, tables, {"samples": 40 if tables else 0})


def make_record(planner: str = "jdm", run: int = 0, seed: int = 7, num_scans: int = 40) -> RunRecord:
    """One run: sensors still until the first decision, then at constant speed on the chosen headings."""
    rng = np.random.default_rng([seed, run, sorted(NOISE).index(planner)])
    truth = make_truth(num_scans)
    poses, decisions = _move(planner, truth.times, rng)
    estimates = tuple(_estimate(truth, scan, NOISE[planner], rng) for scan in range(num_scans))
    record = RunRecord(
        scenario="synthetic",
        planner=planner,
        seed=seed,
        run=run,
        times=truth.times,
        truth=truth,
        poses=poses,
        off=np.zeros(poses.shape[:2], np.bool_),
        estimates=estimates,
        decisions=decisions,
        ospa=np.zeros((num_scans, 3)),
        health=_health(num_scans, rng),
        timings={"filter": np.linspace(0.001, 0.002, num_scans), "planning": np.full(num_scans, 0.1)},
    )
    return replace(record, ospa=ospa_of_run(truth, estimates, cutoff=100.0, order=1.0))


def _move(planner: str, times: Floats, rng: np.random.Generator) -> tuple[Floats, tuple[Decision, ...]]:
    poses, decisions = np.empty((len(times), 2, 3)), []
    pose, moving = SENSORS.copy(), False
    for scan, time in enumerate(times):
        if moving:
            pose = pose + SPEED * np.c_[np.cos(pose[:, 2]), np.sin(pose[:, 2]), np.zeros(2)]
        poses[scan] = pose
        if scan in DECISION_STEPS and planner != "constant":
            plan = make_plan(planner, rng)
            decisions.append(Decision(scan + 1, float(time), pose.copy(), plan))
            pose = np.c_[pose[:, :2], np.deg2rad(plan.chosen_actions)]
            moving = True
    return poses, tuple(decisions)


def _health(num_scans: int, rng: np.random.Generator) -> Health:
    """Two sensors that cut off a little at every scan, and a label that the second lacks at every fourth."""
    health = Health.unreported(num_scans, 2)
    health.truncation_error_bound[:] = rng.uniform(0.0, 1e-3, (num_scans, 2))
    health.log_likelihood[0] = np.nan
    health.num_hypotheses[:] = rng.integers(1, 300, (num_scans, 2))
    health.fusion_num_sets[:] = 10
    health.num_missing_sets[::4, 1] = health.num_missing_labels[::4, 1] = 1
    health.fusion_num_lost_labels[::4] = 1
    return health


def _estimate(truth: Truth, scan: int, noise: float, rng: np.random.Generator) -> Estimate:
    rows = slice(truth.offsets[scan], truth.offsets[scan + 1])
    seen = rng.random(rows.stop - rows.start) < (0.3 if scan < 2 else 0.97)
    states = truth.states[rows][seen]
    means = states + rng.normal(0.0, [noise, noise, 1.0, 1.0], states.shape) * (3.0 if scan < 6 else 1.0)
    labels = np.c_[np.ones(len(means), np.int64), truth.ids[rows][seen]]
    covs = np.broadcast_to(np.diag([noise**2, noise**2, 1.0, 1.0]), (len(means), 4, 4)).copy()
    return Estimate(labels, means, covs, rng.uniform(0.9, 1.0, len(means)))


def means_of(records: Sequence[RunRecord]) -> list[MeanRewards]:
    """The mean rewards of every decision of some runs."""
    return [mean_rewards(records, decision) for decision in range(len(records[0].decisions))]
