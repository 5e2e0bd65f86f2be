"""Finished runs as Arrow tables for other tools: one row a run, a scan, a decision, a reward, a track point.

Every table begins with the columns `cell`, one for each axis of the campaign, and `run`; rows are in the order of the
campaign's cells, then by run, then by time. The unit of a column is the end of its name (`_m`, `_s`, `_rad`) and in the
metadata of its field; null stands where a measure has no value. A `step` is the number of a scan, from 1; that of a
decision is the scan that it followed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from vedette.campaigns.cells import Campaign, Cell
from vedette.campaigns.rows import PER_RUN, Lists

if TYPE_CHECKING:
    from vedette.campaigns.finished import FinishedRun

NAMES = tuple(PER_RUN)
_UNITS = {"_m": "m", "_s": "s", "_rad": "rad"}


def tables_of_runs(campaign: Campaign, runs: Iterable[FinishedRun]) -> dict[str, pa.Table]:
    """The tables `NAMES`, of runs in the order of `CampaignResults.runs`.

    Takes about as much memory as the tables: some 150 MB for 1,000 runs of 40 scans with joint decisions.
    """
    parts: dict[str, list[Any]] = {name: [] for name in NAMES}
    for name, group in groupby(runs, key=lambda run: run.cell):
        finished = list(group)
        for table, rows in PER_RUN.items():
            parts[table].append(_of_cell(campaign, campaign.cell(name), finished, [rows(run) for run in finished]))
    metadata = {"vedette": json.dumps({"campaign": campaign.name, "seed": campaign.seed})}
    return {
        name: _with_units(pa.concat_tables(of, promote_options="permissive")).replace_schema_metadata(metadata)
        for name, of in parts.items()
        if of
    }


def _of_cell(campaign: Campaign, cell: Cell, runs: list[FinishedRun], rows: list[dict[str, Any]]) -> pa.Table:
    """The rows of all finished runs of one cell, its name and settings before them."""
    lengths = [len(next(iter(columns.values()))) for columns in rows]
    num_rows = sum(lengths)
    settings = {axis: setting_of(campaign, cell, axis) for axis in campaign.axes}
    columns = {name: pa.repeat(pa.scalar(value), num_rows) for name, value in {"cell": cell.name, **settings}.items()}
    columns["run"] = pa.array(np.repeat([run.record.run for run in runs], lengths))
    for name in dict.fromkeys(name for each in rows for name in each):
        parts = [each[name] if name in each else [None] * length for each, length in zip(rows, lengths, strict=True)]
        columns[name] = _column(parts)
    return pa.table(columns)


def _column(parts: list[Any]) -> Any:
    parts = [part for part in parts if len(part)] or parts[:1]
    if all(isinstance(part, np.ndarray) for part in parts):
        return pa.array(np.concatenate(parts), from_pandas=True)  # null for NaN, which SQL takes for a number
    if all(isinstance(part, Lists) for part in parts):
        lists = Lists.joined(parts)
        return pa.ListArray.from_arrays(pa.array(np.cumsum([0, *lists.lengths]), pa.int32()), pa.array(lists.values))
    return pa.array([value for part in parts for value in part])


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


def plain_lists(table: pa.Table) -> pa.Table:
    """The table with its lists as JSON text, for formats without lists."""
    for index, schema_field in enumerate(table.schema):
        if pa.types.is_list(schema_field.type):
            texts = [None if value is None else json.dumps(value) for value in table.column(index).to_pylist()]
            table = table.set_column(index, schema_field.name, pa.array(texts, pa.string()))
    return table
