"""Upgrade of runs of earlier formats: missing columns are filled with the values that applied to them."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.internal.files import sync_folder, write_whole
from vedette.simulation.arrow import Columns, Layout, read_table, write_table
from vedette.simulation.serialization import ENDING, FORMAT_VERSION, LACKING, decode_run, encode_run
from vedette.simulation.storage import MANIFEST, TIMINGS, check_upgradable, read_files, read_manifest
from vedette.simulation.tables import LAYOUTS

_STAGED, _PARTIAL = ".upgraded", ".upgraded.part"


def upgraded_files(files: Mapping[str, bytes], number: int) -> dict[str, bytes]:
    """Return the files of a run of format `number` with the columns of the present format.

    Raises `InputError`, naming the file, for a damaged one.
    """
    lacking: dict[str, dict[str, float]] = {}
    for earlier in range(number, FORMAT_VERSION):
        for table, columns in LACKING[earlier].items():
            lacking.setdefault(table, {}).update(columns)
    changed = {
        f"{table}{ENDING}": _filled(files[f"{table}{ENDING}"], table, columns)
        for table, columns in lacking.items()
        if f"{table}{ENDING}" in files
    }
    return {**files, **changed}


def _filled(content: bytes, table: str, lacking: Mapping[str, float]) -> bytes:
    """Return a table with its missing columns; unchanged if it has them already, as after an interruption."""
    layout = LAYOUTS[table]
    fixed = {name: kind for name, kind in layout.fixed.items() if name not in lacking}
    previous = Layout(fixed, {**layout.more, **{name: layout.fixed[name] for name in lacking}})
    columns = read_table(content, previous, f"{table}{ENDING}")
    length = len(next(iter(columns.values())))
    filled: Columns = {name: np.full(length, value) for name, value in lacking.items() if name not in columns}
    return write_table({**columns, **filled}, layout)


def upgrade_run(directory: Path | str) -> int:
    """Upgrade the folder of a saved run to the present format, in place; return its previous format.

    New files are written next to the old ones and then moved over them, the manifest last. A killed upgrade loses
    nothing, and the same call completes it. Other files of the folder stay unchanged.

    Raises `InputError`, and changes nothing, for a folder that holds no run, a format that is newer or cannot be
    upgraded, a damaged file, and a folder that cannot be written.
    """
    folder = Path(directory)
    manifest = read_manifest(folder, check_upgradable)
    number: int = manifest["format_version"]
    if number == FORMAT_VERSION:
        return number
    try:
        if not (folder / _STAGED).is_dir():
            _stage(folder, _upgraded(folder, manifest, number))
        for path in sorted((folder / _STAGED).iterdir(), key=lambda each: each.name == MANIFEST):
            path.replace(folder / path.name)
        sync_folder(folder)
        (folder / _STAGED).rmdir()
    except OSError as error:
        raise InputError(f"{folder}: expected a folder that can be written; {error}") from error
    return number


def _upgraded(folder: Path, manifest: Mapping[str, Any], number: int) -> dict[str, bytes]:
    """Return the files that change, including the manifest."""
    before = read_files(folder, manifest)
    after = upgraded_files(before, number)
    record = decode_run(manifest["run"], after, str(folder), after.get(TIMINGS))
    after |= encode_run(record)
    changed = {name: content for name, content in after.items() if before.get(name) != content}
    checksums = {name: hashlib.sha256(content).hexdigest() for name, content in after.items()}
    fresh = {**manifest, "format_version": FORMAT_VERSION, "files": checksums, "upgraded_from": number}
    return {**changed, MANIFEST: json.dumps(fresh, indent=2, sort_keys=True).encode() + b"\n"}


def _stage(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a staging folder, which gets its final name only when it is complete."""
    partial = folder / _PARTIAL
    if partial.exists():
        shutil.rmtree(partial)
    partial.mkdir()
    for name, content in files.items():
        write_whole(partial / name, lambda file, content=content: file.write(content))  # type: ignore[misc]
    os.replace(partial, folder / _STAGED)
    sync_folder(folder)
