"""Faults of a configuration's data: the errors of its sections, with the words and paths of the file."""

import difflib
import re
import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vedette.scenarios.diagnostics import MISSING, Diagnostic, Path, describe
from vedette.scenarios.sections.base import PARTIAL, Section, UnreadableValue
from vedette.scenarios.sections.courses import COURSE_KEYS

S = TypeVar("S", bound=Section)

# What is expected, by pydantic's error type; `{}` takes a value of the error's context.
_EXPECTED = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "a word or text in quotes",
    "bool_type": "true or false",
    "greater_than": "a number above {gt}",
    "greater_than_equal": "a number of at least {ge}",
    "less_than": "a number below {lt}",
    "less_than_equal": "a number of at most {le}",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "string_too_short": "text of at least {min_length} character",
    "invalid-json-value": "text, a number, true or false, a list or a mapping",
    "expected": "{expected}",
}

UNKNOWN_KEY = "an unknown key"
_MAX_WORD_LENGTH = 100  # comparing words takes the product of their lengths


def read_section(section: type[S], data: Mapping[str, Any]) -> tuple[S, list[Diagnostic]]:
    """Return the section in the data and its faults; if there are any, the section is incomplete."""
    data = section.in_metres(data)
    try:
        return section.model_validate(data), []
    except ValidationError:
        partial = section.model_validate(data, context=PARTIAL)
        return partial, list(_faults(partial, section, data, ()))


def _faults(value: Any, annotation: Any, data: Any, path: Path) -> Iterator[Diagnostic]:
    """Yield all faults of a value of an incomplete section, section by section."""
    if isinstance(value, UnreadableValue):
        errors = (error for error in value.errors if not _is_secondary(error))
        yield from _merge_alternatives([_translate(error, annotation, path) for error in errors])
    elif isinstance(value, Section):
        fields = type(value).model_fields
        for name, field in fields.items():
            inner = data.get(name) if isinstance(data, Mapping) else None
            yield from _faults(getattr(value, name), field.annotation, inner, (*path, name))
        if isinstance(data, Mapping):
            yield from (_unknown_key(path, str(key), sorted(fields)) for key in data if key not in fields)
        yield from (Diagnostic((*path, *at), wanted, got) for at, wanted, got in value.findings())
    elif isinstance(value, tuple):
        items = data if isinstance(data, list) and len(data) == len(value) else [None] * len(value)
        for i, (item, inner) in enumerate(zip(value, items, strict=True)):
            yield from _faults(item, _item_type(annotation, i), inner, (*path, i))
    elif isinstance(value, dict):
        for key, item in value.items():
            inner = data.get(key) if isinstance(data, Mapping) else None
            yield from _faults(item, _value_type(annotation), inner, (*path, key))


def union_members(annotation: Any) -> Iterator[Any]:
    """Yield the types that an annotation allows, without `Annotated` and unions around them."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from union_members(get_args(annotation)[0])
    elif origin in (Union, types.UnionType):
        for option in get_args(annotation):
            yield from union_members(option)
    else:
        yield annotation


def known_kinds(model: type[BaseModel]) -> list[str]:
    """Return the values of `kind` that select a model; none if it is not one of several."""
    field = model.model_fields.get("kind")
    return [] if field is None else _literals(field.annotation)


def _item_type(annotation: Any, index: int) -> Any:
    for option in union_members(annotation):
        if get_origin(option) is tuple:
            arguments = get_args(option)
            return arguments[0] if arguments[-1] is Ellipsis else arguments[min(index, len(arguments) - 1)]
    return None


def _value_type(annotation: Any) -> Any:
    return next((get_args(option)[1] for option in union_members(annotation) if get_origin(option) is dict), None)


def suggestion(word: str, known: list[str]) -> str:
    """Return `did you mean ...?` with the closest known word; empty if none is close."""
    if len(word) > _MAX_WORD_LENGTH:
        return ""
    matches = difflib.get_close_matches(word, known, n=1, cutoff=0.66)
    return f"did you mean {matches[0]}?" if matches else ""


def _one_of(words: list[str]) -> str:
    return words[0] if len(words) == 1 else "one of " + ", ".join(words)


def _unknown_key(path: Path, key: str, known: list[str]) -> Diagnostic:
    hint = suggestion(key, known)
    if key == "<<":
        hint = "YAML 1.2 has no merge keys; sensor_defaults holds what sensors share"
    if key in ("lon_min", "lon_max", "lat_min", "lat_max"):
        hint = "a box of degrees needs an `origin: {lon: , lat: }` of the scenario, and its four ends in order"
    if key in ("speed", "actions_deg", "headings") and "platform" not in path:
        hint = "the platform of a sensor has it: `platform: {kind: heading, speed: 50.0, headings_deg: [0, 90]}`"
    if key in COURSE_KEYS:
        hint = (
            "courses and azimuths count from true north, which needs an `origin` or a sensor with `compass: true`, "
            "and no heading, direction or pointing beside them in the file"
        )
    return Diagnostic((*path, key), _one_of(known), UNKNOWN_KEY, hint)


def _kind_fault(error: ErrorDetails, path: Path, annotation: Any) -> Diagnostic:
    sections = (
        option for option in union_members(annotation) if isinstance(option, type) and issubclass(option, BaseModel)
    )
    kinds = [kind for section in sections for kind in known_kinds(section)]
    if error["type"] == "union_tag_not_found":
        return Diagnostic(path, f"a mapping with kind: {_one_of(kinds)}", "no kind")
    tag = error["input"].get("kind")
    hint = suggestion(tag, kinds) if isinstance(tag, str) else ""
    return Diagnostic((*path, "kind"), _one_of(kinds), describe(tag), hint)


def _literals(annotation: Any) -> list[str]:
    literals = [option for option in union_members(annotation) if get_origin(option) is Literal]
    return [describe(value).strip('"') for literal in literals for value in get_args(literal)]


def _expected(error: ErrorDetails, annotation: Any) -> str:
    if error["type"] == "literal_error":
        return _one_of(_literals(annotation))
    template = _EXPECTED.get(error["type"])
    if template is None:
        return re.sub(r"^Input should be ", "", error["msg"])
    context = error.get("ctx", {})
    return template.format(**{name: f"{x:g}" if isinstance(x, float) else x for name, x in context.items()})


def _length_fault(error: ErrorDetails, annotation: Any) -> tuple[str, str]:
    if isinstance(error["input"], str):
        return f"text of at most {error['ctx']['max_length']} characters", describe(error["input"])
    fixed = [get_args(option) for option in union_members(annotation) if get_origin(option) is tuple]
    context = error.get("ctx", {})
    if fixed and fixed[0][-1] is not Ellipsis:
        wanted = str(len(fixed[0]))
    else:
        wanted = f"at least {context['min_length']}" if "min_length" in context else f"at most {context['max_length']}"
    return f"a list of {wanted}", describe(error["input"])


def _split_location(loc: tuple[str | int, ...], annotation: Any) -> tuple[Path, Any]:
    """Return the path in a field, and the type there, of a pydantic location, which also names members of unions."""
    path: Path = ()
    for part in loc:
        if isinstance(part, int):
            path, annotation = (*path, part), _item_type(annotation, part)
        elif any(get_origin(option) is dict for option in union_members(annotation)):
            path, annotation = (*path, part), _value_type(annotation)
    return path, annotation


def _translate(error: ErrorDetails, annotation: Any, path: Path) -> Diagnostic:
    """Return the fault for one of pydantic's errors in the field at `path`."""
    inner_path, inner_type = _split_location(error["loc"], annotation)
    path = (*path, *inner_path)
    match error["type"]:
        case "union_tag_invalid" | "union_tag_not_found":
            return _kind_fault(error, path, inner_type)
        case "too_short" | "too_long":
            return Diagnostic(path, *_length_fault(error, inner_type))
        case "missing" if inner_path:
            return Diagnostic(path[:-1], *_length_fault(error, _split_location(error["loc"][:-1], annotation)[1]))
        case "missing":
            return Diagnostic(path, "a value", MISSING)
        case "literal_error" if isinstance(error["input"], str):
            return Diagnostic(
                path,
                _expected(error, inner_type),
                describe(error["input"]),
                suggestion(error["input"], _literals(inner_type)),
            )
    if isinstance(error["input"], Mapping) and {"lon", "lat"} & set(error["input"]):
        hint = "places in degrees are `{lon: , lat: }`, both numbers, and need such an `origin` of the scenario"
        given = ", ".join(f"{key}: {describe(value)}" for key, value in error["input"].items())
        return Diagnostic(path, _expected(error, inner_type), f"{{{given}}}", hint)
    return Diagnostic(path, _expected(error, inner_type), describe(error["input"]))


def _is_secondary(error: ErrorDetails) -> bool:
    """Return True if pydantic reports a list as too short only because some of its items are faulty."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _merge_alternatives(diagnostics: list[Diagnostic]) -> list[Diagnostic]:
    """Return one fault for each path; combines what the members of a union expected, unless one got further inside."""
    parents = {path[:length] for path, *_ in diagnostics for length in range(len(path))}
    merged: dict[tuple[Path, str], tuple[list[str], str]] = {}
    for path, wanted, got, hint in diagnostics:
        if path in parents:
            continue
        expectations, hints = merged.get((path, got), ([], ""))
        merged[(path, got)] = ([*expectations, *([] if wanted in expectations else [wanted])], hints or hint)
    return [Diagnostic(path, " or ".join(wanted), got, hint) for (path, got), (wanted, hint) in merged.items()]
