"""The command that finds out from recorded scans what their sensors are like: calibrate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.compiling import compiling
from vedette.cli.options import BadRows, Overwrite, SensorsFile, Speed, Trust
from vedette.cli.output import console, note, publish, say
from vedette.cli.running import compile_if_cold, interruptible
from vedette.cli.tracking import read_recording
from vedette.errors import InputError

if TYPE_CHECKING:
    from vedette.calibration import Calibration


def calibrate(
    scans: Annotated[Path, typer.Argument(metavar="SCANS", help="CSV or Parquet file with a row a measurement.")],
    sensors: SensorsFile,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="The sensors file with what was found; none: only print."),
    ] = None,
    overwrite: Overwrite = False,
    position: Annotated[
        bool, typer.Option("--position", help="Find biases of the sensors' own places, too (x, y).")
    ] = False,
    speed: Speed = 10.0,
    bad_rows: BadRows = "refuse",
    trust: Trust = False,
) -> None:
    """Find from recorded scans alone what each sensor is like: biases, noise, detection, clutter, with intervals."""
    from vedette.calibration.calibrating import calibrate as found_by
    from vedette.files import write_whole
    from vedette.scenarios.calibrated import calibrated_text, problem_of

    if out is not None and out.exists() and not overwrite:
        raise InputError(f"{out}: already there; --overwrite replaces it")
    scenario, recording, assumed = read_recording(sensors, scans, None, speed=speed, bad_rows=bad_rows, trust=trust)
    with interruptible("nothing was written"):
        compile_if_cold(scenario)
        problem = problem_of(scenario, position=position)
        with compiling(), _counting() as watch:
            calibration = found_by(problem, watch)
        if out is not None:
            text = calibrated_text(scenario, sensors, calibration, out.parent)
            try:
                out.parent.mkdir(parents=True, exist_ok=True)
                write_whole(out, lambda file: file.write(text.encode("utf-8")))
            except OSError as error:
                raise InputError(f"{out}: expected a place to write; got {error.strerror}") from None
    rows = _rows(calibration, scenario.model.sensor_names)
    _print(rows, calibration, position)
    if out is not None:
        say(f"wrote {out}")
    likelihoods = {"log_likelihood": calibration.log_likelihood, "log_likelihood_before": calibration.before}
    told = {"converged": calibration.converged, "assumed": assumed, "skipped": recording.skipped}
    publish({"found": rows, **likelihoods, **told, "written": [] if out is None else [out]})


@contextmanager
def _counting() -> Iterator[Callable[[], None]]:
    """A line on a terminal that counts how often the recording was tracked."""
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    screen = console(stderr=True)
    columns = (TimeElapsedColumn(), TextColumn("{task.description} {task.completed:.0f} times"))
    with Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("tracked", total=None)
        yield lambda: bar.advance(task)


def _rows(calibration: Calibration, names: tuple[str, ...]) -> list[dict[str, Any]]:
    """For each parameter the sensor, what was said and found."""
    return [
        {
            "sensor": names[each.parameter.sensor],
            "parameter": each.parameter.name,
            "unit": each.parameter.unit,
            "said": each.parameter.start,
            "found": each.value if not each.why else None,
            "low": each.low,
            "high": each.high,
            "why_not": each.why or None,
        }
        for each in calibration.found
    ]


def _print(rows: list[dict[str, Any]], calibration: Calibration, position: bool) -> None:
    from rich.table import Table

    table = Table("sensor", "parameter", "said", "found", "95 times of 100 in", box=None, pad_edge=False)
    for row in rows:
        unit = f" {row['unit']}" if row["unit"] else ""
        told = [row["sensor"], row["parameter"], f"{row['said']:.4g}{unit}"]
        if row["why_not"]:
            table.add_row(*told, "not found", "")
        else:
            table.add_row(*told, f"{row['found']:.4g}{unit}", f"{row['low']:.4g} to {row['high']:.4g}")
    console().print(table)
    for row in rows:
        if row["why_not"]:
            say(f"{row['parameter']} of {row['sensor']}: {row['why_not']}")
    others = {row["parameter"] for row in rows if row["sensor"] != rows[0]["sensor"]}
    if "clock" in others:
        say("clocks are against that of the first sensor, as a shift of all times changes nothing")
    if "x" in others - {row["parameter"] for row in rows if row["sensor"] == rows[0]["sensor"]}:
        what = "places and bearings" if position else "positions"
        say(f"{what} are against those of the first sensor, as a shift or turn of all changes nothing")
    if not calibration.converged:
        note("the search did not come to an end: what was found may not be the maximum")
    say(f"log likelihood {calibration.before:.1f} as said, {calibration.log_likelihood:.1f} as found")
