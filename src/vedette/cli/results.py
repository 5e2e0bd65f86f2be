"""The command that reads results, of a campaign or of a single run: results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.comparisons import print_comparison
from vedette.cli.errors import usage_error
from vedette.cli.running import print_run
from vedette.errors import VedetteError
from vedette.text import counted

if TYPE_CHECKING:
    from vedette.campaigns import Failed
    from vedette.campaigns.journal import Failure
    from vedette.campaigns.results import CampaignResults
    from vedette.scenarios import Scenario
    from vedette.simulation.records import RunRecord

_SHOWN_FAILURES = 10
_FORMATS = ("parquet", "csv", "netcdf")


def results(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Results folder of a campaign, finished or not; or of a single run.")
    ],
    export: Annotated[
        Path | None, typer.Option("--export", metavar="DIR", help="Folder for the results as files of other tools.")
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option("--format", metavar="NAME", help="Of the files: parquet (default), csv, netcdf; may be repeated."),
    ] = None,
) -> None:
    """Print the comparison of a campaign's strategies, and what is still to be run, or a single run; export either."""
    for name in formats or ():
        if name not in _FORMATS:
            raise usage_error(f"expected one of {', '.join(_FORMATS)}; got {name}", "--format")
    if formats and export is None:
        raise usage_error("expected with --export, which names the folder", "--format")
    from vedette.campaigns.results import open_results
    from vedette.simulation.storage import holds_run, load_run

    opened: CampaignResults | RunRecord
    if holds_run(folder):
        opened = load_run(folder)
        print_run(opened, _scenario_of(folder))
    else:
        opened = open_results(folder)
        print_results(opened)
    if export is not None:
        from vedette.campaigns.export import FORMATS

        for name in dict.fromkeys(formats or ("parquet",)):
            for path in FORMATS[name](opened, export):
                typer.echo(f"wrote {path}")


def _scenario_of(folder: Path) -> Scenario | None:
    """That of a saved run; None where it is not kept beside it, or cannot be read."""
    from vedette.scenarios import load_scenario
    from vedette.simulation.storage import SCENARIO

    try:
        return load_scenario(folder / SCENARIO)
    except VedetteError:
        return None


def print_failures(failed: Sequence[Failed | Failure], *, err: bool = False) -> None:
    """The first of the runs that could not be finished, each with where it stopped."""
    for result in failed[:_SHOWN_FAILURES]:
        typer.echo(f"  cell {result.cell}, run {result.run}: {result.message}", err=err)
    if len(failed) > _SHOWN_FAILURES:
        typer.echo(f"  and {len(failed) - _SHOWN_FAILURES} more", err=err)


def print_results(opened: CampaignResults) -> None:
    """One comparison a group of settings, then how many runs there are and how many are missing."""
    for group in opened.comparisons():
        if title := opened.title(group):
            typer.echo(f"{title}:")
        print_comparison(group.comparison)
        typer.echo("")
    print_progress(opened)


def print_progress(opened: CampaignResults) -> None:
    """How many runs there are and how many are missing, of which cells, and why."""
    campaign = opened.campaign
    missing = {cell.name: len(opened.missing(cell.name)) for cell in campaign.cells}
    total = campaign.total
    typer.echo(f"{campaign.name}, seed {campaign.seed}: {total - sum(missing.values())} of {total} runs are finished")
    for cell, number in missing.items():
        if number:
            typer.echo(f"missing of {cell}: {number}")
    failures = opened.failures()
    if failures:
        typer.echo(f"failed: {counted(len(failures), 'run')}, which the same command tries again:")
        print_failures(failures)
    tables = opened.folder / "tables"
    if tables.is_dir():
        typer.echo(f"tables: {tables}")
