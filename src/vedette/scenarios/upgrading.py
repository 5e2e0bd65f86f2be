"""Scenario and sensors files with former names, rewritten with the present ones; comments and layout stay."""

from __future__ import annotations

import json
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from pathlib import Path as FilePath
from typing import NamedTuple

from vedette.errors import InputError, ScenarioError
from vedette.internal.files import write_file
from vedette.internal.reading import read_text
from vedette.scenarios.diagnostics import format_path
from vedette.scenarios.renamed import Change, changed, changes
from vedette.scenarios.yaml_reader import MAX_BYTES, Document, read_yaml

_LINE = re.compile(r"\r\n|[\n\r]")
_PROPERTIES = r"(?:[&!]\S*\s+)*"  # anchor and tag of a YAML node


class Line(NamedTuple):
    """A change in words, such as `line 4: fusion: by_views -> field_of_view_weighting`."""

    number: int
    section: str
    former: str
    present: str

    def __str__(self) -> str:
        where = f"{self.section}: " if self.section else ""
        return f"line {self.number}: {where}{self.former} -> {self.present}"


def line_of(change: Change, number: int) -> Line:
    """Return a change in words. number: its line."""
    present = change.present if isinstance(change.present, str) else json.dumps(change.present)
    return Line(number, format_path(change.path[:-1] if change.is_key else change.path), change.former, present)


def upgraded_yaml(text: str, file: str = "<text>") -> tuple[str, list[Line]]:
    """Return the text of a scenario or sensors file with present names, and its changes in file order.

    Raises:
        ScenarioError: faults of the text.
        InputError: a section with a former and the present name of one key, or a former name that is written in a way
            that cannot be edited.
    """
    document = read_yaml(text, file)
    if document.faults:
        raise ScenarioError([fault.message(file) for fault in document.faults])
    if not isinstance(document.data, Mapping) or "sensors" not in document.data:
        raise InputError(f"{file}: expected a scenario or sensors file, with `sensors`; got another file")
    found = list(changes(document.data))
    wanted, edits = _with_changes(document, found), {}
    for change in found:
        start, end, present = _edit(text, document, change)
        edits[start] = end, present
    for start in sorted(edits, reverse=True):
        end, present = edits[start]
        text = text[:start] + present + text[end:]
    after = read_yaml(text, file)
    if after.faults or after.data != wanted:
        raise InputError(f"{file}: expected former names that can be replaced one by one; {_by_hand(document, found)}")
    lines = [line_of(change, _place(document, change)[0]) for change in found]
    return text, sorted(dict.fromkeys(lines), key=lambda line: line.number)


def _with_changes(document: Document, found: list[Change]) -> object:
    try:
        return reduce(changed, found, document.data)
    except KeyError as error:
        key = error.args[0]
        former = next(change for change in found if change.present == key and change.is_key)
        raise InputError(
            f"{document.file}:{_place(document, former)[0]}: {format_path(former.path)}: expected one of "
            f"{former.former} and {key}, got both"
        ) from None


def _place(document: Document, change: Change) -> tuple[int, int]:
    places = document.key_places if change.is_key else document.value_places
    return places[change.path]


def _edit(text: str, document: Document, change: Change) -> tuple[int, int, str]:
    """Return where the former name starts and ends in the text, and what stands there instead."""
    line, column = _place(document, change)
    starts = [0, *(match.end() for match in _LINE.finditer(text))]
    at = starts[line - 1] + column - 1 if line <= len(starts) else len(text)
    name = re.escape(change.former)
    written = re.compile(rf"{_PROPERTIES}(?P<word>{name}|\"{name}\"|'{name}')").match(text, at)
    if written is None:
        raise InputError(f"{document.file}: expected former names without escapes; {_by_hand(document, [change])}")
    if isinstance(change.present, bool):
        return written.start("word"), written.end("word"), json.dumps(change.present)
    quote = 0 if written["word"] == change.former else 1
    return written.start("word") + quote, written.end("word") - quote, change.present


def _by_hand(document: Document, found: list[Change]) -> str:
    lines: Iterator[str] = (str(line_of(change, _place(document, change)[0])) for change in found)
    return f"edit the file by hand: {'; '.join(dict.fromkeys(lines))}"


def upgrade_scenario_file(path: FilePath) -> list[Line]:
    """Rewrite the former names in a scenario or sensors file, in place; return the changes, in file order.

    The file is replaced as a whole, or not at all if it is up to date. Raises as `upgraded_yaml`, and `InputError` for
    a file that cannot be read or written.
    """
    return upgrade_text_file(path, read_text(path, "scenario file", MAX_BYTES), upgraded_yaml)


def upgrade_text_file(path: FilePath, text: str, upgraded: Callable[[str, str], tuple[str, list[Line]]]) -> list[Line]:
    """Replace the text of a file by its upgraded form, and return the changes; without any the file stays as it is.

    The file is UTF-8; a byte order mark stays. Raises `InputError` if it cannot be written, and as `upgraded`.
    """
    text, lines = upgraded(text, str(path))
    if not lines:
        return lines
    mark = BOM_UTF8 if path.read_bytes().startswith(BOM_UTF8) else b""
    write_file(path, lambda file: file.write(mark + text.encode()))
    return lines
