"""How a kernel that is called learns the types of bundles of models.

At every call Numba works out the types of the arguments. Its quick way does not know model functions, and the slow way
through all fields took longer than a whole LMB scan (of 177 microseconds a call, 120).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import typeof, types
from numba.extending import typeof_impl

from vedette.kernels.base.types import Motion, Sensor

# The kinds of bundles that hold model functions.
TYPED_BY_FIELDS: set[type] = set()

# By all that the type of a bundle depends on.
_FOUND: dict[Any, Any] = {}

# Bundles with their types by identity, held so that no other comes to the same place: those that models make once.
_HELD_KINDS = {Motion, Sensor}
_HELD: dict[int, tuple[Any, Any]] = {}
_MOST_HELD = 1000


def _key(value: Any) -> Any:
    """All that the type of a bundle's field depends on."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    if type(value) in _HELD_KINDS:
        return type_of_bundle(value)
    if isinstance(value, tuple):
        return (type(value), *map(_key, value))
    if hasattr(value, "numba_type"):  # asking for it compiles the function, where that is still to do
        return value.kind
    return type(value)


def type_of_bundle(value: tuple[Any, ...], context: Any = None) -> Any:
    """The Numba type of a bundle."""
    held = _HELD.get(id(value))
    if held is not None:
        return held[1]
    key = (type(value), *map(_key, value))
    found = _FOUND.get(key)
    if found is None:
        found = _FOUND[key] = types.NamedTuple([typeof(field) for field in value], type(value))
    if type(value) in _HELD_KINDS:
        if len(_HELD) >= _MOST_HELD:
            _HELD.clear()
        _HELD[id(value)] = value, found
    return found


def typed_by_fields(bundle: Any) -> Any:
    """Have a bundle that holds model functions typed quickly; for use as a decorator."""
    typeof_impl.register(bundle)(type_of_bundle)
    TYPED_BY_FIELDS.add(bundle)
    return bundle


for _bundle in _HELD_KINDS:
    typed_by_fields(_bundle)
