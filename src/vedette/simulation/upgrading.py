"""Upgrade of runs of earlier formats: columns get their present names, and missing ones the values that applied."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.internal.files import sync_folder, write_whole
from vedette.simulation.arrow import Layout, read_table, write_table
from vedette.simulation.serialization import (
    ENDING,
    FORMAT_VERSION,
    FORMER_COLUMNS,
    LACKING,
    decode_run,
    encode_run,
)
from vedette.simulation.storage import MANIFEST, SCENARIO, TIMINGS, check_upgradable, read_files, read_manifest
from vedette.simulation.tables import LAYOUTS, OPTIONAL

_STAGED, _PARTIAL = ".upgraded", ".upgraded.part"
_LAYOUTS = {**LAYOUTS, **OPTIONAL}


def upgraded_files(files: Mapping[str, bytes], number: int, strategies: Mapping[str, str]) -> dict[str, bytes]:
    """Return the files of a run of format `number` with the columns of the present format.

    strategies: present names of strategies by former ones. Raises `InputError`, naming the file, for a damaged one.
    """
    lacking: dict[str, dict[str, float]] = {}
    for earlier in range(number, FORMAT_VERSION):
        for table, columns in LACKING[earlier].items():
            lacking.setdefault(table, {}).update(columns)
    return {
        name: _upgraded_table(content, name.removesuffix(ENDING), lacking, strategies)
        if name.removesuffix(ENDING) in _LAYOUTS
        else content
        for name, content in files.items()
    }


def _upgraded_table(
    content: bytes, table: str, all_lacking: Mapping[str, Mapping[str, float]], strategies: Mapping[str, str]
) -> bytes:
    """Return a table with present names and its missing columns; a table that has them already is unchanged."""
    layout, lacking, former = _LAYOUTS[table], all_lacking.get(table, {}), FORMER_COLUMNS.get(table, {})
    changed = {*lacking, *former}
    fixed = {name: kind for name, kind in layout.fixed.items() if name not in changed}
    either = {each: layout.fixed[name] for name in changed for each in (name, former.get(name, name))}
    columns = read_table(content, Layout(fixed, {**either, **layout.more}), f"{table}{ENDING}")
    present = {old: new for new, old in former.items()}
    columns = {present.get(name, name): column for name, column in columns.items()}
    length = len(next(iter(columns.values())))
    columns |= {name: np.full(length, value) for name, value in lacking.items() if name not in columns}
    if table == "decisions":
        columns["planner"] = [strategies.get(name, name) for name in columns["planner"]]
    if table == "explanations":
        columns["missing"] = [re.sub("(?m)^without: ", "reward_without_sensor: ", text) for text in columns["missing"]]
    return write_table(columns, layout)


def upgraded_facts(facts: Mapping[str, Any], strategies: Mapping[str, str]) -> dict[str, Any]:
    """Return the facts that identify a run, with the present name of its strategy."""
    planner = facts.get("planner")
    return {**facts, "planner": strategies.get(planner, planner)} if isinstance(planner, str) else dict(facts)


def upgrade_run(directory: Path | str, strategies: Mapping[str, str], scenario: Callable[[str], str]) -> int:
    """Upgrade the folder of a saved run to the present format, in place; return its previous format.

    Args:
        directory: the folder.
        strategies: present names of strategies by former ones.
        scenario: function that returns the text of a stored scenario with present names.

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
            _stage(folder, _upgraded(folder, manifest, number, strategies, scenario))
        for path in sorted((folder / _STAGED).iterdir(), key=lambda each: each.name == MANIFEST):
            path.replace(folder / path.name)
        sync_folder(folder)
        (folder / _STAGED).rmdir()
    except OSError as error:
        raise InputError(f"{folder}: expected a folder that can be written; {error}") from error
    return number


def _upgraded(
    folder: Path,
    manifest: Mapping[str, Any],
    number: int,
    strategies: Mapping[str, str],
    scenario: Callable[[str], str],
) -> dict[str, bytes]:
    """Return the files that change, including the manifest."""
    before = read_files(folder, manifest)
    after = upgraded_files(before, number, strategies)
    facts = upgraded_facts(manifest["run"], strategies)
    record = decode_run(facts, after, str(folder), after.get(TIMINGS))
    after |= encode_run(record)
    if SCENARIO in before:
        after[SCENARIO] = scenario(before[SCENARIO].decode()).encode()
    changed = {name: content for name, content in after.items() if before.get(name) != content}
    checksums = {name: hashlib.sha256(content).hexdigest() for name, content in after.items()}
    fresh = {**manifest, "run": facts, "format_version": FORMAT_VERSION, "files": checksums, "upgraded_from": number}
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
