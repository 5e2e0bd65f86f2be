"""The results folder of a campaign, opened to write: the one place through which finished runs reach the disk.

The folder holds `manifest.json` (the campaign as data, who worked on it when, with which versions) and
`campaign.sqlite` (the finished runs). Read it with `vedette.campaigns.results.open_results`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from vedette.campaigns.cells import Campaign
from vedette.campaigns.database import DATABASE, LOCK, Failure
from vedette.campaigns.journal import Writer
from vedette.campaigns.manifest import (
    MANIFEST,
    check_same,
    contents_checksum,
    new_manifest,
    new_session,
    read_manifest,
    write_manifest,
)
from vedette.campaigns.rows import Row
from vedette.errors import InputError
from vedette.evaluation.metrics import has_metrics


class Store(Writer):
    """The one writer of a results folder; a context manager. Its calls may come from any thread, one at a time."""

    def __init__(self, folder: Path, campaign: Campaign, fresh: dict[str, Any]) -> None:
        super().__init__(folder)
        self.folder = folder
        try:
            manifest = self._begin_session(fresh)
        except BaseException:
            self.close()
            raise
        self._num_runs = {cell.name: int(manifest["num_runs"]) for cell in campaign.cells}
        self._sessions: list[dict[str, Any]] = manifest["sessions"]

    @classmethod
    def open(cls, folder: Path | str, campaign: Campaign) -> Store:
        """Make the folder, or go on with it.

        A campaign may be gone on with under a larger number of runs; a smaller number leaves the larger in place.

        Raises `InputError`, and changes nothing, for a folder that holds something else or another campaign, one that
        another process is writing, a file in it that is damaged, and a place that cannot be written.
        """
        target = Path(folder)
        fresh = new_manifest(campaign)
        make_folder(target)
        if (target / MANIFEST).exists():  # before the lock, which is a file of its own
            check_same(target, read_manifest(target), fresh)
        return cls(target, campaign, fresh)

    @property
    def session(self) -> int:
        """Number of times, this one included, that the campaign was worked on."""
        return len(self._sessions)

    @property
    def version_changes(self) -> tuple[str, ...]:
        """What has another version now than in an earlier session; runs of other versions may differ in their bytes."""
        now = self._sessions[-1]["versions"]
        changes = (
            f"{package} was {earlier['versions'].get(package, 'absent')} in session {number} and is {version} now"
            for package, version in now.items()
            for number, earlier in enumerate(self._sessions[:-1], start=1)
            if earlier["versions"].get(package) != version
        )
        return tuple(changes)

    def add(self, *runs: Row) -> None:
        """Keep finished runs (`vedette.campaigns.codec`), packed, with their measures if there are any yet.

        When this returns, the runs are on the disk.

        Raises `InputError` for a run that is not the campaign's or is there already, and for a disk that is full or
        fails: then none of these is kept, the earlier ones are, and adding may be tried again.
        """
        for row in runs:
            if row.cell not in self._num_runs:
                raise InputError(f"cell: expected one of {', '.join(self._num_runs)}; got {row.cell!r}")
            if not 0 <= row.run < self._num_runs[row.cell]:
                raise InputError(f"run: expected a number from 0 to {self._num_runs[row.cell] - 1}; got {row.run}")
        self.put(runs, self.session)

    def unmeasured(self, own: Mapping[str, Collection[str]]) -> tuple[tuple[str, int], ...]:
        """Cell name and number of every finished run that lacks measures: this version's, or its cell's `own`."""
        return tuple((cell, run) for cell, run, kept in self.metrics() if not has_metrics(kept, own.get(cell, ())))

    def note_failure(self, cell: str, run: int, message: str) -> None:
        """Keep why a run could not be finished, until it is."""
        self.put_failure(Failure(cell, int(run), self.session, message))

    def _begin_session(self, fresh: dict[str, Any]) -> dict[str, Any]:
        """Write a new session into the folder's manifest, and open its runs; returns the manifest."""
        started = (self.folder / MANIFEST).exists()
        manifest = read_manifest(self.folder) if started else fresh
        check_same(self.folder, manifest, fresh)
        num_runs = max(manifest["num_runs"], fresh["num_runs"])
        manifest = {**manifest, "num_runs": num_runs, "sessions": [*manifest["sessions"], new_session()]}
        contents = contents_checksum(manifest)
        if started:
            self.open_runs(contents)  # first, so that damaged runs leave the manifest as it is
            write_manifest(self.folder, manifest)
        else:
            write_manifest(self.folder, manifest)
            self.open_runs(contents)
        return manifest

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_folder(folder: Path) -> None:
    """Make a results folder, or leave one as it is. Raises `InputError` where something else is there, or no place."""
    try:
        _check_place(folder)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: expected a place for a results folder; {error}") from error


def _check_place(folder: Path) -> None:
    """`InputError` unless the folder is new, empty but for what a killed start leaves, or has a manifest."""
    if not folder.exists() or (folder / MANIFEST).exists():
        return
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for results; got a file")
    names = {path.name for path in folder.iterdir() if not path.name.startswith(f".{MANIFEST}.")} - {LOCK}
    if DATABASE in names:
        raise InputError(f"{folder}: expected {MANIFEST} beside {DATABASE}; it is missing, nothing was changed")
    if names:
        raise InputError(f"{folder}: expected a new or empty folder, or one of results; it holds something else")
