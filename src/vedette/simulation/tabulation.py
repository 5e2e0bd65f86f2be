"""A run as tables of columns, and back: the one mapping behind every form in which runs are kept."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.columns import Columns, Kind
from vedette.simulation.health import FUSION_COLUMNS, SENSOR_COLUMNS, Health
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.truth import Truth

Tables: TypeAlias = dict[str, Columns]

OSPA_COLUMNS = ("ospa_m", "localisation_m", "cardinality_m")
POSE_COLUMNS = ("x_m", "y_m", "heading_rad")

_TIME = {"step": Kind.INTEGER, "time_s": Kind.NUMBER}
_LABEL = {"birth_step": Kind.INTEGER, "birth_site": Kind.INTEGER}
_COUNTS = {"num_targets": Kind.INTEGER, "num_estimates": Kind.INTEGER}

# The tables of a run and their columns; `step` counts scans from 1. A row of `tracks` is one estimate at one scan.
TABLES: dict[str, dict[str, Kind]] = {
    "scans": {**_TIME, **_COUNTS, **dict.fromkeys(OSPA_COLUMNS, Kind.NUMBER), **FUSION_COLUMNS},
    "truth": {**_TIME, "target": Kind.INTEGER, "state": Kind.VECTOR},
    "tracks": {**_TIME, **_LABEL, "existence": Kind.NUMBER, "mean": Kind.VECTOR, "cov": Kind.VECTOR},
    "sensors": {**_TIME, "sensor": Kind.INTEGER, **dict.fromkeys(POSE_COLUMNS, Kind.NUMBER), **SENSOR_COLUMNS},
}


def check_record(record: RunRecord) -> None:
    """Raise `InputError` for a record that contradicts itself or holds an invalid plan."""
    num_scans = record.num_scans
    if not np.array_equal(record.truth.times, record.times):
        raise InputError("record.truth: expected the scan times of the record; got others")
    record.truth.validate()
    lengths = {"estimates": len(record.estimates), "poses": len(record.poses)}
    lengths |= {f"timings[{stage!r}]": len(seconds) for stage, seconds in record.timings.items()}
    for name, length in lengths.items():
        if length != num_scans:
            raise InputError(f"record.{name}: expected one entry for each of {num_scans} scans; got {length}")
    if record.ospa.shape != (num_scans, 3):
        raise InputError(f"record.ospa: expected shape {(num_scans, 3)}; got {record.ospa.shape}")
    record.health.check(num_scans, record.num_sensors)
    for decision in record.decisions:
        decision.plan.validate()


def tables_of(record: RunRecord) -> Tables:
    """The tables of `TABLES`: all of a run but its name, decisions and timings."""
    return {"scans": _scans(record), "truth": _truth(record), "tracks": _tracks(record), "sensors": _sensors(record)}


def run_facts(record: RunRecord) -> dict[str, Any]:
    """What names a run: scenario, planner, seed and number; and why it stopped early, null where it did not."""
    names = {"scenario": record.scenario, "planner": record.planner, "seed": record.seed, "run": record.run}
    return {**names, "stopped": record.stopped}


def record_of(
    facts: Mapping[str, Any],
    tables: Mapping[str, Mapping[str, Any]],
    decisions: tuple[Decision, ...],
    timings: dict[str, Floats],
) -> RunRecord:
    """The record back from `run_facts`, `tables_of`, its decisions and its timings; not yet checked.

    Raises `InputError`, `KeyError`, `TypeError` or `ValueError` for tables that do not fit together.
    """
    scans, sensors = tables["scans"], tables["sensors"]
    times = scans["time_s"]
    return RunRecord(
        scenario=str(facts["scenario"]),
        planner=str(facts["planner"]),
        seed=int(facts["seed"]),
        run=int(facts["run"]),
        times=times,
        truth=_truth_of(tables["truth"], times),
        poses=np.stack([sensors[name] for name in POSE_COLUMNS], axis=1).reshape(len(times), -1, 3),
        estimates=_estimates_of(tables["tracks"], len(times)),
        decisions=decisions,
        ospa=np.stack([scans[name] for name in OSPA_COLUMNS], axis=1),
        health=Health.from_columns(sensors, scans, len(times)),
        timings=timings,
        stopped=None if facts["stopped"] is None else str(facts["stopped"]),
    )


def _scans(record: RunRecord) -> Columns:
    return {
        "step": np.arange(1, record.num_scans + 1),
        "time_s": record.times,
        "num_targets": np.diff(record.truth.offsets),
        "num_estimates": _counts(record),
        **dict(zip(OSPA_COLUMNS, record.ospa.T, strict=True)),
        **record.health.fusion_columns(),
    }


def _truth(record: RunRecord) -> Columns:
    scans = np.repeat(np.arange(record.num_scans), np.diff(record.truth.offsets))
    truth = record.truth
    return {"step": scans + 1, "time_s": record.times[scans], "target": truth.ids, "state": truth.states}


def _truth_of(table: Mapping[str, Any], times: Floats) -> Truth:
    return Truth(times, _offsets(table["step"], len(times)), table["target"], table["state"])


def _tracks(record: RunRecord) -> Columns:
    scans = np.repeat(np.arange(record.num_scans), _counts(record))
    labels = np.concatenate([estimate.labels for estimate in record.estimates])
    covs = np.concatenate([estimate.covs for estimate in record.estimates])
    return {
        "step": scans + 1,
        "time_s": record.times[scans],
        "birth_step": labels[:, 0],
        "birth_site": labels[:, 1],
        "existence": np.concatenate([estimate.existence for estimate in record.estimates]),
        "mean": np.concatenate([estimate.means for estimate in record.estimates]),
        "cov": covs.reshape(len(covs), covs.shape[1] * covs.shape[2]),
    }


def _estimates_of(table: Mapping[str, Any], num_scans: int) -> tuple[Estimate, ...]:
    offsets = _offsets(table["step"], num_scans)
    labels = np.stack([table["birth_step"], table["birth_site"]], axis=1)
    means, existence = table["mean"], table["existence"]
    covs = table["cov"].reshape(len(means), means.shape[1], means.shape[1])
    rows = [slice(start, stop) for start, stop in pairwise(offsets.tolist())]
    return tuple(Estimate(labels[row], means[row], covs[row], existence[row]) for row in rows)


def _sensors(record: RunRecord) -> Columns:
    num_scans, num_sensors = record.num_scans, record.num_sensors
    scans = np.repeat(np.arange(num_scans), num_sensors)
    sensors = np.tile(np.arange(num_sensors), num_scans)
    poses = record.poses.reshape(num_scans * num_sensors, 3)
    columns = dict(zip(POSE_COLUMNS, poses.T, strict=True)) | record.health.sensor_columns()
    return {"step": scans + 1, "time_s": record.times[scans], "sensor": sensors, **columns}


def _counts(record: RunRecord) -> Ints:
    return np.array([len(estimate.labels) for estimate in record.estimates], np.int64)


def _offsets(steps: Ints, num_scans: int) -> Ints:
    """CSR offsets of rows that are in order of step."""
    if len(steps) and (np.any(np.diff(steps) < 0) or steps[0] < 1 or steps[-1] > num_scans):
        raise InputError(f"step: expected rows in order, of steps 1 to {num_scans}")
    return np.searchsorted(steps, np.arange(1, num_scans + 2)).astype(np.int64)
