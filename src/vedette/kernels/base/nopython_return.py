"""Return values of kernels without running Python code in them: arrays and plain tuples, which are named afterwards.

Numba runs Python inside machine code to return an array (it unpickles the array's class) and a named tuple (it calls
it). Python may run a signal handler there, and the machine code continues with the null result of an interrupted call:
Ctrl-C then crashed the process with a segmentation fault. The boxing here runs no Python, so that an interrupt comes
before or after it, and is faster.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.boxing import box_tuple
from numba.core.pythonapi import _boxers
from numba.np.numpy_support import as_dtype

# Numba types of named tuples.
NAMED = (types.NamedTuple, types.NamedUniTuple)


def _box_array(kind: Any, value: Any, c: Any) -> Any:
    """Box an array like Numba, but with the array class among the constants of the code."""
    array_class, dtype = (
        c.env_manager.read_const(c.env_manager.add_const(constant))
        for constant in (kind.box_type, as_dtype(kind.dtype))
    )
    int32 = ir.IntType(32)
    signature = ir.FunctionType(c.pyapi.pyobj, [c.pyapi.voidptr, c.pyapi.pyobj, int32, int32, c.pyapi.pyobj])
    adapt = c.pyapi._get_function(signature, name="NRT_adapt_ndarray_to_python_acqref")
    place = c.builder.bitcast(cgutils.alloca_once_value(c.builder, value), c.pyapi.voidptr)
    array = c.builder.call(adapt, [place, array_class, int32(kind.ndim), int32(int(kind.mutable)), dtype])
    c.context.nrt.decref(c.builder, kind, value)  # the array has its own reference
    return array


_BOXERS = {types.Array: _box_array, **dict.fromkeys(NAMED, box_tuple)}


@contextmanager
def returned_without_python() -> Iterator[None]:
    """Context manager in which code is compiled with this boxing. The caller must hold the compiler's lock."""
    before = {kind: _boxers.functions[kind] for kind in _BOXERS}
    _boxers.functions.update(_BOXERS)
    try:
        yield
    finally:
        _boxers.functions.update(before)
