"""The command that reports on a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.errors import named_options, usage_error
from vedette.cli.options import ResultsFolder
from vedette.cli.output import note, publish, say
from vedette.cli.running import interruptible
from vedette.extras import need


def report(
    folder: ResultsFolder,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Where the page goes; else report.html in the folder.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Write the figures too, as PDF, SVG and PNG.")
    ] = None,
    runs: Annotated[
        str | None,
        typer.Option("--runs", metavar="CELL:RUN,...", help="Runs to replay; else the typical one of each strategy."),
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run code that the scenarios of the results name, to draw measurements.")
    ] = False,
) -> None:
    """Report on a campaign: one page that opens anywhere, with tables, figures and a replay of runs."""
    need("vedette report", "jinja2", "matplotlib", "pyarrow")
    replays = None if runs is None else [_cell_and_run(text) for text in runs.split(",")]
    page = out or folder / "report.html"
    with interruptible("what is not yet written is missing; the same command writes it all anew"):
        from vedette.campaigns.results import open_results
        from vedette.reports import code_in_replays, write_figures, write_report

        results = open_results(folder)
        with named_options({"path": "--out", "replays": "--runs", "cell": "--runs"}):
            write_report(results, page, replays=replays, trust=trust)
        say(f"wrote {page}")
        unmeasured = () if trust else code_in_replays(results)
        if unmeasured:
            note(f"without measurements, as drawing them runs {', '.join(unmeasured)}: --trust allows it")
        written: Sequence[Path] = ()
        if figures is not None:
            with named_options({"path": "--figures"}):
                written = write_figures(results, figures)
            say(f"wrote {len(written)} files to {figures}")
    publish({"page": page, "figures": written, "without_measurements_of": unmeasured})


def _cell_and_run(text: str) -> tuple[str, int]:
    cell, colon, run = text.strip().rpartition(":")
    if not colon or not cell or not (run.isascii() and run.isdigit()):
        raise usage_error(f"expected CELL:RUN, such as jdm:0; got {text.strip()!r}", "--runs")
    return cell, int(run)
