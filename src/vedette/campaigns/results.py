"""Results folder of a campaign, opened for reading: finished, unfinished, or while it is written."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

from vedette.campaigns.aggregation import read_ensemble
from vedette.campaigns.cells import Campaign, Cell
from vedette.campaigns.codec import decode, decode_summary
from vedette.campaigns.database import DATABASE, Failure, Reader
from vedette.campaigns.dataset import dataset_of_scans
from vedette.campaigns.manifest import campaign_of, contents_checksum, read_manifest
from vedette.campaigns.rows import Entry
from vedette.campaigns.tables import FinishedRun, concatenated_tables, tables_of_runs
from vedette.errors import InputError
from vedette.evaluation.comparison import Comparison, compare_scored_scans
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.metrics.run import Metric, RunMetrics
from vedette.evaluation.metrics.serialization import decode_metrics
from vedette.evaluation.runs import measure_run
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import elided, pluralise, shown
from vedette.simulation.records import RunRecord, RunSummary

if TYPE_CHECKING:
    import pyarrow
    import xarray

_TOGETHER = 500  # runs per part of the tables


@dataclass(frozen=True, slots=True)
class GroupComparison:
    """Comparison of cells that differ only in the compared axis."""

    settings: dict[str, Any]  # values of the other axes, which the cells share
    cells: tuple[Cell, ...]  # in the order of the comparison's strategies
    labels: tuple[str, ...]  # values of the compared axis as text, the names of the comparison's strategies
    comparison: Comparison  # over the runs that are finished in every cell, and the scans that the scenario counts


@dataclass(frozen=True, slots=True, repr=False)
class CampaignResults(SummaryRepr):
    """Finished runs of a campaign. Runs are read on demand, and their checksums verified each time.

    Every method that reads runs raises `InputError` for a damaged one. The message names file, cell and run.

    Attributes:
        folder: the results folder.
        campaign: the campaign.
        manifest: the folder's manifest as plain data: specification, scenarios, seeds, sessions with versions and
            machines.
    """

    folder: Path
    campaign: Campaign
    manifest: dict[str, Any]
    _reader: Reader = field(repr=False)
    _own: tuple[Metric, ...] = field(default=(), repr=False)
    _num_workers: int = field(default=1, repr=False)

    def _summary(self) -> str:
        campaign = self.campaign
        done = f"{len(self._finished())} of {pluralise(campaign.total, 'run')} finished"
        return f"of {elided(campaign.name)}: {done}, {pluralise(len(campaign.cells), 'cell')}"

    def _detail(self) -> str:
        return str(self.folder)

    def finished(self, cell: str) -> tuple[int, ...]:
        """Return the increasing numbers of the finished runs of a cell. Raises `InputError` for an unknown cell."""
        self.campaign.cell(cell)
        return tuple(run for name, run in self._finished() if name == cell)

    def missing(self, cell: str) -> tuple[int, ...]:
        """Return the numbers of the runs of a cell that are still missing."""
        done = set(self.finished(cell))
        place = [each.name for each in self.campaign.cells].index(cell)
        return tuple(run for run in self.campaign.runs(place) if run not in done)

    def failures(self) -> tuple[Failure, ...]:
        """Return the runs that could not be finished, with the place and reason, by cell and run.

        The command that runs the campaign tries them again.
        """
        places = {cell.name: place for place, cell in enumerate(self.campaign.cells)}
        return tuple(sorted(self._reader.failures(), key=lambda each: (places.get(each.cell, -1), each.run)))

    def run(self, cell: str, run: SupportsIndex) -> FinishedRun:
        """Return a finished run. Raises `InputError` if it is not finished, or damaged."""
        self.campaign.cell(cell)
        return self._decoded(self._reader.entry(cell, operator.index(run)))

    def runs(self) -> Iterator[FinishedRun]:
        """Yield every finished run, cells in the order of the campaign, runs of a cell in order."""
        finished: dict[str, list[int]] = {}
        for name, run in self._finished():
            finished.setdefault(name, []).append(run)
        for cell in self.campaign.cells:
            for entry in self._reader.entries(cell.name, finished.get(cell.name, [])):
                yield self._decoded(entry)

    def record(self, cell: str, run: SupportsIndex) -> RunRecord:
        """Return the record of a finished run."""
        return self.run(cell, run).record

    def metrics(self, cell: str, run: SupportsIndex) -> RunMetrics:
        """Return the metrics of a finished run: the stored ones, or recomputed ones if this version has others."""
        return self.run(cell, run).metrics

    def ensemble(self, cell: str, runs: Sequence[SupportsIndex] | None = None) -> Ensemble:
        """Return the arrays that comparisons and reports use, from finished runs of a cell.

        runs: increasing numbers of the runs. None: all. Raises `InputError` for no run.
        """
        selected = self.finished(cell) if runs is None else tuple(map(operator.index, runs))
        return read_ensemble(self, cell, selected, 1 if self._own else self._num_workers)

    def summaries(self, cell: str, runs: Sequence[int]) -> Iterator[tuple[RunSummary, RunMetrics]]:
        """Yield summaries of these finished runs, with their metrics."""
        for entry in self._reader.entries(self.campaign.cell(cell).name, runs):
            yield self._summarised(entry)

    def comparisons(self) -> tuple[GroupComparison, ...]:
        """Return a comparison for each group of cells with common finished runs, in order."""
        return tuple(filter(None, map(self._comparison, self.campaign.groups())))

    def title(self, group: GroupComparison) -> str:
        """Return the settings that distinguish a group from the others, such as "fusion clmb", empty for a single
        group.
        """
        several = {axis for axis, values in self.campaign.axes.items() if len(values) > 1}
        return ", ".join(f"{axis} {value}" for axis, value in group.settings.items() if axis in several)

    def tables(self) -> dict[str, pyarrow.Table]:
        """Return runs, scans, decisions, actions, rewards, tracks, truth, sensors and timings as Arrow tables.

        Use `.to_pandas()` for pandas, `polars.from_arrow` for polars. DuckDB queries them directly. See
        `vedette.campaigns.tables`. Empty if no run is finished.
        """
        return concatenated_tables(self.table_parts())

    def table_parts(self) -> Iterator[dict[str, pyarrow.Table]]:
        """Yield the same tables for a few hundred runs at a time, in order, for results that do not fit in memory.

        Every part has only the columns of its own runs: `vedette.campaigns.tables.schema_of` returns all.
        """
        runs = self.runs()
        while batch := list(islice(runs, _TOGETHER)):
            yield tables_of_runs(self.campaign, batch)

    def dataset(self) -> xarray.Dataset:
        """Return the metrics at each scan as arrays over cell, run and step. See `vedette.campaigns.dataset`.

        Raises `InputError` if xarray is not installed.
        """
        scans = concatenated_tables({"scans": part["scans"]} for part in self.table_parts())
        return dataset_of_scans(self.campaign, scans.get("scans"))

    def _finished(self) -> list[tuple[str, int]]:
        """Return cell and number of every finished run, sorted. Raises `InputError` for one outside the campaign."""
        finished = self._reader.finished()
        names = {cell.name for cell in self.campaign.cells}
        for cell, run in finished:
            if cell not in names or not 0 <= run < self.campaign.num_runs:
                raise InputError(
                    f"{self.folder / DATABASE}: expected runs of the campaign; got cell {shown(cell)}, run {run}"
                )
        return finished

    def _comparison(self, cells: tuple[Cell, ...]) -> GroupComparison | None:
        common = sorted(set.intersection(*(set(self.finished(cell.name)) for cell in cells)))
        if not common:
            return None
        axis = self.campaign.compare
        labels = tuple(str(cell.settings[axis]) for cell in cells)
        ensembles = {label: self.ensemble(cell.name, common) for label, cell in zip(labels, cells, strict=True)}
        settings = {name: value for name, value in cells[0].settings.items() if name != axis}
        return GroupComparison(settings, cells, labels, compare_scored_scans(cells[0].scenario, ensembles))

    def _summarised(self, entry: Entry) -> tuple[RunSummary, RunMetrics]:
        if entry.metrics and not self._own:
            with self._placed(entry):
                summary = decode_summary(entry.payload, entry.timings)
                self._check(entry, summary.run, summary.health.num_tracks.shape[1])
                metrics, _ = decode_metrics(entry.metrics, len(summary.times))
            if metrics is not None:  # otherwise they are of another version
                return summary, metrics
        run = self._decoded(entry)
        return run.record.summary(), run.metrics

    def _decoded(self, entry: Entry) -> FinishedRun:
        with self._placed(entry):
            record = decode(entry.payload, entry.timings)
            self._check(entry, record.run, record.num_sensors)
            metrics, custom = decode_metrics(entry.metrics, record.num_scans) if entry.metrics else (None, {})
            if metrics is None:
                metrics = replace(measure_run(record, self.campaign.cell(entry.cell).scenario), custom=custom)
            return FinishedRun(
                entry.cell, record, metrics.with_custom(record, self._own), entry.session, entry.checksum
            )

    def _check(self, entry: Entry, run: int, num_sensors: int) -> None:
        """Raise `InputError` if a run does not belong to that entry."""
        expected = len(self.campaign.cell(entry.cell).scenario.model.sensors)
        if run != entry.run:
            raise InputError(f"run: expected the number {entry.run}; got {run}")
        if num_sensors != expected:
            raise InputError(f"run: expected the {expected} sensors of its scenario; got {num_sensors}")

    @contextmanager
    def _placed(self, entry: Entry) -> Iterator[None]:
        """Context manager that adds the place of an entry to errors about it."""
        try:
            yield
        except InputError as error:
            place = f"{self.folder / DATABASE}: cell {entry.cell}, run {entry.run}"
            raise InputError(f"{place}: {error}") from error


def open_results(
    folder: Path | str, metrics: Sequence[Metric] = (), campaign: Campaign | None = None, num_workers: int = 1
) -> CampaignResults:
    """Open the results folder of a campaign for reading.

    Args:
        folder: folder that is finished, unfinished, or being written.
        metrics: custom metrics to compute for every run that is read, in addition to the stored ones.
        campaign: campaign of the folder, if known, so that its scenarios need not be read, else None.
        num_workers: number of processes that read thousands of runs, in a program that guards its main module as
            `multiprocessing` demands. 0: one per processor. It does not change results.

    Raises `InputError`, naming the file, for a folder without a campaign, or with a manifest or runs that are missing,
    cut short or altered.
    """
    target = Path(folder)
    if not target.is_dir():
        trouble = "a file" if target.exists() else "no such folder"
        raise InputError(f"{target}: {trouble}; expected the results folder of a campaign")
    manifest = read_manifest(target)
    reader = Reader(target)
    reader.check(contents_checksum(manifest))
    resolved = campaign_of(target, manifest) if campaign is None else campaign.with_runs(manifest["num_runs"])
    return CampaignResults(target, resolved, manifest, reader, tuple(metrics), num_workers)
