"""Campaign files and specifications with former names: changes to the present ones, and files rewritten with them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import reduce
from pathlib import Path
from typing import Any

from vedette.campaigns.spec import MOST_BYTES, parse_toml
from vedette.errors import InputError
from vedette.internal.reading import read_text
from vedette.scenarios.diagnostics import Path as Keys
from vedette.scenarios.renamed import STRATEGIES, Change, changed, changes, present_key
from vedette.scenarios.upgrading import Line, line_of, upgrade_text_file


def present_field(field: str) -> str:
    """Return the path of a scenario field, such as `sensors.*.scans.every`, with present names."""
    keys: Keys = ()
    for key in field.split("."):
        keys = (*keys, present_key((*keys, key)) or key)
    return ".".join(map(str, keys))


def spec_changes(data: Mapping[str, Any]) -> Iterator[Change]:
    """Yield the changes of the plain data of a specification, the innermost first."""
    planners, variants = data.get("planners"), data.get("variants")
    for index, name in enumerate(planners if isinstance(planners, list) else ()):
        if isinstance(name, str) and name in STRATEGIES:
            yield Change(("planners", index), False, name, STRATEGIES[name])
    yield from _field_changes(data.get("set"), ("set",))
    for index, variant in enumerate(variants if isinstance(variants, list) else ()):
        if isinstance(variant, Mapping):
            yield from _field_changes(variant.get("set"), ("variants", index, "set"))
    yield from _field_changes(data.get("grid"), ("grid",), are_lists=True)
    compare = data.get("compare")
    if isinstance(compare, str) and present_field(compare) != compare:
        yield Change(("compare",), False, compare, present_field(compare))


def _field_changes(fields: Any, path: Keys, *, are_lists: bool = False) -> Iterator[Change]:
    for field, value in fields.items() if isinstance(fields, Mapping) else ():
        present = present_field(field)
        present_path = tuple(present.split("."))
        if are_lists and isinstance(value, list):
            for index, each in enumerate(value):
                yield from changes(each, present_path, (*path, field, index))
        else:
            yield from changes(value, present_path, (*path, field))
        if present != field:
            yield Change((*path, field), True, field, present)


def with_present_names(data: dict[str, Any]) -> dict[str, Any]:
    """Return the plain data of a specification with present names."""
    renamed: dict[str, Any] = reduce(changed, list(spec_changes(data)), data)
    return renamed


def upgraded_toml(text: str, file: str = "<text>") -> tuple[str, list[Line]]:
    """Return the text of a campaign file with present names, and its changes in file order.

    Raises `InputError` for text that is no campaign file, a former and the present name in one place, and a former name
    that is written in a way that cannot be edited.
    """
    data, lines = parse_toml(text, file), list[Line]()
    if "scenarios" not in data:
        raise InputError(f"{file}: expected a campaign file, with `scenarios`; got another file")
    for change in list(spec_changes(data)):
        try:
            data = changed(data, change)
        except KeyError as error:
            raise InputError(f"{file}: expected one of {change.former} and {error.args[0]}, got both") from None
        offset, text = _edited(text, change, data, file)
        lines.append(line_of(change, text.count("\n", 0, offset) + 1))
    return text, sorted(lines, key=lambda line: line.number)


def _edited(text: str, change: Change, expected: Any, file: str) -> tuple[int, str]:
    """Return where one change was made in the text, and the text that has the wanted data.

    TOML's parser reports no places, so each place where the name occurs is tried.
    """
    name = re.escape(change.former)
    written = rf"(?<![\w-]){name}(?![\w-])" if change.is_key else rf"(?<=\"){name}(?=\")|(?<='){name}(?=')"
    present = change.present
    if isinstance(present, bool):
        written, present = rf"\"{name}\"|'{name}'", str(present).lower()
    for match in re.finditer(written, text):
        candidate = text[: match.start()] + present + text[match.end() :]
        try:
            if repr(tomllib.loads(candidate)) == repr(expected):
                return match.start(), candidate
        except ValueError:
            continue
    raise InputError(f"{file}: expected former names without escapes; replace by hand: {change.former} by {present}")


def upgrade_campaign_file(path: Path) -> list[Line]:
    """Rewrite the former names in a campaign file, in place; return the changes, in file order.

    The file is replaced as a whole, or not at all if it is up to date. Raises as `upgraded_toml`, and `InputError` for
    a file that cannot be read or written.
    """
    return upgrade_text_file(path, read_text(path, "campaign file", MOST_BYTES), upgraded_toml)
