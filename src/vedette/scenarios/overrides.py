"""A scenario with some of its fields changed, each named by its path, such as `sensors.*.clutter.rate`."""

import re
from collections.abc import Mapping
from typing import Any

from vedette.errors import InputError, ScenarioError
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
    faults = []
    for path, value in fields.items():
        try:
            _set(data, explicit, path, value)
        except InputError as fault:
            faults.append(str(fault))
    if faults:
        raise ScenarioError(faults)
    model, remaining = diagnose(Document(scenario.name, data, {}, {}, []), scenario.folder)
    if model is None:
        raise ScenarioError([fault.diagnostic.message for fault in remaining])
    return Scenario(model, scenario.path)


def _set(data: Any, explicit: Any, path: str, value: Any) -> None:
    """Set the value everywhere the path leads, in place; raises `InputError` for a faulty path.

    explicit: the data without defaults.
    """
    *parents, last = path.split(".")
    places: list[tuple[Path, Any]] = [((), data)]
    for part in parents:
        places = [((*at, key), holder[key]) for at, holder in places for key in _keys(holder, at, part, path)]
    for at, holder in places:
        for key in _keys(holder, at, last, path):
            if missing := _reset_keys(_value_at((*at, key), explicit), value):
                example = f"{shown_key(path)}.{shown_key(str(next(iter(value), missing[0])))}"
                raise InputError(
                    f"{shown_key(path)}: expected the whole section, with {missing[0]} too, got a part of it "
                    f'(a field is set by its path in quotes: "{example}")'
                )
            holder[key] = value


def _value_at(path: Path, explicit: Any) -> Any:
    """Return the value at a path; None if it is the default."""
    for part in path:
        try:
            explicit = explicit[part]
        except (KeyError, IndexError, TypeError):
            return None
    return explicit


def _reset_keys(present: Any, value: Any) -> list[str]:
    """Return the keys of a section that a new one would silently reset to defaults; none if the new one gives a kind.

    present: the section, without defaults. Keys with the value None are not counted.
    """
    if not isinstance(present, dict) or not isinstance(value, dict) or "kind" in value:
        return []
    return sorted({key for key, own in present.items() if own is not None} - value.keys())


def _keys(holder: Any, place: Path, part: str, path: str) -> list[Any]:
    """Return the keys or indices that one part of a path means in a mapping or list. Raises `InputError` for others."""
    where, shown = format_path(place) or "the scenario", shown_key(part)
    if isinstance(holder, list):
        if part == ALL_ITEMS:
            return list(range(len(holder)))
        if _INDEX.fullmatch(part) and int(part) < len(holder):
            return [int(part)]
        fault = f"expected * or a number below {len(holder)} after {where}, got '{shown}'"
    elif not isinstance(holder, dict):
        fault = f"expected a section at {where} for '{shown}' to be in, got a single value"
    elif part in holder:
        return [part]
    else:
        hint = "what sensors share is set by sensors.*" if part == "sensor_defaults" else suggestion(part, list(holder))
        fault = f"expected one of {', '.join(sorted(holder))} in {where}, got '{shown}'{f' ({hint})' if hint else ''}"
    raise InputError(f"{shown_key(path)}: {fault}")
