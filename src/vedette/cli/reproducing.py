"""The command that repeats a published comparison: reproduce."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.campaign import load_workers, report_failures, run_with_progress
from vedette.cli.comparisons import print_scores
from vedette.cli.completing import lists_of_strategies, reproducible
from vedette.cli.documents import results_document
from vedette.cli.errors import usage_error
from vedette.cli.options import Seed, Trust, Workers
from vedette.cli.output import console, echo, emit_json, note, print_names
from vedette.cli.results import print_progress, print_results
from vedette.cli.running import CodeTrust, check_planner, interruptible
from vedette.cli.scenario_files import write_text
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from vedette.campaigns import CampaignResults, CampaignSpec
    from vedette.campaigns.published import CheckedClaim, PublishedComparison
    from vedette.campaigns.results import GroupComparison

PUBLISHED_PAGE = "published-comparison.md"
_RUNS = 30
_STRATEGIES = ("jdm", "idm", "assigned_target", "random")
_FOLDER = "reproduction"


def reproduce(
    name: Annotated[
        str,
        typer.Argument(
            help="A published comparison of --list, a built-in scenario, or a scenario file.",
            autocompletion=reproducible,
        ),
    ] = "paper-a",
    planners: Annotated[
        str | None,
        typer.Option(
            "--planners",
            metavar="LIST",
            help="Strategies to compare, the first is the reference; else those of the published "
            "comparison, or jdm,idm,assigned_target,random.",
            autocompletion=lists_of_strategies,
        ),
    ] = None,
    runs: Annotated[
        int | None, typer.Option("--runs", min=1, help="Paired runs of each strategy; else as published, or 30.")
    ] = None,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for all of it; else reproduction, or the comparison's name."),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List the published comparisons, and stop.")] = False,
    trust: Trust = False,
) -> None:
    """Compare strategies over paired runs, as the paper does, or on a published scene beside what is published of it.

    A campaign with its report, tables and figures.
    """
    require_packages("vedette reproduce", "jinja2", "matplotlib", "pyarrow")
    if not list_:
        load_workers(workers)
    from vedette.campaigns import open_results, resolve
    from vedette.campaigns.published import published_comparisons

    comparisons = published_comparisons()
    if list_:
        _print_list(comparisons)
        return
    published = comparisons.get(name)
    spec = (
        comparison_spec(name, planners, runs, seed)
        if published is None
        else _with_options(published.spec, planners, runs, seed)
    )
    campaign = resolve(spec, approve=CodeTrust(trust))
    folder = out or Path(_FOLDER if published is None else campaign.default_folder)
    outcome = run_with_progress(campaign, folder, workers)
    opened = open_results(folder)
    groups = opened.comparisons()
    compared_with = published if published is not None and not published.claims else None
    if compared_with is None:
        print_results(opened, groups)
    else:
        _print_with_published(opened, groups, compared_with)
    claims = () if published is None else _check_claims(published, groups)
    if published is not None:
        _print_claims(claims)
        _print_provenance(published)
    if compared_with is not None:
        print_progress(opened)
    page = _write(opened, compared_with, folder)
    document = {
        "published": [asdict(score) for score in (() if published is None else published.published)],
        "claims": [claim._asdict() for claim in claims],
        "report": page,
    }
    emit_json({**results_document(opened, groups), **document})
    report_failures(outcome.failed)


def comparison_spec(
    scenario: str, planners: str | None, runs: int | None, seed: int, name: str = _FOLDER
) -> CampaignSpec:
    """Return the campaign of strategies on one scenario from the command line; raise `VedetteError` without one."""
    from vedette.campaigns import CampaignSpec
    from vedette.campaigns.published import published_comparisons
    from vedette.scenarios import list_builtin, load_scenario
    from vedette.scenarios.loading import missing_scenario

    if scenario not in list_builtin() and not os.path.isfile(scenario):
        raise missing_scenario(
            scenario, f"a published comparison ({', '.join(published_comparisons())}), ", list(list_builtin())
        )
    loaded = load_scenario(scenario)
    for strategy in _names(planners) or ():
        check_planner(loaded, strategy, "--planners")
    spec = CampaignSpec(name=name, scenarios=(scenario,), planners=_STRATEGIES, runs=_RUNS, compare="planner")
    return _with_options(spec, planners, runs, seed)


def _with_options(spec: CampaignSpec, planners: str | None, runs: int | None, seed: int) -> CampaignSpec:
    """Return the campaign with the values from the command line."""
    names = _names(planners)
    if names is not None and len(set(names)) != len(names):
        raise usage_error(f"expected each strategy once; got {planners}", "--planners")
    return spec.model_copy(update={"planners": names or spec.planners, "runs": runs or spec.runs, "seed": seed})


def _names(planners: str | None) -> tuple[str, ...] | None:
    return None if planners is None else tuple(name.strip() for name in planners.split(","))


def _print_list(comparisons: dict[str, PublishedComparison]) -> None:
    titles = {name: published.title for name, published in comparisons.items()}
    print_names(titles)
    emit_json([{"name": name, "title": title} for name, title in titles.items()])


def _print_with_published(
    opened: CampaignResults, groups: Sequence[GroupComparison], published: PublishedComparison
) -> None:
    from vedette.campaigns.scores import score_strategies

    for group in groups:
        if title := opened.title(group):
            echo(f"{title}:")
        print_scores((*score_strategies(group), *published.published), group.comparison)
        echo("")


def _print_provenance(published: PublishedComparison) -> None:
    from vedette.campaigns.published import provenance

    for line in provenance(published):
        console().print(line, style="dim")


def _check_claims(published: PublishedComparison, groups: Sequence[GroupComparison]) -> tuple[CheckedClaim, ...]:
    from vedette.campaigns.published import checked_claims

    return tuple(claim for group in groups for claim in checked_claims(published, group.comparison))


def _print_claims(claims: Sequence[CheckedClaim]) -> None:
    if claims:
        echo("")
        echo("Published claims:")
    for claim in claims:
        echo(f"  {claim.outcome}: {claim.claim} ({claim.evidence})")


def _write(opened: CampaignResults, published: PublishedComparison | None, folder: Path) -> Path:
    """Write the report, and tables and figures next to it."""
    from vedette.campaigns.published import published_markdown
    from vedette.reports import write_figures, write_report, write_summary

    with interruptible(f"{folder} keeps every run; the same command writes the report"):
        note("drawing the report ...")
        if published is None:
            write_summary(opened, folder)
            write_figures(opened, folder / "figures")
        else:  # with a decision at every scan there would be hundreds of figures: `vedette report --figures`
            write_text(folder / PUBLISHED_PAGE, published_markdown(opened, published))
        write_report(opened, page := folder / "report.html", trust=True)  # the code that it names has just run
    echo(f"Wrote {folder}. Open {page} in a browser.")
    return page
