"""Scenarios from files and by name."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from vedette.errors import InputError, ScenarioError
from vedette.internal.reading import read_text
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import elided, pluralise, printable
from vedette.scenarios.coastline import coastline_findings
from vedette.scenarios.diagnostics import Diagnostic, Fault, Path, describe
from vedette.scenarios.file_checks import BUILTIN_FOLDER, recorded_findings, reference_findings
from vedette.scenarios.geojson import with_zones
from vedette.scenarios.recorded_data import recording_findings
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import readable_findings
from vedette.scenarios.sections.courses import path_in_file
from vedette.scenarios.validation import UNKNOWN_KEY, read_section, suggestion
from vedette.scenarios.yaml_reader import MAX_BYTES, Document, read_yaml

_MAX_NAME_LENGTH = 200


@dataclass(frozen=True, slots=True, repr=False)
class Scenario(SummaryRepr):
    """A valid scenario.

    Attributes:
        model: its sections (`vedette.scenarios.sections`), with defaults.
        path: the file it was read from, or None; the paths in it are relative to that file's folder.
    """

    model: ScenarioModel
    path: FilePath | None = None

    @property
    def name(self) -> str:
        """Name given in the scenario."""
        return self.model.name

    @property
    def folder(self) -> FilePath:
        """Folder to which paths in the scenario are relative."""
        return FilePath() if self.path is None else self.path.parent

    def _summary(self) -> str:
        sizes = pluralise(self.model.time.num_steps, "scan"), pluralise(len(self.model.sensors), "sensor")
        return f"{self.name}: {', '.join(sizes)}, filter {self.model.filter.kind}, fusion {self.model.fusion.kind}"

    def _detail(self) -> str:
        return " ".join(self.model.description.split())


def list_builtin() -> dict[str, FilePath]:
    """Return the names of the scenarios that come with the library, and their files."""
    return {file.stem: file for file in sorted(BUILTIN_FOLDER.glob("*.yaml"), key=lambda file: file.stem)}


def locate_fault(document: Document, diagnostic: Diagnostic) -> Fault:
    """Return the fault with the place in the file where the value at its path is written."""
    written_path = path_in_file(_written_path(diagnostic.path, document.data), document.data)
    at_key = diagnostic.got == UNKNOWN_KEY or written_path not in document.value_places
    place = document.place(written_path) if at_key else document.value_place(written_path)
    return Fault(place, diagnostic._replace(path=written_path))


def _written_path(path: Path, data: Any) -> Path:
    """Return the path where the value at `path` is written: a sensor's value may come from `sensor_defaults`."""
    if len(path) < 3 or path[0] != "sensors" or not isinstance(data, Mapping):
        return path
    sensors, defaults = data.get("sensors"), data.get("sensor_defaults")
    own = sensors[path[1]] if isinstance(sensors, list) and isinstance(path[1], int) else None
    if isinstance(own, Mapping) and path[2] not in own and isinstance(defaults, Mapping) and path[2] in defaults:
        return ("sensor_defaults", *path[2:])
    return path


def _unique(faults: list[Fault]) -> list[Fault]:
    """Return the faults in file order, each once: faults of shared sensor settings are found once for each sensor."""
    return sorted(dict.fromkeys(faults), key=lambda fault: fault.place)


def diagnose(document: Document, folder: FilePath | None) -> tuple[ScenarioModel | None, list[Fault]]:
    """Return the scenario in a document, or None and all its faults, in file order."""
    faults = list(document.faults)
    if not isinstance(document.data, Mapping):
        if not faults:
            place = document.value_place(())
            faults.append(
                Fault(place, Diagnostic((), "a mapping of the sections of a scenario", describe(document.data)))
            )
        return None, _unique(faults)
    root = folder or FilePath()
    data, zone_diagnostics = with_zones(document.data, root)
    model, diagnostics = read_section(ScenarioModel, data)
    diagnostics += zone_diagnostics
    for findings in (recorded_findings, recording_findings, reference_findings, coastline_findings):
        diagnostics += [Diagnostic(*finding) for finding in readable_findings(findings, model, root)]
    faults += [locate_fault(document, fault) for fault in diagnostics]
    return (None if faults else model), _unique(faults)


def parse_scenario(text: str, file: str = "<text>", folder: FilePath | None = None) -> ScenarioModel:
    """Read a scenario from YAML text; `file` is its name in messages, and its paths are relative to `folder`.

    Raises:
        ScenarioError: with every fault, in file order.
    """
    model, faults = diagnose(read_yaml(text, file), folder)
    if model is None:
        raise ScenarioError([fault.message(file) for fault in faults])
    return model


def missing_scenario(name: str, more: str, builtin: list[str]) -> InputError:
    """Return the error for a name that is neither a file nor a built-in scenario, nor any of `more`."""
    problem = "a folder" if os.path.isdir(name) else "no such file"
    hint = suggestion(name, builtin)
    expected = f"{more}a YAML file or one of {', '.join(builtin)}{f' ({hint})' if hint else ''}"
    return InputError(f"{elided(printable(name), _MAX_NAME_LENGTH)}: {problem}; expected {expected}")


def load_scenario(name_or_path: str | FilePath) -> Scenario:
    """Load a built-in scenario by name, or a custom one from its YAML file.

    Raises:
        InputError: there is neither such a name nor such a file, or the file cannot be read.
        ScenarioError: with every fault of the file, in file order.
    """
    builtin = list_builtin()
    path = builtin.get(str(name_or_path), FilePath(name_or_path))
    # With `os.path`: pathlib raises for a name that is too long or has forbidden characters.
    if os.path.isdir(path) or not os.path.exists(path):
        raise missing_scenario(str(name_or_path), "", list(builtin))
    if path.suffix.lower() == ".toml":
        raise InputError(
            f"{path}: expected a scenario file, which is YAML; a campaign file (TOML) and its scenarios are checked by "
            f"vedette campaign {path} --dry-run"
        )
    return Scenario(parse_scenario(read_text(path, "scenario file", MAX_BYTES), str(path), path.parent), path)


def read_document(scenario: Scenario) -> Document | None:
    """Return the file that a scenario was read from, for places in it; None if there is none or it cannot be read."""
    try:
        text = None if scenario.path is None else read_text(scenario.path, "scenario file", MAX_BYTES)
    except InputError:
        return None
    return None if text is None else read_yaml(text, str(scenario.path))


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of scenario files, for editors."""
    schema = ScenarioModel.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "Vedette scenario"}
