"""The command that reports on a campaign."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.errors import usage_error
from vedette.cli.running import interruptible
from vedette.errors import InputError
from vedette.extras import need


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results folder of a campaign, finished or not.")],
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
        with _named({"path": "--out", "replays": "--runs", "cell": "--runs"}):
            write_report(results, page, replays=replays, trust=trust)
        typer.echo(f"wrote {page}")
        if (code := code_in_replays(results)) and not trust:
            typer.echo(f"without measurements, as drawing them runs {', '.join(code)}: --trust allows it", err=True)
        if figures is not None:
            with _named({"path": "--figures"}):
                written = write_figures(results, figures)
            typer.echo(f"wrote {len(written)} files to {figures}")


@contextmanager
def _named(options: Mapping[str, str]) -> Iterator[None]:
    """Errors of arguments of the library's functions, by the options that give them."""
    try:
        yield
    except InputError as error:
        field, _, rest = str(error).partition(": ")
        if field not in options:
            raise
        raise InputError(f"{options[field]}: {rest}") from error


def _cell_and_run(text: str) -> tuple[str, int]:
    cell, colon, run = text.strip().rpartition(":")
    if not colon or not cell or not (run.isascii() and run.isdigit()):
        raise usage_error(f"expected CELL:RUN, such as jdm:0; got {text.strip()!r}", "--runs")
    return cell, int(run)
