"""Checks of the files that a scenario names: recorded targets, and custom models."""

import ast
import csv
import os
import symtable
import tokenize
import warnings
from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import elided, printable
from vedette.scenarios.diagnostics import Finding, Path, describe, shown_key
from vedette.scenarios.recorded_data import recorded_targets
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import is_complete, readable_findings
from vedette.scenarios.sections.custom import Custom, custom_objects
from vedette.scenarios.sections.targets import RecordedTargets

BUILTIN_FOLDER = FilePath(__file__).parent / "builtin"
_MAX_PATH_LENGTH = 200


def _missing_file(file: str) -> str:
    return f'"{elided(printable(file), _MAX_PATH_LENGTH)}": no such file'


def recorded_findings(model: ScenarioModel, folder: FilePath) -> Iterator[Finding]:
    """Yield the faults of the file of recorded targets that a run would refuse."""
    recorded = model.targets
    if not isinstance(recorded, RecordedTargets):
        return
    file = folder / recorded.path
    from vedette.recorded.files import ENDINGS

    if file.suffix.lower() not in ENDINGS:
        wanted = f"a file that ends with {', '.join(ENDINGS)}"
        yield ("targets", "path"), wanted, describe(recorded.path)
    elif not os.path.isfile(file):  # pathlib raises for a name that is too long or has forbidden characters
        yield ("targets", "path"), "a file, relative to the scenario file", _missing_file(recorded.path)
    else:
        if not any(recorded.columns.findings()):
            yield from _content_findings(recorded, model, folder)


def _content_findings(recorded: RecordedTargets, model: ScenarioModel, folder: FilePath) -> Iterator[Finding]:
    """Yield faults of the columns or rows, or of the scans or the region for them.

    If scans or region are faulty, only the columns are checked.
    """
    findings = list[Finding]()
    if all(map(is_complete, (recorded, model.region, model.time))):
        try:
            recorded_targets(model, folder).truth(model.time.build(), rng=np.random.default_rng(0))
            return
        except InputError as error:
            findings = [(("targets", "path"), "a file of recorded targets that a run can use", str(error))]
    yield from list(_column_findings(recorded, folder / recorded.path)) or findings


def _column_findings(recorded: RecordedTargets, file: FilePath) -> Iterator[Finding]:
    """Yield names of columns that a CSV file does not have."""
    if file.suffix.lower() != ".csv":
        return
    from vedette.recorded.files import header_of
    from vedette.recorded.tables import column_names

    try:
        with file.open(encoding="utf-8-sig", errors="replace", newline="") as lines:
            header = header_of(csv.reader(lines), file)
    except InputError as error:
        yield ("targets", "path"), "a readable CSV file", str(error)
        return
    except (OSError, csv.Error) as error:
        yield ("targets", "path"), "a readable CSV file", f"{describe(recorded.path)}: {error}"
        return
    from vedette.recorded.opensky import is_opensky
    from vedette.recorded.reports import usual_names

    if not recorded.columns.to_arguments() and is_opensky(header):
        return
    given, shown = usual_names(header) | recorded.columns.to_arguments(), column_names(header)
    for key, name in given.items():
        if name not in header:
            yield ("targets", "columns", key), f"a column of {shown_key(recorded.path)}: {shown}", describe(name)
    missing = [key for key in ("time", "id") if key not in given and key not in header]
    if "x" not in given and "longitude" not in given and not {"x", "y"} <= set(header):
        missing += [key for key in ("longitude", "latitude") if key not in header]
    if missing:
        wanted = f"the names of the columns of {', '.join(missing)} among {shown}"
        yield ("targets", "columns"), wanted, "nothing"


def _undefined_name(file: FilePath, name: str) -> tuple[str, str] | None:
    """Return a fault if a file is not valid Python or does not define the name; the file is not run."""
    try:
        with warnings.catch_warnings(action="ignore"):  # warnings of the user's style; a run shows them
            with tokenize.open(file) as text:  # in the encoding that the file declares
                code = text.read()
            tree, symbols = ast.parse(code), symtable.symtable(code, str(file), "exec").get_symbols()
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
        return "a file of Python", f"{describe(file.name)}{line}, which is none"
    defined = {symbol.get_name() for symbol in symbols if symbol.is_assigned() or symbol.is_imported()}
    has_star_import = any(isinstance(node, ast.ImportFrom) and node.names[0].name == "*" for node in ast.walk(tree))
    if name in defined or has_star_import or "__getattr__" in defined or "globals" in code:
        return None
    return f"a name that {describe(file.name)} defines", describe(name)


def reference_findings(model: ScenarioModel, folder: FilePath) -> Iterator[Finding]:
    """Yield faults of custom code that cannot be found. Nothing is imported."""
    for path, custom in custom_objects(model):
        yield from readable_findings(_reference_findings, path, custom, folder)


def _reference_findings(path: Path, custom: Custom, folder: FilePath) -> Iterator[Finding]:
    from vedette.internal.extras import is_installed  # here, as most scenarios name no code

    module, _, name = custom.function.rpartition(":")
    if module.endswith(".py"):
        if not os.path.isfile(folder / module):
            copied = " (a built-in one: copy it with `vedette init`)" if folder == BUILTIN_FOLDER else ""
            yield (*path, "function"), f"a file, relative to the scenario file{copied}", _missing_file(module)
        elif fault := _undefined_name(folder / module, name.partition(".")[0]):
            yield (*path, "function"), *fault
    elif not is_installed(module.partition(".")[0]):
        yield (*path, "function"), "a module that Python finds", describe(module)
