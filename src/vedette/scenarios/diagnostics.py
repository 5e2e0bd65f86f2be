"""Faults of a scenario's data: what the schema objects to, in the words and at the places of the file."""

from __future__ import annotations

import difflib
import re
import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vedette.scenarios.faults import Fault, Path, describe
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.yaml_reader import Document

# pydantic's error types and what was expected; `{}` takes a value of the error's context.
_EXPECTED = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "a word or text in quotes",
    "bool_type": "true or false",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number of at least {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "a number of at most {le:g}",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "string_too_short": "text of at least {min_length} character",
    "expected": "{expected}",
}

_UNKNOWN = "an unknown key"
_LONGEST_WORD = 100  # comparing words takes the product of their lengths


def options(annotation: Any) -> Iterator[Any]:
    """The types that an annotation allows, without `Annotated` and unions around them."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from options(get_args(annotation)[0])
    elif origin in (Union, types.UnionType):
        for option in get_args(annotation):
            yield from options(option)
    else:
        yield annotation


def _models(annotation: Any) -> list[type[BaseModel]]:
    return [option for option in options(annotation) if isinstance(option, type) and issubclass(option, BaseModel)]


def kind_of(model: type[BaseModel]) -> str | None:
    """The value of `kind` that selects a model, or None where it is not one of several."""
    field = model.model_fields.get("kind")
    return None if field is None else str(field.default)


def _item(annotation: Any, index: int) -> Any:
    for option in options(annotation):
        if get_origin(option) is tuple:
            arguments = get_args(option)
            return arguments[0] if arguments[-1] is Ellipsis else arguments[min(index, len(arguments) - 1)]
    return None


def locate(loc: tuple[str | int, ...]) -> tuple[Path, Any]:
    """Path in the data of a pydantic error location, and the annotation of what stands there.

    The location also names the member of a union that was tried; the data does not.
    """
    path: list[str | int] = []
    annotation: Any = ScenarioModel
    for position, part in enumerate(loc):
        models = _models(annotation)
        tagged = [model for model in models if kind_of(model) == part]
        if len(models) > 1 and tagged:
            annotation = tagged[0]
        elif isinstance(part, int):
            path.append(part)
            annotation = _item(annotation, part)
        elif models:
            path.append(part)
            field = models[0].model_fields.get(part)
            annotation = None if field is None else field.annotation
        elif any(get_origin(option) is dict for option in options(annotation)):
            return (*path, *loc[position:]), None
    return tuple(path), annotation


def suggestion(word: str, known: list[str]) -> str:
    """`did you mean ...?`, or empty where nothing is near."""
    if len(word) > _LONGEST_WORD:
        return ""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.66)
    return f"did you mean {near[0]}?" if near else ""


def _one_of(words: list[str]) -> str:
    return words[0] if len(words) == 1 else "one of " + ", ".join(words)


def _unknown_key(path: Path, loc: tuple[str | int, ...]) -> tuple[str, str, str]:
    models = _models(locate(loc[:-1])[1])
    known = sorted(models[0].model_fields) if models else []
    hint = suggestion(str(path[-1]), known)
    if path[-1] == "<<":
        hint = "YAML 1.2 has no merge keys; sensor_defaults holds what sensors share"
    return _one_of(known), _UNKNOWN, hint


def _kind_fault(error: ErrorDetails, path: Path, annotation: Any) -> tuple[Path, str, str, str]:
    kinds = [kind for model in _models(annotation) if (kind := kind_of(model))]
    if error["type"] == "union_tag_not_found":
        return path, f"a mapping with kind: {_one_of(kinds)}", "no kind", ""
    tag = error["input"].get("kind")
    hint = suggestion(tag, kinds) if isinstance(tag, str) else ""
    return (*path, "kind"), _one_of(kinds), describe(tag), hint


def _literals(annotation: Any) -> list[str]:
    literals = [option for option in options(annotation) if get_origin(option) is Literal]
    return [describe(value).strip('"') for literal in literals for value in get_args(literal)]


def _expected(error: ErrorDetails, annotation: Any) -> str:
    if error["type"] == "literal_error":
        return _one_of(_literals(annotation))
    template = _EXPECTED.get(error["type"])
    if template is None:
        return re.sub(r"^Input should be ", "", error["msg"])
    return template.format(**error.get("ctx", {}))


def _length_fault(error: ErrorDetails, annotation: Any) -> tuple[str, str]:
    fixed = [get_args(option) for option in options(annotation) if get_origin(option) is tuple]
    context = error.get("ctx", {})
    if fixed and fixed[0][-1] is not Ellipsis:
        wanted = str(len(fixed[0]))
    else:
        wanted = f"at least {context['min_length']}" if "min_length" in context else f"at most {context['max_length']}"
    return f"a list of {wanted}", describe(error["input"])


def _translate(error: ErrorDetails) -> tuple[Path, str, str, str]:
    """Path, expected, got and hint of one error of pydantic's."""
    path, annotation = locate(error["loc"])
    match error["type"]:
        case "extra_forbidden":
            return (path, *_unknown_key(path, error["loc"]))
        case "union_tag_invalid" | "union_tag_not_found":
            return _kind_fault(error, path, annotation)
        case "too_short" | "too_long":
            return (path, *_length_fault(error, annotation), "")
        case "missing" if isinstance(path[-1], int):
            return (path[:-1], *_length_fault(error, locate(error["loc"][:-1])[1]), "")
        case "missing":
            return path, "a value, as it is required", "nothing", ""
        case "literal_error" if isinstance(error["input"], str):
            hint = suggestion(error["input"], _literals(annotation))
            return path, _expected(error, annotation), describe(error["input"]), hint
    context = error.get("ctx", {})
    at, value = context.get("at", ()), error["input"]
    for part in at:
        value = value[part]
    return (*path, *at), _expected(error, annotation), context.get("got") or describe(value), ""


def _written_path(path: Path, data: Any) -> Path:
    """Where the file says what stands at `path`: a sensor's value may come from `sensor_defaults`."""
    if len(path) < 3 or path[0] != "sensors" or not isinstance(data, Mapping):
        return path
    sensors, defaults = data.get("sensors"), data.get("sensor_defaults")
    own = sensors[path[1]] if isinstance(sensors, list) and isinstance(path[1], int) else None
    if isinstance(own, Mapping) and path[2] not in own and isinstance(defaults, Mapping) and path[2] in defaults:
        return ("sensor_defaults", *path[2:])
    return path


def place_fault(document: Document, path: Path, expected: str, got: str, hint: str = "") -> Fault:
    """A fault at the place in the file of the data's `path`."""
    written = _written_path(path, document.data)
    at_key = got == _UNKNOWN or written not in document.value_places
    place = document.place(written) if at_key else document.value_place(written)
    return Fault(place, written, expected, got, hint)


def _is_echo(error: ErrorDetails) -> bool:
    """Whether pydantic counts a list as too short because items of it are faulty."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _merge_alternatives(found: list[tuple[Path, str, str, str]]) -> list[tuple[Path, str, str, str]]:
    """One entry for each path: the members of a union each say what they expected, unless one got further inside."""
    around = {path[:length] for path, *_ in found for length in range(len(path))}
    merged: dict[tuple[Path, str], tuple[list[str], str]] = {}
    for path, expected, got, hint in found:
        if path in around:
            continue
        expectations, hints = merged.get((path, got), ([], ""))
        merged[(path, got)] = ([*expectations, *([] if expected in expectations else [expected])], hints or hint)
    return [(path, " or ".join(wanted), got, hint) for (path, got), (wanted, hint) in merged.items()]


def validation_faults(document: Document, error: ValidationError) -> list[Fault]:
    """The faults behind an error of pydantic's, each at its place in the file."""
    errors = [detail for detail in error.errors(include_url=False) if not _is_echo(detail)]
    found = [entry for entry in map(_translate, errors) if _written_path(entry[0], document.data) == entry[0]]
    return [place_fault(document, *entry) for entry in _merge_alternatives(found)]
