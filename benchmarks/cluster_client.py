"""What one process spends on each run that the workers of a dask cluster do, and how far it feeds them.

    python benchmarks/cluster_client.py                     # 40 workers, runs of .2 s
    python benchmarks/cluster_client.py --threads 400 --runs 8000

A run is a stub: a worker sleeps for as long as a run takes, packs the bytes of a finished run of paper-a and hands them
back, so that hundreds of workers fit a machine. The process that hands out the work and keeps the results is as it is.
What the workers spend on packing is theirs on a cluster; here it shares the processors, so that `fed` is a lower bound.
"""

from __future__ import annotations

import argparse
import os
import resource
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

from vedette.campaigns import Shard, cluster, resolve, run_campaign
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.tasks import CompletedRun, Task, TaskOutcome
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.evaluation.runs import measure_run, run_scenario
from vedette.simulation.serialization import encode_timings

SECONDS = float(os.environ.get("STUB_SECONDS", "0.2"))


@cache
def finished_run() -> tuple[bytes, bytes, bytes]:
    """What is handed back of a run."""
    changes = {"time.num_steps": 40, "control.decision_steps": [9], "ospa.last_scan": 40}
    campaign = resolve(
        spec_from_data({"name": "one", "scenarios": ["paper-a"], "planners": ["idm"], "runs": 1, "set": changes})
    )
    scenario = campaign.cells[0].scenario
    record = run_scenario(scenario, "idm", seed=0, num_threads=1)
    return encode(record), encode_timings(record), encode_metrics(measure_run(record, scenario))


def stub(task: Task) -> TaskOutcome:
    """In place of `vedette.campaigns.tasks.perform`."""
    content = finished_run()
    time.sleep(SECONDS * len(task.runs))
    return tuple(CompletedRun(row_of(task.cell.name, run, *content), 1.0, SECONDS) for run in task.runs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--threads", type=int, default=40, help="that stand for workers, in one process")
    parser.add_argument("--seconds", type=float, default=0.2, help="that a run takes")
    options = parser.parse_args()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent), "STUB_SECONDS": str(options.seconds)}
    dask, quiet = [sys.executable, "-m", "dask"], {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = [*dask, "worker", address, "--nthreads", str(options.threads), "--no-dashboard", "--no-nanny"]
    processes = [subprocess.Popen(each, env=environment, **quiet) for each in (scheduler, worker)]
    spec = {"name": "bench", "scenarios": ["paper-a"], "planners": ["idm", "stationary"], "runs": options.runs}
    campaign = replace(resolve(spec_from_data(spec)), shard=Shard(1, 2))  # of which no tables are written
    from cluster_client import stub as by_name  # as workers find it

    cluster.perform = by_name
    finished_run()
    try:
        with tempfile.TemporaryDirectory() as place:
            time.sleep(5.0)
            before, start = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
            run_campaign(campaign, Path(place) / "results", scheduler=address)
            wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(
        f"{options.runs} runs of {options.seconds:g} s on {options.threads} workers: {1e3 * cpu / options.runs:.2f} ms "
        f"of CPU a run; {wall:.1f} s, fed {options.runs * options.seconds / options.threads / wall:.0%}"
    )


if __name__ == "__main__":
    main()
