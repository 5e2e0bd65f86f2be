"""Small campaigns with finished runs that no filter had to run for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evaluation.synthetic import make_record
from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.evaluation.metrics.run import RunMetrics, measure
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import encode_timings

NUM_RUNS = 3


def make_campaign(**changes) -> Campaign:
    """paper-a with two strategies under two amounts of clutter."""
    data = {
        "name": "trial",
        "scenarios": ["paper-a"],
        "planners": ["jdm", "random"],
        "runs": NUM_RUNS,
        "seed": 7,
        "grid": {"sensors.*.clutter.rate": [5.0, 10.0]},
    }
    return resolve(spec_from_data({**data, **changes}))


def make_run(planner: str, run: int) -> tuple[RunRecord, RunMetrics]:
    record = replace(make_record(planner, run), scenario="paper-a")
    return record, measure(record, cutoff=100.0, order=1.0, window=10)


def add(store: Store, cell: str, run: int) -> bytes:
    """Add a run of the planner that the cell's name begins with; returns its payload."""
    record, metrics = make_run(cell.split("-")[0], run)
    payload = encode(record)
    store.add(row_of(cell, run, payload, encode_timings(record), encode_metrics(metrics)))
    return payload


def fill(folder: Path, campaign: Campaign, leave_out: int = 0) -> Path:
    """A results folder with all runs but the last ones."""
    with Store.open(folder, campaign) as store:
        tasks = campaign.tasks
        for cell, run in tasks[: len(tasks) - leave_out]:
            add(store, cell.name, run)
    return folder
