"""How a long command shows how far it is: on a terminal only, so that logs stay short."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from vedette.campaigns import Campaign, Failed, Landed

_SHOWN_FAILURES = 3


class CampaignProgress:
    """Runs done, their rate, the time left, and the running mean error of what is compared."""

    def __init__(self, campaign: Campaign) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        console = Console(stderr=True)
        columns = (BarColumn(bar_width=20), MofNCompleteColumn(), TextColumn("{task.description}"))
        self._bar = Progress(*columns, console=console, disable=not console.is_terminal, transient=True)
        self._bars = self._bar.add_task("starting", total=None)
        self._label = {cell.name: str(cell.settings[campaign.compare]) for cell in campaign.cells}
        self._errors: dict[str, list[float]] = {}
        self._started, self._landed, self._left, self._failures = time.monotonic(), 0, 0, 0

    def __enter__(self) -> CampaignProgress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, num_found: int, num_runs: int) -> None:
        """See `vedette.campaigns.Watch`."""
        self._left = num_runs - num_found
        if num_found and self._left:
            typer.echo(f"going on: {num_found} of {num_runs} runs are there already", err=True)
        self._bar.update(self._bars, total=num_runs, completed=num_found)

    def note(self, text: str) -> None:
        """See `vedette.campaigns.Watch`."""
        typer.echo(text, err=True)

    def landed(self, result: Landed) -> None:
        """See `vedette.campaigns.Watch`."""
        self._landed += 1
        self._errors.setdefault(self._label[result.cell], []).append(result.ospa)
        self._bar.update(self._bars, advance=1, description=self._description())

    def failed(self, result: Failed) -> None:
        """See `vedette.campaigns.Watch`."""
        self._failures += 1
        if self._failures <= _SHOWN_FAILURES:
            typer.echo(f"cell {result.cell}, run {result.run} failed: {result.message}", err=True)

    def _description(self) -> str:
        spent = time.monotonic() - self._started
        rate = self._landed / spent if spent > 0.0 else 0.0
        seconds = round((self._left - self._landed) / rate) if rate else 0
        means = "  ".join(f"{name} {sum(values) / len(values):.1f} m" for name, values in self._errors.items())
        return f"{rate:.1f}/s, {seconds // 60}:{seconds % 60:02d} left  {means}"
