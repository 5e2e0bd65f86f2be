"""A whole campaign: executes the missing runs, stores each atomically, and writes the tables last."""

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from multiprocessing import current_process
from pathlib import Path
from typing import Protocol

from vedette.campaigns.cells import Campaign
from vedette.campaigns.database import DATABASE
from vedette.campaigns.engine import in_process, on_workers
from vedette.campaigns.export import export_tables
from vedette.campaigns.local import local_workers
from vedette.campaigns.manifest import MANIFEST
from vedette.campaigns.results import open_results
from vedette.campaigns.store import Store
from vedette.campaigns.tasks import CompletedRun, FailedRun, TaskQueue
from vedette.campaigns.tasks import TaskOutcome as Done
from vedette.errors import InputError, VedetteError
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.evaluation.runs import custom_metrics
from vedette.internal.extras import require_packages
from vedette.internal.files import sweep
from vedette.internal.text import pluralise

TABLES = "tables"


class ProgressObserver(Protocol):
    """Observer of a running campaign. See `Progress`."""

    def begin(self, num_existing: int, num_runs: int) -> None:
        """Receives the number of runs that exist already and the total number of runs."""
        return

    def note(self, text: str) -> None:
        """Receives a message for the user."""
        return

    def completed(self, result: CompletedRun) -> None:
        """Receives a run that is stored."""
        return

    def failed(self, result: FailedRun) -> None:
        """Receives a run that could not be finished."""
        return


class NullObserver(ProgressObserver):
    """Observer that ignores everything."""


@dataclass(frozen=True, slots=True)
class CampaignOutcome:
    """How a campaign ended.

    Attributes:
        num_completed: runs that this call added.
        num_existing: runs that existed before.
        failed: runs that could not be finished. The same call tries them again.
    """

    num_completed: int
    num_existing: int
    failed: tuple[FailedRun, ...]


def run_campaign(
    campaign: Campaign,
    folder: Path | str,
    *,
    num_workers: int = 1,
    scheduler: str | None = None,
    redo_damaged: bool = False,
    progress: ProgressObserver | None = None,
) -> CampaignOutcome:
    """Execute the runs that are missing in the folder, and write the tables when all are done.

    May be stopped at any moment, by any means: the same call continues from there. The final folder equals that of one
    uninterrupted call, byte for byte, except for timings. Workers, their number, and the order in which they finish
    change nothing.

    Args:
        campaign: see `vedette.campaigns.resolve`.
        folder: folder for the results, new, empty, or of the same campaign.
        num_workers: processes on this machine. 1: only this process. With a scheduler: number of workers to wait for
            before the first run.
        scheduler: address of a dask scheduler whose workers execute the runs instead, or the file that it writes
            (`--scheduler-file`). Each worker has this version installed.
        redo_damaged: repeat runs that were altered in the folder after they were stored, instead of refusing to
            continue.
        progress: observer of the progress.

    Raises:
        InputError: the folder holds something else, another campaign, or damaged results, or no scheduler answers at
            the address.
        VedetteError: the disk is full, or the scheduler is lost. Stored runs are safe.
    """
    if getattr(current_process(), "_inheriting", False):
        raise VedetteError(
            'a script that runs a campaign with workers needs `if __name__ == "__main__":` around the call'
        )
    if scheduler is not None:
        require_packages("a campaign on a cluster", "distributed")
    progress = progress or NullObserver()
    failed, num_completed = [], 0
    database = Path(folder) / DATABASE
    lost = (Path(folder) / MANIFEST).is_file() and (not database.exists() or database.stat().st_size == 0)
    with Store.open(Path(folder), campaign) as store:
        if lost:
            progress.note(f"{database} was not there, or empty: every run is done again")
        _check_undamaged(store, redo_damaged, progress)
        _add_missing_metrics(store, campaign, progress)
        queue = TaskQueue(campaign, store.finished())
        num_existing = campaign.total - len(queue)
        progress.begin(num_existing, campaign.total)
        for change in store.version_changes:
            progress.note(f"{change}; runs of both may differ in their last digits")
        with closing(_results(queue, num_workers, scheduler, progress)) as results:
            for batch in results:
                store.add(*(result.row for result in batch if isinstance(result, CompletedRun)))
                for result in batch:
                    if isinstance(result, CompletedRun):
                        num_completed += 1
                        progress.completed(result)
                    else:
                        failed.append(result)
                        store.note_failure(result.cell, result.run, result.message)
                        progress.failed(result)
        if campaign.shard.count == 1:  # tables of shards are written when they are merged
            # Always, to repair tables that an interrupted call left or that were altered.
            sweep(Path(folder) / TABLES)
            export_tables(open_results(folder, campaign=campaign), Path(folder) / TABLES)
    return CampaignOutcome(num_completed, num_existing, tuple(failed))


def _check_undamaged(store: Store, redo: bool, progress: ProgressObserver) -> None:
    """Raise `InputError` if a finished run was altered. With `redo` discard it instead, so that it is repeated."""
    damaged = store.damaged()
    names = ", ".join(f"{cell} {run}" for cell, run in damaged)
    if damaged and not redo:
        raise InputError(
            f"{store.folder}: expected the runs as they were kept; altered since: {names} (have what is "
            "damaged redone, or put the file back)"
        )
    for cell, run in damaged:
        store.discard(cell, run)
    if damaged:
        progress.note(f"damaged, and done again: {names}")


def _add_missing_metrics(store: Store, campaign: Campaign, progress: ProgressObserver) -> None:
    """Compute metrics that the program or the scenarios have gained since runs were stored, from their records."""
    metrics = {cell.name: custom_metrics(cell.scenario) for cell in campaign.cells}
    lacking = store.unmeasured({cell: [metric.name for metric in of_cell] for cell, of_cell in metrics.items()})
    if lacking:
        results = open_results(store.folder, campaign=campaign)
        for cell, run in lacking:
            stored = results.run(cell, run)
            store.put_metrics(cell, run, encode_metrics(stored.metrics.with_custom(stored.record, metrics[cell])))
        progress.note(f"measured anew: {pluralise(len(lacking), 'run')}")


def _results(queue: TaskQueue, num_workers: int, scheduler: str | None, progress: ProgressObserver) -> Generator[Done]:
    if scheduler is not None:
        from vedette.campaigns.cluster import remote_workers  # imported here, as only this branch needs asyncio

        with remote_workers(scheduler, progress.note, num_workers) as workers:
            yield from on_workers(workers, queue)
    elif num_workers > 1 and len(queue) > 1:
        with local_workers(min(num_workers, len(queue)), progress.note) as workers:
            yield from on_workers(workers, queue)
    else:
        yield from in_process(queue)
