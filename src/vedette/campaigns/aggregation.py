"""Reads the runs of a cell into arrays, with several processes if there are many. A run is dropped once it is read."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, current_process
from typing import TYPE_CHECKING

from vedette.errors import VedetteError
from vedette.evaluation.ensembles import MAX_BATCH_RUNS, Ensemble, build_ensemble, concatenate_ensembles
from vedette.internal.processes import as_children, context, end_with_parent, let_go_of_results, load_ahead
from vedette.internal.threads import processors

if TYPE_CHECKING:
    from vedette.campaigns.results import CampaignResults

_A_PART = 4 * MAX_BATCH_RUNS  # runs per part; fewer are read faster than another process starts


def read_ensemble(results: CampaignResults, cell: str, runs: Sequence[int], num_workers: int) -> Ensemble:
    """Return the arrays that comparisons and reports use, from these finished runs of a cell.

    num_workers: number of processes, 0 for all processors. Does not change the result.

    Raises `InputError` for no run or a damaged one, and `VedetteError` if a process dies.
    """
    parts = [runs[start : start + _A_PART] for start in range(0, len(runs), _A_PART)]
    number = min(num_workers or processors(), len(parts))
    if number <= 1:
        return concatenate_ensembles([_part(results, cell, part) for part in parts])
    return concatenate_ensembles(list(_by_processes(results, cell, parts, number)))


def _by_processes(
    results: CampaignResults, cell: str, parts: Sequence[Sequence[int]], number: int
) -> Iterator[Ensemble]:
    if getattr(current_process(), "_inheriting", False):  # a reader running an unguarded main module
        raise VedetteError('a script that reads with workers needs `if __name__ == "__main__":` around the call')
    load_ahead()
    earlier_processes = set(active_children())
    pool = ProcessPoolExecutor(number, context(), initializer=_initialise_reader, initargs=(results, cell))
    try:
        with as_children(of_server=True):
            ensembles = pool.map(_read, parts)
        let_go_of_results(pool)
        yield from ensembles
    except BrokenProcessPool as error:
        raise VedetteError(
            "workers: expected processes that read runs; one has died: for want of memory, or, in a script of your "
            'own, as the call that reads is not under `if __name__ == "__main__":`'
        ) from error
    except BaseException:  # Ctrl-C or a damaged run: the other readers would take seconds in vain
        for reader in set(active_children()) - earlier_processes:
            reader.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _part(results: CampaignResults, cell: str, runs: Sequence[int]) -> Ensemble:
    return build_ensemble(results.summaries(cell, runs))


_own_source: list[tuple[CampaignResults, str]] = []  # results and cell of this process, if it is a reader


def _initialise_reader(results: CampaignResults, cell: str) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the fork server may not ignore it
    end_with_parent()
    _own_source.append((results, cell))


def _read(runs: Sequence[int]) -> Ensemble:
    return _part(*_own_source[0], runs)
