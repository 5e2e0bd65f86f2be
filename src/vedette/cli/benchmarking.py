"""The command that compares planners and trackers with the library's own: benchmark."""

from __future__ import annotations

from dataclasses import asdict
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
    from vedette.campaigns.benchmark import Entrant, Scene
    from vedette.campaigns.leaderboard import SceneTable

_RUNS, _QUICK_RUNS = 30, 2
_ENTRANT_FORM = (
    "NAME=COMMAND of a program that speaks JSON lines, NAME=file.py:attribute or NAME=package.module:attribute."
)


def benchmark(
    planners: Annotated[
        list[str] | None, typer.Option("--planner", metavar="NAME=WHAT", help=f"A planner: {_ENTRANT_FORM}")
    ] = None,
    trackers: Annotated[
        list[str] | None, typer.Option("--tracker", metavar="NAME=WHAT", help="A tracker, in the same form.")
    ] = None,
    names: Annotated[
        str | None,
        typer.Option("--scenes", metavar="LIST", help="Scenes of --list; default: all that suit the entrants."),
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option("--runs", metavar="N", min=1, help="Paired runs per scene; default: 30, with --quick 2."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the small scenes; takes a minute.")] = False,
    seconds: Annotated[
        float, typer.Option("--timeout", metavar="SECONDS", min=1e-3, help="Time limit of a program for each answer.")
    ] = 1.0,
    seed: Seed = 0,
    workers: Workers = 0,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Results folder; later calls may add entrants.")
    ] = Path("benchmark"),
    list_: Annotated[bool, typer.Option("--list", help="List the scenes and exit.")] = False,
    trust: Trust = False,
) -> None:
    """Compare your planners and trackers with the built-in ones, rules of thumb and oracles, on the same scenes.

    Runs that are already in the folder are skipped. Prints a table per scene and writes a page.
    """
    require_packages("vedette benchmark", "jinja2", "matplotlib", "pyarrow")
    if not list_:
        load_workers(workers)
    from vedette.campaigns.benchmark import OWN, campaign_of, check_entrant, clear_stale_results, entrant, scenes
    from vedette.campaigns.leaderboard import scene_table

    if list_:
        print_names({name: scene.about for name, scene in scenes().items()})
        emit_json([{"name": name, "role": scene.role, "about": scene.about} for name, scene in scenes().items()])
        return
    with option_errors({"planner": "--planner", "tracker": "--tracker"}):
        entrants = [entrant("planner", each, seconds=seconds, folder=Path()) for each in planners or ()]
        entrants += [entrant("tracker", each, seconds=seconds, folder=Path()) for each in trackers or ()]
    trust_check, num_runs = CodeTrust(trust), runs or (_QUICK_RUNS if quick else _RUNS)
    chosen = _selected_scenes(names, quick, entrants)
    for each in entrants:  # before any result is saved
        suitable = next((scene for scene in chosen if scene.role == each.role), None)
        if suitable is None:
            got = ", ".join(scene.name for scene in chosen)
            raise usage_error(f"expected a scene of {each.role}s for {each.name}, see --list; got {got}", "--scenes")
        check_entrant(each, campaign_of(suitable, each, num_runs, seed, out, approve=trust_check))
    for scene in chosen:
        for current in (
            *(each for each in entrants if each.role == scene.role),
            None,
        ):  # entrants that may fail come first
            folder = out / scene.name / (OWN if current is None else current.name)
            note(f"{scene.name}: {folder.name}")
            campaign = campaign_of(scene, current, num_runs, seed, out, approve=trust_check)
            clear_stale_results(campaign, folder)
            run_with_progress(campaign, folder, workers)
    tables = [table for scene in scenes().values() if (table := scene_table(scene, out)) is not None]
    page = _write_tables(tables, seed, out)
    for table in tables:
        if table.scene in chosen:
            print_standings(table)
            echo()
    echo(f"wrote {out}; open {page}")
    emit_json({"folder": out, "report": page, "scenes": [asdict(table) for table in tables if table.scene in chosen]})


def _selected_scenes(names: str | None, quick: bool, entrants: list[Entrant]) -> list[Scene]:
    from vedette.campaigns.benchmark import scenes

    all_scenes = scenes()
    if names is not None:
        requested = [name.strip() for name in names.split(",")]
        for name in requested:
            if name not in all_scenes:
                raise usage_error(f"expected some of {', '.join(all_scenes)}; got {name!r}", "--scenes")
        return [all_scenes[name] for name in requested]
    roles = {each.role for each in entrants} or {scene.role for scene in all_scenes.values()}
    return [scene for scene in all_scenes.values() if scene.role in roles and (scene.quick or not quick)]


def _write_tables(tables: list[SceneTable], seed: int, out: Path) -> Path:
    from vedette.campaigns.leaderboard import benchmark_csv, benchmark_markdown, benchmark_provenance
    from vedette.reports.benchmark import write_benchmark

    with interruptible(f"{out} keeps every run; the same command writes the tables"):
        facts = benchmark_provenance(tables, seed)
        write_text(out / "benchmark.md", benchmark_markdown(tables, facts))
        write_text(out / "benchmark.csv", benchmark_csv(tables))
        write_benchmark(tables, facts, page := out / "benchmark.html")
    return page
