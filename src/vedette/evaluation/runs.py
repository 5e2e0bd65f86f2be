"""Runs of a scenario: one, or paired runs of several strategies shared over processes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

from vedette.control import IndependentPlanner, JointPlanner, Planner
from vedette.errors import VedetteError
from vedette.evaluation.metrics import ospa_of_run
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_filters, build_planner
from vedette.scenarios.build.experiment import build_experiment
from vedette.simulation.loop import simulate
from vedette.simulation.records import RunRecord

STRATEGIES = ("jdm", "idm", "random", "fixed", "still")


def strategy(scenario: Scenario, name: str, num_threads: int = 0) -> Planner | None:
    """The planner called `jdm`, `idm`, `random` or `fixed`; None for `still`, where the sensors never move.

    Raises:
        InputError: another name.
    """
    if name == "still":
        return None
    planner = build_planner(scenario.model, build_filters(scenario), name)
    if isinstance(planner, JointPlanner | IndependentPlanner):
        return replace(planner, settings=replace(planner.settings, num_threads=num_threads))
    return planner


def run_scenario(scenario: Scenario, planner: str, *, seed: int, run: int = 0, num_threads: int = 0) -> RunRecord:
    """One run. `num_threads` share a decision (0: one a processor) and change no result.

    Raises:
        VedetteError: the scenario's models, filters or planner cannot do what is asked.
    """
    score = partial(ospa_of_run, cutoff=scenario.model.ospa.cutoff, order=scenario.model.ospa.order)
    return simulate(
        build_experiment(scenario), strategy(scenario, planner, num_threads), seed=seed, run=run, score=score
    )


def run_paired(
    scenario: Scenario,
    planners: Sequence[str],
    num_runs: int,
    *,
    seed: int,
    num_workers: int,
    progress: Callable[[RunRecord], None] = lambda record: None,
) -> dict[str, list[RunRecord]]:
    """`num_runs` runs of each strategy, run number by run number on the same truth and noise.

    Args:
        num_workers: processes that share the runs; 1: this process alone. They change no result.
        progress: called with each finished run, in the order of finishing.
    """
    tasks = [(planner, run) for run in range(num_runs) for planner in planners]
    records: dict[tuple[str, int], RunRecord] = {}
    # The first run is this process's own even then, so that kernels are compiled once and not once a worker.
    here, shared = (tasks, []) if num_workers <= 1 else (tasks[:1], tasks[1:])
    for planner, run in here:
        records[planner, run] = run_scenario(scenario, planner, seed=seed, run=run, num_threads=1)
        progress(records[planner, run])
    if shared:
        for task, record in _shared_runs(scenario, shared, seed, num_workers):
            records[task] = record
            progress(record)
    return {planner: [records[planner, run] for run in range(num_runs)] for planner in planners}


def _shared_runs(
    scenario: Scenario, tasks: Sequence[tuple[str, int]], seed: int, num_workers: int
) -> Iterator[tuple[tuple[str, int], RunRecord]]:
    """Each task and its record, in the order of finishing."""
    # Spawned, not forked: a forked child would inherit the locks of threads that it does not have.
    with ProcessPoolExecutor(num_workers, mp_context=get_context("spawn")) as pool:
        with children_ignore_interrupts():
            pending = {
                pool.submit(run_scenario, scenario, planner, seed=seed, run=run, num_threads=1): (planner, run)
                for planner, run in tasks
            }
        try:
            for done in as_completed(pending):
                yield pending[done], done.result()
        except BrokenProcessPool:
            raise VedetteError(
                "a worker process died (out of memory?); nothing was lost but the runs of this call"
            ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def children_ignore_interrupts() -> Iterator[None]:
    """Processes started inside inherit that Ctrl-C is not for them; the main process stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
