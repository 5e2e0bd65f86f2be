"""How a kernel that is called learns the types of bundles of models.

At every call Numba works out the types of the arguments. Its quick way does not know model functions, and the slow way
through all fields took longer than a whole LMB scan (of 177 microseconds a call, 120).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vedette.kernels.base.types import Motion, Sensor

# The kinds of bundles that hold model functions.
TYPED_BY_FIELDS: set[type] = {Motion, Sensor}

_TOLD: list[Callable[[type], object]] = []

# By all that the type of a bundle depends on.
_FOUND: dict[Any, Any] = {}

# Bundles with their types by identity, held so that no other comes to the same place: those that models make once.
_HELD_KINDS = {Motion, Sensor}
HELD: dict[int, tuple[Any, Any]] = {}
_MOST_HELD = 1000


def _key(bundle: tuple[Any, ...]) -> tuple[Any, ...]:
    """All that the type of a bundle depends on; what is found by it is kept, so that a type stands for itself."""
    found: list[Any] = [type(bundle)]
    for value in bundle:
        if isinstance(value, np.ndarray):
            found.append((value.dtype, value.ndim, value.flags.num))
        elif type(value) in _HELD_KINDS:
            found.append(id(type_of_bundle(value)))  # Numba would hash all of its fields
        elif isinstance(value, tuple):
            found.append(_key(value))
        elif hasattr(value, "numba_type"):  # asking for it compiles the function, where that is still to do
            found.append(value.kind)
        else:
            found.append(type(value))
    return tuple(found)


def type_of_bundle(value: tuple[Any, ...], context: Any = None) -> Any:
    """The Numba type of a bundle."""
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
    """Have a bundle that holds model functions typed quickly; for use as a decorator."""
    TYPED_BY_FIELDS.add(bundle)
    for tell in _TOLD:
        tell(bundle)
    return bundle


def when_typed(tell: Callable[[type], object]) -> None:
    """Call `tell` with every bundle that is typed quickly: those there are, and each that comes."""
    _TOLD.append(tell)
    for bundle in TYPED_BY_FIELDS:
        tell(bundle)
