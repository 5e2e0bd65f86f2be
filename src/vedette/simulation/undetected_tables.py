"""Intensity of undetected targets at the decisions of a run as a table of columns, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vedette.densities import UndetectedIntensity
from vedette.errors import InputError
from vedette.models import CellGrid, Region
from vedette.simulation.arrow import Columns, Kind, Layout, stacked
from vedette.simulation.decision_tables import DECISION, decision_columns
from vedette.simulation.records import Decision

_SIDES = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")

# One row per decision: the region, its cells, and the expected number of undetected targets in each cell, from the
# south-west corner, row by row to the north.
UNDETECTED: dict[str, Layout] = {
    "undetected": Layout(
        {**DECISION, **dict.fromkeys(_SIDES, Kind.NUMBER), "columns": Kind.INTEGER, "rows": Kind.INTEGER},
        {"cell_": Kind.NUMBER},
    )
}


def undetected_tables(decisions: Sequence[Decision]) -> dict[str, Columns]:
    """Return the table of `UNDETECTED`, or none if no decision has an intensity of undetected targets."""
    parts = [
        {**decision_columns(number, each), **_row(each.undetected)}
        for number, each in enumerate(decisions)
        if each.undetected is not None
    ]
    return {"undetected": stacked(parts, UNDETECTED["undetected"])} if parts else {}


def with_undetected(decisions: Sequence[Decision], table: Mapping[str, Any]) -> tuple[Decision, ...]:
    """Return the decisions with their intensities from the table.

    Raises `InputError` for decisions that do not exist, missing cells, or an invalid intensity.
    """
    completed = list(decisions)
    for row, number in enumerate(table["decision"].tolist()):
        if not 0 <= number < len(completed):
            raise InputError(f"undetected, column decision: expected numbers below {len(completed)}; got {number}")
        grid = CellGrid(
            Region(*(float(table[name][row]) for name in _SIDES)), int(table["columns"][row]), int(table["rows"][row])
        )
        cells = [name for name in table if name.startswith("cell_")]
        if not grid.num_cells <= len(cells):
            raise InputError(
                f"undetected: expected columns cell_0 to cell_{grid.num_cells - 1}; got {len(cells)} cells"
            )
        expected = np.array([table[f"cell_{cell}"][row] for cell in range(grid.num_cells)])
        completed[number] = replace(completed[number], undetected=UndetectedIntensity(grid, expected))
    return tuple(completed)


def _row(intensity: UndetectedIntensity) -> dict[str, Any]:
    region, grid = intensity.region, intensity.grid
    sides = (region.x_min, region.x_max, region.y_min, region.y_max)
    cells = {f"cell_{cell}": expected for cell, expected in enumerate(intensity.expected.tolist())}
    return {**dict(zip(_SIDES, sides, strict=True)), "columns": grid.columns, "rows": grid.rows, **cells}
