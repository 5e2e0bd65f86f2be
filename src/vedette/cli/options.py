"""Arguments and options shared by several commands."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from vedette.cli import completing

ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO", help="A built-in scenario, or a scenario file.", autocompletion=completing.scenarios
    ),
]
SceneFile = Annotated[
    Path | None, typer.Argument(metavar="FILE", help="File to write, or a folder; default: named after the scene.")
]
ResultsFolder = Annotated[
    Path, typer.Argument(metavar="DIR", help="Results folder of a campaign, finished or not, or of a single run.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", "--force", help="Replace existing files.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Random seed.")]
Workers = Annotated[
    int,
    typer.Option("--workers", metavar="N", min=0, help="Worker processes; 1: no extra process, 0: one per CPU."),
]
Trust = Annotated[
    bool, typer.Option("--allow-code", help="Run Python code named in a scenario that other users can modify.")
]
ScansFile = Annotated[Path, typer.Argument(metavar="SCANS", help="CSV or Parquet file with one row per measurement.")]
SensorsFile = Annotated[
    Path,
    typer.Option("--sensors", metavar="FILE", help="Sensors file (YAML): where the sensors are and what they measure."),
]
Speed = Annotated[
    float,
    typer.Option(
        "--max-target-speed",
        metavar="M/S",
        min=0.001,
        help="Largest expected target speed; used for motion and birth if the sensors file gives neither.",
    ),
]
BadRows = Annotated[
    Literal["refuse", "skip"],
    typer.Option("--bad-rows", metavar="NAME", help="Rows that cannot be read: refuse or skip."),
]
