"""What a campaign of a thousand shards costs beside its runs: the CPU of a run, the merge, its memory.

    python benchmarks/shards.py                                # 10^5 runs planned on 1,000 shards, 20 of them run
    python benchmarks/shards.py --runs 1000000 --sample 3
    python benchmarks/shards.py --sample 1000 --folder /dev/shm   # all of them, where no disk is waited for
    python benchmarks/shards.py --runs 10000 --shards 100 --real   # runs as they are, and the same by one process

A run is a stub: the bytes of one finished run of paper-a with `--scans` scans, under its own number, so that it costs
nothing but what surrounds it: queue, rows, and the store with its fsync. Each shard is the command itself, `vedette
campaign FILE --shard 17/1000 --workers 1`, from the interpreter's start to its end, on one processor as a job array
asks for; `start` is its CPU up to the first run. The bytecode of the library is kept between them, as it is of an
installed one. Of the shards planned `--sample` are run, one after the other, and merged.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import pickle
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from vedette.campaigns import merge, resolve
from vedette.campaigns.codec import encode
from vedette.campaigns.database import Reader
from vedette.campaigns.rows import row_of, verified
from vedette.campaigns.spec import load_spec
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.evaluation.runs import measure_run, run_scenario
from vedette.simulation.serialization import encode_timings

SPEC = """
name = "bench"
scenarios = ["paper-a"]
planners = ["idm", "stationary"]
runs = {runs}
set."time.num_steps" = {scans}
set."control.decision_steps" = [9]
set."ospa.last_scan" = {scans}
"""
# The program, with runs that are stubs where there is a file of one, beside which it says what it took until the first.
PROGRAM = """
import os, pickle, sys, time
from vedette.cli import app

stub, parts = os.environ.get("STUB"), []

def perform(task):
    from vedette.campaigns.rows import row_of
    from vedette.campaigns.tasks import CompletedRun
    if not parts:
        with open(stub + ".start", "w") as file:
            file.write(str(time.process_time()))
        with open(stub, "rb") as file:
            parts.extend(pickle.load(file))
    payload, timings, metrics = parts
    rows = (row_of(task.cell.name, run, payload + b"%d" % run, timings, metrics) for run in task.runs)
    return tuple(CompletedRun(row, 1.0, 0.2) for row in rows)

def run_with_progress(*given):
    from vedette.campaigns import engine
    engine.perform = perform
    return carried_out(*given)

if stub:
    command = sys.modules["vedette.cli.campaign"]
    carried_out, command.run_with_progress = command.run_with_progress, run_with_progress
app()
"""


class Spent(NamedTuple):
    """What a process took: CPU and wall time [s], and its peak of memory [MiB]."""

    cpu: float
    wall: float
    memory: float


def waited(process: int, since: float) -> Spent:
    """What a process has taken when it ends."""
    _, status, used = os.wait4(process, 0)
    if status:
        raise SystemExit("a process failed")
    return Spent(used.ru_utime + used.ru_stime, time.perf_counter() - since, used.ru_maxrss / 1024)


def in_child(work: Callable[[], object]) -> Spent:
    """What a fork of this process takes to do it."""
    since = time.perf_counter()
    child = os.fork()
    if child == 0:
        try:
            work()
            os._exit(0)
        finally:
            os._exit(1)
    return waited(child, since)


def commanded(folder: Path, stub: Path | None, *arguments: str) -> Spent:
    """What the command takes, from the interpreter's start to its end."""
    own = {"PYTHONPYCACHEPREFIX": str(folder / "bytecode"), "PYTHONDONTWRITEBYTECODE": ""}
    environment = os.environ | own | ({} if stub is None else {"STUB": str(stub)})
    since = time.perf_counter()
    command = [sys.executable, "-c", PROGRAM, *arguments]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return waited(process.pid, since)


def write_stub(file: Path, spec: Path) -> None:
    """What stands for the work, a finished run's bytes; and what becomes of them in the store."""
    scenario = resolve(load_spec(spec)).cells[0].scenario
    record = run_scenario(scenario, "idm", seed=0, num_threads=1)
    parts = encode(record), encode_timings(record), encode_metrics(measure_run(record, scenario))
    file.write_bytes(pickle.dumps(parts))
    values = row_of("cell", 0, *parts).values(1)
    packing = statistics.median(cpu_of(lambda: row_of("cell", 0, *parts)) for _ in range(99))
    reading = statistics.median(cpu_of(lambda: verified(values)) for _ in range(99))
    print(
        f"a run: {len(parts[0])} bytes, {len(parts[2])} of measures, {len(parts[1])} of timings, together "
        f"{sum(map(len, values[3::2]))} when packed, in {packing:.3f} ms of CPU; verified in {reading:.3f} ms"
    )


def cpu_of(work: Callable[[], object]) -> float:
    """CPU that it takes [ms]."""
    start = time.process_time()
    work()
    return 1e3 * (time.process_time() - start)


def rows_of(folder: Path) -> str:
    """SHA-256 over the runs of a results folder, in the order of cells and numbers."""
    digest = hashlib.sha256()
    for values in Reader(folder).rows():
        digest.update(f"{values[0]} {values[1]} {values[4]} {values[6]}\n".encode())  # checksums of run and measures
    return digest.hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100_000, help="of both strategies together")
    parser.add_argument("--shards", type=int, default=1000)
    parser.add_argument("--sample", type=int, default=20, help="shards that are run")
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--real", action="store_true", help="do all runs, once in shards and once by one process")
    parser.add_argument("--folder", type=Path, default=None, help="where to write; the system's temporary folder")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):  # one processor, as a job array asks for
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory(dir=options.folder) as place:
        measure(Path(place), options)


def measure(folder: Path, options: argparse.Namespace) -> None:
    """Run the shards, merge them, and say what it took."""
    spec, shards, merged = folder / "bench.toml", folder / "shards", folder / "merged"
    spec.write_text(SPEC.format(runs=options.runs // 2, scans=options.scans))
    stub = None if options.real else folder / "stub"
    if stub:
        write_stub(stub, spec)
    commanded(folder, stub, "campaign", str(spec), "--dry-run")  # compiles the bytecode
    starts: list[float] = []

    def shard(number: int) -> Spent:
        name = f"{number}/{options.shards}"
        spent = commanded(folder, stub, *f"campaign {spec} --workers 1 --out {shards} --shard {name}".split())
        if stub:
            starts.append(float(stub.with_suffix(".start").read_text()))
        return spent

    spent = [shard(number) for number in range(1, (options.shards if options.real else options.sample) + 1)]
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    merging = in_child(lambda: merge([shards], merged, tables=False))
    done = len(Reader(merged).finished())
    cpu, wall = (1e3 * sum(each) / done for each in (list(zip(*spent, strict=True))[:2]))
    print(f"{done} runs in {len(spent)} of {options.shards} shards: {cpu:.3f} ms of CPU a run, {wall:.2f} ms a run")
    if starts:
        start = statistics.median(starts)
        print(f"  of it up to a shard's first run: {start:.2f} s, {1e3 * start * len(spent) / done:.3f} ms a run")
    size = (merged / "campaign.sqlite").stat().st_size
    print(
        f"  merge: {1e3 * merging.cpu / done:.3f} ms of CPU a run, {merging.wall:.2f} s, {size / 2**20:.0f} MiB, "
        f"{size / done / 1e3:.1f} kB a run, peak of {merging.memory:.0f} MiB of memory (before it: {own:.0f})"
    )
    if options.real:
        commanded(folder, None, "campaign", str(spec), "--workers", "1", "--out", str(folder / "alone"))
        same = rows_of(folder / "alone") == (found := rows_of(merged))
        print(f"  rows {found}: {'the same' if same else 'OTHER ONES'} by one process")
        return
    print(f"  a finished shard begun again: {shard(1).cpu:.3f} s of CPU")
    print(f"all in: {cpu + 1e3 * merging.cpu / done:.3f} ms of CPU a run")


if __name__ == "__main__":
    main()
