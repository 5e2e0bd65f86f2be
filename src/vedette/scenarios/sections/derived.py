"""Sections generated from the declarations of run-time classes and functions, so that each is written once.

A field's name, type, default and description are those of the dataclass field or of the parameter, and of its entry in
the docstring, which ends with its unit in brackets if it has one. The source is read but not imported, as importing
parts imports the compiler, which a check does not need; fields of parents are ignored. A parameter whose type is not
in `vedette.models.fields` (a region, a sensor) is not given in a file but passed to `build`. In a file an angle
`*_rad` is `*_deg`, and values that may be infinite are optional.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, TypeVar, Union, cast

from pydantic import Field, create_model

from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.scenarios.sections import base
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.custom import Custom, matching_parts

_ROOT = Path(__file__).parents[2]
_ENTRY = re.compile(r"    (\w+(?:, \w+)*): (.*)")
_TYPES = {**vars(base), "__builtins__": {"bool": bool}, "UnitVolume": Literal["reference"] | base.Positive}
_CONSTANTS = {"__builtins__": {}, "math": math}

# A mark with its kind and room, and the name of the marked part; texts that a class has in addition to its fields.
_MARK = re.compile(r'(?m)^@part\("(\w+)", "(\w+)".*\n(?:@.*\n)*(?:class|def) (\w+)')
_WORDS = re.compile(r'(?m)^    (\w+): ClassVar\[str\] = "(.*)"$')

S = TypeVar("S", bound=Section)
Definition = ast.ClassDef | ast.FunctionDef


class Derived(Section):
    """A section with fields of a class or function of the library."""

    of: ClassVar[str]  # module:name of the class or function
    declared: ClassVar[tuple[Declared, ...]] = ()  # its fields or parameters that a file gives

    if TYPE_CHECKING:  # its fields are declared with the part

        def __getattr__(self, name: str) -> Any: ...

    def to_arguments(self) -> dict[str, Any]:
        """Return the values in the file, with names and units of the class or function; without limits left open."""
        arguments = {}
        for declared in self.declared:
            value = getattr(self, declared.key)
            if isinstance(value, Section):
                value = value.build()  # type: ignore[attr-defined] # of a region, say
            if declared.in_degrees and value is not None:
                value = math.radians(value)
            if value is not None or declared.type != "Limit":
                arguments[declared.name] = value
        return arguments


class Part(Derived):
    """A section of a part of the library, which is made by what it is derived from."""

    def build(self, folder: Path | None = None, **given: Any) -> Any:
        """Return the part; uses the arguments `given` for which it has parameters."""
        module, _, name = self.of.partition(":")
        factory = getattr(importlib.import_module(module), name)
        with suppress_unit_warnings():
            return factory(**self.to_arguments(), **matching_parts(factory, given))


class _OwnPart(Custom):
    def build(self, folder: Path, **_: Any) -> Any:
        return self.instantiate(folder)


class Declared(NamedTuple):
    """A field or parameter in the source: type and default as Python text, and its description.

    key: its name in a file. in_degrees: True if a file gives it in degrees, and the library in radians.
    """

    key: str
    name: str
    type: str
    default: str | None
    description: str
    in_degrees: bool


def derived(of: str, **which: tuple[str, ...]) -> Callable[[type[S]], type[S]]:
    """Add the fields of a class or function, `module:name`, to a section that does not have them.

    A field that the section itself has without a description, because its type in a file differs, gets the description,
    too. without: fields that no file gives. only: fields to add; none: all others. first: keys before these in the file
    and in displays; keys of the section alone come after them. Raises `TypeError` for a plain number that is in
    neither, as its domain is not declared.
    """
    return lambda section: _extended(section, section.__name__, of, {}, **which)


def _extended(
    section: type[S],
    name: str,
    of: str,
    fields: dict[str, Any],
    *,
    without: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
    first: tuple[str, ...] = (),
) -> type[S]:
    """Return a section with further fields and those of a class or function."""
    chosen = []
    for declared in _declared(of):
        own, key = section.model_fields.get(declared.key), declared.key
        annotation = _type(declared.type) if own is None else section.__annotations__.get(key, own.annotation)
        if key == "kind" or key in without or (only and key not in only):
            continue
        if annotation is None:
            if declared.type in ("int", "float"):
                raise TypeError(f"{of}.{declared.name}: expected a type of vedette.models.fields; got {declared.type}")
            continue
        chosen.append(declared)
        if own is None or own.description is None:
            fields[key] = (annotation, _field(declared))
    found: Any = create_model(name, __base__=section, __module__=section.__module__, **fields)
    found.__doc__, found.of, found.declared = _summary(of) if "kind" in fields else section.__doc__, of, tuple(chosen)
    order = dict.fromkeys(("kind", *first, *[each.key for each in chosen], *found.model_fields))
    found.__pydantic_fields__ = {key: found.model_fields[key] for key in order if key in found.model_fields}
    for word, text in _WORDS.findall(_source(of)):
        setattr(found, word, text)
    made: type[S] = found
    return made


def one_of(
    room: str, folder: str, gives: str = "", own: tuple[type[Section], ...] = (), parent: type[Part] = Part
) -> Any:
    """Return the type of a field for the parts of a room, such as "search": one section for each `kind`.

    folder: of the modules in which parts are marked by `vedette.models.fields.part`. gives: class or protocol of custom
    parts, with any further text of their description. own: sections that extend the class they are derived from, in
    place of generated ones. parent: of the others.
    """
    sections = {section.model_fields["kind"].default: section for section in own}
    for kind, of in _marked(folder)[room]:
        if kind not in sections:
            sections[kind] = _importable(_extended(parent, _name(room, kind), of, _kind(room, kind)))
    if gives:
        path, more = re.fullmatch(r"([\w.:]+)(.*)", gives).groups()  # type: ignore[union-attr]
        custom: Any = create_model(
            _name(room, "custom"), __base__=_OwnPart, __module__=__name__, **_kind(room, "custom")
        )
        custom.__doc__, custom.gives = f"A user's own `{path.replace(':', '.')}`{more}.", path
        sections["custom"] = _importable(custom)
    ordered = sorted(sections, key=lambda kind: (kind == "custom", kind))
    return Annotated[Union[tuple(sections[kind] for kind in ordered)], Field(discriminator="kind")]  # noqa: UP007


def _importable(section: Any) -> Any:
    """Return a section that no module defines, as a name of this module, so that workers can unpickle it."""
    section.__module__ = __name__
    globals()[section.__name__] = section
    return section


def of_kind(kind: str) -> Any:
    """Return the default of a field: its part of this kind, as in a file."""
    return {"kind": kind}


def _name(room: str, kind: str) -> str:
    return f"{kind}_{room}".title().replace("_", "")


def _kind(room: str, kind: str) -> dict[str, Any]:
    """Return the field `kind` of a section."""
    return {"kind": (Literal[kind], Field(default=kind, description=f"Kind of {room} [-]."))}


@cache
def _text(file: Path) -> str:
    return file.read_text("utf-8")


@cache
def _source(of: str) -> str:
    """Return the source of a class or function with its decorators; of a class up to its first method."""
    module, _, name = of.partition(":")
    text = _text(_ROOT / (module.partition(".")[2].replace(".", "/") + ".py"))
    head = re.search(rf"(?m)^(?:@.*\n)*(?:class|def) {name}\b", text)
    assert head is not None, of
    end = re.compile(r"\n\n    (?:@|def )|\n(?=[^\s)])").search(text, head.end())
    return text[head.start() : end.start() if end else None]


@cache
def _definition(of: str) -> Definition:
    return cast(Definition, ast.parse(_source(of)).body[0])


@cache
def _marked(folder: str) -> dict[str, list[tuple[str, str]]]:
    """Return by room the kind, and module and name, of the parts that are marked in the modules of a folder."""
    marked = defaultdict[str, list[tuple[str, str]]](list)
    for file in sorted((_ROOT / folder).glob("*.py")):
        module = ".".join(("vedette", *file.relative_to(_ROOT).with_suffix("").parts))
        for kind, room, name in _MARK.findall(_text(file)):
            marked[room].append((kind, f"{module}:{name}"))
    return marked


def _summary(of: str) -> str:
    """Return the first paragraph of the docstring."""
    return inspect.cleandoc(ast.get_docstring(_definition(of)) or "").partition("\n\n")[0]


def _entries(text: str) -> dict[str, str]:
    """Return the description of each field or parameter in a docstring."""
    descriptions: dict[str, str] = {}
    names: list[str] = []
    for line in text.splitlines():
        entry = _ENTRY.fullmatch(line)
        names = entry[1].split(", ") if entry else names if line.startswith(" " * 8) else []
        for name in names:
            descriptions[name] = entry[2] if entry else f"{descriptions[name]} {line.strip()}"
    return descriptions


@cache
def _declared(of: str) -> tuple[Declared, ...]:
    node = _definition(of)
    entries = _entries(ast.get_docstring(node) or "")
    marks = [mark for mark in node.decorator_list if isinstance(mark, ast.Call)]
    keys = {ast.literal_eval(word.value): word.arg for mark in marks for word in mark.keywords if word.arg}
    stated = _fields(node) if isinstance(node, ast.ClassDef) else _parameters(node)
    fields = []
    for name, kind, default in stated:
        key = keys.get(name) or re.sub("_rad$", "_deg", name)
        in_degrees = key.endswith("_deg") and not name.endswith("_deg")
        default_text = None if default is None else ast.unparse(default)
        fields.append(Declared(key, name, kind, default_text, entries.get(name, ""), in_degrees))
    return tuple(fields)


def _fields(node: ast.ClassDef) -> Iterator[tuple[str, str, ast.expr | None]]:
    for item in node.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            kind = ast.unparse(item.annotation)
            if not kind.startswith("ClassVar"):
                yield item.target.id, kind, item.value


def _parameters(node: ast.FunctionDef) -> Iterator[tuple[str, str, ast.expr | None]]:
    of, later = node.args.args, node.args.kwonlyargs
    defaults = [*[None] * (len(of) - len(node.args.defaults)), *node.args.defaults, *node.args.kw_defaults]
    for argument, default in zip((*of, *later), defaults, strict=True):
        yield argument.arg, ast.unparse(argument.annotation) if argument.annotation else "", default


def _type(words: str) -> Any:
    """Return the type of a field in a section; None for one that no file gives."""
    if words == "Sequence[float]":
        return base.Reals
    try:
        kind = eval(words, _TYPES)  # the library's own source
    except (NameError, TypeError):
        return None
    return kind | None if words == "Limit" else kind


def _field(declared: Declared) -> Any:
    default: Any = ...
    if declared.default is not None:
        default = eval(declared.default, _CONSTANTS)
        if isinstance(default, float) and declared.in_degrees:
            default = math.degrees(default)
        default = None if default == math.inf else default
    text = re.sub(r"^\(\w+,\) ", "", declared.description).rstrip(".")
    text = text[:1].upper() + text[1:]
    if declared.in_degrees:
        text = text.replace("[rad", "[deg")
    unit = "" if text.endswith("]") else " [-]"
    return Field(default, description=f"{text}{unit}.")
