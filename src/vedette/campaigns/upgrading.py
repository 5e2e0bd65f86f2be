"""Upgrade of results folders of earlier formats, in place."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import reduce
from pathlib import Path
from typing import Any

from vedette.campaigns import codec, journal
from vedette.campaigns.cells import contents_of, digest_of
from vedette.campaigns.manifest import campaign_of, contents_checksum, read_manifest, write_manifest
from vedette.campaigns.renamed import present_field, with_present_names
from vedette.campaigns.spec import spec_from_data
from vedette.errors import InputError
from vedette.scenarios.dumping import dump_data
from vedette.scenarios.renamed import STRATEGIES, changed, changes
from vedette.scenarios.yaml_reader import read_yaml
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
        return upgrade_run(folder, STRATEGIES, _upgraded_scenario)
    manifest = read_manifest(folder, check_upgradable)
    number: int = manifest["format_version"]
    if number == FORMAT_VERSION:
        return number
    upgraded = {**_upgraded_manifest(folder, manifest), "format_version": FORMAT_VERSION, "upgraded_from": number}
    writer = journal.Writer(folder)
    try:
        contents = contents_checksum(upgraded)
        writer.open_runs(contents_checksum(manifest), contents)
        writer.rewrite(lambda entry: codec.upgraded(entry.payload, number, STRATEGIES), contents)
        write_manifest(folder, upgraded)
    finally:
        writer.close()
    return number


def _upgraded_scenario(text: str) -> str:
    """Return the text of a stored scenario with present names; unchanged if it has no other."""
    data = read_yaml(text, "scenario").data
    scenario_changes = list(changes(data))
    return dump_data(reduce(changed, scenario_changes, data)) if scenario_changes else text


def _upgraded_manifest(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return the manifest with present names; names of cells, which identify runs, stay."""
    spec = with_present_names(manifest["spec"])
    specification = spec_from_data({**spec, "runs": manifest["num_runs"]}, "spec")
    cells = [
        {**cell, "planner": settings["planner"], "settings": settings, "scenario": _upgraded_scenario(cell["scenario"])}
        for cell, settings in zip(manifest["cells"], specification.settings(), strict=True)
    ]
    compare = present_field(manifest["compare"])
    plain = json.loads(json.dumps({"spec": spec, "axes": specification.axes(), "compare": compare, "cells": cells}))
    upgraded = {**manifest, **plain}
    return {**upgraded, "digest": _upgraded_digest(folder, manifest, upgraded)}


def _upgraded_digest(folder: Path, before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """Return the digest with present names; unchanged if the files that it covers are missing or have changed."""
    digest: str = before["digest"]
    try:
        contents = [contents_of(cell.scenario) for cell in campaign_of(folder, after).cells]
    except OSError:
        return digest
    digests = [
        digest_of(
            manifest["seed"],
            [
                (cell["name"], cell["planner"], cell["scenario"], settings)
                for cell, settings in zip(manifest["cells"], contents, strict=True)
            ],
        )
        for manifest in (before, after)
    ]
    return digests[1] if digests[0] == digest else digest
