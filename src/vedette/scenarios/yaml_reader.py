"""YAML 1.2 (core schema) read into plain data, with the place of every key and value.

The result has only mappings, lists, words, numbers, true/false and null; a tag never makes an object. Anchors and
aliases work. All faults that leave the text readable (a repeated key, a foreign tag) are reported together.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from vedette.scenarios.diagnostics import Diagnostic, Fault, Path, Place, describe

_MAX_DEPTH = 50
_MAX_NODES = 100_000  # aliases of aliases can stand for any number of nodes
MAX_BYTES = 2_000_000
_MAX_DIGITS = 300  # longer numbers are read as words; Python refuses to convert thousands of digits
_CORE_TAGS = {f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "seq", "map")}
_STR_TAGS = ("tag:yaml.org,2002:str", "!")
_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_NO_LETTER = re.compile(r"\\U(?!000[0-9a-fA-F]|0010)[0-9a-fA-F]{8}")
_WORDS: dict[str, Any] = {text: None for text in ("", "~", "null", "Null", "NULL")}
_WORDS |= {text: True for text in ("true", "True", "TRUE")} | {text: False for text in ("false", "False", "FALSE")}


@dataclass(frozen=True, slots=True)
class Document:
    """Plain data of a file, the place of each key and value, and the faults of the text."""

    file: str
    data: Any
    key_places: dict[Path, Place]
    value_places: dict[Path, Place]
    faults: list[Fault]

    def place(self, path: Path) -> Place:
        """Return the place of the key (or list item) at `path`, or of the nearest key or value around it."""
        for length in range(len(path), 0, -1):
            place = self.key_places.get(path[:length]) or self.value_places.get(path[:length])
            if place:
                return place
        return self.value_places.get((), (1, 1))

    def value_place(self, path: Path) -> Place:
        """Return the place of the value at `path`, or of the nearest one around it."""
        return self.value_places.get(path) or self.place(path)


def plain_scalar(text: str) -> Any:
    """Return the value of an unquoted scalar in the core schema: `1e3` is a number, `no` and `1_000` are words."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text) if len(text) <= _MAX_DIGITS else text
    if _BASED.fullmatch(text):
        return int(text, 0) if len(text) <= _MAX_DIGITS else text
    if _FLOAT.fullmatch(text):
        return float(text)
    return float(text.replace(".", "")) if _SPECIAL.fullmatch(text) else text


@dataclass(slots=True)
class _Anchor:
    """A node that aliases can name: its value, its path, and the range of recorded places inside it."""

    value: Any
    path: Path
    first: int
    last: int


@dataclass(slots=True)
class _Reader:
    events: Iterator[Any]
    keys: dict[Path, Place] = field(default_factory=dict)
    values: dict[Path, Place] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    anchors: dict[str, _Anchor] = field(default_factory=dict)
    read: list[tuple[Path, Place, bool]] = field(default_factory=list)  # every place in order, and True for a key

    def record(self, path: Path, place: Place, *, is_key: bool) -> None:
        """Record the place of a key or value."""
        if len(self.read) >= 2 * _MAX_NODES:
            raise _Unreadable(
                Fault(place, Diagnostic((), f"at most {_MAX_NODES} values", "more, aliases and keys counted"))
            )
        self.read.append((path, place, is_key))
        (self.keys if is_key else self.values)[path] = place

    def fault(self, place: Place, path: Path, expected: str, got: str) -> None:
        self.faults.append(Fault(place, Diagnostic(path, expected, got)))

    def node(self, event: Any, path: Path) -> Any:
        if len(path) > _MAX_DEPTH:
            raise _Unreadable(Fault(_place(event), Diagnostic((), f"at most {_MAX_DEPTH} levels of nesting", "more")))
        place = _place(event)
        self.record(path, place, is_key=False)
        if isinstance(event, AliasEvent):
            return self.alias(event, path)
        first = len(self.read)
        tag = event.tag
        if tag is not None and str(tag) not in (*_CORE_TAGS, "!"):
            self.fault(place, path, "plain data without a tag", f"the tag {tag}")
        if isinstance(event, ScalarEvent):
            value = self.scalar(event, path)
        elif isinstance(event, SequenceStartEvent):
            value = self.sequence(path)
        else:
            value = self.mapping(path)
        if event.anchor is not None:
            self.anchors[event.anchor] = _Anchor(value, path, first, len(self.read))
        return value

    def scalar(self, event: Any, path: Path) -> Any:
        quoted_or_text = event.style in ("'", '"', "|", ">") or (event.tag is not None and str(event.tag) in _STR_TAGS)
        return self.text(event, path) if quoted_or_text else plain_scalar(event.value)

    def text(self, event: Any, path: Path) -> str:
        """Return quoted text; two escapes that are halves of one letter, as JSON writes it, become that letter."""
        value = str(event.value)
        joined = value.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
        if joined != value and "\ufffd" in joined:
            self.fault(_place(event), path, "whole letters", "half of one, as an escape from \\ud800 to \\udfff")
        return joined

    def sequence(self, path: Path) -> list[Any]:
        items: list[Any] = []
        while not isinstance(event := next(self.events), SequenceEndEvent):
            items.append(self.node(event, (*path, len(items))))
        return items

    def mapping(self, path: Path) -> dict[str, Any]:
        entries: dict[str, Any] = {}
        while not isinstance(event := next(self.events), MappingEndEvent):
            key = self.key(event, path)
            inner = (*path, key) if key is not None and key not in entries else (*path, "?")
            if key is not None and key in entries:
                first = self.keys[(*path, key)][0]
                self.fault(_place(event), (*path, key), "each key once", f"it again, after line {first}")
            elif key is not None:
                self.record(inner, _place(event), is_key=True)
            value = self.node(next(self.events), inner)
            if inner[-1] == key:
                entries[key] = value
        return entries

    def key(self, event: Any, path: Path) -> str | None:
        if isinstance(event, ScalarEvent):
            value = self.scalar(event, path)
            if isinstance(value, str):
                return value
            got = describe(value)
        else:
            got = describe(self.node(event, (*path, "?")))
        self.fault(_place(event), path, "a word as key", got)
        return None

    def alias(self, event: Any, path: Path) -> Any:
        anchor = self.anchors.get(event.anchor)
        if anchor is None:
            self.fault(_place(event), path, "an alias of a node that stands, complete, before it", f"*{event.anchor}")
            return None
        depth = len(anchor.path)
        for inner, place, is_key in self.read[anchor.first : anchor.last]:
            self.record((*path, *inner[depth:]), place, is_key=is_key)
        return anchor.value


class _Unreadable(Exception):
    """A fault after which the text cannot be read further."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(str(fault))
        self.fault = fault


def _place(event: Any) -> Place:
    return event.start_mark.line + 1, event.start_mark.column + 1


def _syntax(place: Place, problem: str) -> Fault:
    hint = "indent with spaces, not tabs" if "\\t" in problem else ""
    return Fault(place, Diagnostic((), "valid YAML 1.2", f"a syntax error: {problem}", hint))


def _document_start(events: Iterator[Any]) -> Any:
    """Skip to the first node; return None if there is none."""
    for event in events:
        if isinstance(event, DocumentStartEvent):
            if event.version is not None and tuple(event.version) != (1, 2):
                got = ".".join(map(str, event.version))
                raise _Unreadable(Fault(_place(event), Diagnostic((), "YAML 1.2", f"a %YAML {got} directive")))
            return next(events)
        if isinstance(event, StreamEndEvent):
            return None
    return None


def _place_of_escape(text: str) -> Place:
    """Return the place of the first escape beyond the last Unicode letter, U+10FFFF."""
    match = _NO_LETTER.search(text)
    before = text[: match.start()] if match else ""
    return before.count("\n") + 1, len(before) - before.rfind("\n")


def _read(reader: _Reader) -> Any:
    first = _document_start(reader.events)
    if first is None:
        return None
    data = reader.node(first, ())
    for event in reader.events:
        if isinstance(event, DocumentStartEvent):
            reader.fault(_place(event), (), "one document", "another after it")
            break
    return data


def read_yaml(text: str, file: str) -> Document:
    """Read YAML 1.2 text. Never raises for faults of the text: they are in the result."""
    if len(text) > MAX_BYTES:
        fault = Fault((1, 1), Diagnostic((), f"a file of at most {MAX_BYTES} letters", f"{len(text)}"))
        return Document(file, None, {}, {}, [fault])
    reader = _Reader(iter(YAML(typ="safe", pure=True).parse(text)))
    data: Any = None
    try:
        data = _read(reader)
    except _Unreadable as error:
        reader.faults.append(error.fault)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        reader.faults.append(_syntax(place, str(error.problem or error.context)))
    except YAMLError as error:
        reader.faults.append(_syntax((1, 1), str(error).splitlines()[0]))
    except (ValueError, OverflowError):  # the scanner raises these for an escape such as "\U00110000"
        reader.faults.append(_syntax(_place_of_escape(text), "an escape of what is no letter"))
    return Document(file, data, reader.keys, reader.values, reader.faults)
