"""Snapshots of a tracking loop in a file: states, random generators and counters, restored exactly.

A file is a NumPy .npz archive of arrays and a JSON text with the structure of the objects. Shared objects are restored
as shared, because some trackers recognise equal beliefs by identity. Nothing is unpickled: objects are built by the
constructors of the library's own data classes, with their checks.
"""

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

# Packages whose data classes may occur in a file; they hold arrays and open no files.
_PACKAGES: tuple[str, ...] = ("densities", "filters", "fusion", "tracking", "models", "control", "calibration")
_PACKAGES += ("kernels.base", "evaluation.fit", "evaluation.innovations", "live.fit", "recorded.merging")
_BITS = {kind.__name__: kind for kind in (np.random.PCG64, np.random.PCG64DXSM, np.random.SFC64, np.random.Philox)}
_PLAIN = (bool, int, str, type(None))


def save_snapshot(path: str | os.PathLike[str], parts: Mapping[str, Any]) -> None:
    """Write a snapshot of the parts of a loop to `path`. The file is complete or absent.

    Args:
        path: path of the file, which is replaced.
        parts: by any names: states of trackers, timelines, densities, random generators, arrays, numbers, texts, and
            tuples, lists and dictionaries of these.

    Raises:
        InputError: an object of another type, with its place in `parts`, or a path that cannot be written.
    """
    writer = _Writer()
    root = writer.node(dict(parts), "parts")
    text = json.dumps({"format": FORMAT_NAME, "version": FORMAT_VERSION, "root": root, "nodes": writer.nodes})
    arrays = {"structure": np.frombuffer(text.encode(), np.uint8)}
    arrays |= {f"array{i}": array for i, array in enumerate(writer.arrays)}
    write_file(Path(path), lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]


def load_snapshot(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the parts that `save_snapshot` wrote, with every number bit for bit the same.

    Raises:
        InputError: a file that is missing, damaged, of another format or version, or whose parts are not valid.
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
        parts = _Reader(arrays, structure["nodes"]).value(structure["root"])
    except VedetteError as fault:
        raise InputError(f"{source}: expected valid parts; {fault}") from fault
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError) as fault:
        raise InputError(f"{source}: expected a snapshot; it is damaged: {error_summary(fault)}") from fault
    if not isinstance(parts, dict):
        raise InputError(f"{source}: expected named parts; got {type(parts).__name__}")
    return parts


class _Writer:
    """Writer of a structure as nodes that refer to each other by number."""

    def __init__(self) -> None:
        self.nodes: list[list[Any]] = []
        self.arrays: list[np.ndarray[Any, Any]] = []
        self._numbers: dict[int, int] = {}
        self._kept: list[Any] = []  # keeps the objects alive, so that their ids are not reused

    def node(self, value: Any, place: str) -> int:
        """Return the number of the node of a value, written at its first occurrence."""
        if id(value) in self._numbers:
            return self._numbers[id(value)]
        node = self._new_node(value, place)
        self.nodes.append(node)
        number = len(self.nodes) - 1
        self._numbers[id(value)] = number
        self._kept.append(value)
        return number

    def _new_node(self, value: Any, place: str) -> list[Any]:
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


class _Reader:
    """Reader of nodes. The value of each node is made once."""

    def __init__(self, arrays: Mapping[str, Any], nodes: list[list[Any]]) -> None:
        self._arrays, self._nodes = arrays, nodes
        self._values: dict[int, Any] = {}
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
        """Return the value of a node. Nodes refer to earlier nodes only, so there are no cycles."""
        if number not in self._values:
            kind, *content = self._nodes[number]
            self._values[number] = self._makers[kind](*content)
        return self._values[number]

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
    """Return the arguments of a data class or named tuple, or None for any other class."""
    if is_dataclass(kind):
        return tuple(field.name for field in fields(kind) if field.init)
    return getattr(kind, "_fields", None) if issubclass(kind, tuple) else None


def _class_of(module: str, name: str) -> Any:
    """Return a data class or named tuple of the library by its name, or None for any other name."""
    if not any(module == f"vedette.{package}" or module.startswith(f"vedette.{package}.") for package in _PACKAGES):
        return None
    try:
        kind = getattr(import_module(module), name, None)
    except ImportError:
        return None
    return kind if isinstance(kind, type) and _field_names(kind) is not None else None
