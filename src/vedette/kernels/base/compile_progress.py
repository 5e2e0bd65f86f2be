"""Progress of compilation for a listener, as a start that compiles takes minutes and should not look stuck."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

from vedette.kernels.base.compile import Kernel


@dataclass(frozen=True, slots=True)
class CompileProgress:
    """A kernel that is being compiled with everything that it calls."""

    name: str
    num_done: int  # functions compiled so far, of those that had to be compiled
    num_functions: int


Listener = Callable[[CompileProgress | None], None]


class _Watch:
    """Counts the functions of the compiled kernel, and notifies the listener, with None when a kernel is done."""

    def __init__(self, listener: Listener) -> None:
        self._tell = listener
        self._compiled: set[int] = set()
        self._state = CompileProgress("", 0, 0)
        self._following = ExitStack()
        self._follows = False

    def begin(self, function: Callable[..., Any]) -> None:
        """Start counting for a kernel that is compiled now."""
        if not self._follows:
            self._follows = True
            self._following.enter_context(_compile_listener(self._compiled_one))
        self._state = CompileProgress(function.__name__, 0, len(_reached(function) - self._compiled))
        self._tell(self._state)

    def end(self) -> None:
        """Notify the listener that the kernel is compiled."""
        self._tell(None)

    def close(self) -> None:
        """Stop listening to Numba."""
        self._following.close()

    def _compiled_one(self, function: Callable[..., Any]) -> None:
        if id(function) not in self._compiled:
            self._compiled.add(id(function))
            done = min(self._state.num_done + 1, self._state.num_functions)
            self._state = replace(self._state, num_done=done)
            self._tell(self._state)


@contextmanager
def _compile_listener(tell: Callable[[Callable[..., Any]], None]) -> Iterator[None]:
    """Context manager that calls `tell` with every function that Numba has compiled."""
    from numba.core import event

    class Follower(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            pass

        def on_end(self, event: Any) -> None:
            tell(event.data["dispatcher"].py_func)

    with event.install_listener("numba:compile", Follower()):
        yield


def _reached(function: Callable[..., Any]) -> set[int]:
    """Return the ids of the function and of all kernels that it calls, resolved by their names."""
    found, pending = {id(function)}, [function]
    while pending:
        code, names = pending[-1].__code__, pending.pop().__globals__
        for name in code.co_names:
            called = names.get(name)
            if isinstance(called, Kernel) and id(called.py_func) not in found:
                found.add(id(called.py_func))
                pending.append(called.py_func)
    return found


_watch: _Watch | None = None


@contextmanager
def watched(listener: Listener) -> Iterator[None]:
    """Context manager that notifies `listener` of compilation: of each function done, and None at the end of a
    kernel.
    """
    global _watch
    before, _watch = _watch, _Watch(listener)
    try:
        yield
    finally:
        _watch.close()
        _watch = before


def compilation_begins(function: Callable[..., Any]) -> None:
    """Report that a kernel was not in the cache and is compiled now."""
    if _watch is not None:
        _watch.begin(function)


def compilation_ends() -> None:
    """Report that a kernel is compiled."""
    if _watch is not None:
        _watch.end()
