"""Campaigns whose runs are made up, so that what surrounds them can be tested by the thousand."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from functools import cache
from pathlib import Path

from campaigns.filled import make_campaign, make_run
from vedette.campaigns import Campaign, Shard, engine, run_campaign
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import row_of
from vedette.campaigns.running import NullObserver
from vedette.campaigns.tasks import CompletedRun, Task, TaskOutcome
from vedette.evaluation.metrics.run import RunMetrics
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import encode_timings


def stub_campaign(runs: int) -> Campaign:
    """Two cells."""
    return make_campaign(runs=runs, grid={})


@cache
def _first(planner: str) -> tuple[RunRecord, RunMetrics]:
    return make_run(planner, 0)


def stub_perform(task: Task) -> TaskOutcome:
    """In place of `vedette.campaigns.tasks.perform`: the same numbers every time, under the run's own number."""
    record, metrics = _first(task.cell.planner)
    return tuple(
        CompletedRun(row_of(task.cell.name, run, encode(mine), encode_timings(mine), encode_metrics(metrics)), 1.0, 0.2)
        for run in task.runs
        for mine in [replace(record, run=run)]
    )


class _Killed(NullObserver):
    """Ends the process once so many rows are there."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._count = 0

    def completed(self, result: CompletedRun) -> None:
        """See `vedette.campaigns.ProgressObserver`."""
        self._count += 1
        if self._count % self._every == 0:
            os.kill(os.getpid(), signal.SIGKILL)


def run_killed(folder: Path, runs: str, count: str, every: str = "10") -> None:
    """Run all shares, each in children that are killed after so many rows; print the rows there after each kill."""
    engine.perform = stub_perform
    engine._MOST_TOGETHER = 5  # in a transaction: a kill may come after each
    whole = stub_campaign(int(runs))
    for number in range(1, int(count) + 1):
        campaign = replace(whole, shard=Shard(number, int(count)))
        done = 0
        while True:
            child = os.fork()
            if child == 0:
                run_campaign(campaign, folder / campaign.shard.folder, progress=_Killed(int(every)))
                os._exit(0)
            if os.waitpid(child, 0)[1] == 0:
                break
            done += int(every)
            print(done, flush=True)
