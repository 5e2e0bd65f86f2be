"""The command that carries out many runs, campaign, and helpers of commands that do."""

from __future__ import annotations

import gc
import shlex
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli import completing
from vedette.cli.errors import option_errors, usage_error
from vedette.cli.options import Trust, Workers
from vedette.cli.output import console, echo, echo_error, emit_json, note
from vedette.cli.results import print_failures
from vedette.cli.running import CodeTrust, compile_if_cold, interruptible
from vedette.internal.extras import require_packages
from vedette.internal.processes import load_ahead
from vedette.internal.text import pluralise
from vedette.internal.threads import processors

if TYPE_CHECKING:
    from vedette.campaigns import Campaign, CampaignOutcome, FailedRun


Spec = Annotated[
    Path,
    typer.Argument(
        metavar="SPEC",
        help="Campaign file (TOML), or a built-in campaign.",
        autocompletion=completing.campaigns,
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Results folder; default: named after the campaign.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler: tcp://host:port or its .json file. --workers: number of workers to wait for.",
    ),
]
Runs = Annotated[
    int | None, typer.Option("--runs", metavar="N", min=1, help="Number of runs per cell; default: as in the file.")
]
RedoDamaged = Annotated[bool, typer.Option("--redo-damaged", help="Rerun results whose checksum does not match.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Print the plan and exit.")]
ShardNumber = Annotated[
    str | None,
    typer.Option(
        "--shard", metavar="NUMBER/COUNT", help="Run one share of the campaign (e.g. 17/1000) in its own folder."
    ),
]
NumSlurmTasks = Annotated[
    int | None,
    typer.Option("--slurm", metavar="COUNT", min=1, help="Print a Slurm job array with COUNT shards and exit."),
]
SlurmTime = Annotated[
    str | None, typer.Option("--time", metavar="TIME", help="Time limit of each Slurm task: 4h, 90m, 1d12h.")
]


def campaign(
    spec: Spec,
    out: Out = None,
    workers: Workers = 0,
    scheduler: Scheduler = None,
    runs: Runs = None,
    redo_damaged: RedoDamaged = False,
    dry_run: DryRun = False,
    shard: ShardNumber = None,
    slurm: NumSlurmTasks = None,
    time: SlurmTime = None,
    trust: Trust = False,
) -> None:
    """Run a campaign, or resume one.

    Runs that are already in the results folder are skipped.
    """
    require_packages("vedette campaign", "pyarrow")
    if (slurm is None) != (time is None):
        raise usage_error("expected both or neither", "--slurm and --time")
    if slurm is not None and shard is not None:
        raise usage_error("expected without --slurm, which gives each task its shard", "--shard")
    if scheduler is None and not dry_run and slurm is None:
        load_workers(workers)
    resolved = _read_campaign(spec, runs, shard, trust)
    folder = out or Path(resolved.default_folder if (shard or slurm) is None else resolved.default_shards)
    if dry_run:
        _print_plan(resolved)
    elif slurm is not None and time is not None:
        options = [*([f"--runs={runs}"] if runs else []), *(["--allow-code"] if trust else [])]
        _print_job(resolved, slurm, time, folder, ["vedette", "campaign", str(spec), "--out", str(folder), *options])
    else:
        own_folder = folder if shard is None else folder / resolved.shard.folder
        outcome = run_with_progress(resolved, own_folder, workers, scheduler, redo_damaged)
        _print_outcome(resolved, outcome, own_folder, shards=None if shard is None else folder)


def _read_campaign(spec: Path, runs: int | None, shard: str | None, trust: bool) -> Campaign:
    gc.disable()
    from vedette.campaigns import load_spec, parse_shard, resolve

    gc.freeze()  # before a user's code: loaded objects are not searched for garbage, now or at the end of the process
    gc.enable()
    resolved = resolve(load_spec(spec), spec.parent, approve=CodeTrust(trust, spec))
    if runs is not None:
        resolved = resolved.with_runs(runs)
    if shard is not None:
        with option_errors({"shard": "--shard"}):
            resolved = replace(resolved, shard=parse_shard(shard))
    return resolved


def _print_outcome(campaign: Campaign, outcome: CampaignOutcome, folder: Path, *, shards: Path | None) -> None:
    """Print the number of finished runs and the next command. shards: the folder of all shards, None: no shard."""
    finished = outcome.num_completed + outcome.num_existing
    echo(f"{folder}: {finished} of {campaign.total} runs")
    if shards is None:
        echo(f"next: vedette results {shlex.quote(str(folder))}; vedette report {shlex.quote(str(folder))}")
    else:
        echo(f"next: vedette merge {shlex.quote(str(shards))}")
    emit_json(
        {
            "campaign": campaign.name,
            "folder": folder,
            "runs": campaign.total,
            "finished": finished,
            "failed": [asdict(each) for each in outcome.failed],
        }
    )
    report_failures(outcome.failed)


def _print_job(campaign: Campaign, count: int, time: str, folder: Path, command: list[str]) -> None:
    from vedette.campaigns.cells import safe_name
    from vedette.campaigns.shards import slurm_script

    merge = shlex.join(["vedette", "merge", str(folder), "--out", campaign.default_folder])
    with option_errors({"time": "--time", "shard": "--slurm"}):
        script = slurm_script(safe_name(campaign.name), count, time, shlex.join([*command, "--workers=1"]), merge)
    echo(script.rstrip("\n"))
    emit_json({"script": script})


def load_workers(workers: int) -> None:
    """Start loading the modules of several workers while this process reads its input."""
    if (workers or processors()) > 1:
        load_ahead("vedette.cli")


def run_with_progress(
    campaign: Campaign, folder: Path, workers: int, scheduler: str | None = None, redo_damaged: bool = False
) -> CampaignOutcome:
    """Run a campaign and show its progress. After Ctrl-C, print how to continue."""
    from vedette.campaigns import Progress, run_campaign

    with interruptible(f"{folder} keeps every run that is finished; the same command goes on from there"):
        first = campaign.cells[0].scenario
        compile_if_cold(first, [cell.planner for cell in campaign.cells if cell.scenario is first])
        with Progress(campaign, console(stderr=True)) as progress:
            return run_campaign(
                campaign,
                folder,
                num_workers=workers or (1 if scheduler else processors()),
                scheduler=scheduler,
                redo_damaged=redo_damaged,
                progress=progress,
            )


def report_failures(failed: tuple[FailedRun, ...]) -> None:
    """Print the runs that failed, and exit with status 1 if there are any."""
    if not failed:
        return
    echo_error(f"failed: {pluralise(len(failed), 'run')}; the same command tries again:")
    print_failures(failed, echo_error)
    raise typer.Exit(1)


def _print_plan(campaign: Campaign) -> None:
    from vedette.scenarios.warnings import scenario_warnings

    share = f", shard {campaign.shard}" if campaign.shard.count > 1 else ""
    echo(
        f"{campaign.name}{share}: {campaign.total} runs, {campaign.num_runs} of each of {len(campaign.cells)} cells, "
        f"seed {campaign.seed}"
    )
    for field, value in campaign.spec["set"].items():
        echo(f"  set {field} = {value}")
    for variant in campaign.spec["variants"]:
        for field, value in variant["set"].items():
            echo(f"  variant {variant['name']}: {field} = {value}")
    for axis, values in campaign.axes.items():
        compared = " (compared)" if axis == campaign.compare else ""
        echo(f"  {axis}: {', '.join(str(value) for value in values)}{compared}")
    cell_of_warnings: dict[tuple[str, ...], str] = {}
    for cell in campaign.cells:
        echo(f"  - {cell.name}")
        lines = scenario_warnings(cell.scenario)
        if lines not in cell_of_warnings:  # once for all planners, filters and values with this warning
            cell_of_warnings[lines] = cell.name
            for line in lines:
                note(f"cell {cell.name}: {line}")
    emit_json(
        {
            "campaign": campaign.name,
            "seed": campaign.seed,
            "runs": campaign.total,
            "runs_of_each_cell": campaign.num_runs,
            "cells": [{"name": cell.name, **cell.settings} for cell in campaign.cells],
            "compared": campaign.compare,
            "warnings": [{"cell": cell, "lines": lines} for lines, cell in cell_of_warnings.items() if lines],
        }
    )
