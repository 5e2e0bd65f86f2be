"""The command that prints and exports saved results, of a campaign or a single run: results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.comparisons import print_comparison
from vedette.cli.documents import results_document, run_document
from vedette.cli.errors import check_ending, usage_error
from vedette.cli.options import ResultsFolder
from vedette.cli.output import echo, emit_json, note
from vedette.cli.run_summary import print_run
from vedette.errors import VedetteError
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.campaigns import FailedRun
    from vedette.campaigns.database import Failure
    from vedette.campaigns.results import CampaignResults, GroupComparison
    from vedette.scenarios import Scenario
    from vedette.simulation.records import RunRecord

_MAX_SHOWN_FAILURES = 10
Format = StrEnum("Format", ["parquet", "csv", "netcdf"])
Export = Annotated[
    Path | None, typer.Option("--export", metavar="DIR", help="Folder for the results as files of other tools.")
]
Formats = Annotated[
    list[Format] | None,
    typer.Option("--format", metavar="NAME", help="Of the files: parquet (default), csv, netcdf; may be repeated."),
]
TexFile = Annotated[
    Path | None, typer.Option("--tex", metavar="FILE", help="Write the comparisons as LaTeX tables (booktabs).")
]


def results(folder: ResultsFolder, export: Export = None, formats: Formats = None, tex: TexFile = None) -> None:
    """Print the comparison of a campaign's strategies and what is still to be run, or a single run. Export either."""
    _check_options(export, formats or (), tex)
    from vedette.simulation.storage import holds_run

    opened, document, written = _show_run(folder, tex) if holds_run(folder) else _show_campaign(folder, tex)
    if export is not None:
        from vedette.campaigns.export import FORMATS

        for name in dict.fromkeys(formats or ("parquet",)):
            written += FORMATS[name](opened, export)
    for path in written:
        echo(f"wrote {path}")
    emit_json({**document, "written": written})


def _check_options(export: Path | None, formats: Sequence[str], tex: Path | None) -> None:
    if formats and export is None:
        raise usage_error("expected with --export, which names the folder", "--format")
    check_ending(tex, "--tex", "tex")
    require_packages("vedette results", "pyarrow")
    if "netcdf" in formats:
        require_packages("vedette results --format netcdf", "xarray")


def _show_run(folder: Path, tex: Path | None) -> tuple[RunRecord, dict[str, Any], list[Path]]:
    """Print a saved run, and return it, its document, and no files."""
    from vedette.evaluation.fit import Fit
    from vedette.simulation.storage import load_run, read_manifest

    record, scenario = load_run(folder), _load_scenario(folder)
    fit = Fit.from_dict(read_manifest(folder).get("fit"))
    if tex is not None:
        raise usage_error(f"expected of a campaign; {folder} holds a single run", "--tex")
    print_run(record, scenario, fit)
    return record, run_document(record, scenario, fit), []


def _show_campaign(folder: Path, tex: Path | None) -> tuple[CampaignResults, dict[str, Any], list[Path]]:
    """Print the results of a campaign. Return them, their document, and the file of LaTeX tables if one is written."""
    from vedette.campaigns.results import open_results

    opened = open_results(folder, num_workers=0)
    groups = opened.comparisons()
    print_results(opened, groups)
    written = [] if tex is None else [_write_tex(opened, groups, tex)]
    return opened, results_document(opened, groups), written


def _write_tex(opened: CampaignResults, groups: Sequence[GroupComparison], path: Path) -> Path:
    from vedette.evaluation.tables import strategy_latex
    from vedette.internal.files import write_whole

    session = opened.manifest["sessions"][-1]
    origin = f"seed {opened.campaign.seed}, vedette {session['versions']['vedette']}, {opened.manifest['digest'][:12]}"
    tables = [
        f"% {opened.title(group) or opened.campaign.name}: {origin}\n{strategy_latex(group.comparison)}"
        for group in groups
    ]
    try:
        write_whole(path, lambda file: file.write("\n".join(tables).encode()))
    except OSError as error:
        raise usage_error(f"expected a place to write tables; got {path}: {error.strerror}", "--tex") from None
    return path


def _load_scenario(folder: Path) -> Scenario | None:
    """Return the scenario of a saved run. Print a note and return None if it is missing or cannot be read."""
    from vedette.scenarios import load_scenario
    from vedette.simulation.storage import SCENARIO

    try:
        return load_scenario(folder / SCENARIO)
    except VedetteError as error:
        note(f"without its scenario: {error}")
        return None


def print_failures(failed: Sequence[FailedRun | Failure], print_line: Callable[[str], None] = echo) -> None:
    """Print the first failed runs, each with its error."""
    for result in failed[:_MAX_SHOWN_FAILURES]:
        print_line(f"  cell {result.cell}, run {result.run}: {result.message}")
    if len(failed) > _MAX_SHOWN_FAILURES:
        print_line(f"  and {len(failed) - _MAX_SHOWN_FAILURES} more")


def print_results(opened: CampaignResults, groups: Sequence[GroupComparison]) -> None:
    """Print the comparison of each group of settings, then the number of finished and missing runs."""
    for group in groups:
        if title := opened.title(group):
            echo(f"{title}:")
        words = tuple(cell.words for cell in group.cells) if opened.campaign.compare == "planner" else ()
        print_comparison(group.comparison, words)
        echo("")
    print_progress(opened)


def print_progress(opened: CampaignResults) -> None:
    """Print the number of finished runs, the number of missing runs of each cell, and the failed runs."""
    campaign = opened.campaign
    missing = {cell.name: len(opened.missing(cell.name)) for cell in campaign.cells}
    total = campaign.total
    finished = f"all {total}" if not any(missing.values()) else f"{total - sum(missing.values())} of {total}"
    tables = opened.folder / "tables"
    where = f"; tables in {tables}" if tables.is_dir() else ""
    echo(f"{campaign.name}, seed {campaign.seed}: {finished} runs are finished{where}")
    for cell, number in missing.items():
        if number:
            echo(f"missing: {pluralise(number, 'run')} of {cell}")
    failures = opened.failures()
    if failures:
        echo(f"failed: {pluralise(len(failures), 'run')}; the same command tries again:")
        print_failures(failures)
