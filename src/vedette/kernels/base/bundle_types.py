"""How a kernel that is called learns the types of bundles of models. Imported for that by those who take such bundles.

At every call Numba works out the types of the arguments. Its quick way does not know model functions, and the slow way
through all fields took longer than a whole LMB scan (of 177 microseconds a call, 120).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import typeof, types
from numba.extending import typeof_impl

from vedette.kernels.base.types import Motion, Sensor

_FOUND: dict[Any, Any] = {}


def _key(value: Any) -> Any:
    """All that the type of a bundle's field depends on."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    if isinstance(value, tuple):
        return (type(value), *map(_key, value))
    if hasattr(value, "numba_type"):  # asking for it compiles the function, where that is still to do
        return value.kind
    return type(value)


def _typeof_bundle(value: tuple[Any, ...], context: Any) -> Any:
    """The Numba type of a bundle, looked up by all that the types of its fields depend on."""
    key = _key(value)
    found = _FOUND.get(key)
    if found is None:
        found = types.NamedTuple([typeof(field) for field in value], type(value))
        _FOUND[key] = found
    return found


def typed_by_fields(bundle: Any) -> Any:
    """Have a bundle that holds model functions typed quickly; for use as a decorator."""
    typeof_impl.register(bundle)(_typeof_bundle)
    return bundle


for _bundle in (Motion, Sensor):
    typed_by_fields(_bundle)
