"""What a results folder says of itself: the campaign as data, and the sessions that worked on it."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vedette.campaigns.cells import Campaign, Cell, scenario_text
from vedette.errors import InputError
from vedette.files import write_whole
from vedette.scenarios import Scenario
from vedette.scenarios.schema import ScenarioModel
from vedette.scenarios.yaml_reader import read_yaml
from vedette.simulation.storage import versions

MANIFEST = "manifest.json"
FORMAT = "vedette-campaign"
FORMAT_VERSION = 2
# What of the manifest can never change. The number of runs is not part of it: a campaign may be made longer.
_FIXED = ("name", "seed", "axes", "compare", "spec", "cells", "digest")


def new_manifest(campaign: Campaign) -> dict[str, Any]:
    """The manifest of a campaign that nobody has worked on yet, as plain data of JSON."""
    manifest = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "name": campaign.name,
        "seed": campaign.seed,
        "num_runs": campaign.num_runs,
        "compare": campaign.compare,
        "axes": campaign.axes,
        "spec": {field: value for field, value in campaign.spec.items() if field != "runs"},
        "digest": campaign.digest(),
        "cells": [
            {
                "name": cell.name,
                "planner": cell.planner,
                "settings": cell.settings,
                "scenario": scenario_text(cell.scenario),
            }
            for cell in campaign.cells
        ],
        "created": _now(),
        "sessions": [],
    }
    plain: dict[str, Any] = json.loads(json.dumps(manifest))
    return plain


def new_session() -> dict[str, Any]:
    """When, with which versions and on what machine the campaign is worked on; no names of hosts or users."""
    machine = {"platform": platform.platform(), "architecture": platform.machine(), "processors": os.cpu_count()}
    return {"started": _now(), "versions": versions("llvmlite"), "machine": machine}


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a results folder. Raises `InputError`, naming the file, where there is none that can be used."""
    path = folder / MANIFEST
    try:
        manifest = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: expected the manifest of a campaign; {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: expected the manifest of a campaign; it is cut short or altered: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{path}: expected the manifest of a campaign; got another file")
    if manifest.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{path}: expected format version {FORMAT_VERSION}; got {manifest.get('format_version')}, "
            "written by another version of this program"
        )
    missing = [field for field in (*_FIXED, "num_runs", "sessions") if field not in manifest]
    if missing:
        raise InputError(f"{path}: expected a field {missing[0]}; it is cut short or altered")
    return manifest


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Put the manifest in place, whole or not at all. Raises `InputError` where it cannot be written."""
    content = json.dumps(manifest, indent=1).encode() + b"\n"
    try:
        write_whole(folder / MANIFEST, lambda file: file.write(content))
    except OSError as error:
        raise InputError(f"{folder / MANIFEST}: expected a file that can be written; {error}") from error


def contents_checksum(manifest: Mapping[str, Any]) -> str:
    """SHA-256 of what can never change in a manifest."""
    fixed = {field: manifest[field] for field in _FIXED}
    return hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()


def check_same(folder: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    """`InputError`, naming the first field that differs, unless both manifests are of the same campaign."""
    for field in _FIXED:
        difference = _difference(field, there[field], here[field])
        if difference and field == "digest":
            difference = "the files that its scenarios name have other contents now"
        if difference:
            raise InputError(
                f"{folder}: expected a folder of this campaign; it is of another, and is kept as it is: {difference}"
            )


def campaign_of(folder: Path, manifest: Mapping[str, Any]) -> Campaign:
    """The campaign back from its manifest. The files that its scenarios name need not be there."""
    try:
        return Campaign(
            name=manifest["name"],
            seed=manifest["seed"],
            num_runs=manifest["num_runs"],
            cells=tuple(_cell(entry) for entry in manifest["cells"]),
            axes={axis: tuple(values) for axis, values in manifest["axes"].items()},
            compare=manifest["compare"],
            spec={**manifest["spec"], "runs": manifest["num_runs"]},
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{folder / MANIFEST}: expected a campaign; it is cut short or altered: {error}") from error


def _cell(entry: Mapping[str, Any]) -> Cell:
    model = ScenarioModel.model_validate(read_yaml(entry["scenario"], "scenario").data)
    return Cell(entry["name"], entry["settings"], Scenario(model), entry["planner"])


def _difference(place: str, there: Any, here: Any) -> str:
    """Where two pieces of plain data first differ, in words; empty where they do not."""
    if isinstance(there, dict) and isinstance(here, dict):
        parts = [(f"{place}.{key}", there.get(key), here.get(key)) for key in (*there, *(here.keys() - there.keys()))]
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        parts = [(f"{place}[{index}]", *pair) for index, pair in enumerate(zip(there, here, strict=True))]
    elif isinstance(there, str) and isinstance(here, str) and "\n" in there:
        lines = zip(there.splitlines(), here.splitlines(), strict=False)
        parts = [(f"{place}, line {number}", *pair) for number, pair in enumerate(lines, start=1)]
    else:
        return "" if there == here else f"{place} is {there!r} there and {here!r} here"
    return next(filter(None, (_difference(*part) for part in parts)), "")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
