"""Scans of finished runs as an xarray dataset: every metric over cell, run and step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from vedette.campaigns.cells import Campaign
from vedette.campaigns.tables import setting_of, unit_of
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    import xarray


def dataset_of_scans(campaign: Campaign, scans: pa.Table | None) -> xarray.Dataset:
    """Return every column of the table `scans` (None: no run is finished) as a float64 variable of (cell, run, step).

    NaN if a run is not finished, a cell has fewer scans than another, or a metric has no value. Coordinates: `cell`
    (name), `run`, `step` (from 1), the value of each axis of the campaign by cell, and `time_s` by cell and step.
    `attrs["units"]` of a variable is its unit.

    Raises `MissingPackageError` if xarray is not installed.
    """
    require_packages("a dataset", "xarray")
    import xarray

    table = scans
    if table is None:
        table = pa.table({"cell": pa.array([], pa.string()), **dict.fromkeys(("run", "step", "time_s"), np.empty(0))})
    cells = [cell.name for cell in campaign.cells]
    of_cells = np.array([cells.index(name) for name in table["cell"].to_pylist()], np.int64)
    of_runs, steps = (table[name].to_numpy().astype(np.int64) for name in ("run", "step"))
    num_scans = int(steps.max(initial=0))
    values = {}
    for name in table.column_names:
        if name not in ("cell", "run", "step", *campaign.axes):
            values[name] = np.full((len(cells), campaign.num_runs, num_scans), np.nan)
            values[name][of_cells, of_runs, steps - 1] = table[name].to_numpy()
    times = np.full((len(cells), num_scans), np.nan)
    times[of_cells, steps - 1] = table["time_s"].to_numpy()  # equal in all runs of a cell
    del values["time_s"]
    units = {name: {"units": unit} if (unit := unit_of(name)) else {} for name in values}
    return xarray.Dataset(
        {name: (("cell", "run", "step"), array, units[name]) for name, array in values.items()},
        coords={
            "cell": cells,
            "run": np.arange(campaign.num_runs),
            "step": np.arange(1, num_scans + 1),
            "time_s": (("cell", "step"), times, {"units": "s"}),
            **{axis: ("cell", _values(campaign, axis)) for axis in campaign.axes},
        },
        attrs={"campaign": campaign.name, "seed": str(campaign.seed)},
    )


def _values(campaign: Campaign, axis: str) -> list[Any]:
    """Return the values of an axis by cell, booleans as text, as NetCDF has none."""
    values = [setting_of(campaign, cell, axis) for cell in campaign.cells]
    return [str(value) if isinstance(value, bool) else value for value in values]
