"""Scenarios from files and by name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError

from vedette.errors import InputError, ScenarioError
from vedette.scenarios.checks import findings
from vedette.scenarios.diagnostics import locate, place_fault, suggestion, validation_faults
from vedette.scenarios.faults import Fault, Path, describe, named
from vedette.scenarios.parts import Parts, parts_of_data, parts_of_model
from vedette.scenarios.sections import ScenarioModel, merge_sensor_defaults
from vedette.scenarios.yaml_reader import Document, read_yaml

BUILTIN_FOLDER = FilePath(__file__).parent / "builtin"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A valid scenario.

    Attributes:
        model: its sections (`vedette.scenarios.sections`), defaults filled in.
        path: the file it was read from; the paths in it are relative to that file's folder.
    """

    model: ScenarioModel
    path: FilePath | None = None

    @property
    def name(self) -> str:
        """Name that the scenario gives itself."""
        return self.model.name

    @property
    def folder(self) -> FilePath:
        """What paths in the scenario are relative to."""
        return FilePath() if self.path is None else self.path.parent


def list_builtin() -> dict[str, FilePath]:
    """Names of the scenarios that come with the library, and their files."""
    return {file.stem: file for file in sorted(BUILTIN_FOLDER.glob("*.yaml"))}


def _without(data: Any, paths: list[Path]) -> Any:
    """A deep copy of plain data without the keys at `paths`."""
    inner: dict[str | int, list[Path]] = {}
    for first, *rest in paths:
        inner.setdefault(first, []).append(tuple(rest))
    if isinstance(data, Mapping):
        kept = {key: inner.get(key, []) for key in data}
        return {key: _without(value, kept[key]) for key, value in data.items() if () not in kept[key]}
    if isinstance(data, list):
        return [_without(item, inner.get(i, [])) for i, item in enumerate(data)]
    return data


def _partial(document: Document, error: ValidationError, folder: FilePath | None) -> Parts:
    unknown = [locate(e["loc"])[0] for e in error.errors(include_url=False) if e["type"] == "extra_forbidden"]
    return parts_of_data(_without(merge_sensor_defaults(document.data), unknown), folder)


def _unique(faults: list[Fault]) -> list[Fault]:
    """In file order, each once: what sensors share is read once a sensor; one cause a field is enough."""
    return sorted(dict.fromkeys(faults), key=lambda fault: fault.place)


def diagnose(document: Document, folder: FilePath | None) -> tuple[ScenarioModel | None, list[Fault]]:
    """The scenario in a document, or else everything that is wrong with it, in file order."""
    faults = list(document.faults)
    if not isinstance(document.data, Mapping):
        if not faults:
            place = document.value_place(())
            faults.append(Fault(place, (), "a mapping of the sections of a scenario", describe(document.data)))
        return None, _unique(faults)
    model: ScenarioModel | None = None
    try:
        model = ScenarioModel.model_validate(document.data)
        parts = parts_of_model(model, folder)
    except ValidationError as error:
        faults += validation_faults(document, error)
        parts = _partial(document, error, folder)
    faults += [place_fault(document, *finding) for finding in findings(parts)]
    return (None if faults else model), _unique(faults)


def parse_scenario(text: str, file: str = "<text>", folder: FilePath | None = None) -> ScenarioModel:
    """Read a scenario from YAML text; `file` is what messages call it, `folder` what its paths are relative to.

    Raises:
        ScenarioError: with every fault, in file order.
    """
    model, faults = diagnose(read_yaml(text, file), folder)
    if model is None:
        raise ScenarioError([fault.message(file) for fault in faults])
    return model


def _read_text(path: FilePath) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError([f"{path}:1:1: expected UTF-8 text, got byte {error.start} that is not"]) from None
    except OSError as error:
        raise InputError(f"scenario file {path}: expected a readable file; got {error.strerror}") from None


def load_scenario(name_or_path: str | FilePath) -> Scenario:
    """Load a built-in scenario by name, or one of your own from its YAML file.

    Raises:
        InputError: there is neither such a name nor such a file, or the file cannot be read.
        ScenarioError: with every fault of the file, in file order.
    """
    builtin = list_builtin()
    path = builtin.get(str(name_or_path), FilePath(name_or_path))
    if not os.path.isfile(path):  # a name can be too long, or hold what no name can: for pathlib, an error
        near = suggestion(str(name_or_path), list(builtin))
        hint = f" ({near})" if near else ""
        known = ", ".join(builtin)
        got = named(str(name_or_path))
        raise InputError(f"scenario: expected a YAML file or one of {known}; got '{got}'{hint}")
    return Scenario(parse_scenario(_read_text(path), str(path), path.parent), path)


def json_schema() -> dict[str, Any]:
    """JSON schema of scenario files, for editors."""
    schema = ScenarioModel.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "Vedette scenario"}
