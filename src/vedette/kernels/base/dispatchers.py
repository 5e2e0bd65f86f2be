"""Dispatchers that compile kernels and model functions, and call them from Python, the only module that needs Numba.

Imported when the first of them is called, compiled or read from disk.
"""

from collections.abc import Callable
from typing import Any, cast

from numba import types
from numba.core import cgutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError as NumbaError
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.experimental.function_type import FunctionModel
from numba.extending import NativeValue, register_model, typeof_impl, unbox

from vedette.kernels.base.bundle_types import HELD, TYPED_BY_FIELDS, type_of_bundle, when_typed
from vedette.kernels.base.compile import SIGNATURES, ModelFunction
from vedette.kernels.base.disk_cache import LazyCache
from vedette.kernels.base.libraries import PartLibrary, WholeLibrary, made_as
from vedette.kernels.base.nopython_return import NAMED, returned_without_python

# Shape of a return value: None without named tuples in it, else its class and the shapes of its fields.
Shape = tuple[type, tuple[Any, ...]] | None

when_typed(lambda bundle: typeof_impl.register(bundle)(type_of_bundle))


def shape_of(kind: Any) -> Shape:
    """Return the named tuples in a return type."""
    if not isinstance(kind, types.BaseTuple):
        return None
    fields = tuple(shape_of(field) for field in kind.types)
    if isinstance(kind, NAMED):
        return kind.instance_class, fields
    return (tuple, fields) if any(fields) else None


def naming(shape: Shape) -> Callable[[tuple[Any, ...]], Any]:
    """Return a function that turns the plain tuples of a shape into its named tuples."""
    names: dict[str, Any] = {"new": tuple.__new__}

    def named(shape: Shape, value: str) -> str:
        if shape is None:
            return value
        bundle = f"bundle_{len(names)}"
        names[bundle], fields = shape
        inner = "".join(f"{named(field, f'{value}[{place}]')}, " for place, field in enumerate(fields))
        return f"new({bundle}, ({inner}))" if any(fields) else f"new({bundle}, {value})"

    # One expression of the whole shape takes half the time of a function for each bundle.
    return cast(Callable[[tuple[Any, ...]], Any], eval(f"lambda values: {named(shape, 'values')}", names))


class PartKernel(CPUDispatcher):  # type: ignore[misc]
    """Kernel function as other kernels call it."""

    def compile(self, sig: Any) -> Any:
        """Compile as a part of other kernels."""
        with made_as(PartLibrary, self.targetctx.codegen()):
            return super().compile(sig)


def _is_read_only(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return any(map(_is_read_only, kind.types))
    return isinstance(kind, types.Array) and not kind.mutable


class WholeKernel(CPUDispatcher):  # type: ignore[misc]
    """Kernel function with everything that it reaches, as Python calls it, cached on disk."""

    # Function that names the plain tuples that it returns; None if there are none to name.
    name: Callable[[Any], Any] | None = None
    _shape: Shape = None

    @classmethod
    def of(cls, function: Callable[..., Any], options: dict[str, Any]) -> "WholeKernel":
        """Return the whole kernel of a function."""
        whole = cls(function, targetoptions=options)
        whole._cache = LazyCache(function)
        return whole

    def compile(self, sig: Any) -> Any:
        """Compile as a whole.

        Raises `TypeError` for a read-only array, as compiling everything again for it would take minutes.
        """
        arguments, _ = normalize_signature(sig)
        if any(map(_is_read_only, arguments)):
            raise TypeError(f"kernel {self.py_func.__qualname__}: expected writeable arrays; got a read-only one")
        with made_as(WholeLibrary, self.targetctx.codegen()), returned_without_python():
            return super().compile(sig)

    def add_overload(self, cres: Any) -> None:
        """Add code that was compiled or read from disk. Everything that a call needs is set before it can be called."""
        for environment in cres._find_referenced_environments():  # includes those of the parts
            self.targetctx.codegen().set_env(environment.env_name, environment)
        shape = shape_of(cres.signature.return_type)
        if self.overloads and shape != self._shape:
            raise TypeError(f"kernel {self.py_func.__qualname__}: expected one kind of bundle to be returned")
        self._shape, self.name = shape, shape and naming(shape)
        super().add_overload(cres)

    def typeof_pyval(self, value: Any) -> Any:
        """Return the type of an argument that Numba's fast path does not support, called by its dispatcher.

        Numba's own method registers a bundle's type as in use, which hashes the types of all its fields.
        """
        if type(value) in TYPED_BY_FIELDS:
            held = HELD.get(id(value))
            return type_of_bundle(value) if held is None else held[1]
        return super().typeof_pyval(value)


class ModelDispatcher(WholeKernel):
    """Dispatcher of a model function, for the single signature of its kind."""

    model: ModelFunction

    @classmethod
    def of_model(cls, model: ModelFunction, options: dict[str, Any]) -> "ModelDispatcher":
        """Return the dispatcher of a model function."""
        dispatcher: ModelDispatcher = cls.of(model.py_func, options)
        dispatcher.model = model
        return dispatcher

    def _reduce_states(self) -> dict[str, Any]:
        return {**super()._reduce_states(), "kind": self.model.kind}

    @classmethod
    def _rebuild(cls, kind: str, **states: Any) -> "ModelDispatcher":
        """Restore from a pickle in another process, locked, so that no other thread sees it incomplete."""
        with global_compiler_lock:
            dispatcher: ModelDispatcher = super()._rebuild(**states)
            if not hasattr(dispatcher, "model"):
                dispatcher.model = ModelFunction(dispatcher.py_func, kind)
                dispatcher.model.__dict__["dispatcher"] = dispatcher
            return dispatcher


def addresses_of(dispatcher: ModelDispatcher) -> tuple[int, int, Any]:
    """Compile a model function, and return its addresses for C and for kernels, and its Numba type."""
    # Numba's own lock: a thread that compiles a kernel holds it while it asks for the types of functions.
    with global_compiler_lock:
        args, result = normalize_signature(SIGNATURES[dispatcher.model.kind][1])
        signature = result(*args)
        if not dispatcher.overloads:  # an unpickled one is compiled already
            dispatcher.compile(signature)
            dispatcher.disable_compile()
        compiled = dispatcher.get_compile_result(signature)
        names = compiled.fndesc.llvm_cfunc_wrapper_name, compiled.fndesc.llvm_func_name
        c_address, jit_address = map(compiled.library.get_pointer_to_function, names)
        if not (c_address and jit_address):  # a kernel that calls address 0 would never return
            raise RuntimeError(f"the machine code of {dispatcher.py_func.__qualname__} was not found")
        return c_address, jit_address, _ModelFunctionType(compiled.signature)


class _ModelFunctionType(types.FunctionType):  # type: ignore[misc]
    """Numba's first-class function type, unboxed from two stored addresses.

    Numba's own unboxing looks up both addresses by name at every call of a kernel: 50 microseconds per function.
    """


register_model(_ModelFunctionType)(FunctionModel)


@unbox(_ModelFunctionType)  # type: ignore[untyped-decorator]
def _unbox_model_function(kind: Any, value: Any, context: Any) -> Any:
    struct = cgutils.create_struct_proxy(kind)(context.context, context.builder)
    for field, attribute in (("c_addr", "c_address"), ("jit_addr", "jit_address")):
        address = context.pyapi.object_getattr_string(value, attribute)
        setattr(struct, field, context.pyapi.long_as_voidptr(address))
        context.pyapi.decref(address)
    struct.py_addr = context.builder.ptrtoint(value, context.context.get_value_type(types.voidptr))
    return NativeValue(struct._getvalue())


@lower_constant(_ModelFunctionType)  # type: ignore[untyped-decorator]
def _named_model_function(context: Any, builder: Any, kind: Any, value: ModelFunction) -> Any:
    """Return the constant for a model function that compiled code refers to by name."""
    struct = cgutils.create_struct_proxy(kind)(context, builder)
    for field, address in (("c_addr", value.c_address), ("jit_addr", value.jit_address), ("py_addr", id(value))):
        setattr(struct, field, context.add_dynamic_addr(builder, address, info=str(kind)))
    return struct._getvalue()
