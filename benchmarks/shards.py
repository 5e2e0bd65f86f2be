"""What a campaign of a thousand shards costs beside its runs: the CPU of a run, the merge, its memory.

    python benchmarks/shards.py                                # 10^5 runs planned on 1,000 shards, 20 of them run
    python benchmarks/shards.py --runs 1000000 --sample 3
    python benchmarks/shards.py --sample 1000 --folder /dev/shm   # all of them, where no disk is waited for
    python benchmarks/shards.py --runs 10000 --shards 100 --real   # runs as they are, and the same by one process

A run is a stub: the bytes of one finished run of paper-a with `--scans` scans, under its own number, so that it costs
nothing but what surrounds it: queue, rows, and the store with its fsync. Each shard is a process of its own, forked
from one that has everything loaded: `process` is what a new interpreter needs to load as much and to read the
specification, once a shard. Of the shards planned `--sample` are run, one after the other, and merged.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from vedette.campaigns import Campaign, Shard, engine, merge, resolve, run_campaign
from vedette.campaigns.codec import encode
from vedette.campaigns.database import Reader
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.tasks import Landed, Outcome, Task
from vedette.evaluation.metrics import encode_metrics
from vedette.evaluation.runs import measure_run, run_scenario
from vedette.simulation.kept import encode_timings

START = """
import resource
from vedette.campaigns import resolve
from vedette.campaigns.spec import spec_from_data
import vedette.campaigns.merging, vedette.cli.campaign
resolve(spec_from_data({0!r}))
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime)
"""


def specification(num_runs: int, num_scans: int) -> dict[str, object]:
    """Two strategies in one setting."""
    changes = {"time.num_steps": num_scans, "control.decision_steps": [9], "ospa.to_step": num_scans}
    return {"name": "bench", "scenarios": ["paper-a"], "planners": ["idm", "still"], "runs": num_runs, "set": changes}


def stub_of(campaign: Campaign) -> Callable[[Task], Outcome]:
    """What stands for the work: a finished run's bytes under the run's own number."""
    scenario = campaign.cells[0].scenario
    record = run_scenario(scenario, "idm", seed=0, num_threads=1)
    payload, metrics, timings = encode(record), encode_metrics(measure_run(record, scenario)), encode_timings(record)
    print(f"a run: {len(payload)} bytes, {len(metrics)} of measures, {len(timings)} of timings")

    def perform(task: Task) -> Outcome:
        return tuple(
            Landed(row_of(task.cell.name, run, payload + b"%d" % run, timings, metrics), 1.0, 0.2) for run in task.runs
        )

    return perform


def rows_of(folder: Path) -> str:
    """SHA-256 over the runs of a results folder, in the order of cells and numbers."""
    digest = hashlib.sha256()
    for values in Reader(folder).rows():
        digest.update(f"{values[0]} {values[1]} {values[4]} {values[6]}\n".encode())  # checksums of run and measures
    return digest.hexdigest()


def in_child(work: Callable[[], object]) -> tuple[float, float, float]:
    """CPU seconds, seconds and the peak memory in MiB of a child that does it."""
    start = time.perf_counter()
    child = os.fork()
    if child == 0:
        try:
            work()
            os._exit(0)
        finally:
            os._exit(1)
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit("a child failed")
    return used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100_000, help="of both strategies together")
    parser.add_argument("--shards", type=int, default=1000)
    parser.add_argument("--sample", type=int, default=20, help="shards that are run")
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--real", action="store_true", help="do all runs, once in shards and once by one process")
    parser.add_argument("--folder", type=Path, default=None, help="where to write; the system's temporary folder")
    options = parser.parse_args()
    data = specification(options.runs // 2, options.scans)
    started = subprocess.run([sys.executable, "-c", START.format(data)], capture_output=True, text=True, check=True)
    campaign = resolve(spec_from_data(data))
    if not options.real:
        engine.perform = stub_of(campaign)
    number = options.shards if options.real else options.sample
    shares = [replace(campaign, shard=Shard(each, options.shards)) for each in range(1, number + 1)]
    with tempfile.TemporaryDirectory(dir=options.folder) as place:
        folder = Path(place)
        spent = [in_child(lambda share=share: run_campaign(share, folder / share.shard.folder)) for share in shares]
        done = sum(share.total for share in shares)
        cpu, wall = (1e3 * sum(each[i] for each in spent) / done for i in (0, 1))
        process = 1e3 * float(started.stdout) * len(shares) / done
        print(
            f"{done} runs in {len(shares)} of {options.shards} shards: {cpu:.3f} ms of CPU a run, {wall:.2f} ms a run"
        )
        print(f"  process: {float(started.stdout):.2f} s of CPU a shard, {process:.3f} ms a run")
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        merging, seconds, memory = in_child(lambda: merge([folder], folder / "merged", tables=False))
        size = (folder / "merged" / "campaign.sqlite").stat().st_size / 2**20
        print(
            f"  merge: {1e3 * merging / done:.3f} ms of CPU a run, {seconds:.2f} s, {size:.0f} MiB, "
            f"peak of {memory:.0f} MiB of memory (before it: {own:.0f})"
        )
        if options.real:
            run_campaign(campaign, folder / "alone")
            same = rows_of(folder / "alone") == (found := rows_of(folder / "merged"))
            print(f"  rows {found}: {'the same' if same else 'OTHER ONES'} by one process")
            return
        resumed, _, _ = in_child(lambda: run_campaign(shares[0], folder / shares[0].shard.folder))
        print(f"  a finished shard begun again: {resumed:.3f} s of CPU")
        print(f"all in: {cpu + process + 1e3 * merging / done:.3f} ms of CPU a run")


if __name__ == "__main__":
    main()
