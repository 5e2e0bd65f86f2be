"""Finished runs as Arrow tables for other tools: those of a single run, one below another.

Every table of many runs begins with the columns `cell`, one for each axis of the campaign, and `run`; rows are in the
order of the campaign's cells, then by run, then by time. The unit of a column is the end of its name (`_m`, `_s`,
`_rad`) and in the metadata of its field; null stands where a measure has no value. A `step` is the number of a scan,
from 1; that of a decision is the scan that it followed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from vedette.campaigns.cells import Campaign, Cell
from vedette.simulation.arrow import Columns, Kind, Layout, to_arrow
from vedette.simulation.records import RunRecord
from vedette.simulation.tables import (
    LAYOUTS,
    OPTIONAL,
    OSPA_COLUMNS,
    TIMINGS,
    optional_tables_of,
    tables_of,
    timing_table,
)

if TYPE_CHECKING:
    from vedette.campaigns.finished import FinishedRun

_UNITS = {"_m": "m", "_s": "s", "_rad": "rad"}
_ANY = Layout({"sha256": Kind.TEXT}, {"": Kind.NUMBER})


class _Part(NamedTuple):
    """The table of one run among those of its name."""

    cell: Cell
    run: int
    table: pa.Table


def tables_of_record(record: RunRecord) -> dict[str, pa.Table]:
    """The tables of a single run, null for what is not a number."""
    return {name: _with_units(pa.Table.from_batches([table])) for name, table in _batches(record).items()}


def tables_of_runs(campaign: Campaign, runs: Iterable[FinishedRun]) -> dict[str, pa.Table]:
    """The tables of all runs, which come in the order of `CampaignResults.runs`.

    Takes about as much memory as the tables: some 150 MB for 1,000 runs of 40 scans with joint decisions.
    """
    parts: dict[str, list[_Part]] = {}
    for run in runs:
        cell = campaign.cell(run.cell)
        measures, session = run.metrics.columns(), np.full(run.record.num_scans, run.session)
        of_run = {"runs": to_arrow(_summary(run), _ANY), **_batches(run.record, measures, {"session": session})}
        for name, table in of_run.items():
            parts.setdefault(name, []).append(_Part(cell, run.record.run, pa.Table.from_batches([table])))
    metadata = {"vedette": json.dumps({"campaign": campaign.name, "seed": campaign.seed})}
    return {name: _with_units(_joined(campaign, of)).replace_schema_metadata(metadata) for name, of in parts.items()}


def _batches(record: RunRecord, measures: Any = None, timed: Any = None) -> dict[str, pa.RecordBatch]:
    """The tables of one run; `measures` are more columns of the scans, `timed` of the timings."""
    tables = tables_of(record)
    timings = {"step": np.arange(1, record.num_scans + 1), "time_s": record.times, **timing_table(record)}
    scans = to_arrow({**tables.pop("scans"), **(measures or {})}, _ANY, nan_is_null=True)
    others = {
        name: to_arrow(table, layout, nan_is_null=True)
        for of, layouts in ((tables, LAYOUTS), (optional_tables_of(record), OPTIONAL))
        for name, layout in layouts.items()
        if (table := of.get(name)) is not None
    }
    return {"scans": scans, **others, "timings": to_arrow({**timings, **(timed or {})}, TIMINGS, nan_is_null=True)}


def _summary(run: FinishedRun) -> Columns:
    """One row: numbers of scans and decisions, means over all scans, and the checksum of the run."""
    record = run.record
    means = zip(OSPA_COLUMNS, record.ospa.mean(axis=0), strict=True)
    return {
        "num_scans": np.array([record.num_scans]),
        "num_decisions": np.array([len(record.decisions)]),
        **{f"mean_{name}": np.array([value]) for name, value in means},
        "sha256": [run.checksum],
    }


def _joined(campaign: Campaign, parts: list[_Part]) -> pa.Table:
    """The tables of one name of all runs, cell, settings and number before each row; null for what a run lacks."""
    rows = np.repeat(np.arange(len(parts)), [part.table.num_rows for part in parts])
    settings = {axis: [setting_of(campaign, part.cell, axis) for part in parts] for axis in campaign.axes}
    keys = {"cell": [part.cell.name for part in parts], **settings, "run": [part.run for part in parts]}
    table = pa.concat_tables([part.table for part in parts], promote_options="default")
    return pa.table(
        {
            **{name: pa.array(of).take(pa.array(rows)) for name, of in keys.items()},
            **dict(zip(table.column_names, table.columns, strict=True)),
        }
    ).combine_chunks()


def setting_of(campaign: Campaign, cell: Cell, axis: str) -> Any:
    """What stands in the column of an axis: text, a truth or a number where all its values are such, else JSON."""
    value, values = cell.settings[axis], campaign.axes[axis]
    if all(isinstance(one, str) for one in values) or all(isinstance(one, bool) for one in values):
        return value
    if all(isinstance(one, int | float) and not isinstance(one, bool) for one in values):
        return float(value) if any(isinstance(one, float) for one in values) else value
    return json.dumps(value)


def _with_units(table: pa.Table) -> pa.Table:
    schema = table.schema
    for index, schema_field in enumerate(schema):
        unit = unit_of(schema_field.name)
        if unit:
            schema = schema.set(index, schema_field.with_metadata({"unit": unit}))
    return table.cast(schema)


def unit_of(column: str) -> str | None:
    """Unit of a column by the end of its name; None for numbers and names."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), None)
