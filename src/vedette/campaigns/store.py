"""Store of a campaign: its results folder, opened for writing.

The folder contains `manifest.json` (the campaign as data, and its sessions with times and versions) and
`campaign.sqlite` (the finished runs). Read it with `vedette.campaigns.results.open_results`.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from vedette.campaigns.cells import Campaign
from vedette.campaigns.database import DATABASE, LOCK
from vedette.campaigns.journal import Writer
from vedette.campaigns.manifest import (
    MANIFEST,
    check_same_campaign,
    contents_checksum,
    new_manifest,
    new_session,
    read_manifest,
    write_manifest,
)
from vedette.campaigns.rows import Row
from vedette.errors import InputError
from vedette.evaluation.metrics.serialization import has_metrics


class Store(Writer):
    """The only writer of a results folder, a context manager. Calls may come from any thread, one at a time."""

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
    def open(cls, folder: Path | str, campaign: Campaign) -> "Store":
        """Create the folder, or continue with it.

        A campaign may continue with a larger number of runs. A smaller number does not reduce it.

        Raises `InputError`, and changes nothing, for a folder that holds something else or another campaign, a folder
        that another process is writing, a damaged file in it, and a place that cannot be written.
        """
        target = Path(folder)
        fresh = new_manifest(campaign)
        make_folder(target)
        if (target / MANIFEST).exists():  # before locking, which creates a file
            check_same_campaign(target, read_manifest(target), fresh)
        return cls(target, campaign, fresh)

    @property
    def session(self) -> int:
        """Number of sessions of work on the campaign, including this one."""
        return len(self._sessions)

    @property
    def version_changes(self) -> tuple[str, ...]:
        """Packages with another version than in an earlier session, in words.

        Runs of other versions may differ in their bytes.
        """
        now = self._sessions[-1]["versions"]
        changes = (
            f"{package} was {earlier['versions'].get(package, 'absent')} in session {number} and is {version} now"
            for package, version in now.items()
            for number, earlier in enumerate(self._sessions[:-1], start=1)
            if earlier["versions"].get(package) != version
        )
        return tuple(changes)

    def add(self, *runs: Row) -> None:
        """Store finished runs (`vedette.campaigns.codec`), packed, with their metrics if they exist.

        When this returns, the runs are on disk.

        Raises `InputError` for a run that is not in the campaign or is stored already, and if the disk is full or
        fails: then none of these runs is stored, earlier ones are kept, and the call may be repeated.
        """
        for row in runs:
            if row.cell not in self._num_runs:
                raise InputError(f"cell: expected one of {', '.join(self._num_runs)}; got {row.cell!r}")
            if not 0 <= row.run < self._num_runs[row.cell]:
                raise InputError(f"run: expected a number from 0 to {self._num_runs[row.cell] - 1}; got {row.run}")
        self.put(runs, self.session)

    def unmeasured(self, names: Mapping[str, Collection[str]]) -> tuple[tuple[str, int], ...]:
        """Return cell and number of finished runs that lack metrics of this version, or those of `names` by cell."""
        return tuple((cell, run) for cell, run, kept in self.metrics() if not has_metrics(kept, names.get(cell, ())))

    def note_failure(self, cell: str, run: int, message: str) -> None:
        """Store why a run could not be finished, replacing an earlier reason, until it is finished."""
        statement = "INSERT OR REPLACE INTO failures (session, message, cell, run) VALUES (?, ?, ?, ?)"
        self._change(cell, int(run), statement, self.session, message)

    def _begin_session(self, fresh: dict[str, Any]) -> dict[str, Any]:
        """Add a session to the folder's manifest, open its runs, and return the manifest."""
        started = (self.folder / MANIFEST).exists()
        manifest = read_manifest(self.folder) if started else fresh
        check_same_campaign(self.folder, manifest, fresh)
        num_runs = max(manifest["num_runs"], fresh["num_runs"])
        manifest = {**manifest, "num_runs": num_runs, "sessions": [*manifest["sessions"], new_session()]}
        contents = contents_checksum(manifest)
        if started:
            self.open_runs(contents)  # first, so that damaged runs leave the manifest unchanged
            write_manifest(self.folder, manifest)
        else:
            write_manifest(self.folder, manifest)
            self.open_runs(contents)
        return manifest

    def __enter__(self) -> "Store":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_folder(folder: Path) -> None:
    """Create a results folder if it does not exist.

    Raises `InputError` if something else is there, or it cannot be made.
    """
    try:
        _check_place(folder)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: expected a place for a results folder; {error}") from error


def _check_place(folder: Path) -> None:
    """Raise `InputError` unless the folder is new, empty except for leftovers of a killed start, or has a manifest."""
    if not folder.exists() or (folder / MANIFEST).exists():
        return
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for results; got a file")
    names = {path.name for path in folder.iterdir() if not path.name.startswith(f".{MANIFEST}.")}
    names -= {LOCK, f"{LOCK}-journal"}
    if DATABASE in names:
        raise InputError(f"{folder}: expected {MANIFEST} beside {DATABASE}; it is missing, nothing was changed")
    if names:
        raise InputError(f"{folder}: expected a new or empty folder, or one of results; it holds something else")
