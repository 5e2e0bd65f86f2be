"""What a tracking loop holds, in a file: states, random numbers, counters; taken up again as if nothing had been.

A file is NumPy's .npz: arrays of their own, and a text that says how they hang together. What stands there twice is one
object again, as some trackers tell by that who believes the same. Nothing is unpickled: objects are made by the
constructors, and their checks, of the library's own data classes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from vedette.errors import InputError, VedetteError
from vedette.internal.files import write_file
from vedette.internal.reading import error_summary, parse_json, read_arrays, read_file, unreadable
from vedette.internal.text import shown
from vedette.models.arguments import reject

FORMAT_NAME = "vedette-snapshot"
FORMAT_VERSION = 1

# The rooms whose data classes may stand in a file; they hold arrays and open nothing.
_ROOMS = ("densities", "filters", "fusion", "tracking", "models", "control", "calibration", "kernels.base")
_BITS = {kind.__name__: kind for kind in (np.random.PCG64, np.random.PCG64DXSM, np.random.SFC64, np.random.Philox)}
_PLAIN = (bool, int, str, type(None))


def save_snapshot(path: str | os.PathLike[str], parts: Mapping[str, Any]) -> None:
    """Write what a loop holds to `path`. The file appears whole or not at all.

    Args:
        path: of the file, which is replaced.
        parts: by names of your own: states of trackers, timelines, densities, generators of random numbers, arrays,
            numbers, texts, and tuples, lists and dictionaries of these.

    Raises:
        InputError: something else, named by where it is; or a path that cannot be written.
    """
    writing = _Writing()
    root = writing.node(dict(parts), "parts")
    text = json.dumps({"format": FORMAT_NAME, "version": FORMAT_VERSION, "root": root, "nodes": writing.nodes})
    arrays = {"structure": np.frombuffer(text.encode(), np.uint8)}
    arrays |= {f"array{i}": array for i, array in enumerate(writing.arrays)}
    write_file(Path(path), lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]


def load_snapshot(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The parts that `save_snapshot` wrote, every bit of every number as it was.

    Raises:
        InputError: a file that is missing, damaged, of another origin or a later version, or that holds what no such
            object can be made of.
    """
    source = Path(path)
    try:
        arrays = read_arrays(read_file(source))
        structure = parse_json(arrays["structure"].tobytes()) if "structure" in arrays else None
    except OSError as fault:
        raise unreadable(source, "a snapshot", fault) from fault
    except ValueError as fault:
        raise InputError(f"{source}: expected a snapshot; it is damaged or another: {fault}") from fault
    if not isinstance(structure, dict) or structure.get("format") != FORMAT_NAME:
        raise InputError(f"{source}: expected a file of format {FORMAT_NAME}; got one of another origin")
    if structure.get("version") != FORMAT_VERSION:
        raise InputError(
            f"{source}: expected format version {FORMAT_VERSION}; got {error_summary(structure.get('version'))}"
        )
    try:
        parts = _Reading(arrays, structure["nodes"]).value(structure["root"])
    except VedetteError as fault:
        raise InputError(f"{source}: expected valid parts; {fault}") from fault
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError) as fault:
        raise InputError(f"{source}: expected a snapshot; it is damaged: {error_summary(fault)}") from fault
    if not isinstance(parts, dict):
        raise InputError(f"{source}: expected named parts; got {type(parts).__name__}")
    return parts


class _Writing:
    """Nodes of a structure that refer to each other by number."""

    def __init__(self) -> None:
        self.nodes: list[list[Any]] = []
        self.arrays: list[np.ndarray[Any, Any]] = []
        self._numbers: dict[int, int] = {}
        self._kept: list[Any] = []  # so that no two of the ids are of one after the other

    def node(self, value: Any, place: str) -> int:
        """The number of the node of a value."""
        if id(value) in self._numbers:
            return self._numbers[id(value)]
        made = self._made(value, place)
        self.nodes.append(made)
        number = len(self.nodes) - 1
        self._numbers[id(value)] = number
        self._kept.append(value)
        return number

    def _made(self, value: Any, place: str) -> list[Any]:
        if isinstance(value, np.generic):
            value = np.asarray(value) if not isinstance(value, float | int | str) else value
        if type(value) in _PLAIN:
            return ["plain", value]
        if isinstance(value, float):
            return ["float", float(value).hex()]
        if isinstance(value, np.ndarray):
            if value.dtype.hasobject:
                raise reject(place, "an array of numbers", f"one of {value.dtype}")
            self.arrays.append(value)
            return ["array", len(self.arrays) - 1]
        if isinstance(value, np.random.Generator):
            return self._generator(value, place)
        if type(value) in (tuple, list):
            return [type(value).__name__, [self.node(item, f"{place}[{i}]") for i, item in enumerate(value)]]
        if type(value) is dict:
            return ["dict", [[self.node(k, place), self.node(v, f"{place}[{k!r}]")] for k, v in value.items()]]
        return self._object(value, place)

    def _generator(self, value: np.random.Generator, place: str) -> list[Any]:
        bits = value.bit_generator
        if type(bits).__name__ not in _BITS:
            raise reject(place, f"a generator by {', '.join(_BITS)}", type(bits).__name__)
        return ["generator", type(bits).__name__, self.node(dict(bits.state), place)]

    def _object(self, value: Any, place: str) -> list[Any]:
        kind = type(value)
        names = _field_names(kind)
        if names is None or _class_of(kind.__module__, kind.__qualname__) is not kind:
            expected = (
                "arrays, numbers, texts, generators, data classes of this library, and tuples, lists, dicts of them"
            )
            raise reject(place, expected, f"a {kind.__module__}.{kind.__qualname__}")
        return [
            "object",
            kind.__module__,
            kind.__qualname__,
            {name: self.node(getattr(value, name), f"{place}.{name}") for name in names},
        ]


class _Reading:
    """The values of nodes, each made once."""

    def __init__(self, arrays: Mapping[str, Any], nodes: list[list[Any]]) -> None:
        self._arrays, self._nodes = arrays, nodes
        self._made: dict[int, Any] = {}
        self._makers: dict[str, Callable[..., Any]] = {
            "plain": self._plain,
            "float": float.fromhex,
            "array": lambda number: np.array(self._arrays[f"array{number}"]),
            "generator": self._generator,
            "tuple": lambda items: tuple(map(self.value, items)),
            "list": lambda items: list(map(self.value, items)),
            "dict": lambda pairs: {self.value(key): self.value(value) for key, value in pairs},
            "object": self._object,
        }

    def value(self, number: int) -> Any:
        """The value of a node. A node refers to earlier ones only, so that no circle can be written."""
        if number not in self._made:
            kind, *content = self._nodes[number]
            self._made[number] = self._makers[kind](*content)
        return self._made[number]

    def _plain(self, value: Any) -> Any:
        if type(value) not in _PLAIN:
            raise ValueError(f"expected a plain value; got {type(value).__name__}")
        return value

    def _generator(self, name: str, state: int) -> np.random.Generator:
        bits = _BITS[name]()
        bits.state = self.value(state)
        return np.random.Generator(bits)

    def _object(self, module: str, name: str, numbers: Mapping[str, int]) -> Any:
        kind = _class_of(module, name)
        if kind is None:
            raise ValueError(f"{shown(f'{module}.{name}')} is no data class that a snapshot may hold")
        if set(numbers) != set(_field_names(kind) or ()):
            raise ValueError(f"{name}: expected fields {', '.join(_field_names(kind) or ())}")
        return kind(**{field: self.value(number) for field, number in numbers.items()})


def _field_names(kind: type) -> tuple[str, ...] | None:
    """The arguments of a data class or named tuple; None of anything else."""
    if is_dataclass(kind):
        return tuple(field.name for field in fields(kind) if field.init)
    return getattr(kind, "_fields", None) if issubclass(kind, tuple) else None


def _class_of(module: str, name: str) -> Any:
    """A data class or named tuple of the library by its name; None of anything else."""
    if not any(module == f"vedette.{room}" or module.startswith(f"vedette.{room}.") for room in _ROOMS):
        return None
    try:
        found = getattr(import_module(module), name, None)
    except ImportError:
        return None
    return found if isinstance(found, type) and _field_names(found) is not None else None
