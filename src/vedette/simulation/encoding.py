"""A run as texts of CSV and JSON, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.control.plan import Plan, RewardTable
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.kernels.types import Floats, Ints
from vedette.simulation.columns import ColumnReader, write_columns
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.truth import Truth

SCANS, TRUTH, TRACKS, SENSORS, DECISIONS = "scans.csv", "truth.csv", "tracks.csv", "sensors.csv", "decisions.json"
OSPA_COLUMNS = ("ospa_m", "localisation_m", "cardinality_m")
POSE_COLUMNS = ("x_m", "y_m", "heading_rad")


def encode_run(record: RunRecord) -> dict[str, str]:
    """File names and contents. Raises `InputError` for a record that contradicts itself or holds an invalid plan."""
    _check(record)
    return {
        SCANS: _encode_scans(record),
        TRUTH: _encode_truth(record),
        TRACKS: _encode_tracks(record),
        SENSORS: _encode_sensors(record),
        DECISIONS: _encode_decisions(record),
    }


def decode_run(run: Mapping[str, Any], files: Mapping[str, str], place: str) -> RunRecord:
    """The record back from its texts. Raises `InputError`, naming `place` and the file, for texts that do not fit."""
    names = (SCANS, TRUTH, TRACKS, SENSORS)
    tables = {name: ColumnReader(_text(files, name, place), f"{place}/{name}") for name in names}
    times = tables[SCANS].floats("time_s")
    try:
        record = RunRecord(
            scenario=str(run["scenario"]),
            planner=str(run["planner"]),
            seed=int(run["seed"]),
            run=int(run["run"]),
            times=times,
            truth=_decode_truth(tables[TRUTH], times),
            poses=_stack(tables[SENSORS], POSE_COLUMNS).reshape(len(times), -1, 3),
            estimates=_decode_tracks(tables[TRACKS], len(times)),
            decisions=tuple(_decode_decision(entry) for entry in json.loads(_text(files, DECISIONS, place))),
            ospa=_stack(tables[SCANS], OSPA_COLUMNS),
            timings={str(name): float(seconds) for name, seconds in run["timings_s"].items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{place}: expected the files of a run; they do not fit together: {error!r}") from error
    _check(record)
    return record


def _text(files: Mapping[str, str], name: str, place: str) -> str:
    if name not in files:
        raise InputError(f"{place}: expected a file {name}; the manifest names {', '.join(files) or 'none'}")
    return files[name]


def _check(record: RunRecord) -> None:
    num_scans = record.num_scans
    if not np.array_equal(record.truth.times, record.times):
        raise InputError("record.truth: expected the scan times of the record; got others")
    record.truth.validate()
    lengths = {"estimates": len(record.estimates), "poses": len(record.poses)}
    for name, length in lengths.items():
        if length != num_scans:
            raise InputError(f"record.{name}: expected one entry for each of {num_scans} scans; got {length}")
    if record.ospa.shape != (num_scans, 3):
        raise InputError(f"record.ospa: expected shape {(num_scans, 3)}; got {record.ospa.shape}")
    for decision in record.decisions:
        decision.plan.validate()


def _encode_scans(record: RunRecord) -> str:
    return write_columns(
        {
            "scan": np.arange(record.num_scans),
            "time_s": record.times,
            "num_targets": np.diff(record.truth.offsets),
            "num_estimates": _counts(record),
            **dict(zip(OSPA_COLUMNS, record.ospa.T, strict=True)),
        }
    )


def _encode_truth(record: RunRecord) -> str:
    scans = np.repeat(np.arange(record.num_scans), np.diff(record.truth.offsets))
    truth = record.truth
    return write_columns({"scan": scans, "time_s": record.times[scans], "target": truth.ids, "state": truth.states})


def _decode_truth(table: ColumnReader, times: Floats) -> Truth:
    offsets = _offsets(table.ints("scan"), len(times))
    return Truth(times, offsets, table.ints("target"), table.vectors("state"))


def _encode_tracks(record: RunRecord) -> str:
    scans = np.repeat(np.arange(record.num_scans), _counts(record))
    labels = np.concatenate([estimate.labels for estimate in record.estimates])
    return write_columns(
        {
            "scan": scans,
            "time_s": record.times[scans],
            "birth_step": labels[:, 0],
            "birth_site": labels[:, 1],
            "existence": np.concatenate([estimate.existence for estimate in record.estimates]),
            "mean": np.concatenate([estimate.means for estimate in record.estimates]),
            "cov": _flat(np.concatenate([estimate.covs for estimate in record.estimates])),
        }
    )


def _decode_tracks(table: ColumnReader, num_scans: int) -> tuple[Estimate, ...]:
    offsets = _offsets(table.ints("scan"), num_scans)
    labels = np.stack([table.ints("birth_step"), table.ints("birth_site")], axis=1)
    means, existence = table.vectors("mean"), table.floats("existence")
    covs = table.vectors("cov").reshape(len(means), means.shape[1], means.shape[1])
    rows = [slice(start, stop) for start, stop in pairwise(offsets)]
    return tuple(Estimate(labels[row], means[row], covs[row], existence[row]) for row in rows)


def _encode_sensors(record: RunRecord) -> str:
    num_scans, num_sensors = record.num_scans, record.num_sensors
    scans = np.repeat(np.arange(num_scans), num_sensors)
    sensors = np.tile(np.arange(num_sensors), num_scans)
    columns = dict(zip(POSE_COLUMNS, record.poses.reshape(num_scans * num_sensors, 3).T, strict=True))
    return write_columns({"scan": scans, "time_s": record.times[scans], "sensor": sensors, **columns})


def _encode_decisions(record: RunRecord) -> str:
    try:
        entries = [_encode_decision(decision) for decision in record.decisions]
        return json.dumps(entries, indent=1, allow_nan=False) + "\n"
    except ValueError as error:
        raise InputError(f"record.decisions: expected finite numbers; {error}") from error


def _encode_decision(decision: Decision) -> dict[str, Any]:
    plan = decision.plan
    return {
        "step": int(decision.step),
        "time_s": float(decision.time),
        "poses": decision.poses.tolist(),
        "planner": plan.planner,
        "action_headings_rad": [values.tolist() for values in plan.action_values],
        "chosen": [int(index) for index in plan.chosen],
        "chosen_headings_deg": np.rad2deg(plan.chosen_headings).tolist(),
        "counts": {name: int(count) for name, count in plan.counts.items()},
        "reward_tables": [
            {
                "sensors": [int(sensor) for sensor in table.sensors],
                "mean": _with_gaps(table.mean),
                "standard_error": _with_gaps(table.standard_error),
            }
            for table in plan.tables
        ],
    }


def _with_gaps(values: Floats) -> Any:
    """Nested lists, null where there is no number."""
    numbers = values.astype(object)
    numbers[np.isnan(values)] = None
    return numbers.tolist()


def _decode_decision(entry: Mapping[str, Any]) -> Decision:
    plan = Plan(
        planner=str(entry["planner"]),
        action_values=tuple(np.array(values, np.float64) for values in entry["action_headings_rad"]),
        chosen=tuple(int(index) for index in entry["chosen"]),
        tables=tuple(
            RewardTable(
                tuple(int(sensor) for sensor in table["sensors"]),
                np.array(table["mean"], np.float64),
                np.array(table["standard_error"], np.float64),
            )
            for table in entry["reward_tables"]
        ),
        counts={str(name): int(count) for name, count in entry["counts"].items()},
    )
    return Decision(int(entry["step"]), float(entry["time_s"]), np.array(entry["poses"], np.float64), plan)


def _counts(record: RunRecord) -> Ints:
    return np.array([len(estimate.labels) for estimate in record.estimates], np.int64)


def _stack(table: ColumnReader, names: tuple[str, ...]) -> Floats:
    return np.stack([table.floats(name) for name in names], axis=1)


def _flat(covs: Floats) -> Floats:
    return covs.reshape(len(covs), covs.shape[1] * covs.shape[2])


def _offsets(scans: Ints, num_scans: int) -> Ints:
    """CSR offsets of rows that are in order of scan."""
    if len(scans) and (np.any(np.diff(scans) < 0) or scans[0] < 0 or scans[-1] >= num_scans):
        raise InputError(f"scan: expected rows in order, of scans 0 to {num_scans - 1}")
    return np.searchsorted(scans, np.arange(num_scans + 1)).astype(np.int64)
