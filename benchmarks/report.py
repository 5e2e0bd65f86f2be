"""What it costs to compare and report the runs of a long campaign: seconds, CPU, and the memory of all processes.

    python benchmarks/report.py                      # 10^5 runs of paper-a by four strategies
    python benchmarks/report.py --runs 10000

A few runs of each strategy are real; the others have their bytes under numbers of their own, so that it costs minutes,
not hours, to have them. `vedette results` and `vedette report` are then processes as a user starts them. Memory is the
largest sum over a command and the processes that it starts, of what each has to itself and its share of what they have
together (PSS, Linux alone), looked at every fifth of a second.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

from vedette.campaigns import resolve
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.evaluation.runs import measure_run, run_scenario
from vedette.internal.reading import read_members
from vedette.simulation.serialization import encode_timings

PLANNERS = ("jdm", "idm", "assigned_target", "random")


def renumbered(payload: bytes, run: int) -> bytes:
    """The bytes of a run under another number."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name, content in read_members(payload).items():
            if name == "run.json":
                content = json.dumps({**json.loads(content), "run": run}).encode() + b"\n"
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
    return out.getvalue()


def fill(folder: Path, num_runs: int, num_real: int) -> None:
    """A results folder of so many runs of each strategy."""
    data = {"name": "long", "scenarios": ["paper-a"], "planners": list(PLANNERS), "runs": num_runs}
    campaign = resolve(spec_from_data(data))
    with Store.open(folder, campaign) as store:
        for cell in campaign.cells:
            records = [
                run_scenario(cell.scenario, cell.planner, seed=0, run=run, num_threads=1) for run in range(num_real)
            ]
            kept = [
                (encode(each), encode_timings(each), encode_metrics(measure_run(each, cell.scenario)))
                for each in records
            ]
            for start in range(0, num_runs, 200):
                rows = [
                    row_of(cell.name, run, renumbered(payload, run), timings, metrics)
                    for run in range(start, min(start + 200, num_runs))
                    for payload, timings, metrics in [kept[run % num_real]]
                ]
                store.add(*rows)


def family(process: int) -> list[int]:
    """A process and those that it has started, and they."""
    children: dict[int, list[int]] = {}
    for each in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = int((each / "stat").read_text().rpartition(")")[2].split()[1])
            children.setdefault(parent, []).append(int(each.name))
    found = [process]
    for one in found:
        found += children.get(one, [])
    return found


def memory_of(process: int) -> float:
    """MiB that a process has."""
    with contextlib.suppress(OSError):
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
        return sum(float(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024
    return 0.0


def cpu_of(process: int) -> float:
    """Seconds of CPU that a process has had."""
    with contextlib.suppress(OSError):
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def spent(*command: str) -> str:
    """What a command of the program costs."""
    start, peak, cpu = time.perf_counter(), 0.0, dict[int, float]()
    program = [sys.executable, "-c", "from vedette.cli import app; app()"]
    with subprocess.Popen([*program, *command], stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            everyone = family(process.pid)
            peak = max(peak, sum(map(memory_of, everyone)))
            cpu |= {one: max(cpu.get(one, 0.0), cpu_of(one)) for one in everyone}
            time.sleep(0.2)
    if process.returncode:
        raise SystemExit(f"vedette {' '.join(command)}: exit status {process.returncode}")
    wall = time.perf_counter() - start
    return f"{wall:6.1f} s, {sum(cpu.values()):6.1f} s of CPU, at most {peak:5.0f} MiB"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100_000, help="of all strategies together")
    parser.add_argument("--real", type=int, default=40, help="runs of each strategy that are real")
    parser.add_argument("--folder", type=Path, default=None, help="results that an earlier call has filled, or is to")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = options.folder or Path(place) / "results"
        if not folder.exists():
            fill(folder, options.runs // len(PLANNERS), options.real)
        size = os.stat(folder / "campaign.sqlite").st_size / 2**30
        print(f"{options.runs} runs of paper-a by {len(PLANNERS)} strategies, {size:.2f} GiB; {os.cpu_count()} cores")
        print(f"vedette results: {spent('results', str(folder))}", flush=True)
        print(f"vedette report:  {spent('report', str(folder), '--out', str(Path(place) / 'report.html'))}")


if __name__ == "__main__":
    main()
