"""Command `demo`: strategies on one scene, on one page."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.campaign import load_workers, report_failures, run_with_progress
from vedette.cli.completing import lists_of_strategies, scenarios
from vedette.cli.documents import results_document
from vedette.cli.options import Seed, Trust, Workers
from vedette.cli.output import console, echo, emit_json
from vedette.cli.reproducing import comparison_spec
from vedette.cli.running import CodeTrust, interruptible
from vedette.internal.extras import require_packages
from vedette.internal.text import named_in, pluralise

if TYPE_CHECKING:
    from vedette.campaigns.results import GroupComparison

_SCENE = "eight-mobile"
_STRATEGIES = "jdm,nearest,idm,random"


def demo(
    scenario: Annotated[
        str, typer.Argument(help="A built-in scenario, or a scenario file.", autocompletion=scenarios)
    ] = _SCENE,
    planners: Annotated[
        str,
        typer.Option("--planners", metavar="LIST", help="At most four strategies.", autocompletion=lists_of_strategies),
    ] = _STRATEGIES,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the runs and the page.")] = Path("demo"),
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
    trust: Trust = False,
) -> None:
    """Compare strategies on one scene in the browser.

    One run of each strategy, on the same targets and noise.
    """
    require_packages("vedette demo", "jinja2", "matplotlib", "pyarrow")
    load_workers(workers)
    from vedette.campaigns import open_results, resolve
    from vedette.reports import write_demo

    campaign = resolve(comparison_spec(scenario, planners, 1, seed, "demo"), approve=CodeTrust(trust))
    outcome = run_with_progress(campaign, out, workers)
    opened = open_results(out)
    groups = opened.comparisons()
    for group in groups:
        _print_errors(group)
    with interruptible(f"{out} keeps every run; the same command writes the page"):
        page = write_demo(opened, out / "demo.html", trust=True)  # the code that it names has just run
    is_open = open_ and _has_windows() and webbrowser.open(page.resolve().as_uri())
    echo(f"Wrote {page} and opened it in your browser." if is_open else f"Wrote {page}. Open it in a browser.")
    echo(f"One run proves nothing; compare 30 runs with: vedette reproduce {scenario}")
    emit_json({**results_document(opened, groups), "page": page})
    report_failures(outcome.failed)


def _print_errors(group: GroupComparison) -> None:
    """Print the scene and, for each strategy, a line with its mean error."""
    from rich.table import Table

    model, comparison = group.cells[0].scenario.model, group.comparison
    times = comparison.times[comparison.counted]
    sizes = f"{pluralise(len(model.sensors), 'sensor')}, {pluralise(len(comparison.times), 'scan')}"
    shown = console()
    shown.print(f"{model.name}: {sizes}. One run of each strategy, on the same targets and noise.\n", style="bold")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("", "strategy"):
        table.add_column(heading)
    table.add_column(named_in("mean OSPA", comparison.unit), justify="right")
    for cell, name in zip(group.cells, comparison.strategies, strict=True):
        table.add_row(name, cell.words, f"{float(comparison.summary(name).mean):.1f}")
    shown.print(table)
    shown.print(f"(mean over t = {times[0]:g} to {times[-1]:g} s)\n", style="dim")


def _has_windows() -> bool:
    """Return True if a browser would open in a window instead of taking over the terminal."""
    if not sys.stdout.isatty():
        return False
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
