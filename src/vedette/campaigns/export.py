"""Export of the results of a campaign or a single run to files of other tools: Parquet, CSV, NetCDF."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa

from vedette.campaigns.results import CampaignResults
from vedette.campaigns.tables import in_schema, schema_of, tables_of_record
from vedette.errors import InputError
from vedette.internal.files import write_file
from vedette.internal.text import spreadsheet_text
from vedette.simulation.records import RunRecord

NETCDF = "scans.nc"


def export_tables(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write each table as `<name>.parquet` into a folder, and return the files.

    Each file is written atomically and replaces one of that name. Equal results give equal bytes with the same version
    of pyarrow, except for `timings.parquet`. No file is written if no run is finished.

    Raises `InputError` if the files cannot be written.
    """
    return _write_tables(results, Path(folder), ".parquet", _write_parquet)


def _write_parquet(tables: Iterator[pa.Table], schema: pa.Schema, file: BinaryIO) -> None:
    from pyarrow import parquet

    with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
        for table in tables:
            writer.write_table(table)


def export_csv(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write the same tables as `<name>.csv`, otherwise as `export_tables`.

    Text that a spreadsheet would run as a formula gets a leading apostrophe (`spreadsheet_text`).
    """
    return _write_tables(results, Path(folder), ".csv", _write_csv)


def _write_csv(tables: Iterator[pa.Table], schema: pa.Schema, file: BinaryIO) -> None:
    from pyarrow import csv

    names = [spreadsheet_text(name) for name in schema.names]
    with csv.CSVWriter(file, pa.schema(zip(names, schema.types, strict=True))) as writer:
        for table in tables:
            writer.write_table(pa.table([_spreadsheet_column(column) for column in table.columns], names))


def _spreadsheet_column(column: pa.ChunkedArray) -> pa.ChunkedArray | pa.Array:
    if not pa.types.is_string(column.type):
        return column
    return pa.array([None if text is None else spreadsheet_text(text) for text in column.to_pylist()], pa.string())


def export_netcdf(results: CampaignResults | RunRecord, folder: Path | str) -> tuple[Path, ...]:
    """Write `CampaignResults.dataset` as `scans.nc` (NetCDF 3) into a folder.

    Raises `InputError` for a single run, if xarray is not installed, or if the file cannot be written.
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
    results: CampaignResults | RunRecord,
    folder: Path,
    ending: str,
    write: Callable[[Iterator[pa.Table], pa.Schema, BinaryIO], None],
) -> tuple[Path, ...]:
    """Write each table while holding at most a few hundred runs in memory.

    Until all columns are known, parts are kept in temporary files.
    """
    parts = [tables_of_record(results)] if isinstance(results, RunRecord) else results.table_parts()
    schemas_of_tables: dict[str, dict[Path, pa.Schema]] = {}
    with tempfile.TemporaryDirectory() as place:
        for number, part in enumerate(parts):
            for name, table in part.items():
                path = _put(table, Path(place) / f"{name}-{number}.arrow")
                schemas_of_tables.setdefault(name, {})[path] = table.schema
        return tuple(_join(schemas, folder / f"{name}{ending}", write) for name, schemas in schemas_of_tables.items())


def _put(table: pa.Table, path: Path) -> Path:
    packing = pa.ipc.IpcWriteOptions(compression="zstd")
    try:
        with pa.ipc.new_file(str(path), table.schema, options=packing) as file:
            file.write_table(table)
    except OSError as error:
        raise InputError(f"{path.parent}: expected room for files until all tables are written; {error}") from error
    return path


def _join(
    parts: Mapping[Path, pa.Schema], target: Path, write: Callable[[Iterator[pa.Table], pa.Schema, BinaryIO], None]
) -> Path:
    schema = schema_of(parts.values())
    tables = (in_schema(pa.ipc.open_file(str(path)).read_all(), schema) for path in parts)
    write_file(target, lambda file: write(tables, schema, file), make_folder=True)
    return target
