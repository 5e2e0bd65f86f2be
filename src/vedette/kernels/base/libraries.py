"""How the code of kernels that call each other comes together: each is optimised once, in what Python calls.

Numba optimises a function and makes machine code of it, then takes it into every function that calls it and does so
again, level by level. Here what only kernels call stays a *part*, unoptimised and without machine code, and what Python
calls is made a *whole* of all the parts that it reaches.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that is only ever run as part of other code."""

    @property
    def codegen(self) -> Any:
        """Asked for one thing: to tell the code where its environment lies, which is the whole's affair."""
        return _NoEnvironment

    @property
    def called(self) -> list[Any]:
        """The libraries of what it calls."""
        return list(self._linking_libraries)

    def finalize(self) -> None:
        """Nothing more may be added."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalized = True

    def own_module(self) -> Any:
        """Its code without what it calls."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """With all that it calls, for functions that are not compiled here: a user's own."""
        module = self.own_module().clone()
        for library in _all_of(self.called):
            module.link_in(_code_of(library)._get_module_for_linking(), preserve=True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """None: there is no machine code."""
        return 0


class WholeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code with all the parts that it reaches, each once."""

    def finalize(self) -> None:
        """Take in the parts, optimise, and make machine code."""
        self._linking_libraries: list[Any] = [_code_of(library) for library in _all_of(self._linking_libraries)]
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Once all is linked: what nothing asked for at its turn was left out by LLVM, and is linked again.

        To link all that call a part before it would leave nothing out, but what LLVM then makes of it is 7 to 13 %
        slower in decisions on GLMBs.
        """
        missing = _names(self._final_module, declared=True)
        while missing:
            modules = [library._get_module_for_linking() for library in self._linking_libraries]
            for module in modules:
                if missing & _names(module, declared=False):
                    self._final_module.link_in(module, preserve=True)
            left = _names(self._final_module, declared=True)
            missing = left if left < missing else set()
        super()._optimize_final_module()

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Machine code and the names that it defines: nothing takes a whole in, so that nobody needs its source."""
        self._ensure_finalized()
        module = self._final_module
        items = (*module.functions, *module.global_variables)
        return (
            self.name,
            "object",
            (self._get_compiled_object(), [item.name for item in items if not item.is_declaration]),
        )

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> WholeLibrary:
        name, _, (code, defined) = state
        library: WholeLibrary = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(defined)
        return library


def _all_of(libraries: list[Any]) -> list[Any]:
    """These, and all the libraries that parts among them reach, each once."""
    found: dict[Any, None] = {}
    pending = list(reversed(libraries))
    while pending:
        library = pending.pop()
        if library not in found:
            found[library] = None
            pending.extend(library.called if isinstance(library, PartLibrary) else ())
    return list(found)


def _names(module: Any, *, declared: bool) -> set[str]:
    """The compiled functions that a module only declares, or those that it defines."""
    return {item.name for item in module.functions if item.is_declaration == declared and item.name.startswith("_ZN")}


def _code_of(library: Any) -> Any:
    return _OwnCode(library) if isinstance(library, PartLibrary) else library


class _OwnCode:
    """A part's own code, as what takes it in asks for it."""

    def __init__(self, part: PartLibrary) -> None:
        self._part = part
        self._reload_init = part._reload_init

    def _get_module_for_linking(self) -> Any:
        return self._part.own_module()


class _NoEnvironment:
    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """Not here."""


@contextmanager
def made_as(kind: type, codegen: Any) -> Iterator[None]:
    """Have what is compiled meanwhile made as libraries of this kind; what it calls first may be made as another."""
    with global_compiler_lock:
        before = codegen._library_class
        codegen._library_class = kind
        try:
            yield
        finally:
            codegen._library_class = before
