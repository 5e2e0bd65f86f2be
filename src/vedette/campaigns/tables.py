"""Arrow tables of finished runs for other tools: the tables of single runs, concatenated.

Every table of many runs begins with the columns `cell`, one for each axis of the campaign, and `run`. Rows are ordered
by cell as in the campaign, then by run, then by time. The unit of a column is the end of its name (`_m`, `_s`, `_rad`)
and in the metadata of its field. Null means that a metric has no value. A `step` is the number of a scan, from 1. For a
decision it is the scan that it followed.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from vedette.campaigns.cells import Campaign, Cell
from vedette.evaluation.metrics.run import RunMetrics
from vedette.simulation.arrow import Columns, Kind, Layout, stacked, to_arrow
from vedette.simulation.records import OSPA_COLUMNS, RunRecord
from vedette.simulation.tables import (
    LAYOUTS,
    OPTIONAL,
    TIMINGS,
    tables_of,
    timing_table,
)

_UNITS = {"_m": "m", "_s": "s", "_rad": "rad"}
_ANY = Layout({"sha256": Kind.TEXT}, {"": Kind.NUMBER})


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """One run of a campaign."""

    cell: str  # name of its cell
    record: RunRecord  # the record, including timings
    metrics: RunMetrics  # metrics of its estimates
    session: int  # number, from 1, of the session in the manifest's list that stored it
    checksum: str  # SHA-256 of everything except timings, equal for equal results


def tables_of_record(record: RunRecord) -> dict[str, pa.Table]:
    """Return the tables of a single run, with null for NaN."""
    return {name: _arrow(columns, _layout(name)) for name, columns in _columns(record).items()}


def tables_of_runs(campaign: Campaign, runs: Iterable[FinishedRun]) -> dict[str, pa.Table]:
    """Return the tables of runs, which must be in the order of `CampaignResults.runs`.

    Takes twice the memory of the tables: about 300 MB for 1,000 runs of 40 scans with joint decisions.
    """
    parts: dict[str, list[Columns]] = {}
    for run in runs:
        cell = campaign.cell(run.cell)
        of_run = {"runs": _summary(run), **_columns(run.record)}
        of_run["scans"] |= run.metrics.columns()
        of_run["timings"]["session"] = np.full(run.record.num_scans, run.session)
        settings = {axis: setting_of(campaign, cell, axis) for axis in campaign.axes}
        keys = {"cell": run.cell, **settings, "run": run.record.run}
        for name, columns in of_run.items():
            parts.setdefault(name, []).append({**keys, **columns})
    kinds = {key: Kind.TEXT if isinstance(value, str) else Kind.NUMBER for key, value in keys.items()} if parts else {}
    metadata = {"vedette": json.dumps({"campaign": campaign.name, "seed": campaign.seed})}
    tables = {}
    for name, table_parts in parts.items():
        layout = Layout({**kinds, **_layout(name).fixed}, _layout(name).more)
        names = list(dict.fromkeys(name for part in table_parts for name in part))
        tables[name] = _arrow(stacked(table_parts, layout, names), layout).replace_schema_metadata(metadata)
    return tables


def schema_of(parts: Iterable[pa.Schema]) -> pa.Schema:
    """Return the schema of concatenated tables: all columns, in the order of their first appearance."""
    return pa.unify_schemas(list(parts), promote_options="permissive")


def in_schema(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return the table with the columns of `schema_of`, null where it has none."""
    return pa.concat_tables([schema.empty_table(), table], promote_options="permissive")


def concatenated_tables(parts: Iterable[dict[str, pa.Table]]) -> dict[str, pa.Table]:
    """Concatenate the tables of several sets of runs."""
    tables_by_name: dict[str, list[pa.Table]] = {}
    for part in parts:
        for name, table in part.items():
            tables_by_name.setdefault(name, []).append(table)
    return {name: pa.concat_tables(tables, promote_options="permissive") for name, tables in tables_by_name.items()}


def _columns(record: RunRecord) -> dict[str, Columns]:
    """Return the tables of one run."""
    timings = timing_table(record)
    return {**tables_of(record), "timings": {"step": timings.pop("step"), "time_s": record.times, **timings}}


def _layout(name: str) -> Layout:
    return {**LAYOUTS, **OPTIONAL, "timings": TIMINGS, "scans": _ANY, "runs": _ANY}[name]


def _summary(run: FinishedRun) -> Columns:
    """Return one row: numbers of scans and decisions, means over all scans, and the checksum of the run."""
    record = run.record
    means = zip(OSPA_COLUMNS, record.ospa.mean(axis=0), strict=True)
    return {
        "num_scans": np.array([record.num_scans]),
        "num_decisions": np.array([len(record.decisions)]),
        **{f"mean_{name}": np.array([value]) for name, value in means},
        "sha256": [run.checksum],
    }


def setting_of(campaign: Campaign, cell: Cell, axis: str) -> Any:
    """Return the value in the column of an axis: text, boolean or number if all its values are such, else JSON."""
    value, values = cell.settings[axis], campaign.axes[axis]
    if all(isinstance(one, str) for one in values) or all(isinstance(one, bool) for one in values):
        return value
    if all(isinstance(one, int | float) and not isinstance(one, bool) for one in values):
        return float(value) if any(isinstance(one, float) for one in values) else value
    return json.dumps(value)


def _arrow(columns: Columns, layout: Layout) -> pa.Table:
    """Return the table with the unit of each column in the metadata of its field."""
    batch = to_arrow(columns, layout, nan_is_null=True)
    schema = batch.schema
    for index, schema_field in enumerate(schema):
        if unit := unit_of(schema_field.name):
            schema = schema.set(index, schema_field.with_metadata({"unit": unit}))
    return pa.Table.from_arrays(batch.columns, schema=schema)


def unit_of(column: str) -> str | None:
    """Return the unit of a column by the end of its name, or None for dimensionless columns."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), None)
