"""The command that finds out from recorded scans what their sensors are like: calibrate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.compiling import compiling
from vedette.cli.errors import check_ending
from vedette.cli.options import BadRows, Overwrite, SensorsFile, Speed, Trust
from vedette.cli.output import console, note, publish, say
from vedette.cli.running import compile_if_cold, interruptible
from vedette.cli.tracking import read_recording
from vedette.errors import InputError

NOT_CONVERGED = 3  # exit status

if TYPE_CHECKING:
    from vedette.calibration import Calibration, Window


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
    window: Annotated[
        float | None,
        typer.Option("--window", metavar="S", min=0.001, help="Find them anew for every S seconds, where they drift."),
    ] = None,
    speed: Speed = 10.0,
    bad_rows: BadRows = "refuse",
    trust: Trust = False,
) -> None:
    """Find from recorded scans alone what each sensor is like: biases, noise, detection, clutter, with intervals."""
    from vedette.calibration.drifting import calibrate_windows
    from vedette.files import unwritable, write_file
    from vedette.scenarios.calibrated import calibrated_text, problem_of

    check_ending(out, "--out", "yaml", "yml")
    if out is not None and out.exists() and not overwrite:
        raise InputError(f"{out}: already there; --overwrite replaces it")
    if out is not None and (reason := unwritable(out)):
        raise InputError(f"{out}: expected a file that can be written; {reason}")
    read, cautions = read_recording(sensors, scans, None, speed=speed, bad_rows=bad_rows, trust=trust)
    scenario, recording, assumed = read
    with interruptible("nothing was written"):
        compile_if_cold(scenario)
        problem = problem_of(scenario, position=position)
        with compiling(), _counting() as watch:
            windows = list(calibrate_windows(problem, window or math.inf, watch))
        if out is not None:
            text = calibrated_text(scenario, sensors, windows[-1].calibration, out.parent)
            write_file(out, lambda file: file.write(text.encode("utf-8")), make_folder=True)
    names = scenario.model.sensor_names
    _print(windows, names, position)
    if out is not None:
        say(f"wrote {out}")
    converged = all(each.calibration.converged for each in windows)
    documents = [_document(each.calibration, names) for each in windows]
    told = {
        "assumed": assumed,
        "skipped": recording.skipped,
        "warnings": cautions,
        "written": [] if out is None else [out],
    }
    if window is None:
        publish({**documents[0], **told})
    else:
        spans = [{"begin_s": each.begin, "end_s": each.end} for each in windows]
        publish({"windows": [span | own for span, own in zip(spans, documents, strict=True)], **told})
    if not converged:
        raise typer.Exit(NOT_CONVERGED)


def _document(calibration: Calibration, names: tuple[str, ...]) -> dict[str, Any]:
    likelihoods = {"log_likelihood": calibration.log_likelihood, "log_likelihood_before": calibration.before}
    return {
        "found": _rows(calibration, names),
        **likelihoods,
        "converged": calibration.converged,
        "rank": calibration.rank,
    }


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


def _print(windows: list[Window], names: tuple[str, ...], position: bool) -> None:
    """Each parameter, through the windows."""
    from rich.table import Table

    all_rows = [_rows(each.calibration, names) for each in windows]
    rows, several = all_rows[0], len(windows) > 1
    table = Table("sensor", "parameter", *["from, s"] * several, "said", "found", "95 times of 100 in", box=None)
    for i in range(len(rows)):
        for window, own in zip(windows, all_rows, strict=True):
            row, since = own[i], [f"{window.begin:.0f}"] * several
            unit = f" {row['unit']}" if row["unit"] else ""
            told = [row["sensor"], row["parameter"], *since, f"{row['said']:.4g}{unit}"]
            if row["why_not"]:
                table.add_row(*told, "not found", "")
            else:
                interval = f"{row['low']:.4g} to {row['high']:.4g}" if window.calibration.converged else ""
                table.add_row(*told, f"{row['found']:.4g}{unit}", interval)
    table.pad_edge = False
    console().print(table)
    told_of = [
        f"{row['parameter']} of {row['sensor']}: {row['why_not']}" for own in all_rows for row in own if row["why_not"]
    ]
    for text in dict.fromkeys(told_of):
        say(text)
    others = {row["parameter"] for row in rows if row["sensor"] != rows[0]["sensor"]}
    if "clock" in others:
        say("clocks are against that of the first sensor, as a shift of all times changes nothing")
    if position or "x" in others - {row["parameter"] for row in rows if row["sensor"] == rows[0]["sensor"]}:
        what, alone = "places and bearings" if position else "positions", "" if others else ", and there is no other"
        say(f"{what} are against those of the first sensor, as a shift or turn of all changes nothing{alone}")
    for window in windows:
        calibration, part = window.calibration, f"from {window.begin:.0f} s on: " if several else ""
        if not calibration.converged:
            why = "these values may not be those of the maximum, and there are no intervals"
            note(
                f"{part}the search did not converge: {why}; check units, north and --speed, or take a longer recording"
            )
        if any(each.why for each in calibration.found):
            say(f"{part}the recording says something of {calibration.rank} of {len(calibration.found)} directions")
        say(f"{part}log likelihood {calibration.before:.1f} as said, {calibration.log_likelihood:.1f} as found")
