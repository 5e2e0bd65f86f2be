"""The command line: a thin face over the library. Each command imports what it needs when it runs."""

from __future__ import annotations

from typing import Annotated

import typer

from vedette import __version__
from vedette.cli.benchmarking import benchmark
from vedette.cli.calibrating import calibrate
from vedette.cli.campaign import campaign
from vedette.cli.checking import check
from vedette.cli.demo import demo
from vedette.cli.errors import Commands
from vedette.cli.live import live
from vedette.cli.merging import merge
from vedette.cli.output import speaking
from vedette.cli.reproducing import reproduce
from vedette.cli.results import report, results, upgrade
from vedette.cli.running import run
from vedette.cli.scenario_files import crowd, generate, init, list_, schema
from vedette.cli.show import show
from vedette.cli.tracking import track
from vedette.cli.video import video

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Track an unknown number of targets with mobile sensors, and decide where the sensors should go next.",
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


app.command("list")(speaking(list_))
app.command()(speaking(demo))
app.command()(speaking(init))
app.command()(speaking(generate))
app.command()(speaking(crowd))
app.command()(speaking(check))
app.command()(speaking(show))
app.command()(speaking(schema))
app.command()(speaking(run))
app.command()(speaking(track))
app.command()(speaking(live))
app.command()(speaking(calibrate))
app.command()(speaking(reproduce))
app.command()(speaking(benchmark))
app.command()(speaking(campaign))
app.command()(speaking(merge))
app.command()(speaking(results))
app.command()(speaking(report))
app.command()(speaking(video))
app.command()(speaking(upgrade))
