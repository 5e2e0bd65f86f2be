"""The command that merges the results folders of shards into one: merge."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.output import echo, echo_error, emit_json
from vedette.cli.running import interruptible
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.campaigns import MergeResult

_MAX_SHOWN_COMMANDS = 3

Folders = Annotated[
    list[Path], typer.Argument(metavar="DIR", help="Results folders of shards, or folders that contain them.")
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Results folder; default: named after the campaign.")
]
WriteTables = Annotated[
    bool, typer.Option("--tables/--no-tables", help="Write tables for other tools if no run is missing.")
]


def merge(folders: Folders, out: Out = None, tables: WriteTables = True) -> None:
    """Merge the results folders of shards into one, and name missing shards."""
    require_packages("vedette merge", "pyarrow")
    from vedette.campaigns import merging

    with interruptible("nothing of this call was kept; the shards are as they were"):
        merged = merging.merge(folders, out, tables=tables)
    results = merged.results
    campaign = results.campaign
    finished = campaign.total - merged.num_missing
    echo(f"{results.folder}: {finished} of {campaign.total} runs, {merged.num_added} of them new")
    commands = _commands(merged)
    emit_json(
        {
            "campaign": campaign.name,
            "folder": results.folder,
            "runs": campaign.total,
            "finished": finished,
            "missing_shards": merged.missing,
            "commands": commands,
        }
    )
    if commands:
        _print_missing(merged, commands)
        raise typer.Exit(1)
    place = shlex.quote(str(results.folder))
    echo(f"next: vedette results {place}; vedette report {place}")


def _print_missing(merged: MergeResult, commands: list[str]) -> None:
    from vedette.campaigns.shards import ranges

    echo_error(f"missing: {pluralise(merged.num_missing, 'run')}, which these run (SPEC: the campaign's file):")
    for command in commands[:_MAX_SHOWN_COMMANDS]:
        echo_error(f"  {command}")
    if len(commands) > _MAX_SHOWN_COMMANDS:
        job_array = f"sbatch --array={ranges(merged.missing)} SCRIPT"
        echo_error(f"  and so on, {len(commands)} shards; as a job array: {job_array}")


def _commands(merged: MergeResult) -> list[str]:
    """Return the command for each missing shard, or a single command if the campaign was not divided."""
    words = ["vedette", "campaign", "SPEC", f"--runs={merged.results.campaign.num_runs}", "--out"]
    if merged.count == 1:
        return [shlex.join([*words, str(merged.results.folder)]) for _ in merged.missing]
    words.append(str(merged.shards))
    return [shlex.join([*words, "--shard", f"{number}/{merged.count}"]) for number in merged.missing]
