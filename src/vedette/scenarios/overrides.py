"""A scenario with some of its fields changed, each named by its path, such as `sensors.*.clutter.rate`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from vedette.errors import ScenarioError
from vedette.scenarios.diagnostics import Path, format_path, shown_key
from vedette.scenarios.loading import Scenario, diagnose
from vedette.scenarios.validation import suggestion
from vedette.scenarios.yaml_reader import Document

ALL_ITEMS = "*"
_INDEX = re.compile(r"[0-9]{1,9}")


def replace_fields(scenario: Scenario, fields: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other values at some fields, checked as a whole like a file.

    Args:
        scenario: to be changed; it stays as it is.
        fields: values by path. A path is the keys that lead to a field, joined by dots; a number counts the items of a
            list from 0, and `*` stands for each of them. A value may be a whole section. Sensors contain the values
            from `sensor_defaults`, so shared values are set by `sensors.*`.

    Raises:
        ScenarioError: a path that leads nowhere, or all faults of the resulting scenario.
    """
    if not fields:
        return scenario
    data = scenario.model.model_dump(mode="json")
    explicit = scenario.model.model_dump(mode="json", exclude_defaults=True)
    faults = [fault for path, value in fields.items() for fault in _set(data, explicit, path, value)]
    if faults:
        raise ScenarioError(faults)
    model, remaining = diagnose(Document(scenario.name, data, {}, {}, []), scenario.folder)
    if model is None:
        raise ScenarioError([fault.diagnostic.message for fault in remaining])
    return Scenario(model, scenario.path)


def _set(data: Any, explicit: Any, path: str, value: Any) -> Iterator[str]:
    """Set the value everywhere the path leads, in place; yields faults of the path. explicit: without defaults."""
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
            missing = _reset_keys(_value_at((*place, key), explicit), value)
            if missing:
                example = f"{shown_key(path)}.{shown_key(str(next(iter(value), missing[0])))}"
                yield (
                    f"{shown_key(path)}: expected the whole section, with {missing[0]} too, got a part of it "
                    f'(a field is set by its path in quotes: "{example}")'
                )
                return
            holder[key] = value


def _value_at(path: Path, explicit: Any) -> Any:
    """Return the value at a path; None if it is the default."""
    for part in path:
        if isinstance(explicit, dict):
            explicit = explicit.get(part)
        else:
            explicit = (
                explicit[part]
                if isinstance(explicit, list) and isinstance(part, int) and part < len(explicit)
                else None
            )
    return explicit


def _reset_keys(present: Any, value: Any) -> list[str]:
    """Return the keys of a section that a new one would silently reset to defaults; none if the new one gives a kind.

    present: the section, without defaults. Keys with the value None are not counted.
    """
    if not isinstance(present, dict) or not isinstance(value, dict) or "kind" in value:
        return []
    return sorted({key for key, own in present.items() if own is not None} - value.keys())


def _keys(holder: Any, place: Path, part: str, path: str) -> tuple[list[Any], str]:
    """Return the keys or indices that one part of a path means in a mapping or list, or else the fault of the path."""
    where = format_path(place) or "the scenario"
    if isinstance(holder, list):
        if part == ALL_ITEMS:
            return list(range(len(holder))), ""
        if _INDEX.fullmatch(part) and int(part) < len(holder):
            return [int(part)], ""
        return (
            [],
            f"{shown_key(path)}: expected * or a number below {len(holder)} after {where}, got '{shown_key(part)}'",
        )
    if not isinstance(holder, dict):
        return (
            [],
            f"{shown_key(path)}: expected a section at {where} for '{shown_key(part)}' to be in, got a single value",
        )
    if part not in holder:
        hint = "what sensors share is set by sensors.*" if part == "sensor_defaults" else suggestion(part, list(holder))
        known = ", ".join(sorted(holder))
        fault = f"expected one of {known} in {where}, got '{shown_key(part)}'"
        return [], f"{shown_key(path)}: {fault}" + (f" ({hint})" if hint else "")
    return [part], ""
