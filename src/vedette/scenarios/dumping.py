"""Scenarios written as YAML."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from vedette.scenarios.recorded_data import recorded_scans, recorded_targets
from vedette.scenarios.sections import ScenarioModel, Section
from vedette.scenarios.sections.base import sections_in
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.program import ProgramSection
from vedette.scenarios.sections.recording import RecordingSection
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.yaml_reader import plain_scalar

if TYPE_CHECKING:
    from vedette.scenarios.loading import Scenario

_MAX_LINE_LENGTH = 100
_NUMBERS = float | int | None
# Text without quotes: words of letters, digits, dots and dashes that YAML 1.2 reads as nothing else.
_PLAIN = re.compile(r"[A-Za-z][\w.-]*( [A-Za-z0-9][\w.-]*)*")


def dump_scenario(model: ScenarioModel, *, folder: Path | None = None) -> str:
    """Return the YAML text of a scenario with every default written out; it reads back as the same scenario.

    Args:
        model: its sections.
        folder: to which the files that it names are relative; with it, the text can be stored anywhere.
    """
    return dump_data(model.model_dump(mode="json"), folder)


def dump_stored(scenario: Scenario) -> str:
    """Return the YAML text of a scenario that is stored with its run, with the SHA-256 of its recordings."""
    model, folder = scenario.model, scenario.folder
    data = _with_absolute_paths(model.model_dump(mode="json"), folder.resolve())
    if model.recording is not None:
        data["recording"]["sha256"] = recorded_scans(model, folder).file.sha256
    if isinstance(model.targets, RecordedTargets):
        data["targets"]["sha256"] = recorded_targets(model, folder).reports.sha256
    return dump_data(data)


def dump_data(data: Any, folder: Path | None = None) -> str:
    """Return the YAML text of plain data of a scenario, without checks; folder: see `dump_scenario`."""
    yaml = YAML(typ="rt", pure=True)
    yaml.width = 10_000
    yaml.indent(mapping=2, sequence=4, offset=2)
    out = io.StringIO()
    yaml.dump(_with_flow_style(data if folder is None else _with_absolute_paths(data, folder.resolve())), out)
    return out.getvalue()


def scenario_files(model: ScenarioModel, folder: Path) -> tuple[Path, ...]:
    """Return the files that a scenario depends on: recorded targets and scans, custom Python files, programs."""
    root = folder.resolve()
    files = [root / name for _, section in sections_in(model) for name in _files(section, root)]
    return tuple(dict.fromkeys(files))


def _files(section: Section, folder: Path) -> tuple[str, ...]:
    """Return the files that a section itself names."""
    if isinstance(section, RecordedTargets | RecordingSection):
        return (section.path,)
    return section.files(folder) if isinstance(section, Custom | ProgramSection) else ()


def _with_absolute_paths(value: dict[str, Any] | list[Any], folder: Path) -> Any:
    """Return the data with absolute paths of the files and folders that they name."""
    if isinstance(value, list):
        return [_with_absolute_paths(item, folder) if isinstance(item, dict | list) else item for item in value]
    result = {
        key: _with_absolute_paths(item, folder) if isinstance(item, dict | list) else item
        for key, item in value.items()
    }
    if isinstance(value.get("coastline"), str):
        result["coastline"] = str((folder / value["coastline"]).resolve())
    if value.get("kind") == "recorded" or {"path", "bad_rows"} <= set(value):
        result["path"] = str((folder / value["path"]).resolve())
    elif value.get("kind") == "custom" and ".py:" in value["function"]:
        result = {**value, "function": str(folder / value["function"])}
    elif value.get("kind") == "program":
        result = {**value, "folder": str((folder / value["folder"]).resolve())}
    return result


def _with_flow_style(value: Any) -> Any:
    """Return the data with small collections on one line."""
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) and plain_scalar(value) == value else DoubleQuotedScalarString(value)
    if isinstance(value, dict):
        items = [
            (_with_flow_style(key), item if isinstance(item, _NUMBERS) else _with_flow_style(item))
            for key, item in value.items()
        ]
        mapping = CommentedMap(items)
        inner = [item for item in value.values() if isinstance(item, dict | list)]
        if value and not inner and len(repr(value)) <= _MAX_LINE_LENGTH:
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, list):
        row = CommentedSeq([item if isinstance(item, _NUMBERS) else _with_flow_style(item) for item in value])
        if not [item for item in value if isinstance(item, dict)]:
            row.fa.set_flow_style()
        return row
    return value
