"""Numba types of bundles of models, for the arguments of a kernel call.

At every call Numba determines the types of the arguments. Its fast path does not support model functions, and the slow
path through all fields took longer than a whole LMB scan (120 of 177 microseconds per call).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from vedette.kernels.base.types import Motion, Sensor

# Bundle types that contain model functions.
TYPED_BY_FIELDS: set[type] = {Motion, Sensor}

_TOLD: list[Callable[[type], object]] = []

# Cache of types, by `_key`.
_FOUND: dict[Any, Any] = {}

# Bundles that models make once, with their types, by identity; held so that no other object gets the same identity.
_HELD_KINDS = {Motion, Sensor}
HELD: dict[int, tuple[Any, Any]] = {}
_MOST_HELD = 1000


def _key(bundle: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return everything that the type of a bundle depends on. Results are cached by it, so a type stands for itself."""
    found: list[Any] = [type(bundle)]
    for value in bundle:
        if isinstance(value, np.ndarray):
            found.append((value.dtype, value.ndim, value.flags.num))
        elif type(value) in _HELD_KINDS:
            found.append(id(type_of_bundle(value)))  # Numba would hash all of its fields
        elif isinstance(value, tuple):
            found.append(_key(value))
        elif hasattr(value, "kind"):  # a model function
            if not hasattr(value, "jit_address"):
                value.bind()
            found.append(value.kind)
        else:
            found.append(type(value))
    return tuple(found)


def type_of_bundle(value: tuple[Any, ...], context: Any = None) -> Any:
    """Return the Numba type of a bundle."""
    held = HELD.get(id(value))
    if held is not None:
        return held[1]
    key = _key(value)
    found = _FOUND.get(key)
    if found is None:
        from numba import typeof, types

        found = _FOUND[key] = types.NamedTuple([typeof(field) for field in value], type(value))
    if type(value) in _HELD_KINDS:
        if len(HELD) >= _MOST_HELD:
            HELD.clear()
        HELD[id(value)] = value, found
    return found


def typed_by_fields(bundle: Any) -> Any:
    """Decorator that registers a bundle type with model functions for fast typing."""
    TYPED_BY_FIELDS.add(bundle)
    for tell in _TOLD:
        tell(bundle)
    return bundle


def when_typed(tell: Callable[[type], object]) -> None:
    """Call `tell` with every registered bundle type: the present ones, and each later one."""
    _TOLD.append(tell)
    for bundle in TYPED_BY_FIELDS:
        tell(bundle)
