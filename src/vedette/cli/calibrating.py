"""The command that estimates sensor parameters from recorded scans: calibrate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.calibration_table import calibration_document, print_windows
from vedette.cli.compiling import compiling
from vedette.cli.errors import check_ending
from vedette.cli.options import BadRows, Overwrite, SensorsFile, Speed, Trust
from vedette.cli.output import console, echo, emit_json
from vedette.cli.running import interruptible
from vedette.cli.tracking import read_recording
from vedette.errors import InputError

NOT_CONVERGED = 3  # exit status


def calibrate(
    scans: Annotated[Path, typer.Argument(metavar="SCANS", help="CSV or Parquet file with one row per measurement.")],
    sensors: SensorsFile,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the sensors file with the estimates; default: print only."),
    ] = None,
    overwrite: Overwrite = False,
    position: Annotated[
        bool, typer.Option("--sensor-positions", help="Also estimate errors of the sensor positions (x, y).")
    ] = False,
    window: Annotated[
        float | None,
        typer.Option(
            "--window", metavar="SECONDS", min=0.001, help="Calibrate each part of this length; for drifting biases."
        ),
    ] = None,
    speed: Speed = 10.0,
    bad_rows: BadRows = "refuse",
    trust: Trust = False,
) -> None:
    """Estimate sensor biases, noise, detection, clutter.

    From recorded scans alone, by maximum likelihood, with 95 % intervals.
    """
    from vedette.calibration.bias_drift import calibrate_windows
    from vedette.internal.files import unwritable, write_file
    from vedette.scenarios.calibration import build_problem, calibrated_text

    check_ending(out, "--out", "yaml", "yml")
    if out is not None and out.exists() and not overwrite:
        raise InputError(f"{out}: already there; --overwrite replaces it")
    if out is not None and (reason := unwritable(out)):
        raise InputError(f"{out}: expected a file that can be written; {reason}")
    recorded, warnings = read_recording(sensors, scans, None, speed=speed, bad_rows=bad_rows, trust=trust)
    scenario, recording, assumed = recorded
    with interruptible("nothing was written"):
        problem = build_problem(scenario, position=position)
        with compiling(), _pass_counter() as progress:
            windows = list(calibrate_windows(problem, window or math.inf, progress))
        if out is not None:
            text = calibrated_text(scenario, sensors, windows[-1].calibration, out.parent)
            write_file(out, lambda file: file.write(text.encode("utf-8")), make_folder=True)
    names = scenario.model.sensor_names
    print_windows(windows, names, position=position)
    if out is None:
        echo("Nothing was written. Add --out calibrated.yaml to save the estimates for `vedette track`.")
    else:
        echo(f"Wrote {out}. Use it with: vedette track {scans} --sensors {out}")
    converged = all(part.calibration.converged for part in windows)
    documents = [calibration_document(part.calibration, names) for part in windows]
    origin = {
        "assumptions": assumed,
        "skipped": recording.skipped,
        "warnings": warnings,
        "written": [] if out is None else [out],
    }
    if window is None:
        emit_json({**documents[0], **origin})
    else:
        spans = [{"begin_s": part.begin, "end_s": part.end} for part in windows]
        emit_json({"windows": [span | document for span, document in zip(spans, documents, strict=True)], **origin})
    if not converged:
        raise typer.Exit(NOT_CONVERGED)


@contextmanager
def _pass_counter() -> Iterator[Callable[[], None]]:
    """Show on a terminal how many times the filter has processed the recording."""
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    screen = console(stderr=True)
    columns = (TimeElapsedColumn(), TextColumn("{task.description} {task.completed:.0f}"))
    with Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("passes of the filter:", total=None)
        yield lambda: bar.advance(task)
