"""Merges the results folders of the shards of one campaign."""

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
    check_same_campaign,
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
    """Result of merging the shards of a campaign.

    Attributes:
        results: results of the merged folder.
        num_added: runs that this call added.
        count: number of shards of the campaign, or 1 if it was not split.
        missing: numbers of the shards with runs that no folder holds, increasing.
        num_missing: number of these runs.
        shards: folder that contains the folders of the shards.
    """

    results: CampaignResults
    num_added: int
    count: int
    missing: tuple[int, ...]
    num_missing: int
    shards: Path


def merge(folders: Sequence[Path | str], out: Path | str | None = None, *, tables: bool = True) -> MergeResult:
    """Merge results folders of shards. The runs equal those of a single process, byte for byte.

    Runs that several folders hold are taken once. Folders of unfinished shards are accepted: the same call later adds
    the runs done since.

    Args:
        folders: folders of shards, or folders that contain such folders. Whole results folders of the campaign are
            accepted too.
        out: folder for the results, new, empty, or of the same campaign. None: named after the campaign.
        tables: also write the tables for other tools, if no run is missing.

    Raises:
        InputError: no results folder among these; one of another campaign, of other versions, or damaged; a run that
            two folders have with different bytes. `out` is then unchanged.
    """
    places = _places(folders)
    manifest, shares = _read(places)
    target = Path(results_folder(manifest["name"]) if out is None else out)
    if any(target.resolve() == place.resolve() for place in places):
        raise InputError(f"{target}: expected a folder for the results beside those that are merged; it is one of them")
    num_added = _fill(target, manifest, shares)
    results = open_results(target)
    count = max(share.shard.count for share in shares)
    lacking = _lacking(results, count)
    if tables and not lacking.any():
        export_tables(results, target / TABLES)
    missing = tuple(np.flatnonzero(lacking).tolist())
    return MergeResult(results, num_added, count, missing, int(lacking.sum()), places[0].parent)


def _lacking(results: CampaignResults, count: int) -> Ints:
    """(count + 1,) number of missing runs of each shard, by columns, as there may be a million runs."""
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
    """Return the results folders among these folders, or inside them, each once."""
    by_path: dict[Path, Path] = {}
    for folder in map(Path, folders):
        inside = sorted(folder.glob(f"*/{MANIFEST}")) if folder.is_dir() else []
        places = [folder] if (folder / MANIFEST).exists() else [each.parent for each in inside]
        if not places:
            raise InputError(f"{folder}: expected the results folder of a shard, or a folder that such are in")
        by_path |= {place.resolve(): place for place in places}
    return list(by_path.values())


@dataclass(frozen=True, slots=True)
class _Share:
    """Parts of a shard's manifest. The manifests of a thousand folders may not fit in memory."""

    folder: Path
    shard: Shard
    sessions: tuple[dict[str, Any], ...]
    contents: str


def _read(places: Sequence[Path]) -> tuple[dict[str, Any], list[_Share]]:
    """Return the merged manifest. Raises `InputError`, naming the folder, for one of another campaign."""
    merged: dict[str, Any] = {}
    shares: list[_Share] = []
    for place in places:
        manifest = {"shard": None, **read_manifest(place)}
        shard = parse_shard(manifest.pop("shard") or "1/1")
        shares.append(_Share(place, shard, tuple(manifest["sessions"]), contents_checksum(manifest)))
        try:
            merged = _joined(place, manifest, merged) if merged else manifest
        except InputError as error:
            raise InputError(f"{error} (here: {places[0]} and those that agree with it)") from error
    return merged, shares


def _joined(place: Path, manifest: dict[str, Any], merged: dict[str, Any]) -> dict[str, Any]:
    """Return the merged manifest extended by the runs and sessions of the manifest in that place."""
    check_same_campaign(place, manifest, merged)
    versions = next((session["versions"] for session in merged["sessions"]), None)
    for session in manifest["sessions"]:
        for name, version in (versions or session["versions"]).items():
            if (other := session["versions"].get(name, "absent")) != version:
                raise InputError(
                    f"{place}: expected runs of the same versions as the folders before it, as others may differ in "
                    f"their last digits; {name} is {other} there and {version} here"
                )
    new = [session for session in manifest["sessions"] if session not in merged["sessions"]]
    num_runs = max(merged["num_runs"], manifest["num_runs"])
    created = min(merged["created"], manifest["created"])
    return {**merged, "num_runs": num_runs, "created": created, "sessions": merged["sessions"] + new}


def _fill(target: Path, merged: dict[str, Any], shares: Sequence[_Share]) -> int:
    """Copy the runs into the target, and return how many are new."""
    make_folder(target)
    started = (target / MANIFEST).exists()
    writer = Writer(target)
    try:
        if started:  # the existing sessions come first, as the runs refer to them by position
            merged = _joined(target, merged, read_manifest(target))
            writer.open_runs(contents_checksum(merged))
        write_manifest(target, merged)
        if not started:
            writer.open_runs(contents_checksum(merged))
        num_added = writer.copy_missing(
            (_reader(share), _session(share, merged)) for share in shares if _has_begun(share)
        )
    except BaseException:
        writer.close()
        if not started:
            for name in (MANIFEST, DATABASE, LOCK):
                (target / name).unlink(missing_ok=True)
            with suppress(OSError):  # the folder holds other files
                target.rmdir()
        raise
    writer.close()
    return num_added


def _has_begun(share: _Share) -> bool:
    """Return False if the shard was killed between writing its manifest and its runs."""
    database = share.folder / DATABASE
    return database.exists() and database.stat().st_size > 0


def _reader(share: _Share) -> Reader:
    reader = Reader(share.folder)
    reader.check(share.contents)
    return reader


def _session(share: _Share, merged: dict[str, Any]) -> Callable[[int], int]:
    """Return a function from the session numbers of a shard to those of the merged manifest."""
    numbers: list[int] = [merged["sessions"].index(session) + 1 for session in share.sessions]

    def number(session: int) -> int:
        if not 1 <= session <= len(numbers):
            raise InputError(f"{share.folder}: expected one of the manifest's {len(numbers)} sessions; got {session}")
        return numbers[session - 1]

    return number
