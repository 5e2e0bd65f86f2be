"""The command that compares planners and trackers with the library's own: benchmark."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.campaign import load_workers, run_with_progress
from vedette.cli.comparisons import print_standings
from vedette.cli.errors import option_errors, usage_error
from vedette.cli.options import Seed, Trust, Workers
from vedette.cli.output import echo, emit_json, note, print_names
from vedette.cli.running import CodeTrust, interruptible
from vedette.cli.scenario_files import write_text
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from vedette.campaigns import Campaign
    from vedette.campaigns.benchmark import Entrant, Scene

_RUNS, _QUICK_RUNS = 30, 2
_ENTRANT_FORM = (
    "NAME=COMMAND of a program that speaks JSON lines, NAME=file.py:attribute or NAME=package.module:attribute."
)

Planners = Annotated[
    list[str] | None, typer.Option("--planner", metavar="NAME=WHAT", help=f"A planner: {_ENTRANT_FORM}")
]
Trackers = Annotated[
    list[str] | None, typer.Option("--tracker", metavar="NAME=WHAT", help="A tracker, in the same form.")
]
SceneNames = Annotated[
    str | None,
    typer.Option("--scenes", metavar="LIST", help="Scenes of --list; default: all that suit the entrants."),
]
Runs = Annotated[
    int | None,
    typer.Option("--runs", metavar="N", min=1, help="Paired runs per scene; default: 30, with --quick 2."),
]
Quick = Annotated[bool, typer.Option("--quick", help="Only the small scenes; takes a minute.")]
Timeout = Annotated[
    float, typer.Option("--timeout", metavar="SECONDS", min=1e-3, help="Time limit of a program for each answer.")
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Results folder; later calls may add entrants.")]
ListScenes = Annotated[bool, typer.Option("--list", help="List the scenes and exit.")]


def benchmark(
    planners: Planners = None,
    trackers: Trackers = None,
    names: SceneNames = None,
    runs: Runs = None,
    quick: Quick = False,
    seconds: Timeout = 1.0,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Out = Path("benchmark"),
    list_: ListScenes = False,
    trust: Trust = False,
) -> None:
    """Compare your planners and trackers with the built-in ones, rules of thumb and oracles, on the same scenes.

    Runs that are already in the folder are skipped. Prints a table per scene and writes a page.
    """
    require_packages("vedette benchmark", "jinja2", "matplotlib", "pyarrow")
    if list_:
        _print_list()
        return
    load_workers(workers)
    from vedette.campaigns.benchmark import OWN, campaign_of, clear_stale_results, entrant

    with option_errors({"planner": "--planner", "tracker": "--tracker"}):
        entrants = [entrant("planner", text, seconds=seconds, folder=Path()) for text in planners or ()]
        entrants += [entrant("tracker", text, seconds=seconds, folder=Path()) for text in trackers or ()]
    num_runs = runs or (_QUICK_RUNS if quick else _RUNS)
    build_campaign = partial(campaign_of, runs=num_runs, seed=seed, folder=out, approve=CodeTrust(trust))
    scenes = _select_scenes(names, quick, entrants)
    for each in entrants:  # before any result is saved
        _check_entrant(each, scenes, build_campaign)
    for scene in scenes:
        for current in (*(each for each in entrants if each.role == scene.role), None):  # those that may fail first
            folder = out / scene.name / (OWN if current is None else current.name)
            note(f"{scene.name}: {folder.name}")
            campaign = build_campaign(scene, current)
            clear_stale_results(campaign, folder)
            run_with_progress(campaign, folder, workers)
    _report(scenes, seed, out)


def _print_list() -> None:
    from vedette.campaigns.benchmark import scenes

    print_names({name: scene.about for name, scene in scenes().items()})
    emit_json([{"name": name, "role": scene.role, "about": scene.about} for name, scene in scenes().items()])


def _select_scenes(names: str | None, quick: bool, entrants: list[Entrant]) -> list[Scene]:
    from vedette.campaigns.benchmark import scenes

    all_scenes = scenes()
    if names is not None:
        requested = [name.strip() for name in names.split(",")]
        for name in requested:
            if name not in all_scenes:
                raise usage_error(f"expected some of {', '.join(all_scenes)}; got {name!r}", "--scenes")
        return [all_scenes[name] for name in requested]
    roles = {entrant.role for entrant in entrants} or {scene.role for scene in all_scenes.values()}
    return [scene for scene in all_scenes.values() if scene.role in roles and (scene.quick or not quick)]


def _check_entrant(entrant: Entrant, scenes: Sequence[Scene], build_campaign: Callable[..., Campaign]) -> None:
    """Raise an error unless an entrant suits one of the scenes and can be started there."""
    from vedette.campaigns.benchmark import check_entrant

    suitable = next((scene for scene in scenes if scene.role == entrant.role), None)
    if suitable is None:
        got = ", ".join(scene.name for scene in scenes)
        raise usage_error(f"expected a scene of {entrant.role}s for {entrant.name}, see --list; got {got}", "--scenes")
    check_entrant(entrant, build_campaign(suitable, entrant))


def _report(scenes: Sequence[Scene], seed: int, out: Path) -> None:
    """Write the tables of all scenes with results, and print those of `scenes`."""
    from vedette.campaigns.benchmark import scenes as all_scenes
    from vedette.campaigns.leaderboard import benchmark_csv, benchmark_markdown, benchmark_provenance, scene_table
    from vedette.reports.benchmark import write_benchmark

    tables = [table for scene in all_scenes().values() if (table := scene_table(scene, out)) is not None]
    with interruptible(f"{out} keeps every run; the same command writes the tables"):
        facts = benchmark_provenance(tables, seed)
        write_text(out / "benchmark.md", benchmark_markdown(tables, facts))
        write_text(out / "benchmark.csv", benchmark_csv(tables))
        write_benchmark(tables, facts, page := out / "benchmark.html")
    printed = [table for table in tables if table.scene in scenes]
    for table in printed:
        print_standings(table)
        echo()
    echo(f"wrote {out}; open {page}")
    emit_json({"folder": out, "report": page, "scenes": [asdict(table) for table in printed]})
