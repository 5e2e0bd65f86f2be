"""The command that repeats a published comparison: reproduce."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.campaign import carry_out, load_workers, report_failures
from vedette.cli.comparisons import print_scores
from vedette.cli.completing import lists_of_strategies, reproducible
from vedette.cli.documents import results_document
from vedette.cli.errors import usage_error
from vedette.cli.options import Seed, Trust, Workers
from vedette.cli.output import console, note, print_names, publish, say
from vedette.cli.results import print_progress, print_results
from vedette.cli.running import Approval, check_planner, interruptible
from vedette.cli.scenario_files import write_text
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from vedette.campaigns import CampaignResults, CampaignSpec
    from vedette.campaigns.published import CheckedClaim, PublishedComparison
    from vedette.campaigns.results import GroupComparison

YARDSTICK = "yardstick.md"
_RUNS = 30
_STRATEGIES = ("jdm", "idm", "assigned", "random")
_FOLDER = "reproduction"


def reproduce(
    name: Annotated[
        str,
        typer.Argument(
            help="A yardstick of --list, a built-in scenario, or a scenario file.", autocompletion=reproducible
        ),
    ] = "paper-a",
    planners: Annotated[
        str | None,
        typer.Option(
            "--planners",
            metavar="LIST",
            help="Strategies to compare, the first is the reference; else the yardstick's, or jdm,idm,assigned,random.",
            autocompletion=lists_of_strategies,
        ),
    ] = None,
    runs: Annotated[
        int | None, typer.Option("--runs", min=1, help="Paired runs of each strategy; else the yardstick's, or 30.")
    ] = None,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for all of it; else reproduction, or as the yardstick."),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List the yardsticks, and stop.")] = False,
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

    known = published_comparisons()
    if list_:
        _list(known)
        return
    yardstick = known.get(name)
    spec = compared(name, planners, runs, seed) if yardstick is None else _changed(yardstick.spec, planners, runs, seed)
    campaign = resolve(spec, approve=Approval(trust))
    folder = out or Path(_FOLDER if yardstick is None else campaign.default_folder)
    outcome = carry_out(campaign, folder, workers)
    opened = open_results(folder)
    groups = opened.comparisons()
    beside = yardstick if yardstick is not None and not yardstick.claims else None
    if beside is None:
        print_results(opened, groups)
    else:
        _print_beside_published(opened, groups, beside)
    claims = () if yardstick is None else _checked(yardstick, groups)
    if yardstick is not None:
        _print_claims(claims)
        _print_provenance(yardstick)
    if beside is not None:
        print_progress(opened)
    page = _write(opened, beside, folder)
    document = {
        "published": [asdict(score) for score in (() if yardstick is None else yardstick.published)],
        "claims": [claim._asdict() for claim in claims],
        "report": page,
    }
    publish({**results_document(opened, groups), **document})
    report_failures(outcome.failed)


def compared(scenario: str, planners: str | None, runs: int | None, seed: int, name: str = _FOLDER) -> CampaignSpec:
    """Return the campaign of strategies on one scenario from the command line; raise `VedetteError` without one."""
    from vedette.campaigns import CampaignSpec
    from vedette.campaigns.published import published_comparisons
    from vedette.scenarios import list_builtin, load_scenario
    from vedette.scenarios.loading import missing_scenario

    if scenario not in list_builtin() and not os.path.isfile(scenario):
        raise missing_scenario(scenario, f"a yardstick ({', '.join(published_comparisons())}), ", list(list_builtin()))
    loaded = load_scenario(scenario)
    for strategy in _names(planners) or ():
        check_planner(loaded, strategy, "--planners")
    spec = CampaignSpec(name=name, scenarios=(scenario,), planners=_STRATEGIES, runs=_RUNS, compare="planner")
    return _changed(spec, planners, runs, seed)


def _changed(spec: CampaignSpec, planners: str | None, runs: int | None, seed: int) -> CampaignSpec:
    """Return the campaign with the values from the command line."""
    names = _names(planners)
    if names is not None and len(set(names)) != len(names):
        raise usage_error(f"expected each strategy once; got {planners}", "--planners")
    return spec.model_copy(update={"planners": names or spec.planners, "runs": runs or spec.runs, "seed": seed})


def _names(planners: str | None) -> tuple[str, ...] | None:
    return None if planners is None else tuple(name.strip() for name in planners.split(","))


def _list(known: dict[str, PublishedComparison]) -> None:
    titles = {name: yardstick.title for name, yardstick in known.items()}
    print_names(titles)
    publish([{"name": name, "title": title} for name, title in titles.items()])


def _print_beside_published(
    opened: CampaignResults, groups: Sequence[GroupComparison], yardstick: PublishedComparison
) -> None:
    from vedette.campaigns.scores import score_strategies

    for group in groups:
        if title := opened.title(group):
            say(f"{title}:")
        print_scores((*score_strategies(group), *yardstick.published), group.comparison)
        say("")


def _print_provenance(yardstick: PublishedComparison) -> None:
    from vedette.campaigns.published import provenance

    for line in provenance(yardstick):
        console().print(line, style="dim")


def _checked(yardstick: PublishedComparison, groups: Sequence[GroupComparison]) -> tuple[CheckedClaim, ...]:
    from vedette.campaigns.published import checked_claims

    return tuple(claim for group in groups for claim in checked_claims(yardstick, group.comparison))


def _print_claims(claims: Sequence[CheckedClaim]) -> None:
    if claims:
        say("")
        say("Published claims:")
    for claim in claims:
        say(f"  {claim.outcome}: {claim.claim} ({claim.evidence})")


def _write(opened: CampaignResults, yardstick: PublishedComparison | None, folder: Path) -> Path:
    """Write the report, and tables and figures next to it."""
    from vedette.campaigns.published import published_markdown
    from vedette.reports import write_figures, write_report, write_summary

    with interruptible(f"{folder} keeps every run; the same command writes the report"):
        note("drawing the report ...")
        if yardstick is None:
            write_summary(opened, folder)
            write_figures(opened, folder / "figures")
        else:  # with a decision at every scan there would be hundreds of figures: `vedette report --figures`
            write_text(folder / YARDSTICK, published_markdown(opened, yardstick))
        write_report(opened, page := folder / "report.html", trust=True)  # the code that it names has just run
    say(f"Wrote {folder}. Open {page} in a browser.")
    return page
