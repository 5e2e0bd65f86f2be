"""Progress of a campaign: a live line on a terminal or in a notebook, occasional lines elsewhere."""

from __future__ import annotations

import importlib.util
import time
from typing import TYPE_CHECKING

from vedette.campaigns.cells import Campaign
from vedette.campaigns.running import ProgressObserver
from vedette.campaigns.tasks import CompletedRun, FailedRun
from vedette.internal.text import with_unit

if TYPE_CHECKING:
    from rich.console import Console

_SHOWN_FAILURES = 3
_LOG_SECONDS, _NOTEBOOK_SECONDS = 600.0, 15.0  # between two lines
_ROOM_FOR_BAR = 90


class Progress(ProgressObserver):
    """Progress display: finished runs, rate, remaining time, and running mean error of the compared strategies.

    A context manager to pass to `run_campaign` as its `progress`. In a notebook the line is updated in place if
    ipywidgets is installed. Otherwise one is printed every 15 s.
    """

    def __init__(self, campaign: Campaign, console: Console | None = None) -> None:
        """Create the display before the first run.

        Args:
            campaign: the campaign to run.
            console: rich console to write to. None: standard error, in a notebook the output of the cell.
        """
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bars

        self._console = Console(stderr=True) if console is None else console
        notebook = self._console.is_jupyter
        self._terminal = self._console.is_terminal or (notebook and importlib.util.find_spec("ipywidgets") is not None)
        self._line_seconds = _NOTEBOOK_SECONDS if notebook else _LOG_SECONDS
        bar = (BarColumn(bar_width=20),) if self._console.width >= _ROOM_FOR_BAR else ()
        self._bar = Bars(
            *bar,
            TextColumn("{task.description}", markup=False),
            console=self._console,
            disable=not self._terminal,
            transient=True,
        )
        self._bars = self._bar.add_task("starting", total=None)
        self._name = campaign.name
        # Means over several settings are meaningless.
        alone = len(campaign.groups()) == 1
        self._label = {cell.name: str(cell.settings[campaign.compare]) for cell in campaign.cells} if alone else {}
        self._unit = campaign.cells[0].scenario.model.ospa.unit
        self._errors: dict[str, tuple[int, float]] = {}  # number of runs and sum of errors
        self._existing = self._completed = self._total = self._failures = 0
        self._first_at = self._last_line_at = time.monotonic()

    def __enter__(self) -> Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, num_existing: int, num_runs: int) -> None:
        """See `vedette.campaigns.ProgressObserver`."""
        self._existing, self._total = num_existing, num_runs
        existing = f", {num_existing} are there already" if num_existing else ""
        if num_existing < num_runs and (num_existing or not self._terminal):
            self.note(f"{self._name}: {num_runs} runs{existing}")
        self._bar.update(self._bars, total=num_runs, completed=num_existing, description=f"{num_existing}/{num_runs}")

    def note(self, text: str) -> None:
        """See `vedette.campaigns.ProgressObserver`."""
        self._console.print(text, soft_wrap=True)

    def completed(self, result: CompletedRun) -> None:
        """See `vedette.campaigns.ProgressObserver`."""
        now = time.monotonic()
        if self._completed == 0:  # the rate excludes the loading and compiling before the first run
            self._first_at = now
        self._completed += 1
        if result.cell in self._label:
            number, total = self._errors.get(self._label[result.cell], (0, 0.0))
            self._errors[self._label[result.cell]] = number + 1, total + result.ospa
        if self._terminal:
            self._bar.update(self._bars, advance=1, description=self._description(now))
        elif now - self._last_line_at > self._line_seconds:
            self._last_line_at = now
            self.note(self._description(now))

    def failed(self, result: FailedRun) -> None:
        """See `vedette.campaigns.ProgressObserver`."""
        self._failures += 1
        if self._failures <= _SHOWN_FAILURES:
            self.note(f"cell {result.cell}, run {result.run} failed: {result.message}")

    def _description(self, now: float) -> str:
        done = self._existing + self._completed
        parts = [f"{done}/{self._total}"]
        rate = (self._completed - 1) / (now - self._first_at) if self._completed > 1 and now > self._first_at else 0.0
        if rate:
            seconds = round((self._total - done) / rate)
            parts += [f"{rate:.1f}/s", f"{seconds // 60}:{seconds % 60:02d} left"]
        parts += [
            f"{name} {with_unit(f'{total / num:.1f}', self._unit)}" for name, (num, total) in self._errors.items()
        ]
        return "  ".join(parts)
