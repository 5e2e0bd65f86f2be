"""The results of a campaign in the files of other tools: Parquet, CSV, NetCDF."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from pyarrow import csv, parquet

from vedette.campaigns.results import CampaignResults
from vedette.campaigns.tables import plain_lists
from vedette.errors import InputError
from vedette.files import write_whole

NETCDF = "scans.nc"


def export_tables(results: CampaignResults, folder: Path | str) -> tuple[Path, ...]:
    """Write each table of `CampaignResults.tables` as `<name>.parquet` into a folder; returns the files.

    Each file appears whole or not at all, in place of one of that name. Equal results give equal bytes under the same
    version of pyarrow, but for `timings.parquet`, which holds what the clock said. No file where no run is finished.

    Raises `InputError` where the files cannot be written.
    """

    def write(table: Any, file: BinaryIO) -> None:
        parquet.write_table(table, file, compression="zstd")

    return _write_tables(results, Path(folder), ".parquet", write)


def export_csv(results: CampaignResults, folder: Path | str) -> tuple[Path, ...]:
    """Write the same tables as `<name>.csv`, lists as JSON; as `export_tables`."""
    return _write_tables(results, Path(folder), ".csv", lambda table, file: csv.write_csv(plain_lists(table), file))


def export_netcdf(results: CampaignResults, folder: Path | str) -> tuple[Path, ...]:
    """Write `CampaignResults.dataset` as `scans.nc` (NetCDF 3) into a folder.

    Raises `InputError` where xarray is not installed or the file cannot be written.
    """
    content = bytes(results.dataset().to_netcdf(engine="scipy"))
    return (_write(Path(folder) / NETCDF, content),)


FORMATS: dict[str, Callable[[CampaignResults, Path], tuple[Path, ...]]] = {
    "parquet": export_tables,
    "csv": export_csv,
    "netcdf": export_netcdf,
}


def _write_tables(
    results: CampaignResults, folder: Path, ending: str, write: Callable[[Any, BinaryIO], None]
) -> tuple[Path, ...]:
    files = []
    for name, table in results.tables().items():
        content = io.BytesIO()
        write(table, content)
        files.append(_write(folder / f"{name}{ending}", content.getvalue()))
    return tuple(files)


def _write(path: Path, content: bytes) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, lambda file: file.write(content))
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be written; {error}") from error
    return path
