"""A scenario with some of its fields changed, each named by its path, such as `sensors.*.clutter.rate`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from vedette.errors import ScenarioError
from vedette.scenarios.diagnostics import suggestion
from vedette.scenarios.faults import Path, format_path, named
from vedette.scenarios.loading import Scenario, diagnose
from vedette.scenarios.yaml_reader import Document

EVERY = "*"
_INDEX = re.compile(r"[0-9]{1,9}")


def with_fields(scenario: Scenario, fields: Mapping[str, Any]) -> Scenario:
    """The scenario with other values at some fields, checked as a whole as if its file had said so.

    Args:
        scenario: what is changed; it stays as it is.
        fields: values by path. A path is the keys that lead to a field, joined by dots; a number counts the items of a
            list from 0, and `*` stands for each of them. A value may be a whole section. Sensors hold what
            `sensor_defaults` gave them, so what they share is set by `sensors.*`.

    Raises:
        ScenarioError: a path that leads nowhere, or everything that is wrong with the scenario that would result.
    """
    if not fields:
        return scenario
    data = scenario.model.model_dump(mode="json")
    said = scenario.model.model_dump(mode="json", exclude_defaults=True)
    faults = [fault for path, value in fields.items() for fault in _set(data, said, path, value)]
    if faults:
        raise ScenarioError(faults)
    model, found = diagnose(Document(scenario.name, data, {}, {}, []), scenario.folder)
    if model is None:
        raise ScenarioError([fault.told.message for fault in found])
    return Scenario(model, scenario.path)


def _set(data: Any, said: Any, path: str, value: Any) -> Iterator[str]:
    """Set the value everywhere the path leads, in place; what is wrong with the path. said: what is no default."""
    *parents, last = path.split(".")
    places: list[tuple[Path, Any]] = [((), data)]
    for part in parents:
        inner: list[tuple[Path, Any]] = []
        for place, holder in places:
            keys, fault = _keys(holder, place, part, path)
            if fault:
                yield fault
                return
            inner += [((*place, key), holder[key]) for key in keys]
        places = inner
    for place, holder in places:
        keys, fault = _keys(holder, place, last, path)
        if fault:
            yield fault
            return
        for key in keys:
            missing = _left_out(_at((*place, key), said), value)
            if missing:
                one = f"{named(path)}.{named(str(next(iter(value), missing[0])))}"
                yield (
                    f"{named(path)}: expected the whole section, with {missing[0]} too, got a part of it "
                    f'(a field is set by its path in quotes: "{one}")'
                )
                return
            holder[key] = value


def _at(path: Path, said: Any) -> Any:
    """What stands at a path; None where it is left at its default."""
    for part in path:
        if isinstance(said, dict):
            said = said.get(part)
        else:
            said = said[part] if isinstance(said, list) and isinstance(part, int) and part < len(said) else None
    return said


def _left_out(present: Any, value: Any) -> list[str]:
    """Keys of a section without which a new one would fall back on defaults unseen; one of another kind may.

    present: the section, of what is no default. What is null falls back on nothing.
    """
    if not isinstance(present, dict) or not isinstance(value, dict) or "kind" in value:
        return []
    return sorted({key for key, own in present.items() if own is not None} - value.keys())


def _keys(holder: Any, place: Path, part: str, path: str) -> tuple[list[Any], str]:
    """The keys or indices that one part of a path means inside a mapping or list, or else what is wrong with it."""
    where = format_path(place) or "the scenario"
    if isinstance(holder, list):
        if part == EVERY:
            return list(range(len(holder))), ""
        if _INDEX.fullmatch(part) and int(part) < len(holder):
            return [int(part)], ""
        return [], f"{named(path)}: expected * or a number below {len(holder)} after {where}, got '{named(part)}'"
    if not isinstance(holder, dict):
        return [], f"{named(path)}: expected a section at {where} for '{named(part)}' to be in, got a single value"
    if part not in holder:
        hint = "what sensors share is set by sensors.*" if part == "sensor_defaults" else suggestion(part, list(holder))
        known = ", ".join(sorted(holder))
        found = f"expected one of {known} in {where}, got '{named(part)}'"
        return [], f"{named(path)}: {found}" + (f" ({hint})" if hint else "")
    return [part], ""
