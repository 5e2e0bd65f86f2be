"""The command that repeats a published comparison: reproduce."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

ComparisonName = Annotated[
    str,
    typer.Argument(
        help="A published comparison of --list, a built-in scenario, or a scenario file.",
        autocompletion=reproducible,
    ),
]
PlannerNames = Annotated[
    str | None,
    typer.Option(
        "--planners",
        metavar="LIST",
        help="Strategies to compare, the first is the reference; else those of the published "
        "comparison, or jdm,idm,assigned_target,random.",
        autocompletion=lists_of_strategies,
    ),
]
Runs = Annotated[
    int | None, typer.Option("--runs", min=1, help="Paired runs of each strategy; else as published, or 30.")
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for all of it; else reproduction, or the comparison's name."),
]
ListComparisons = Annotated[bool, typer.Option("--list", help="List the published comparisons, and stop.")]


def reproduce(
    name: ComparisonName = "paper-a",
    planners: PlannerNames = None,
    runs: Runs = None,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Out = None,
    list_: ListComparisons = False,
    trust: Trust = False,
) -> None:
    """Compare strategies over paired runs, as the paper does, or on a published scene beside what is published of it.

    A campaign with its report, tables and figures.
    """
    require_packages("vedette reproduce", "jinja2", "matplotlib", "pyarrow")
    if list_:
        _print_list()
        return
    load_workers(workers)
    from vedette.campaigns import open_results, resolve
    from vedette.campaigns.published import published_comparisons

    published = published_comparisons().get(name)
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
    document = _print_outcome(opened, groups, published)
    page = _write(opened, published, folder)
    emit_json({**results_document(opened, groups), **document, "report": page})
    report_failures(outcome.failed)


def comparison_spec(
    scenario: str, planners: str | None, runs: int | None, seed: int, name: str = _FOLDER
) -> CampaignSpec:
    """Return the campaign of strategies on one scenario from the command line. Raise `VedetteError` without one."""
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


def _print_list() -> None:
    from vedette.campaigns.published import published_comparisons

    titles = {name: published.title for name, published in published_comparisons().items()}
    print_names(titles)
    emit_json([{"name": name, "title": title} for name, title in titles.items()])


def _print_outcome(
    opened: CampaignResults, groups: Sequence[GroupComparison], published: PublishedComparison | None
) -> dict[str, Any]:
    """Print the results, and what is published of them, and return the published part of the document."""
    if published is None:
        print_results(opened, groups)
        return {"published": [], "claims": []}
    from vedette.campaigns.published import checked_claims, provenance

    claims = [claim for group in groups for claim in checked_claims(published, group.comparison)]
    if published.claims:
        print_results(opened, groups)
    else:
        _print_scores(opened, groups, published)
    _print_claims(claims)
    for line in provenance(published):
        console().print(line, style="dim")
    if not published.claims:
        print_progress(opened)
    scores = [asdict(score) for score in published.published]
    return {"published": scores, "claims": [claim._asdict() for claim in claims]}


def _print_scores(opened: CampaignResults, groups: Sequence[GroupComparison], published: PublishedComparison) -> None:
    """Print the scores of the strategies next to the published ones."""
    from vedette.campaigns.scores import score_strategies

    for group in groups:
        if title := opened.title(group):
            echo(f"{title}:")
        print_scores((*score_strategies(group), *published.published), group.comparison)
        echo("")


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
        if published is None or published.claims:
            write_summary(opened, folder)
            write_figures(opened, folder / "figures")
        else:  # with a decision at every scan there would be hundreds of figures: `vedette report --figures`
            write_text(folder / PUBLISHED_PAGE, published_markdown(opened, published))
        write_report(opened, page := folder / "report.html", trust=True)  # the code that it names has just run
    echo(f"Wrote {folder}. Open {page} in a browser.")
    return page
