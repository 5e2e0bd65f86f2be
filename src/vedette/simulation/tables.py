"""Runs as tables of columns, and back: the one mapping behind all stored forms of runs.

`step` counts scans from 1 in every table. A row of `tracks` is one estimate at one scan, a row of `actions` one
available action of a sensor at a decision, and a row of `rewards` one evaluated combination, with `action_0` the action
of the first sensor. For many sensors, rewards of a single sensor's actions are in a table of their own. See
`decision_tables` for decisions and `explanation_tables` for their explanations.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from vedette.densities.estimates import Estimate, joined_mode_probs
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.arrow import Columns, Kind, Layout
from vedette.simulation.decision_tables import DECISION_TABLES, OWN_REWARDS, decision_tables, decisions_of
from vedette.simulation.explanation_tables import EXPLANATION_TABLES, explanation_tables, with_explanations
from vedette.simulation.health import FUSION_COLUMNS, SENSOR_COLUMNS, Health
from vedette.simulation.records import OSPA_COLUMNS, RunRecord, RunSummary, ScansFile
from vedette.simulation.truth import Truth
from vedette.simulation.undetected_tables import UNDETECTED, undetected_tables, with_undetected

Tables: TypeAlias = dict[str, Columns]

POSE_COLUMNS = ("x_m", "y_m", "heading_rad")
FACTOR = "detection_factor"  # column of true targets with a mode in which they are detected less
OFF = "off"  # column of runs in which an action switched a sensor off: 1 where it did

_TIME = {"step": Kind.INTEGER, "time_s": Kind.NUMBER}
_LABEL = {"birth_step": Kind.INTEGER, "birth_site": Kind.INTEGER}
_COUNTS = {"num_targets": Kind.INTEGER, "num_estimates": Kind.INTEGER}

# All of a run except the facts that identify it and its timings. Runs of recorded scans have no `DECISION_TABLES`.
LAYOUTS: dict[str, Layout] = {
    "scans": Layout({**_TIME, **_COUNTS, **dict.fromkeys(OSPA_COLUMNS, Kind.NUMBER), **FUSION_COLUMNS}),
    "truth": Layout({**_TIME, "target": Kind.INTEGER}, {"state_": Kind.NUMBER, FACTOR: Kind.NUMBER}),
    "tracks": Layout(
        {**_TIME, **_LABEL, "existence": Kind.NUMBER}, dict.fromkeys(("mean_", "cov_", "class_", "mode_"), Kind.NUMBER)
    ),
    "sensors": Layout(
        {**_TIME, "sensor": Kind.INTEGER, **dict.fromkeys(POSE_COLUMNS, Kind.NUMBER), **SENSOR_COLUMNS},
        {"pose_": Kind.NUMBER, OFF: Kind.COUNT},
    ),
    **DECISION_TABLES,
}
# Optional tables of a run; of `EXPLANATION_TABLES` all or none.
OPTIONAL: dict[str, Layout] = {**OWN_REWARDS, **EXPLANATION_TABLES, **UNDETECTED}
TIMINGS = Layout({"step": Kind.INTEGER}, {"": Kind.NUMBER})


def tables_of(record: RunRecord) -> Tables:
    """Return the tables of `LAYOUTS` for runs of this kind, and those of `OPTIONAL` that the run has."""
    of_scans = {
        "scans": record.scan_columns(),
        "truth": _truth(record),
        "tracks": _tracks(record),
        "sensors": _sensors(record),
    }
    if record.recording is not None:
        return of_scans
    planned = {**decision_tables(record.decisions, record.num_sensors), **undetected_tables(record.decisions)}
    if not any(decision.plan.explanation is not None for decision in record.decisions):
        return {**of_scans, **planned}
    return {**of_scans, **planned, **explanation_tables(record.decisions, record.num_sensors)}


def timing_table(record: RunRecord) -> Columns:
    """Return the columns step and, per stage, `<stage>_s`."""
    seconds = {f"{stage}_s": spent for stage, spent in record.timings.items()}
    return {"step": np.arange(1, record.num_scans + 1), **seconds}


def timings_of(table: Mapping[str, Any]) -> dict[str, Floats]:
    """Return the timings from their table."""
    return {name.removesuffix("_s"): seconds for name, seconds in table.items() if name != "step"}


def run_facts(record: RunRecord) -> dict[str, Any]:
    """Return the facts that identify a run: scenario, planner, seed and number.

    Also the file of recorded scans, and why the run stopped early, None if it did not.
    """
    names = {"scenario": record.scenario, "planner": record.planner, "seed": record.seed, "run": record.run}
    recorded = {} if record.recording is None else {"recording": record.recording._asdict()}
    return {**names, **recorded, "stopped": record.stopped}


def record_of(
    facts: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]], timings: dict[str, Floats]
) -> RunRecord:
    """Return the record from `run_facts`, `tables_of` and its timings, not yet checked.

    Raises `InputError`, `KeyError`, `TypeError` or `ValueError` for inconsistent tables.
    """
    summary, poses, file = summary_of(facts, tables, timings), _poses_of(tables), facts.get("recording")
    times, decisions = summary.times, summary.decisions
    off = tables["sensors"].get(OFF, np.zeros(poses.shape[:2]))
    if any(name in tables for name in EXPLANATION_TABLES):
        decisions = with_explanations(decisions, tables)
    if "undetected" in tables:
        decisions = with_undetected(decisions, tables["undetected"])
    return RunRecord(
        scenario=summary.scenario,
        planner=str(facts["planner"]),
        seed=summary.seed,
        run=summary.run,
        times=times,
        truth=Truth(
            times,
            _offsets(tables["truth"], len(times)),
            tables["truth"]["target"],
            _matrix(tables["truth"], "state_"),
            tables["truth"].get(FACTOR),
        ),
        poses=poses,
        off=np.reshape(off == 1, poses.shape[:2]),
        estimates=_estimates_of(tables["tracks"], len(times)),
        decisions=decisions,
        ospa=summary.ospa,
        health=summary.health,
        timings=timings,
        stopped=None if facts["stopped"] is None else str(facts["stopped"]),
        recording=None if file is None else ScansFile(str(file["name"]), str(file["sha256"])),
    )


# Tables that `summary_of` needs.
SUMMARY_TABLES = frozenset({"scans", "sensors", *DECISION_TABLES, *OWN_REWARDS})


def summary_of(
    facts: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]], timings: dict[str, Floats]
) -> RunSummary:
    """Return the summary of a run from its tables in `SUMMARY_TABLES`.

    Raises as `record_of`.

    The numbers of targets are those in the table `scans`. They are not checked against the table of targets.
    """
    scans, sensors, num_scans = tables["scans"], tables["sensors"], len(tables["scans"]["step"])
    poses = _poses_of(tables)
    return RunSummary(
        scenario=str(facts["scenario"]),
        seed=int(facts["seed"]),
        run=int(facts["run"]),
        times=scans["time_s"],
        decisions=decisions_of(tables, poses) if "decisions" in tables else (),
        ospa=np.stack([scans[name] for name in OSPA_COLUMNS], axis=1),
        num_targets=scans["num_targets"],
        health=Health(
            **{name: sensors[name].reshape(num_scans, -1) for name in SENSOR_COLUMNS},
            **{name: scans[name] for name in FUSION_COLUMNS},
        ),
        timings=timings,
    )


def _poses_of(tables: Mapping[str, Mapping[str, Any]]) -> Floats:
    """(num_scans, num_sensors, pose_dim)."""
    sensors, num_scans = tables["sensors"], len(tables["scans"]["step"])
    if num_scans == 0 or len(sensors["step"]) % num_scans:
        raise InputError(
            f"sensors: expected a row of every sensor for each of {num_scans} scans; got {len(sensors['step'])}"
        )
    columns = [*POSE_COLUMNS, *(name for name in sensors if name.startswith("pose_"))]
    return np.stack([sensors[name] for name in columns], axis=1).reshape(num_scans, -1, len(columns))


def _truth(record: RunRecord) -> Columns:
    truth = record.truth
    scans = truth.scans
    return {
        "step": scans + 1,
        "time_s": record.times[scans],
        "target": truth.ids,
        **_columns("state_", truth.states),
        **({} if truth.detection_factors is None else {FACTOR: truth.detection_factors}),
    }


def _tracks(record: RunRecord) -> Columns:
    scans = np.repeat(np.arange(record.num_scans), [len(estimate.labels) for estimate in record.estimates])
    labels = np.concatenate([estimate.labels for estimate in record.estimates])
    covs = np.concatenate([estimate.covs for estimate in record.estimates])
    return {
        "step": scans + 1,
        "time_s": record.times[scans],
        "birth_step": labels[:, 0],
        "birth_site": labels[:, 1],
        "existence": np.concatenate([estimate.existence for estimate in record.estimates]),
        **_columns("mean_", np.concatenate([estimate.means for estimate in record.estimates])),
        **_columns("cov_", covs.reshape(len(covs), covs.shape[1] * covs.shape[2])),
        **_columns("class_", np.concatenate([estimate.class_probs for estimate in record.estimates])),
        **_columns("mode_", joined_mode_probs(record.estimates)),
    }


def _estimates_of(table: Mapping[str, Any], num_scans: int) -> tuple[Estimate, ...]:
    labels = np.stack([table["birth_step"], table["birth_site"]], axis=1)
    means, existence = _matrix(table, "mean_"), table["existence"]
    covs = _matrix(table, "cov_").reshape(len(means), means.shape[1], means.shape[1])
    none = np.empty((len(means), 0))
    classes, modes = (_matrix(table, name) if f"{name}0" in table else none for name in ("class_", "mode_"))
    rows = [slice(start, stop) for start, stop in pairwise(_offsets(table, num_scans).tolist())]
    return tuple(Estimate(labels[row], means[row], covs[row], existence[row], classes[row], modes[row]) for row in rows)


def _sensors(record: RunRecord) -> Columns:
    num_scans, num_sensors, pose_dim = record.poses.shape
    scans = np.repeat(np.arange(num_scans), num_sensors)
    poses = record.poses.reshape(num_scans * num_sensors, pose_dim)
    return {
        "step": scans + 1,
        "time_s": record.times[scans],
        "sensor": np.tile(np.arange(num_sensors), num_scans),
        **dict(zip(POSE_COLUMNS, poses.T, strict=False)),
        **{f"pose_{index}": poses[:, index] for index in range(len(POSE_COLUMNS), pose_dim)},
        **{name: getattr(record.health, name).ravel() for name in SENSOR_COLUMNS},
        **({OFF: record.off.ravel().astype(np.int64)} if record.off.any() else {}),
    }


def _columns(start: str, matrix: Floats) -> Columns:
    return {f"{start}{index}": column for index, column in enumerate(matrix.T)}


def _matrix(table: Mapping[str, Any], start: str) -> Floats:
    """(num_rows, n) matrix from the columns of `_columns`."""
    width = sum(name.startswith(start) for name in table)
    if not all(f"{start}{index}" in table for index in range(max(width, 1))):
        raise InputError(f"expected columns {start}0 to {start}{max(width, 1) - 1}; got {', '.join(table)}")
    return np.stack([table[f"{start}{index}"] for index in range(width)], axis=1)


def _offsets(table: Mapping[str, Any], num_scans: int) -> Ints:
    """Return the CSR offsets of rows that are ordered by step."""
    steps = table["step"]
    if len(steps) and (np.any(np.diff(steps) < 0) or steps[0] < 1 or steps[-1] > num_scans):
        raise InputError(f"step: expected rows in order, of steps 1 to {num_scans}")
    return np.searchsorted(steps, np.arange(1, num_scans + 2)).astype(np.int64)
