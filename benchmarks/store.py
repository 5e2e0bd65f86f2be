"""What it costs to keep the runs of a campaign: one SQLite file, or a folder of Parquet files a run.

    python benchmarks/store.py                    # 300 runs, on the disk of the temporary folder
    python benchmarks/store.py --runs 3000 --folder /somewhere/else

Each run is the same finished run of paper-a (joint decisions). Every way of keeping makes it reach the disk before the
next run: SQLite by its durable settings, Parquet files by fsync of each file and of the folder that holds them. Times
are those to encode and land a run (median and 99th percentile) and to read everything back as run records; sizes are
those on the disk. Last, what is done with a whole results folder of so many runs: comparing them, writing the tables.
"""

from __future__ import annotations

import argparse
import json
import os
import sqlite3
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet
from timing import Measure, Once, cpu_seconds, milliseconds_of

from vedette.campaigns.cells import resolve
from vedette.campaigns.codec import decode, encode
from vedette.campaigns.export import export_tables
from vedette.campaigns.results import open_results
from vedette.campaigns.rows import pack, row_of, unpack
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.evaluation.metrics.run import RunMetrics, measure
from vedette.evaluation.metrics.serialization import decode_metrics, encode_metrics
from vedette.evaluation.runs import run_scenario
from vedette.internal.files import sync_folder
from vedette.scenarios import load_scenario
from vedette.simulation.arrow import read_table, to_arrow
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import encode_timings
from vedette.simulation.tables import LAYOUTS, record_of, run_facts, tables_of

Way = tuple[Callable[[int], None], Callable[[], int]]


def sqlite_file(folder: Path, record: RunRecord, metrics: RunMetrics, journal: str) -> Way:
    """One row a run in one file."""
    database = sqlite3.connect(folder / "campaign.sqlite", isolation_level=None)
    database.execute(f"PRAGMA journal_mode = {journal}")
    database.execute(f"PRAGMA synchronous = {'EXTRA' if journal == 'delete' else 'FULL'}")
    database.execute(
        "CREATE TABLE runs (cell TEXT, run INTEGER, payload BLOB, metrics BLOB, PRIMARY KEY (cell, run)) STRICT"
    )

    def land(run: int) -> None:
        payload, measures = (pack("jdm", run, part).content for part in (encode(record), encode_metrics(metrics)))
        database.execute("INSERT INTO runs VALUES ('jdm', ?, ?, ?)", (run, payload, measures))

    def read() -> int:
        rows = database.execute("SELECT payload, metrics FROM runs ORDER BY cell, run")
        return sum(_read(unpack(payload), unpack(measures)) for payload, measures in rows)

    return land, read


def _read(payload: bytes, measures: bytes) -> int:
    num_scans = decode(payload).num_scans
    decode_metrics(measures, num_scans)
    return num_scans


def parquet_folders(folder: Path, record: RunRecord, metrics: RunMetrics) -> Way:
    """A folder of Parquet files a run, made beside and renamed into place."""

    def land(run: int) -> None:
        scratch = folder / f".jdm-{run}"
        scratch.mkdir()
        for name, columns in tables_of(record).items():
            batch = to_arrow(columns, LAYOUTS[name])
            parquet.write_table(pa.Table.from_batches([batch]), scratch / f"{name}.parquet")
        parquet.write_table(pa.table(metrics.columns()), scratch / "metrics.parquet")
        (scratch / "run.json").write_text(json.dumps(run_facts(record)))
        for file in scratch.iterdir():
            with file.open("rb") as opened:
                os.fsync(opened.fileno())
        sync_folder(scratch)
        scratch.rename(folder / f"jdm-{run}")
        sync_folder(folder)

    def read() -> int:
        return sum(_read_folder(folder / name).num_scans for name in sorted(os.listdir(folder)))

    return land, read


def _read_folder(folder: Path) -> RunRecord:
    tables = {}
    for name in LAYOUTS:
        table = parquet.read_table(folder / f"{name}.parquet").combine_chunks()
        out = pa.BufferOutputStream()
        with pa.ipc.new_file(out, table.schema) as writer:
            writer.write_table(table)
        tables[name] = read_table(out.getvalue().to_pybytes(), LAYOUTS[name], name)
    parquet.read_table(folder / "metrics.parquet")
    return record_of(json.loads((folder / "run.json").read_text()), tables, {})


def print_codec(record: RunRecord, metrics: RunMetrics, repeats: int = 200) -> None:
    """Median milliseconds to encode and to decode a run, with all checks."""
    payload, measures = encode(record), encode_metrics(metrics)
    calls: dict[str, Callable[[], object]] = {
        "encode": lambda: (encode(record), encode_metrics(metrics)),
        "decode": lambda: _read(payload, measures),
    }
    for name, call in calls.items():
        seconds = []
        for _ in range(repeats):
            start = time.perf_counter()
            call()
            seconds.append(time.perf_counter() - start)
        print(f"{name}: {1e3 * statistics.median(seconds):.2f} ms, {len(payload) + len(measures)} bytes")


def finished_run() -> tuple[RunRecord, RunMetrics]:
    """That all here is about."""
    record = run_scenario(load_scenario("paper-a"), "jdm", seed=0, num_threads=1)
    return record, measure(record, cutoff=100.0, order=1.0, window=10)


def prepared(what: str) -> Once:
    """What gives the CPU milliseconds to encode a run, to read it back, to measure it, or to land it in a store."""
    record, metrics = finished_run()
    payload, measures = encode(record), encode_metrics(metrics)
    if what == "encode":
        return milliseconds_of(lambda: (encode(record), encode_metrics(metrics)), calls=20)
    if what == "decode":
        return milliseconds_of(lambda: _read(payload, measures), calls=20)
    if what == "measure":
        return milliseconds_of(lambda: measure(record, cutoff=100.0, order=1.0, window=10), calls=10)
    spec = {"name": "bench", "scenarios": ["paper-a"], "planners": ["jdm"], "runs": 10}
    campaign, timings = resolve(spec_from_data(spec)), encode_timings(record)

    def land() -> float:
        with tempfile.TemporaryDirectory() as place, Store.open(Path(place) / "results", campaign) as store:
            seconds = [
                cpu_seconds(lambda run=run: store.add(row_of("jdm", run, payload, timings, measures)))
                for run in range(10)
            ]
        return 1e3 * sum(seconds) / 10

    return land


def measures() -> Iterator[Measure]:
    """What a run costs beside its scans and decisions."""
    for what, name in (("encode", "encoded"), ("decode", "read back"), ("measure", "measured"), ("land", "landed")):
        yield Measure("store", f"a run of paper-a, {name}", partial(prepared, what))


def measured(way: Way, folder: Path, num_runs: int) -> str:
    land, read = way
    seconds = []
    for run in range(num_runs):
        start = time.perf_counter()
        land(run)
        seconds.append(time.perf_counter() - start)
    size = sum(file.stat().st_blocks * 512 for file in folder.rglob("*") if file.is_file())
    files = sum(file.is_file() for file in folder.rglob("*"))
    start = time.perf_counter()
    read()
    whole = time.perf_counter() - start
    worst = statistics.quantiles(seconds, n=100)[-1]
    return f"{1e3 * statistics.median(seconds):9.2f} {1e3 * worst:9.2f} {whole:10.2f} {size / 2**20:10.1f} {files:8d}"


def whole_folder(folder: Path, record: RunRecord, metrics: RunMetrics, num_runs: int) -> None:
    """Print what reading a results folder of two strategies, and writing its tables cost."""
    spec = {"name": "bench", "scenarios": ["paper-a"], "planners": ["jdm", "random"], "runs": num_runs // 2}
    campaign = resolve(spec_from_data(spec))
    with Store.open(folder / "results", campaign) as store:
        for cell, run in campaign.tasks:
            mine = replace(record, run=run)
            store.add(row_of(cell.name, run, encode(mine), encode_timings(mine), encode_metrics(metrics)))
    start = time.perf_counter()
    results = open_results(folder / "results")
    results.comparisons()
    compared = time.perf_counter()
    export_tables(results, folder / "tables")
    exported = time.perf_counter()
    memory = sum(table.nbytes for table in results.tables().values())
    print(
        f"results folder: opened and compared in {compared - start:.2f} s; "
        f"tables written in {exported - compared:.2f} s, {memory / 2**20:.1f} MiB in memory"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--folder", type=Path, default=None, help="where to write; the system's temporary folder")
    options = parser.parse_args()
    record, metrics = finished_run()
    print_codec(record, metrics)
    print(f"{options.runs} runs              ms a run   99th ms   read all s        MiB    files")
    for journal in ("delete", "truncate", "persist", "wal", "parquet"):
        with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
            folder = Path(scratch)
            if journal == "parquet":
                name, way = "Parquet folders", parquet_folders(folder, record, metrics)
            else:
                name, way = f"SQLite, {journal}", sqlite_file(folder, record, metrics, journal)
            print(f"{name:18s} {measured(way, folder, options.runs)}", flush=True)
    with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
        whole_folder(Path(scratch), record, metrics, options.runs)


if __name__ == "__main__":
    main()
