"""The results folder of a campaign, opened to read: finished, unfinished, or while it is written."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

from vedette.campaigns.cells import Campaign, Cell
from vedette.campaigns.codec import decode
from vedette.campaigns.database import DATABASE, Failure, Reader
from vedette.campaigns.dataset import dataset_of_scans
from vedette.campaigns.manifest import campaign_of, contents_checksum, read_manifest
from vedette.campaigns.rows import Entry
from vedette.campaigns.tables import FinishedRun, tables_of_runs
from vedette.errors import InputError
from vedette.evaluation.comparison import Comparison, Outline, outline, scored
from vedette.evaluation.metrics import Metric, RunMetrics, decode_metrics
from vedette.evaluation.runs import measure_run
from vedette.simulation.records import RunRecord
from vedette.speaking import Speaking
from vedette.text import counted, elided, shown

if TYPE_CHECKING:
    import pyarrow
    import xarray


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
class CampaignResults(Speaking):
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

    def _summary(self) -> str:
        campaign = self.campaign
        done = f"{len(self._finished())} of {counted(campaign.total, 'run')} finished"
        return f"of {elided(campaign.name)}: {done}, {counted(len(campaign.cells), 'cell')}"

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
        finished = self._finished()
        for cell in self.campaign.cells:
            for name, run in finished:
                if name == cell.name:
                    yield self.run(name, run)

    def record(self, cell: str, run: SupportsIndex) -> RunRecord:
        """The record of a finished run."""
        return self.run(cell, run).record

    def metrics(self, cell: str, run: SupportsIndex) -> RunMetrics:
        """The measures of a finished run: as they were kept, or where this version has others, computed anew."""
        return self.run(cell, run).metrics

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
        return tables_of_runs(self.campaign, self.runs())

    def dataset(self) -> xarray.Dataset:
        """Measures at each scan as arrays over cell, run and step; see `vedette.campaigns.dataset`.

        Raises `InputError` where xarray is not installed.
        """
        return dataset_of_scans(self.campaign, self.tables().get("scans"))

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
        outlines: dict[str, list[RunRecord | Outline]] = {}
        metrics: dict[str, list[RunMetrics]] = {}
        for label, cell in zip(labels, cells, strict=True):
            outlines[label], metrics[label] = [], []
            for number in common:  # of a hundred thousand runs the records would take gigabytes
                run = self.run(cell.name, number)
                outlines[label].append(outline(run.record))
                metrics[label].append(run.metrics)
        settings = {name: value for name, value in cells[0].settings.items() if name != axis}
        return GroupComparison(settings, cells, labels, scored(cells[0].scenario, outlines, metrics))

    def _decoded(self, entry: Entry) -> FinishedRun:
        try:
            record = decode(entry.payload, entry.timings)
            if record.run != entry.run:
                raise InputError(f"run: expected the number {entry.run}; got {record.run}")
            scenario = self.campaign.cell(entry.cell).scenario
            num_sensors = len(scenario.model.sensors)
            if record.num_sensors != num_sensors:
                raise InputError(f"run: expected the {num_sensors} sensors of its scenario; got {record.num_sensors}")
            metrics, own = decode_metrics(entry.metrics, record.num_scans) if entry.metrics else (None, {})
            if metrics is None:
                metrics = replace(measure_run(record, scenario), own=own)
            metrics = metrics.with_own(record, self._own)
        except InputError as error:
            place = f"{self.folder / DATABASE}: cell {entry.cell}, run {entry.run}"
            raise InputError(f"{place}: {error}") from error
        return FinishedRun(entry.cell, record, metrics, entry.session, entry.checksum)


def open_results(
    folder: Path | str, metrics: Sequence[Metric] = (), campaign: Campaign | None = None
) -> CampaignResults:
    """Open the results folder of a campaign to read.

    Args:
        folder: finished, unfinished, or while it is written.
        metrics: measures of one's own, computed of every run that is read, beside those that were kept.
        campaign: what the folder is of, where that is known, so that its scenarios need not be read; else None.

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
    return CampaignResults(target, known, manifest, reader, tuple(metrics))
