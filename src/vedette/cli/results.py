"""The command that reads results, of a campaign or of a single run: results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.comparisons import print_comparison
from vedette.cli.completing import one_of
from vedette.cli.documents import results_document, run_document
from vedette.cli.errors import usage_error
from vedette.cli.output import publish, say
from vedette.cli.running import print_run
from vedette.errors import VedetteError
from vedette.extras import need
from vedette.text import counted

if TYPE_CHECKING:
    from vedette.campaigns import Failed
    from vedette.campaigns.journal import Failure
    from vedette.campaigns.results import CampaignResults, GroupComparison
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
        typer.Option(
            "--format",
            metavar="NAME",
            help="Of the files: parquet (default), csv, netcdf; may be repeated.",
            autocompletion=one_of(*_FORMATS),
        ),
    ] = None,
) -> None:
    """Print the comparison of a campaign's strategies, and what is still to be run, or a single run; export either."""
    for name in formats or ():
        if name not in _FORMATS:
            raise usage_error(f"expected one of {', '.join(_FORMATS)}; got {name}", "--format")
    if formats and export is None:
        raise usage_error("expected with --export, which names the folder", "--format")
    need("vedette results", "pyarrow")
    from vedette.campaigns.results import open_results
    from vedette.simulation.storage import holds_run, load_run

    opened: CampaignResults | RunRecord
    if holds_run(folder):
        opened = load_run(folder)
        scenario = _scenario_of(folder)
        print_run(opened, scenario)
        document = run_document(opened, "" if scenario is None else scenario.model.ospa.unit)
    else:
        opened = open_results(folder)
        groups = opened.comparisons()
        print_results(opened, groups)
        document = results_document(opened, groups)
    written: list[Path] = []
    if export is not None:
        from vedette.campaigns.export import FORMATS

        for name in dict.fromkeys(formats or ("parquet",)):
            written += FORMATS[name](opened, export)
        for path in written:
            say(f"wrote {path}")
    publish({**document, "written": written})


def _scenario_of(folder: Path) -> Scenario | None:
    """That of a saved run; None where it is not kept beside it, or cannot be read."""
    from vedette.scenarios import load_scenario
    from vedette.simulation.storage import SCENARIO

    try:
        return load_scenario(folder / SCENARIO)
    except VedetteError:
        return None


def print_failures(failed: Sequence[Failed | Failure], tell: Callable[[str], None] = say) -> None:
    """The first of the runs that could not be finished, each with where it stopped."""
    for result in failed[:_SHOWN_FAILURES]:
        tell(f"  cell {result.cell}, run {result.run}: {result.message}")
    if len(failed) > _SHOWN_FAILURES:
        tell(f"  and {len(failed) - _SHOWN_FAILURES} more")


def print_results(opened: CampaignResults, groups: Sequence[GroupComparison]) -> None:
    """One comparison a group of settings, then how many runs there are and how many are missing."""
    for group in groups:
        if title := opened.title(group):
            say(f"{title}:")
        print_comparison(group.comparison)
        say("")
    print_progress(opened)


def print_progress(opened: CampaignResults) -> None:
    """How many runs there are and how many are missing, of which cells, and why."""
    campaign = opened.campaign
    missing = {cell.name: len(opened.missing(cell.name)) for cell in campaign.cells}
    total = campaign.total
    say(f"{campaign.name}, seed {campaign.seed}: {total - sum(missing.values())} of {total} runs are finished")
    for cell, number in missing.items():
        if number:
            say(f"missing of {cell}: {number}")
    failures = opened.failures()
    if failures:
        say(f"failed: {counted(len(failures), 'run')}, which the same command tries again:")
        print_failures(failures)
    tables = opened.folder / "tables"
    if tables.is_dir():
        say(f"tables: {tables}")
