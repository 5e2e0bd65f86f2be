"""Finished runs as one xarray dataset: every measure of every scan over cell, run and step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from vedette.campaigns.cells import Campaign
from vedette.campaigns.rows import scan_rows
from vedette.campaigns.tables import setting_of, unit_of
from vedette.errors import InputError

if TYPE_CHECKING:
    import xarray

    from vedette.campaigns.finished import FinishedRun


def dataset_of_runs(campaign: Campaign, runs: Iterable[FinishedRun]) -> xarray.Dataset:
    """Every column of the table `scans` as a float64 variable of dimensions (cell, run, step).

    NaN where a run is not finished, a cell has fewer scans than another, or a measure has no value. Coordinates: `cell`
    (name), `run`, `step` (from 1), the value of each axis of the campaign by cell, and `time_s` by cell and step.
    `attrs["units"]` of a variable is its unit.

    Raises `InputError` where xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise InputError("dataset: expected xarray, which is not installed; pip install 'vedette[xarray]'") from None
    rows = {(run.cell, run.record.run): scan_rows(run) for run in runs}
    num_scans = max((len(columns["step"]) for columns in rows.values()), default=0)
    names = list(dict.fromkeys(name for columns in rows.values() for name in columns if name != "step"))
    values = {name: np.full((len(campaign.cells), campaign.num_runs, num_scans), np.nan) for name in names}
    places = {cell.name: index for index, cell in enumerate(campaign.cells)}
    for (cell, run), columns in rows.items():
        for name in names:
            column: Any = columns[name]
            values[name][places[cell], run, : len(column)] = column
    times = _times(values.pop("time_s", np.full((len(campaign.cells), 1, num_scans), np.nan)))
    return xarray.Dataset(
        {name: (("cell", "run", "step"), array, _attributes(name)) for name, array in values.items()},
        coords={
            "cell": [cell.name for cell in campaign.cells],
            "run": np.arange(campaign.num_runs),
            "step": np.arange(1, num_scans + 1),
            "time_s": (("cell", "step"), times, {"units": "s"}),
            **{axis: ("cell", _values(campaign, axis)) for axis in campaign.axes},
        },
        attrs={"campaign": campaign.name, "seed": str(campaign.seed)},
    )


def _times(of_runs: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """(num_cells, num_scans) from the same for each run, NaN where it is not finished."""
    times = np.full((of_runs.shape[0], of_runs.shape[2]), np.nan)
    for run in range(of_runs.shape[1]):
        times = np.where(np.isnan(times), of_runs[:, run], times)
    return times


def _values(campaign: Campaign, axis: str) -> list[Any]:
    """The axis by cell; truths as text, as NetCDF has none."""
    values = [setting_of(campaign, cell, axis) for cell in campaign.cells]
    return [str(value) if isinstance(value, bool) else value for value in values]


def _attributes(name: str) -> dict[str, str]:
    unit = unit_of(name)
    return {"units": unit} if unit else {}
