"""The one place that configures Numba: how kernels and model functions are compiled.

Kernels are compiled at their first call and kept on disk, see `vedette.kernels.base.disk_cache`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core import cgutils, config
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.experimental.function_type import FunctionModel
from numba.extending import NativeValue, register_model, typeof_impl, unbox

from vedette.kernels.base.bundle_types import TYPED_BY_FIELDS, type_of_bundle
from vedette.kernels.base.disk_cache import OnDemand
from vedette.kernels.base.libraries import PartLibrary, WholeLibrary, made_as

_F = TypeVar("_F", bound=Callable[..., Any])
JIT_ENABLED = not config.DISABLE_JIT

# No fastmath: -inf is a legal log weight. NumPy's error model: division by zero is inf, not an exception branch.
_OPTIONS: dict[str, Any] = {"nopython": True, "nogil": True, "error_model": "numpy"}
_BORROWING: dict[str, Any] = {**_OPTIONS, "_nrt": False}
_AS_PART: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: _F) -> _F:
    """Compile a kernel lazily, without the interpreter lock, cached under a stamp of all the sources it reaches."""
    return _compiled(function, _OPTIONS)


def borrowing(function: _F) -> _F:
    """Compile a kernel that makes no array and only borrows those of its caller, so that no references are counted.

    Counting costs two atomic operations for every array of a bundle and every slice: more than the arithmetic of small
    matrices. Such a kernel may return arrays (views of its arguments) only to another such kernel, and may call only
    such kernels and model functions.
    """
    return _compiled(function, _BORROWING)


def inlined(function: _F) -> _F:
    """As `borrowing`, and always inlined into its caller.

    A bundle of arrays is passed as dozens of words, which costs more than a small kernel's own work.
    """
    return _compiled(function, {**_BORROWING, "forceinline": True})


def _compiled(function: _F, options: dict[str, Any]) -> _F:
    return cast(_F, Kernel(function, targetoptions=options | _AS_PART)) if JIT_ENABLED else function


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A function of kernels: part of those that call it, and compiled as a whole where Python calls it."""

    _whole: WholeKernel | None = None

    def __call__(self, *args: Any) -> Any:
        return (self._whole or self.whole)(*args)

    @property
    def whole(self) -> WholeKernel:
        """What Python calls; any number of threads may ask."""
        with global_compiler_lock:
            if self._whole is None:
                options = {k: v for k, v in self.targetoptions.items() if k not in _AS_PART}
                self._whole = WholeKernel(self.py_func, targetoptions=options)
                self._whole._cache = OnDemand(self.py_func)
        return self._whole

    def compile(self, sig: Any) -> Any:
        """As a part."""
        with made_as(PartLibrary, self.targetctx.codegen()):
            return super().compile(sig)


class WholeKernel(CPUDispatcher):  # type: ignore[misc]
    """A function with all that it reaches, as Python calls it; kept on disk."""

    def compile(self, sig: Any) -> Any:
        """As a whole."""
        codegen = self.targetctx.codegen()
        with made_as(WholeLibrary, codegen):
            entry = super().compile(sig)
            # Those of the parts, too, as when it is read from disk.
            for environment in self.overloads[tuple(normalize_signature(sig)[0])]._find_referenced_environments():
                codegen.set_env(environment.env_name, environment)
        return entry

    def typeof_pyval(self, value: Any) -> Any:
        """The type of an argument that Numba's quick way does not know; asked for by its dispatcher.

        Numba's own way notes a bundle's type as in use, for which the types of all its fields are hashed.
        """
        if type(value) in TYPED_BY_FIELDS:
            return type_of_bundle(value)
        return super().typeof_pyval(value)


_VECTOR = types.float64[::1]
_MATRIX = types.float64[:, ::1]

# kind -> (argument names that a user's function is checked against, compiled signature)
SIGNATURES: dict[str, tuple[tuple[str, ...], Any]] = {
    "transition": (("state", "dt", "params", "out"), types.void(_VECTOR, types.float64, _VECTOR, _VECTOR)),
    "transition_jacobian": (("state", "dt", "params", "out"), types.void(_VECTOR, types.float64, _VECTOR, _MATRIX)),
    "process_noise_cov": (("state", "dt", "params", "out"), types.void(_VECTOR, types.float64, _VECTOR, _MATRIX)),
    "prob_survival": (("state", "dt", "params"), types.float64(_VECTOR, types.float64, _VECTOR)),
    "measurement": (("state", "pose", "params", "out"), types.void(_VECTOR, _VECTOR, _VECTOR, _VECTOR)),
    "measurement_jacobian": (("state", "pose", "params", "out"), types.void(_VECTOR, _VECTOR, _VECTOR, _MATRIX)),
    "measurement_noise_cov": (("state", "pose", "params", "out"), types.void(_VECTOR, _VECTOR, _VECTOR, _MATRIX)),
    "prob_detection": (("state", "pose", "params"), types.float64(_VECTOR, _VECTOR, _VECTOR)),
    "mean_prob_detection": (
        ("mean", "cov", "pose", "params"),
        types.float64(_VECTOR, _MATRIX, _VECTOR, _VECTOR),
    ),
    "label_reward": (
        ("existence", "mean", "cov", "new_existence", "new_mean", "new_cov", "params", "out"),
        types.void(types.float64, _VECTOR, _MATRIX, types.float64, _VECTOR, _MATRIX, _VECTOR, _VECTOR),
    ),
    "log_clutter_intensity": (("measurement", "pose", "params"), types.float64(_VECTOR, _VECTOR, _VECTOR)),
}


class ModelFunction(WholeKernel):
    """A user's or built-in model function, compiled to the one signature of its kind.

    Kernels receive it as a first-class function, so one compiled kernel serves every model, and an exception that the
    function raises reaches the caller.
    """

    kind: str
    c_address: int
    jit_address: int
    _numba_type: Any = None

    @property
    def numba_type(self) -> Any:
        """The type by which kernels know it; asking for it compiles the function."""
        if self._numba_type is None:
            self.bind()
        return self._numba_type

    def __call__(self, *args: Any) -> Any:
        if self._numba_type is None:
            self.bind()
        return super().__call__(*args)

    def bind(self) -> None:
        """Compile to the signature of the kind and note where the machine code lies; any number of threads may ask."""
        # Numba's own lock: a thread that compiles a kernel holds it when it asks for the types of functions.
        with global_compiler_lock:
            if self._numba_type is not None:
                return
            signature = SIGNATURES[self.kind][1]
            if not self.overloads:  # an unpickled one comes compiled
                self.compile(signature)
                self.disable_compile()
            compiled = self.get_compile_result(signature)
            self.c_address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)
            self.jit_address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
            self._numba_type = _ModelFunctionType(compiled.signature)  # last, as it is read without the lock

    def _reduce_states(self) -> dict[str, Any]:
        return {**super()._reduce_states(), "kind": self.kind}

    @classmethod
    def _rebuild(cls, kind: str, **states: Any) -> ModelFunction:
        """What unpickling in another process calls; another thread must not meet it half built."""
        with global_compiler_lock:
            function: ModelFunction = super()._rebuild(**states)
            function.kind = kind
            return function


class _ModelFunctionType(types.FunctionType):  # type: ignore[misc]
    """Numba's first-class function type, unboxed from two stored addresses.

    Numba's own unboxing looks both addresses up by name at every call of a kernel: 50 microseconds a function.
    """


register_model(_ModelFunctionType)(FunctionModel)


@typeof_impl.register(ModelFunction)  # type: ignore[untyped-decorator]
def _typeof_model_function(value: ModelFunction, context: Any) -> Any:
    return value.numba_type


@unbox(_ModelFunctionType)  # type: ignore[untyped-decorator]
def _unbox_model_function(kind: Any, value: Any, context: Any) -> Any:
    struct = cgutils.create_struct_proxy(kind)(context.context, context.builder)
    for field, attribute in (("c_addr", "c_address"), ("jit_addr", "jit_address")):
        address = context.pyapi.object_getattr_string(value, attribute)
        setattr(struct, field, context.pyapi.long_as_voidptr(address))
        context.pyapi.decref(address)
    struct.py_addr = context.builder.ptrtoint(value, context.context.get_value_type(types.voidptr))
    return NativeValue(struct._getvalue())


def check_arguments(function: Callable[..., Any], kind: str) -> None:
    """Raise `TypeError` unless `function` takes the number of arguments that its kind demands."""
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

    The library's own functions are known to compile and wait until a model uses them, which saves seconds at the first
    start; a user's is compiled here, where its faults can be told.

    Raises `TypeError` for a wrong kind, a wrong number of arguments, or a body that Numba cannot compile.
    """
    check_arguments(function, kind)
    if not JIT_ENABLED:
        function.kind = kind  # type: ignore[attr-defined]
        return function
    dispatcher = ModelFunction(function, targetoptions=dict(_OPTIONS))
    dispatcher.kind = kind
    dispatcher._cache = OnDemand(function)
    if function.__module__.startswith("vedette."):
        return dispatcher
    try:
        dispatcher.bind()
    except numba.core.errors.NumbaError as error:
        raise TypeError(f"{kind} function {function.__name__!r} cannot be compiled: {error}") from error
    return dispatcher


__all__ = [
    "JIT_ENABLED",
    "SIGNATURES",
    "ModelFunction",
    "compile_model_function",
    "kernel",
]
