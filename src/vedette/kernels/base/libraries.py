"""Linking of the code of kernels that call each other: each is optimised once, in the kernel that Python calls.

Numba optimises a function and makes machine code from it, then includes it in every function that calls it and repeats
this, level by level. Here code that only kernels call stays a *part*, unoptimised and without machine code, and a
kernel that Python calls is a *whole* of all the parts that it reaches.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that only runs as part of other code."""

    @property
    def codegen(self) -> Any:
        """Used for one purpose: to set the environment of the code, which the whole does."""
        return _NoEnvironment

    @property
    def called(self) -> list[Any]:
        """Libraries of the functions that it calls."""
        return list(self._linking_libraries)

    def finalize(self) -> None:
        """Freeze the library."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalized = True

    def own_module(self) -> Any:
        """Return its code without the functions that it calls."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """Return its code with all functions that it calls.

        Used by functions that are not compiled here, such as a user's.
        """
        module = self.own_module().clone()
        for library in _all_of(self.called):
            module.link_in(_code_of(library)._get_module_for_linking(), preserve=True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0, as there is no machine code."""
        return 0


class WholeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code with all the parts that it reaches, each once."""

    def finalize(self) -> None:
        """Link the parts, optimise, and make machine code."""
        self._linking_libraries: list[Any] = [_code_of(library) for library in _all_of(self._linking_libraries)]
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Link again the parts that LLVM left out because nothing linked before used them, then optimise.

        Linking every caller before its parts would leave nothing out, but the code that LLVM then makes is 7 to 13 %
        slower in decisions on GLMBs. Parts that are linked in may call others, which are missing then.
        """
        missing = _names(self._final_module, declared=True)
        while missing:
            modules = [library._get_module_for_linking() for library in self._linking_libraries]
            for module in modules:
                if missing & _names(module, declared=False):
                    self._final_module.link_in(module, preserve=True)
            left = _names(self._final_module, declared=True)
            missing = left if left != missing else set()
        super()._optimize_final_module()
        if left := _names(self._final_module, declared=True):  # it would call address 0
            raise RuntimeError(f"the code of {', '.join(sorted(left))} was not found")

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Return machine code and the names that it defines. The source is not needed, as nothing links a whole."""
        self._ensure_finalized()
        module = self._final_module
        items = (*module.functions, *module.global_variables)
        return (
            self.name,
            "object",
            (self._get_compiled_object(), [item.name for item in items if not item.is_declaration]),
        )

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> "WholeLibrary":
        name, _, (code, defined) = state
        library: WholeLibrary = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(defined)
        return library


def _all_of(libraries: list[Any]) -> list[Any]:
    """Return these libraries and all that parts among them reach, each once."""
    found: dict[Any, None] = {}
    pending = list(reversed(libraries))
    while pending:
        library = pending.pop()
        if library not in found:
            found[library] = None
            pending.extend(library.called if isinstance(library, PartLibrary) else ())
    return list(found)


def _names(module: Any, *, declared: bool) -> set[str]:
    """Return the compiled functions that a module only declares, or those that it defines."""
    return {item.name for item in module.functions if item.is_declaration == declared and item.name.startswith("_ZN")}


def _code_of(library: Any) -> Any:
    return _OwnCode(library) if isinstance(library, PartLibrary) else library


class _OwnCode:
    """Adapter that links only a part's own code."""

    def __init__(self, part: PartLibrary) -> None:
        self._part = part
        self._reload_init = part._reload_init

    def _get_module_for_linking(self) -> Any:
        return self._part.own_module()


class _NoEnvironment:
    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """Do nothing: the whole sets environments."""


@contextmanager
def made_as(kind: type, codegen: Any) -> Iterator[None]:
    """Context manager in which code is compiled into libraries of this class.

    Functions that it calls may use another class.
    """
    with global_compiler_lock:
        before = codegen._library_class
        codegen._library_class = kind
        try:
            yield
        finally:
            codegen._library_class = before
