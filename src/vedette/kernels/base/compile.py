"""Compilation options and wrappers of kernels and model functions, in one place.

They are compiled at their first call and cached on disk, see `vedette.kernels.base.disk_cache`. Numba is imported only
then (`vedette.kernels.base.dispatchers`), so importing the library is fast.
"""

from __future__ import annotations

import importlib
import inspect
import os
import threading
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from vedette.kernels.base.interrupts import interrupts_wait
from vedette.kernels.base.sources import note_source

if TYPE_CHECKING:
    from vedette.kernels.base.dispatchers import ModelDispatcher, PartKernel, WholeKernel

_F = TypeVar("_F", bound=Callable[..., Any])
JIT_ENABLED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")

# No fastmath: -inf is a legal log weight. NumPy's error model: division by zero is inf, not an exception branch.
_OPTIONS: dict[str, Any] = {"nopython": True, "nogil": True, "error_model": "numpy"}
_BORROWING: dict[str, Any] = {**_OPTIONS, "_nrt": False}
_AS_PART: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: _F) -> _F:
    """Compile a kernel lazily, without the interpreter lock.

    It is cached under a stamp of all the sources that it reaches.
    """
    return _compiled(function, _OPTIONS)


def borrowing(function: _F) -> _F:
    """Compile a kernel that allocates no array and only borrows those of its caller, so that no references are counted.

    Counting costs two atomic operations for every array of a bundle and every slice, more than the arithmetic of small
    matrices. Such a kernel may return arrays (views of its arguments) only to another such kernel, and may call only
    such kernels and model functions.
    """
    return _compiled(function, _BORROWING)


def inlined(function: _F) -> _F:
    """Compile like `borrowing`, and always inline into the caller.

    A bundle of arrays is passed as dozens of words, which costs more than a small kernel's own work.
    """
    return _compiled(function, {**_BORROWING, "forceinline": True})


def _compiled(function: _F, options: dict[str, Any]) -> _F:
    return cast(_F, Kernel(function, options)) if JIT_ENABLED else function


# Lock, so that concurrent threads compile a function once.
_MAKING = threading.RLock()


@cache
def _dispatchers() -> ModuleType:
    """Import and return the module that needs Numba."""
    with interrupts_wait():
        return importlib.import_module("vedette.kernels.base.dispatchers")


class Kernel:
    """Kernel function: compiled as a part of kernels that call it, and as a whole if Python calls it."""

    _whole: WholeKernel | None = None

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self.py_func = function
        self._options = options
        update_wrapper(self, function)
        note_source(function)

    def __call__(self, *args: Any) -> Any:
        whole = self._whole or self.whole
        returned = whole(*args)
        return returned if whole.name is None else whole.name(returned)

    @property
    def whole(self) -> WholeKernel:
        """The compiled function that Python calls."""
        with _MAKING:
            if self._whole is None:
                self._whole = _dispatchers().WholeKernel.of(self.py_func, self._options)
        return self._whole

    @cached_property
    def part(self) -> PartKernel:
        """The compiled function that other kernels call, requested during their compilation."""
        return _dispatchers().PartKernel(self.py_func, targetoptions=self._options | _AS_PART)

    @property
    def _numba_type_(self) -> Any:
        """Numba type for compiled code that refers to it by name."""
        return self.part._numba_type_


_VECTOR, _MATRIX, _INTEGERS = "float64[::1]", "float64[:,::1]", "int64[::1]"

# kind -> (argument names, for checking a user's function; compiled signature)
SIGNATURES: dict[str, tuple[tuple[str, ...], str]] = {
    "transition": (("state", "dt", "params", "out"), f"void({_VECTOR}, float64, {_VECTOR}, {_VECTOR})"),
    "transition_jacobian": (("state", "dt", "params", "out"), f"void({_VECTOR}, float64, {_VECTOR}, {_MATRIX})"),
    "process_noise_cov": (("state", "dt", "params", "out"), f"void({_VECTOR}, float64, {_VECTOR}, {_MATRIX})"),
    "prob_survival": (("state", "dt", "params"), f"float64({_VECTOR}, float64, {_VECTOR})"),
    "measurement": (("state", "pose", "params", "out"), f"void({_VECTOR}, {_VECTOR}, {_VECTOR}, {_VECTOR})"),
    "measurement_jacobian": (("state", "pose", "params", "out"), f"void({_VECTOR}, {_VECTOR}, {_VECTOR}, {_MATRIX})"),
    "measurement_noise_cov": (("state", "pose", "params", "out"), f"void({_VECTOR}, {_VECTOR}, {_VECTOR}, {_MATRIX})"),
    "prob_detection": (("state", "pose", "params"), f"float64({_VECTOR}, {_VECTOR}, {_VECTOR})"),
    "mean_prob_detection": (
        ("mean", "cov", "pose", "params"),
        f"float64({_VECTOR}, {_MATRIX}, {_VECTOR}, {_VECTOR})",
    ),
    "label_reward": (
        ("existence", "mean", "cov", "new_existence", "new_mean", "new_cov", "params", "out"),
        f"void(float64, {_VECTOR}, {_MATRIX}, float64, {_VECTOR}, {_MATRIX}, {_VECTOR}, {_VECTOR})",
    ),
    "association_marginals": (
        ("offsets", "columns", "log_weights", "params", "out"),
        f"float64({_INTEGERS}, {_INTEGERS}, {_VECTOR}, {_VECTOR}, {_VECTOR})",
    ),
    "log_clutter_intensity": (("measurement", "pose", "params"), f"float64({_VECTOR}, {_VECTOR}, {_VECTOR})"),
}


class ModelFunction:
    """Model function, built-in or of a user, compiled to the signature of its kind.

    Kernels receive it as a first-class function, so one compiled kernel serves every model, and an exception in the
    function reaches the caller.
    """

    # After `bind`: addresses of its machine code, read by unboxing, and its type in kernels, as Numba names it.
    c_address: int
    jit_address: int
    _numba_type_: Any

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self.py_func = function
        self.kind = kind
        update_wrapper(self, function)
        note_source(function)

    def __call__(self, *args: Any) -> Any:
        """Call the function from Python. Read-only arrays, such as those of densities, are copied."""
        if not hasattr(self, "c_address"):
            self.bind()
        return self.dispatcher(*map(_writeable, args))

    @cached_property
    def dispatcher(self) -> ModelDispatcher:
        """Numba dispatcher that compiles it and calls it from Python."""
        return _dispatchers().ModelDispatcher.of_model(self, dict(_OPTIONS))

    def __getattr__(self, name: str) -> Any:
        """Compile the function when its type is first read. A property would be called again at every kernel call."""
        if name != "_numba_type_":
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        self.bind()
        return self.__dict__[name]

    def bind(self) -> None:
        """Compile to the signature of the kind, and store the addresses of the machine code, thread-safe."""
        with _MAKING:
            dispatcher = self.dispatcher
        self.c_address, self.jit_address, found = _dispatchers().addresses_of(dispatcher)
        self._numba_type_ = found  # last, as it is read without a lock

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a built-in function by its name, and a user's with its code."""
        named = self.py_func.__module__, self.py_func.__qualname__
        if named[0].startswith("vedette.") and _found(*named) is self:
            return _found, named
        return _model_of, (self.dispatcher,)


def _writeable(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) and not value.flags.writeable else value


def _found(module: str, name: str) -> Any:
    return getattr(importlib.import_module(module), name, None)


def _model_of(dispatcher: ModelDispatcher) -> ModelFunction:
    return dispatcher.model


def check_arguments(function: Callable[..., Any], kind: str) -> None:
    """Raise `TypeError` unless `function` has the number of arguments that its kind requires."""
    if kind not in SIGNATURES:
        raise TypeError(f"model function kind: expected one of {', '.join(SIGNATURES)}; got {kind!r}")
    expected = SIGNATURES[kind][0]
    got = tuple(inspect.signature(function).parameters)
    if len(got) != len(expected):
        raise TypeError(
            f"{kind} function {function.__name__!r}: expected {len(expected)} arguments ({', '.join(expected)}); "
            f"got {len(got)} ({', '.join(got)})"
        )


def compile_model_function(function: Callable[..., Any], kind: str) -> Any:
    """Compile `function` as a model function of `kind`.

    The library's own functions are known to compile and are compiled at first use, which saves seconds at the first
    start. A user's function is compiled here, where its errors can be reported.

    Raises `TypeError` for a wrong kind, a wrong number of arguments, or a body that Numba cannot compile.
    """
    check_arguments(function, kind)
    if not JIT_ENABLED:
        function.kind = kind  # type: ignore[attr-defined]
        return function
    model = ModelFunction(function, kind)
    if function.__module__.startswith("vedette."):
        return model
    try:
        model.bind()
    except _dispatchers().NumbaError as error:
        raise TypeError(f"{kind} function {function.__name__!r} cannot be compiled: {error}") from error
    return model
