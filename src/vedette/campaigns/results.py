"""The results folder of a campaign, opened to read: finished, unfinished, or while it is written."""

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
from vedette.campaigns.tables import FinishedRun, joined_tables, tables_of_runs
from vedette.errors import InputError
from vedette.evaluation.comparison import Comparison, scored
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.metrics import Metric, RunMetrics, decode_metrics
from vedette.evaluation.runs import measure_run
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import elided, pluralise, shown
from vedette.simulation.records import RunRecord, RunSummary

if TYPE_CHECKING:
    import pyarrow
    import xarray

_TOGETHER = 500  # runs in a part of the tables


@dataclass(frozen=True, slots=True)
class GroupComparison:
    """Cells that differ in the compared axis alone, side by side.

    Attributes:
        settings: axis and value, of the axes that all of them share.
        cells: in the order of the comparison's strategies.
        labels: values of the compared axis as text: the names of the comparison's strategies.
        comparison: over the runs that are finished in every cell, and the scans that the scenario counts.
    """

    settings: dict[str, Any]
    cells: tuple[Cell, ...]
    labels: tuple[str, ...]
    comparison: Comparison


@dataclass(frozen=True, slots=True, repr=False)
class CampaignResults(SummaryRepr):
    """What is finished of a campaign. Runs are read when they are asked for, and their checksums verified each time.

    Every method that reads runs raises `InputError`, naming file, cell and run, for one that is damaged.

    Attributes:
        folder: where it is.
        campaign: what was to be run.
        manifest: all that the folder says of itself, as plain data: spec, scenarios, seeds, sessions with versions and
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
        """Numbers of the finished runs of a cell, increasing. Raises `InputError` for a name of no cell."""
        self.campaign.cell(cell)
        return tuple(run for name, run in self._finished() if name == cell)

    def missing(self, cell: str) -> tuple[int, ...]:
        """Numbers of the runs of a cell that are still to be done."""
        done = set(self.finished(cell))
        place = [each.name for each in self.campaign.cells].index(cell)
        return tuple(run for run in self.campaign.runs(place) if run not in done)

    def failures(self) -> tuple[Failure, ...]:
        """The runs that were tried and could not be finished, each with where and why it stopped; by cell and run.

        The same command that runs the campaign tries them again.
        """
        places = {cell.name: place for place, cell in enumerate(self.campaign.cells)}
        return tuple(sorted(self._reader.failures(), key=lambda each: (places.get(each.cell, -1), each.run)))

    def run(self, cell: str, run: SupportsIndex) -> FinishedRun:
        """A finished run. Raises `InputError` for one that is not finished, or damaged."""
        self.campaign.cell(cell)
        return self._decoded(self._reader.entry(cell, operator.index(run)))

    def runs(self) -> Iterator[FinishedRun]:
        """Every finished run, cells in the order of the campaign, each with its runs in order."""
        finished: dict[str, list[int]] = {}
        for name, run in self._finished():
            finished.setdefault(name, []).append(run)
        for cell in self.campaign.cells:
            for entry in self._reader.entries(cell.name, finished.get(cell.name, [])):
                yield self._decoded(entry)

    def record(self, cell: str, run: SupportsIndex) -> RunRecord:
        """The record of a finished run."""
        return self.run(cell, run).record

    def metrics(self, cell: str, run: SupportsIndex) -> RunMetrics:
        """The measures of a finished run: as they were kept, or where this version has others, computed anew."""
        return self.run(cell, run).metrics

    def ensemble(self, cell: str, runs: Sequence[SupportsIndex] | None = None) -> Ensemble:
        """What is compared and reported of finished runs of a cell, by their increasing numbers; None: of all.

        Raises `InputError` for no run.
        """
        wanted = self.finished(cell) if runs is None else tuple(map(operator.index, runs))
        return read_ensemble(self, cell, wanted, 1 if self._own else self._num_workers)

    def summaries(self, cell: str, runs: Sequence[int]) -> Iterator[tuple[RunSummary, RunMetrics]]:
        """What is compared of these finished runs, with their measures."""
        for entry in self._reader.entries(self.campaign.cell(cell).name, runs):
            yield self._summarised(entry)

    def comparisons(self) -> tuple[GroupComparison, ...]:
        """One for each group of cells, in order, that has finished runs in common."""
        return tuple(filter(None, map(self._comparison, self.campaign.groups())))

    def title(self, group: GroupComparison) -> str:
        """What sets a group apart from the others, such as "fusion clmb"; empty where it is the only one."""
        several = {axis for axis, values in self.campaign.axes.items() if len(values) > 1}
        return ", ".join(f"{axis} {value}" for axis, value in group.settings.items() if axis in several)

    def tables(self) -> dict[str, pyarrow.Table]:
        """Runs, scans, decisions, actions, rewards, tracks, truth, sensors and timings as Arrow tables.

        For pandas `.to_pandas()`, for polars `polars.from_arrow`; DuckDB queries them as they are. See
        `vedette.campaigns.tables`. None where no run is finished.
        """
        return joined_tables(self.table_parts())

    def table_parts(self) -> Iterator[dict[str, pyarrow.Table]]:
        """The same a few hundred runs at a time, in order, for results that no memory holds.

        Every part has the columns of its own runs: `vedette.campaigns.tables.schema_of` is of all.
        """
        runs = self.runs()
        while few := list(islice(runs, _TOGETHER)):
            yield tables_of_runs(self.campaign, few)

    def dataset(self) -> xarray.Dataset:
        """Measures at each scan as arrays over cell, run and step; see `vedette.campaigns.dataset`.

        Raises `InputError` where xarray is not installed.
        """
        scans = joined_tables({"scans": part["scans"]} for part in self.table_parts())
        return dataset_of_scans(self.campaign, scans.get("scans"))

    def _finished(self) -> list[tuple[str, int]]:
        """Cell and number of every finished run, sorted; `InputError` for one that the campaign does not have."""
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
        return GroupComparison(settings, cells, labels, scored(cells[0].scenario, ensembles))

    def _summarised(self, entry: Entry) -> tuple[RunSummary, RunMetrics]:
        if entry.metrics and not self._own:
            with self._placed(entry):
                summary = decode_summary(entry.payload, entry.timings)
                self._check(entry, summary.run, summary.health.num_tracks.shape[1])
                metrics, _ = decode_metrics(entry.metrics, len(summary.times))
            if metrics is not None:  # otherwise another version's
                return summary, metrics
        run = self._decoded(entry)
        return run.record.summary(), run.metrics

    def _decoded(self, entry: Entry) -> FinishedRun:
        with self._placed(entry):
            record = decode(entry.payload, entry.timings)
            self._check(entry, record.run, record.num_sensors)
            metrics, own = decode_metrics(entry.metrics, record.num_scans) if entry.metrics else (None, {})
            if metrics is None:
                metrics = replace(measure_run(record, self.campaign.cell(entry.cell).scenario), own=own)
            return FinishedRun(entry.cell, record, metrics.with_own(record, self._own), entry.session, entry.checksum)

    def _check(self, entry: Entry, run: int, num_sensors: int) -> None:
        """`InputError` for a run that is not of that entry."""
        expected = len(self.campaign.cell(entry.cell).scenario.model.sensors)
        if run != entry.run:
            raise InputError(f"run: expected the number {entry.run}; got {run}")
        if num_sensors != expected:
            raise InputError(f"run: expected the {expected} sensors of its scenario; got {num_sensors}")

    @contextmanager
    def _placed(self, entry: Entry) -> Iterator[None]:
        """What is wrong with an entry, with the place where it stands."""
        try:
            yield
        except InputError as error:
            place = f"{self.folder / DATABASE}: cell {entry.cell}, run {entry.run}"
            raise InputError(f"{place}: {error}") from error


def open_results(
    folder: Path | str, metrics: Sequence[Metric] = (), campaign: Campaign | None = None, num_workers: int = 1
) -> CampaignResults:
    """Open the results folder of a campaign to read.

    Args:
        folder: finished, unfinished, or while it is written.
        metrics: measures of one's own, computed of every run that is read, beside those that were kept.
        campaign: what the folder is of, where that is known, so that its scenarios need not be read; else None.
        num_workers: processes that read where there are thousands of runs, in a program that guards its main module as
            `multiprocessing` demands; 0: one a processor. It changes no number.

    Raises `InputError`, naming the file, for a folder that holds no campaign, or one whose manifest or runs are
    missing, cut short or altered.
    """
    target = Path(folder)
    if not target.is_dir():
        trouble = "a file" if target.exists() else "no such folder"
        raise InputError(f"{target}: {trouble}; expected the results folder of a campaign")
    manifest = read_manifest(target)
    reader = Reader(target)
    reader.check(contents_checksum(manifest))
    known = campaign_of(target, manifest) if campaign is None else campaign.with_runs(manifest["num_runs"])
    return CampaignResults(target, known, manifest, reader, tuple(metrics), num_workers)
