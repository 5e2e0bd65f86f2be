"""The command that shows in a minute what this is about: demo."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.campaign import carry_out, load_workers, report_failures
from vedette.cli.completing import lists_of_strategies, scenarios
from vedette.cli.documents import results_document
from vedette.cli.options import Seed, Trust, Workers
from vedette.cli.output import note, publish, say
from vedette.cli.reproducing import compared
from vedette.cli.running import Approval, interruptible
from vedette.extras import need
from vedette.text import amount

_SCENE = "solent-patrol"
_STRATEGIES = "jdm,nearest,oracle"


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
    """Show one run of several strategies side by side, on one page: joint decisions, a rule of thumb, the oracle."""
    need("vedette demo", "jinja2", "matplotlib", "pyarrow")
    load_workers(workers)
    from vedette.campaigns import open_results, resolve
    from vedette.reports import write_demo

    campaign = resolve(compared(scenario, planners, 1, seed, "demo"), approve=Approval(trust))
    outcome = carry_out(campaign, out, workers)
    opened = open_results(out)
    groups = opened.comparisons()
    for comparison in (group.comparison for group in groups):
        for name in comparison.strategies:
            say(f"{name}: OSPA {amount(f'{float(comparison.summary(name).mean):.1f}', comparison.unit)}")
    with interruptible(f"{out} keeps every run; the same command writes the page"):
        page = write_demo(opened, out / "demo.html", trust=True)  # what it names has just been run
    say(f"wrote {page}")
    if not (open_ and _has_windows() and webbrowser.open(page.resolve().as_uri())):
        note("open it in a browser; Play, and Beside chooses what is shown")
    publish({**results_document(opened, groups), "page": page})
    report_failures(outcome.failed)


def _has_windows() -> bool:
    """Whether a browser would come in a window: in a terminal it would take the terminal."""
    if not sys.stdout.isatty():
        return False
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
