"""The command that checks scenario files and sensors files: check."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli import completing
from vedette.cli.output import echo, emit_json, note
from vedette.cli.scenario_files import print_warnings
from vedette.errors import InputError, ScenarioError

if TYPE_CHECKING:
    from vedette.scenarios import Scenario


def check(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE", help="Scenario files and sensors files.", autocompletion=completing.scenarios),
    ],
) -> None:
    """Check scenario files and sensors files.

    Prints every fault with its file, line, column and field, with what was expected and what was found. A sensors file
    has `sensors`, but neither `time` nor `targets`. `vedette track` uses it. Python code that a scenario names is
    imported and run for three scans, unless other users can modify it. Warnings, of what is valid but may cost
    accuracy, go to standard error and leave the exit status at 0.
    """
    from vedette.scenarios.sensors_file import is_sensors_file

    documents: list[dict[str, Any]] = []
    for file in files:
        faults = list[str]()
        document: dict[str, Any] = {"kind": "scenario", "summary": None, "warnings": []}
        try:
            document = _check_sensors(file) if is_sensors_file(file) else _check_scenario(file)
        except (ScenarioError, InputError) as error:
            echo(str(error), even_if_quiet=True)
            faults = error.faults if isinstance(error, ScenarioError) else [str(error)]
        documents.append({"file": file, "valid": not faults, "faults": faults, **document})
    emit_json({"files": documents})
    if not all(each["valid"] for each in documents):
        raise typer.Exit(1)


def _check_scenario(file: Path) -> dict[str, Any]:
    """Print a summary of a valid scenario, and return its part of the document."""
    from vedette.scenarios import load_scenario
    from vedette.scenarios.strategy_warnings import strategy_warnings
    from vedette.scenarios.summary import summary_line

    scenario = load_scenario(file)
    if faults := code_faults(scenario):
        raise ScenarioError(faults)
    summary = summary_line(scenario)
    echo(f"{file}: valid ({summary})")
    return {"kind": "scenario", "summary": summary, "warnings": print_warnings(scenario, strategy_warnings(scenario))}


def _check_sensors(file: Path) -> dict[str, Any]:
    """Print a summary of a valid sensors file and how to use it, and return its part of the document."""
    from vedette.scenarios.sensors_file import check_sensors_file

    valid = check_sensors_file(file)
    echo(f"{file}: valid sensors file: {valid.summary}")
    if valid.not_given:
        echo(f"  not given, will be assumed: {', '.join(valid.not_given)}")
    echo(f"  use it with: vedette track SCANS --sensors {file}")
    return {"kind": "sensors", "summary": valid.summary, "not_given": valid.not_given, "warnings": []}


def code_faults(scenario: Scenario) -> list[str]:
    """Return the faults of the code that a scenario names. Print a warning if other users may have written it."""
    from vedette.scenarios.trust import custom_code, foreign_code_reason

    code = custom_code(scenario.model)
    if not code:
        return []
    if reason := foreign_code_reason(scenario):
        note(f"{scenario.path}: warning: {', '.join(code)} is not imported, as {reason}")
        return []
    from vedette.cli.compiling import compiling
    from vedette.scenarios import code_checks

    with compiling():
        return code_checks.code_faults(scenario)
