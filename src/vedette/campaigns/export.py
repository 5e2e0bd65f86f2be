"""Results in the files of other tools, of a campaign or of a single run: Parquet, CSV, NetCDF."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa

from vedette.campaigns.results import CampaignResults
from vedette.campaigns.tables import tables_of_record
from vedette.errors import InputError
from vedette.files import write_file
from vedette.simulation.records import RunRecord
from vedette.text import spreadsheet_text

NETCDF = "scans.nc"


def export_tables(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write each table as `<name>.parquet` into a folder; returns the files.

    Each file appears whole or not at all, in place of one of that name. Equal results give equal bytes under the same
    version of pyarrow, but for `timings.parquet`, which holds what the clock said. No file where no run is finished.

    Raises `InputError` where the files cannot be written.
    """

    from pyarrow import parquet

    def write(table: Any, file: BinaryIO) -> None:
        parquet.write_table(table, file, compression="zstd")

    return _write_tables(results, Path(folder), ".parquet", write)


def export_csv(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write the same tables as `<name>.csv`; as `export_tables`.

    A text that a spreadsheet would run as a formula has an apostrophe before it (`vedette.text.spreadsheet_text`).
    """
    return _write_tables(results, Path(folder), ".csv", _write_csv)


def _write_csv(table: pa.Table, file: BinaryIO) -> None:
    from pyarrow import csv

    for place, column in enumerate(table.columns):
        if pa.types.is_string(column.type):
            texts = [None if text is None else spreadsheet_text(text) for text in column.to_pylist()]
            table = table.set_column(place, table.field(place), pa.array(texts, pa.string()))
    csv.write_csv(table.rename_columns([spreadsheet_text(name) for name in table.column_names]), file)


def export_netcdf(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write `CampaignResults.dataset` as `scans.nc` (NetCDF 3) into a folder.

    Raises `InputError` for a single run, where xarray is not installed or the file cannot be written.
    """
    if isinstance(results, RunRecord):
        raise InputError("netcdf: expected the results of a campaign, over cells and runs; got a single run")
    content = bytes(results.dataset().to_netcdf(engine="scipy"))
    write_file(file := Path(folder) / NETCDF, lambda stream: stream.write(content), make_folder=True)
    return (file,)


FORMATS: dict[str, Callable[[CampaignResults | RunRecord, Path], tuple[Path, ...]]] = {
    "parquet": export_tables,
    "csv": export_csv,
    "netcdf": export_netcdf,
}


def _write_tables(
    results: CampaignResults | RunRecord, folder: Path, ending: str, write: Callable[[Any, BinaryIO], None]
) -> tuple[Path, ...]:
    files: list[Path] = []
    tables = tables_of_record(results) if isinstance(results, RunRecord) else results.tables()
    for name, table in tables.items():
        files.append(folder / f"{name}{ending}")
        write_file(files[-1], partial(write, table), make_folder=True)
    return tuple(files)
