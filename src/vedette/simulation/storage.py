"""Runs on disk, in open formats.

A run is a folder: `manifest.json` (the run, the versions, and a checksum of every other file), an Arrow file for each
table of `vedette.simulation.tables`, `timings.arrow` and, if given, `scenario.yaml`. If a run stopped early, the
manifest states it (`stopped`). A folder is written atomically.
"""

import contextlib
import hashlib
import itertools
import json
import platform
import shutil
import tempfile
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from vedette.errors import InputError
from vedette.internal.files import unwritable
from vedette.internal.reading import parse_json, read_file, unreadable
from vedette.internal.text import printable, shown
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import FORMAT_VERSION, decode_run, encode_run, encode_timings
from vedette.simulation.tables import run_facts

FORMAT = "vedette-run"
MANIFEST, TIMINGS = "manifest.json", "timings.arrow"
SCENARIO = "scenario.yaml"
UNFINISHED = ".unfinished"  # in a folder whose tracks or figures are not all written
_PACKAGES = ("vedette", "numpy", "scipy", "numba")


def save_run(
    record: RunRecord,
    directory: Path | str,
    *,
    scenario_text: str | None = None,
    fit: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    unfinished: bool = False,
) -> Path:
    """Write a run as a new folder.

    Args:
        record: the run.
        directory: the folder to make. Missing parents are made too.
        scenario_text: text of the scenario, stored with the results.
        fit: of the model to recorded scans (`vedette.evaluation.fit.Fit.to_dict`), kept in the manifest.
        overwrite: replace a folder that holds a run. A folder that holds anything else is never replaced.
        unfinished: mark the folder with a file `UNFINISHED`, to be deleted when its other files are written too. Until
            then it may be replaced without `overwrite`.

    Returns the folder. Raises `InputError` if it exists already, cannot be written, or the record contradicts itself.
    """
    target = Path(directory)
    check_target(target, overwrite)
    files = {**encode_run(record), TIMINGS: encode_timings(record)}
    if scenario_text is not None:
        files[SCENARIO] = scenario_text.encode()
    files[MANIFEST] = json.dumps(_manifest(record, files, fit), indent=2, sort_keys=True).encode() + b"\n"
    if unfinished:
        files[UNFINISHED] = b""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as scratch:
            fresh = Path(scratch) / "new"
            fresh.mkdir()
            for name, content in files.items():
                (fresh / name).write_bytes(content)
            _swap_in(fresh, target, Path(scratch) / "old")
    except OSError as error:
        raise InputError(f"directory: expected a place to write a run; got {target}: {error}") from error
    return target


def load_run(directory: Path | str) -> RunRecord:
    """Read a saved run, lossless.

    Raises `InputError`, naming the file, if the folder holds no run, one of another format, or one with a file that is
    missing, cut short or altered since it was written.
    """
    folder = Path(directory)
    manifest = read_manifest(folder)
    files = read_files(folder, manifest)
    if TIMINGS not in files:
        raise InputError(
            f"{folder / MANIFEST}: expected a file {TIMINGS}; it names {shown(', '.join(files)) or 'none'}"
        )
    return decode_run(manifest["run"], files, str(folder), files[TIMINGS])


def read_files(folder: Path, manifest: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the verified files of a saved run by name. Raises `InputError` as `load_run`."""
    files = {}
    for name, checksum in manifest["files"].items():
        if Path(name).name != name:
            raise InputError(f"{folder / MANIFEST}: expected plain file names; got {shown(name)}")
        content = _read(folder / name)
        if hashlib.sha256(content).hexdigest() != checksum:
            raise InputError(f"{folder / name}: expected the file as it was written; it is cut short or altered")
        files[name] = content
    return files


def check_version(manifest: Mapping[str, Any], session: Any, place: Path) -> None:
    """Raise `InputError` unless a saved run or a campaign has this format. The message says what to do with another."""
    number = manifest.get("format_version")
    if type(number) is int and number == FORMAT_VERSION:
        return
    writer = session.get("versions") if isinstance(session, dict) else None
    writer = writer.get("vedette") if isinstance(writer, dict) else None
    reader = "the version that wrote it"
    if isinstance(writer, str) and writer != versions()["vedette"]:
        reader = f"vedette {printable(writer)[:40]}"
    relation = "another" if type(number) is not int else "a later" if number > FORMAT_VERSION else "an earlier"
    raise InputError(
        f"{place}: expected format {FORMAT_VERSION}; got {shown(number)}, written by {relation} version of this "
        f"program: run it again, or read it with {reader}"
    )


def read_manifest(directory: Path | str) -> dict[str, Any]:
    """Return the manifest of a saved run: format, versions, run, checksums of its files.

    Raises `InputError` as `load_run`.
    """
    path = Path(directory) / MANIFEST
    try:
        manifest = parse_json(_read(path))
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: expected the manifest of a run; it is cut short or altered: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{path}: expected the manifest of a run; got another file")
    check_version(manifest, manifest, path)
    if not isinstance(manifest.get("files"), dict) or not isinstance(manifest.get("run"), dict):
        raise InputError(f"{path}: expected the fields files and run; it is cut short or altered")
    return manifest


def holds_run(directory: Path | str) -> bool:
    """Return True if the manifest of a folder is that of a saved run, of any format."""
    try:
        manifest = parse_json(read_file(Path(directory) / MANIFEST))
    except (OSError, ValueError):
        return False
    return isinstance(manifest, dict) and manifest.get("format") == FORMAT


def _manifest(record: RunRecord, files: Mapping[str, bytes], fit: Mapping[str, Any] | None) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "run": run_facts(record),
        "versions": versions(),
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
        **({} if fit is None else {"fit": fit}),
    }


def versions(*more: str) -> dict[str, str]:
    """Return the versions of Python, of the packages that results depend on, and of `more` packages."""
    return {"python": platform.python_version(), **{name: _version(name) for name in (*_PACKAGES, *more)}}


@cache  # called for every task of a campaign, and read from disk
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def _read(path: Path) -> bytes:
    try:
        return read_file(path)
    except OSError as error:
        raise unreadable(path, "a file of a saved run", error) from error
    except ValueError as error:
        raise InputError(f"{path}: expected a file of a saved run; {error}") from error


def check_target(target: Path, overwrite: bool) -> tuple[int, ...]:
    """Return the identity of the run that a folder holds, () if none. Raise `InputError` unless one may be saved there.

    The place must be new, empty, or a run that is unfinished or may be overwritten, and its parent folder must be
    writable.
    """
    reason = f"{target} is no folder" if target.exists() and not target.is_dir() else unwritable(target)
    if reason:
        raise InputError(f"directory: expected a folder that may be written to; got {target}: {reason}")
    if not target.exists() or (target.is_dir() and not any(target.iterdir())):
        return ()
    if not overwrite and not (target / UNFINISHED).exists():
        raise InputError(
            f"directory: expected a new folder; {target} exists (--overwrite or overwrite=True replaces it)"
        )
    if not holds_run(target):
        raise InputError(f"directory: expected a folder that holds a run; {target} holds something else and is kept")
    state = (target / MANIFEST).stat()
    return state.st_ino, state.st_mtime_ns


def unchanged_target(target: Path, overwrite: bool, identity: tuple[int, ...]) -> Path:
    """Return the folder if it is as it was when `check_target` returned `identity`, else a new one of a similar name.

    This keeps what another process has written there in the meantime.
    """
    with contextlib.suppress(InputError, OSError):
        if check_target(target, overwrite) == identity:
            return target
    similar = (target.with_name(f"{target.name}-{number}") for number in itertools.count(2))
    return next(folder for folder in similar if not folder.exists())


def _swap_in(fresh: Path, target: Path, old: Path) -> None:
    if not target.exists():
        fresh.rename(target)
        return
    target.rename(old)
    try:
        fresh.rename(target)
    except OSError:
        old.rename(target)
        raise
    shutil.rmtree(old)
