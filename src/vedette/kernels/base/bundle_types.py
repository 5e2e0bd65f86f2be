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

_FOUND: dict[tuple[Any, ...], Any] = {}


@typeof_impl.register(Motion)  # type: ignore[untyped-decorator]
@typeof_impl.register(Sensor)  # type: ignore[untyped-decorator]
def _typeof_bundle(value: tuple[Any, ...], context: Any) -> Any:
    """The Numba type of a bundle, looked up by all that the types of its fields depend on."""
    key: list[Any] = [type(value)]
    for field in value:
        if isinstance(field, np.ndarray):
            key += (field.dtype, field.ndim, field.flags.num)
        elif hasattr(field, "numba_type"):  # asking for it compiles the function, where that is still to do
            key.append(field.kind)
        else:
            key.append(type(field))
    found = _FOUND.get(tuple(key))
    if found is None:
        found = types.NamedTuple([typeof(field) for field in value], type(value))
        _FOUND[tuple(key)] = found
    return found
