"""The command line: a thin layer over the library. Each command imports what it needs when it runs."""

from collections.abc import Callable
from typing import Annotated

import typer

from vedette import __version__
from vedette.cli.benchmarking import benchmark
from vedette.cli.calibrating import calibrate
from vedette.cli.campaign import campaign
from vedette.cli.checking import check
from vedette.cli.demo import demo
from vedette.cli.errors import CommandGroup
from vedette.cli.live import live
from vedette.cli.merging import merge
from vedette.cli.output import with_output_options
from vedette.cli.reporting import report, video
from vedette.cli.reproducing import reproduce
from vedette.cli.results import results
from vedette.cli.running import run
from vedette.cli.scenario_files import crowd, generate, init, list_, schema
from vedette.cli.show import show
from vedette.cli.tracking import track

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Track targets with mobile sensors, and decide where the sensors should go next.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"vedette {__version__}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options that come before the command."""


# By group, as `vedette --help` lists them; a summary has at most 55 characters.
_COMMANDS: dict[str, list[tuple[Callable[..., None], str]]] = {
    "Start here": [
        (demo, "Compare strategies on one scene in the browser"),
        (reproduce, "Compare strategies over many runs, with a report"),
        (init, "Write a commented scenario file"),
    ],
    "Your data": [
        (track, "Track recorded scans"),
        (live, "Track scans as they arrive"),
        (calibrate, "Estimate sensor biases, noise, detection, clutter"),
    ],
    "Scenarios": [
        (list_, "List built-in scenarios"),
        (show, "Show a scenario as tables or as a picture"),
        (check, "Check scenario files and sensors files"),
        (generate, "Generate a scene with many sensors"),
        (crowd, "Generate a scene with many targets, one sensor"),
        (schema, "Print the JSON schema of scenario files"),
    ],
    "Runs and campaigns": [
        (run, "Run a scenario once"),
        (campaign, "Run or resume a campaign"),
        (results, "Print or export results"),
        (report, "Write an HTML report"),
        (video, "Write a video of a run"),
        (merge, "Merge results of shards"),
        (benchmark, "Compare your planner or tracker with built-in ones"),
    ],
}
for _group, _members in _COMMANDS.items():
    for _command, _summary in _members:
        _name = _command.__name__.rstrip("_")
        app.command(_name, short_help=_summary, rich_help_panel=_group)(with_output_options(_command))
