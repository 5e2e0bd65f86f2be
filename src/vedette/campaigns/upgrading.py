"""Upgrade of results folders of earlier formats, in place."""

from __future__ import annotations

from pathlib import Path

from vedette.campaigns import codec, journal
from vedette.campaigns.manifest import contents_checksum, read_manifest, write_manifest
from vedette.errors import InputError
from vedette.simulation.serialization import FORMAT_VERSION
from vedette.simulation.storage import check_upgradable, holds_run
from vedette.simulation.upgrading import upgrade_run


def upgrade_results(directory: Path | str) -> int:
    """Upgrade a results folder, of a campaign or of a single run, to the present format; return its previous format.

    The runs of a campaign are rewritten in one transaction of their file, and the manifest after them. A killed upgrade
    loses nothing, and the same call completes it. A folder of the present format is left alone.

    Raises `InputError`, and changes nothing, for a folder that cannot be upgraded: no results, a format that was never
    released, a later version, damaged runs, or a campaign that is running.
    """
    folder = Path(directory)
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a results folder; got {'a file' if folder.exists() else 'nothing'}")
    if holds_run(folder):
        return upgrade_run(folder)
    manifest = read_manifest(folder, check_upgradable)
    number: int = manifest["format_version"]
    if number == FORMAT_VERSION:
        return number
    writer = journal.Writer(folder)
    try:
        writer.open_runs(contents_checksum(manifest))
        writer.rewrite(lambda entry: codec.upgraded(entry.payload, number))
        write_manifest(folder, {**manifest, "format_version": FORMAT_VERSION, "upgraded_from": number})
    finally:
        writer.close()
    return number
