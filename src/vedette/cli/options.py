"""Arguments and options that several commands share, each said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vedette.cli import completing

ScenarioName = Annotated[
    str,
    typer.Argument(help="Name of a built-in scenario, or a scenario file.", autocompletion=completing.scenarios),
]
SceneFile = Annotated[
    Path | None, typer.Argument(help="File to write, or a folder; none: a file named after the scene.")
]
ResultsFolder = Annotated[
    Path, typer.Argument(metavar="DIR", help="Results folder of a campaign, finished or not; or of a single run.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", "--force", help="Replace what is there.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed; with the run number it fixes every random number.")]
Workers = Annotated[
    int, typer.Option("--workers", min=0, help="Processes on this machine; 1: this one; 0: one a processor.")
]
Trust = Annotated[
    bool, typer.Option("--trust", help="Run code that a scenario names also where others may have written it.")
]
BAD_ROWS = ("refuse", "skip")
SensorsFile = Annotated[
    Path, typer.Option("--sensors", metavar="FILE", help="YAML file about the sensors: where they are, what they see.")
]
Speed = Annotated[
    float,
    typer.Option("--speed", min=0.001, help="m/s that targets hardly exceed, where motion or births are not said."),
]
BadRows = Annotated[
    str,
    typer.Option(
        "--bad-rows",
        help="refuse (default) or skip rows that cannot be read.",
        autocompletion=completing.one_of(*BAD_ROWS),
    ),
]
