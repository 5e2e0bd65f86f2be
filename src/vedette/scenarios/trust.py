"""The code that a scenario names, and whether other users may have changed it."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from vedette.scenarios.file_checks import BUILTIN_FOLDER
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.base import Section, sections_in
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.program import ProgramSection


def custom_code(section: Section) -> tuple[str, ...]:
    """Return the custom code that a scenario or a section imports, calls or starts, each once, in order."""
    return tuple(dict.fromkeys(own.code for own in _custom_sections(section)))


def _custom_sections(section: Section) -> Iterator[Custom | ProgramSection]:
    """Return the sections whose code does not belong to the library."""
    sections = (each for _, each in sections_in(section) if isinstance(each, Custom | ProgramSection))
    return (each for each in sections if not each.code.startswith("vedette."))


def foreign_code_reason(scenario: Scenario) -> str:
    """Return the reason why other users may have changed the code that a scenario names; empty if there is none.

    Code is trusted if the scenario file, the Python files and programs that it names, and their folders belong to the
    user or to the system's administrator, and no other user may write to them. Systems without owners of files give no
    reason.
    """
    files = [] if scenario.path is None else [scenario.path]
    files += [scenario.folder / name for own in _custom_sections(scenario.model) for name in own.files(scenario.folder)]
    files = [file for file in files if file.parent != BUILTIN_FOLDER]
    return next(filter(None, map(foreign_write_reason, files)), "")


def foreign_write_reason(file: Path) -> str:
    """Return the reason why other users may change a file; empty if there is none, or if the file does not exist."""
    if not hasattr(os, "getuid"):
        return ""
    resolved = file.resolve()
    for path in (resolved, resolved.parent):
        try:
            status = path.stat()
        except OSError:  # reported when it is opened
            return ""
        if status.st_uid not in (os.getuid(), 0):
            return f"{path} belongs to another user"
        if status.st_mode & stat.S_IWOTH and not (path == resolved.parent and status.st_mode & stat.S_ISVTX):
            return f"every user may write to {path}"
    return ""
