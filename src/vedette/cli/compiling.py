"""Progress of compiling kernels: a moving line on a terminal, and elsewhere a line at the start and the end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vedette.cli.output import console
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.kernels.base.compile_progress import CompileProgress


@contextmanager
def compiling() -> Iterator[None]:
    """Show the progress of compilation inside the context. Show nothing if all kernels are compiled."""
    from vedette.kernels.base.compile_progress import watched

    progress = _CompileProgress()
    try:
        with watched(progress):
            yield
    finally:
        progress.close()


class _CompileProgress:
    """Progress display that is called for every compiled function and starts with the first."""

    def __init__(self) -> None:
        self._started: float | None = None
        self._kernels = self._functions = 0
        self._now: CompileProgress | None = None

    def __call__(self, state: CompileProgress | None) -> None:
        """Update the display, see `vedette.kernels.base.compile_progress.watched`."""
        if self._started is None:
            self._begin()
        if state is None:
            self._kernels += self._now is not None
            self._functions += self._now.num_functions if self._now is not None else 0
        self._now = state
        self._line.update(self._task, description=self._text())

    def close(self) -> None:
        """Replace the display by one line with the number of kernels and the time."""
        if self._started is None:
            return
        self._line.stop()
        seconds = time.monotonic() - self._started
        self._console.print(f"compiled {pluralise(self._kernels, 'kernel')} in {seconds:.0f} s", soft_wrap=True)

    def _begin(self) -> None:
        from rich.progress import Progress, TextColumn, TimeElapsedColumn

        from vedette.kernels.base.cache_paths import cache_directory

        self._started = time.monotonic()
        self._console = console(stderr=True)
        where = f"kept in {cache_directory()}"
        self._console.print(f"compiling kernels for this machine: once, a minute or two, {where}", soft_wrap=True)
        self._line = Progress(
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._task = self._line.add_task("")
        self._line.start()

    def _text(self) -> str:
        done = f"{pluralise(self._kernels, 'kernel')} done"
        if self._now is None:
            return done
        progress = f"{self._now.num_done} of {pluralise(self._now.num_functions, 'function')}"
        return f"{done}, {self._now.name}: {progress}"
