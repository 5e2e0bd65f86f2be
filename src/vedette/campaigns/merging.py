"""Results folders of the shares of one campaign, made one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vedette.campaigns.cells import results_folder
from vedette.campaigns.database import DATABASE, LOCK, Reader
from vedette.campaigns.export import export_tables
from vedette.campaigns.journal import Writer
from vedette.campaigns.manifest import (
    MANIFEST,
    check_same,
    contents_checksum,
    read_manifest,
    write_manifest,
)
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.running import TABLES
from vedette.campaigns.shards import Shard, owner, parse_shard
from vedette.campaigns.store import make_folder
from vedette.errors import InputError
from vedette.kernels.base.types import Ints


@dataclass(frozen=True, slots=True)
class MergeResult:
    """What became of the shares of a campaign.

    Attributes:
        results: of the one folder.
        num_taken: runs that this call added.
        count: of shares that the campaign was cut into; 1 where it was not.
        missing: numbers of the shares that have runs which no folder holds, increasing.
        num_missing: number of these runs.
        shards: where the folders of the shares are.
    """

    results: CampaignResults
    num_taken: int
    count: int
    missing: tuple[int, ...]
    num_missing: int
    shards: Path


def merge(folders: Sequence[Path | str], out: Path | str | None = None, *, tables: bool = True) -> MergeResult:
    """Make one results folder of those of shares; its runs are those that a single process leaves, byte for byte.

    What several folders hold is taken once. Folders of shares that are unfinished are taken as they are: the same call
    adds what has been done since.

    Args:
        folders: of shares, or folders that such folders are in. Whole results folders of the campaign do, too.
        out: for the results; new, empty, or of the same campaign. None: named after the campaign.
        tables: write the tables for other tools, too, where no run is missing.

    Raises:
        InputError: no folder of results among these; one of another campaign, of other versions, or damaged; a run
            that two folders have with different bytes. `out` is then left as it was.
    """
    places = _places(folders)
    whole, shares = _read(places)
    target = Path(results_folder(whole["name"]) if out is None else out)
    if any(target.resolve() == place.resolve() for place in places):
        raise InputError(f"{target}: expected a folder for the results beside those that are merged; it is one of them")
    num_taken = _fill(target, whole, shares)
    results = open_results(target)
    count = max(share.shard.count for share in shares)
    lacking = _lacking(results, count)
    if tables and not lacking.any():
        export_tables(results, target / TABLES)
    missing = tuple(np.flatnonzero(lacking).tolist())
    return MergeResult(results, num_taken, count, missing, int(lacking.sum()), places[0].parent)


def _lacking(results: CampaignResults, count: int) -> Ints:
    """(count + 1,) runs of each share that are not there; of a million runs, so by columns and not one by one."""
    campaign, done = results.campaign, defaultdict[str, list[int]](list)
    for name, run in Reader(results.folder).finished():
        done[name].append(run)
    lacking = np.zeros(count + 1, np.int64)
    runs = np.arange(campaign.num_runs)
    for place, cell in enumerate(campaign.cells):
        left = runs[np.isin(runs, done[cell.name], assume_unique=True, invert=True)]
        lacking += np.bincount(owner(left, place, len(campaign.cells), count), minlength=count + 1)
    return lacking


def _places(folders: Sequence[Path | str]) -> list[Path]:
    """The results folders among these, or in them, each once."""
    found: dict[Path, Path] = {}
    for folder in map(Path, folders):
        inside = sorted(folder.glob(f"*/{MANIFEST}")) if folder.is_dir() else []
        places = [folder] if (folder / MANIFEST).exists() else [each.parent for each in inside]
        if not places:
            raise InputError(f"{folder}: expected the results folder of a shard, or a folder that such are in")
        found |= {place.resolve(): place for place in places}
    return list(found.values())


@dataclass(frozen=True, slots=True)
class _Share:
    """What is kept of a folder's manifest: of a thousand folders they may be too many to hold."""

    folder: Path
    shard: Shard
    sessions: tuple[dict[str, Any], ...]
    contents: str


def _read(places: Sequence[Path]) -> tuple[dict[str, Any], list[_Share]]:
    """The manifest of all together; `InputError`, naming the folder, for one that is not of the same campaign."""
    whole: dict[str, Any] = {}
    shares: list[_Share] = []
    for place in places:
        manifest = {"shard": None, **read_manifest(place)}
        shard = parse_shard(manifest.pop("shard") or "1/1")
        shares.append(_Share(place, shard, tuple(manifest["sessions"]), contents_checksum(manifest)))
        try:
            whole = _joined(place, manifest, whole) if whole else manifest
        except InputError as error:
            raise InputError(f"{error} (here: {places[0]} and those that agree with it)") from error
    return whole, shares


def _joined(place: Path, manifest: dict[str, Any], whole: dict[str, Any]) -> dict[str, Any]:
    """The whole with what the manifest in that place adds: runs, and sessions."""
    check_same(place, manifest, whole)
    wanted = next((session["versions"] for session in whole["sessions"]), None)
    for session in manifest["sessions"]:
        for name, version in (wanted or session["versions"]).items():
            if (there := session["versions"].get(name, "absent")) != version:
                raise InputError(
                    f"{place}: expected runs of the same versions as the folders before it, as others may differ in "
                    f"their last digits; {name} is {there} there and {version} here"
                )
    new = [session for session in manifest["sessions"] if session not in whole["sessions"]]
    num_runs = max(whole["num_runs"], manifest["num_runs"])
    created = min(whole["created"], manifest["created"])
    return {**whole, "num_runs": num_runs, "created": created, "sessions": whole["sessions"] + new}


def _fill(target: Path, whole: dict[str, Any], shares: Sequence[_Share]) -> int:
    """Take the runs in; returns how many are new."""
    make_folder(target)
    started = (target / MANIFEST).exists()
    writer = Writer(target)
    try:
        if started:  # what is there comes first, as its runs name its sessions by their places
            whole = _joined(target, whole, read_manifest(target))
            writer.open_runs(contents_checksum(whole))
        write_manifest(target, whole)
        if not started:
            writer.open_runs(contents_checksum(whole))
        num_taken = writer.take_in((_reader(share), _session(share, whole)) for share in shares if _has_begun(share))
    except BaseException:
        writer.close()
        if not started:
            for name in (MANIFEST, DATABASE, LOCK):
                (target / name).unlink(missing_ok=True)
            with suppress(OSError):  # somebody else's files
                target.rmdir()
        raise
    writer.close()
    return num_taken


def _has_begun(share: _Share) -> bool:
    """Whether it was not killed between its manifest and its runs."""
    database = share.folder / DATABASE
    return database.exists() and database.stat().st_size > 0


def _reader(share: _Share) -> Reader:
    reader = Reader(share.folder)
    reader.check(share.contents)
    return reader


def _session(share: _Share, whole: dict[str, Any]) -> Callable[[int], int]:
    """Number in the whole of a session of the share."""
    numbers: list[int] = [whole["sessions"].index(session) + 1 for session in share.sessions]

    def number(session: int) -> int:
        if not 1 <= session <= len(numbers):
            raise InputError(f"{share.folder}: expected one of the manifest's {len(numbers)} sessions; got {session}")
        return numbers[session - 1]

    return number
