"""Manifest of a results folder: the campaign as data, and the sessions of work on it."""

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError

from vedette.campaigns.cells import Campaign, Cell, safe_name
from vedette.campaigns.shards import WHOLE, parse_shard
from vedette.campaigns.spec import CampaignSpec, spec_from_data
from vedette.errors import InputError
from vedette.internal.files import write_file
from vedette.internal.reading import error_summary, parse_json, read_file, unreadable
from vedette.internal.text import shown
from vedette.scenarios import Scenario
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.yaml_reader import read_yaml
from vedette.simulation.serialization import FORMAT_VERSION
from vedette.simulation.storage import check_version, versions

MANIFEST = "manifest.json"
FORMAT = "vedette-campaign"
_MOST_BYTES = 2**27  # of a manifest, five times that of 10,000 cells
# Fields that never change. The number of runs is not among them, as a campaign may be extended.
_FIXED = ("name", "seed", "axes", "compare", "spec", "cells", "digest")


class _Session(BaseModel):
    """Time, versions and machine of a session."""

    model_config = ConfigDict(strict=True)
    started: str
    versions: dict[str, str]
    machine: dict[str, str | int | None]


class _CellEntry(BaseModel):
    """One cell, with its scenario as YAML."""

    model_config = ConfigDict(strict=True)
    name: str
    planner: str
    settings: dict[str, JsonValue]
    scenario: str


class _Manifest(BaseModel):
    """Form of a manifest. `campaign_of` checks that its parts are consistent."""

    model_config = ConfigDict(strict=True)
    name: str
    seed: int
    num_runs: int
    compare: str
    axes: dict[str, list[JsonValue]]
    spec: dict[str, JsonValue]
    digest: str
    cells: list[_CellEntry]
    created: str
    sessions: list[_Session]
    shard: str | None = None


def new_manifest(campaign: Campaign) -> dict[str, Any]:
    """Return the manifest of a new campaign, as plain JSON data."""
    texts = campaign.texts()
    manifest = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "name": campaign.name,
        "seed": campaign.seed,
        "num_runs": campaign.num_runs,
        "compare": campaign.compare,
        "axes": campaign.axes,
        "spec": {field: value for field, value in campaign.spec.items() if field != "runs"},
        "digest": campaign.digest(texts),
        "cells": [
            {
                "name": cell.name,
                "planner": cell.planner,
                "settings": cell.settings,
                "scenario": text,
            }
            for cell, text in zip(campaign.cells, texts, strict=True)
        ],
        "created": _now(),
        "sessions": [],
        **({"shard": str(campaign.shard)} if campaign.shard.count > 1 else {}),
    }
    plain: dict[str, Any] = json.loads(json.dumps(manifest))
    return plain


def new_session() -> dict[str, Any]:
    """Return a session: time, versions and machine, without names of hosts or users."""
    machine = {"platform": platform.platform(), "architecture": platform.machine(), "processors": os.cpu_count()}
    return {"started": _now(), "versions": versions("llvmlite"), "machine": machine}


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a results folder.

    Raises `InputError`, naming the file, if there is no valid one.
    """
    path = folder / MANIFEST
    try:
        manifest = parse_json(read_file(path, _MOST_BYTES))
    except OSError as error:
        raise unreadable(path, "the manifest of a results folder", error) from None
    except ValueError as error:
        raise InputError(
            f"{path}: expected the manifest of a results folder; it is cut short or altered: {error}"
        ) from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{path}: expected the manifest of a results folder; got another file")
    sessions = manifest.get("sessions")
    check_version(manifest, sessions[-1] if isinstance(sessions, list) and sessions else None, path)
    try:
        _Manifest.model_validate(manifest)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        place = ".".join(map(str, fault["loc"]))
        raise InputError(
            f"{path}: expected a campaign; it is cut short or altered: {place}: {error_summary(fault['msg'])}"
        ) from None
    return manifest


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest atomically. Raises `InputError` if it cannot be written."""
    content = json.dumps(manifest, indent=1).encode() + b"\n"
    write_file(folder / MANIFEST, lambda file: file.write(content))


def contents_checksum(manifest: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the fields of a manifest that never change."""
    fixed = {field: manifest[field] for field in _FIXED}
    return hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()


def check_same_campaign(folder: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    """Raise `InputError`, naming the first difference, unless both manifests are of the same shard of a campaign."""
    for field in (*_FIXED, "shard"):
        difference = _difference(field, there.get(field), here.get(field))
        if difference and field == "digest":
            difference = "the files that its scenarios name have other contents now"
        if difference:
            raise InputError(
                f"{folder}: expected a folder of this campaign; it is of another, and is kept as it is: {difference}"
            )


def campaign_of(folder: Path, manifest: Mapping[str, Any]) -> Campaign:
    """Return the campaign from its manifest. The files that its scenarios name need not exist.

    Raises `InputError`, naming the file, for a manifest that no specification produces, as later steps rely on it.
    """
    try:
        spec = {**manifest["spec"], "runs": manifest["num_runs"]}
        specification = spec_from_data(spec, "spec")
        axes = specification.axes()
        _check_same_as(specification, manifest)
        read: dict[str, Scenario] = {}
        return Campaign(
            name=manifest["name"],
            seed=manifest["seed"],
            num_runs=manifest["num_runs"],
            cells=tuple(_cell(entry, read) for entry in manifest["cells"]),
            axes=axes,
            compare=manifest["compare"],
            spec=spec,
            shard=parse_shard(shard) if (shard := manifest.get("shard")) else WHOLE,
        )
    except (InputError, ValidationError) as error:
        raise InputError(
            f"{folder / MANIFEST}: expected a campaign; it is cut short or altered: {error_summary(error)}"
        ) from error


def _check_same_as(specification: CampaignSpec, manifest: Mapping[str, Any]) -> None:
    """Raise `InputError` unless the cells are those of the specification, each with a name that is fit for a file."""
    axes, settings = specification.axes(), specification.settings()
    for field, value, expected in (
        ("name", manifest["name"], specification.name),
        ("seed", manifest["seed"], specification.seed),
        ("axes", manifest["axes"], axes),
        ("settings", [cell["settings"] for cell in manifest["cells"]], settings),
        ("planner", [cell["planner"] for cell in manifest["cells"]], [setting["planner"] for setting in settings]),
    ):
        if json.dumps(value) != json.dumps(expected):  # compared as text, as 1, 1.0 and True are equal in Python
            raise InputError(f"{field}: expected what the specification says; got other values")
    names = [cell["name"] for cell in manifest["cells"]]
    if len(set(names)) < len(names) or any(name != safe_name(name) or name in ("", ".", "..") for name in names):
        raise InputError(f"cells: expected names that are unique and fit for files; got {shown(names)}")
    if manifest["compare"] not in axes:
        raise InputError(f"compare: expected one of {', '.join(axes)}; got {shown(manifest['compare'])}")


def _cell(entry: Mapping[str, Any], read: dict[str, Scenario]) -> Cell:
    """Return a cell. `read` caches the scenarios by their texts, as strategies share them."""
    text = entry["scenario"]
    if text not in read:
        place = f"cell {entry['name']}"
        document = read_yaml(text, place)
        if document.faults:
            raise InputError(document.faults[0].message(place))
        read[text] = Scenario(ScenarioModel.model_validate(document.data))
    return Cell(entry["name"], entry["settings"], read[text], entry["planner"])


def _difference(place: str, there: Any, here: Any) -> str:
    """Return in words where two pieces of plain data first differ, empty if they do not."""
    if isinstance(there, dict) and isinstance(here, dict):
        parts = [(f"{place}.{key}", there.get(key), here.get(key)) for key in (*there, *(here.keys() - there.keys()))]
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        parts = [(f"{place}[{index}]", *pair) for index, pair in enumerate(zip(there, here, strict=True))]
    elif isinstance(there, str) and isinstance(here, str) and "\n" in there:
        lines = zip(there.splitlines(), here.splitlines(), strict=False)
        parts = [(f"{place}, line {number}", *pair) for number, pair in enumerate(lines, start=1)]
    else:
        return "" if there == here else f"{place} is {shown(there)} there and {shown(here)} here"
    return next(filter(None, (_difference(*part) for part in parts)), "")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
