"""The command that estimates sensor parameters from recorded scans: calibrate."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.calibration_table import calibration_document, print_windows, windows_document
from vedette.cli.compiling import compiling
from vedette.cli.errors import check_ending
from vedette.cli.options import BadRows, Overwrite, ScansFile, SensorsFile, Speed, Trust
from vedette.cli.output import console, echo, emit_json, note
from vedette.cli.recordings import read_recording
from vedette.cli.running import interruptible
from vedette.cli.scenario_files import write_text
from vedette.errors import InputError

if TYPE_CHECKING:
    from vedette.calibration import CalibrationWindow, Parameter, Problem
    from vedette.evaluation.fit import Fit
    from vedette.scenarios.from_recording import RecordingScenario

NOT_CONVERGED = 3  # exit status
_SECONDS_A_LINE = 10.0  # between lines of progress in pipes

Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help="Write the sensors file with the estimates; default: print only."),
]
SensorPositions = Annotated[
    bool, typer.Option("--sensor-positions", help="Also estimate errors of the sensor positions (x, y).")
]
Biases = Annotated[
    bool | None,
    typer.Option("--biases/--no-biases", help="Estimate biases; default: if there are several sensors."),
]
Window = Annotated[
    float | None,
    typer.Option(
        "--window", metavar="SECONDS", min=0.001, help="Calibrate each part of this length; for drifting biases."
    ),
]

PriorScale = Annotated[
    float,
    typer.Option(
        "--prior-scale",
        metavar="X",
        min=0.01,
        help="Widen the prior of biases (1 deg, 5 m or 1 % of the range, 1 s) and noise by this factor.",
    ),
]


def calibrate(
    scans: ScansFile,
    sensors: SensorsFile,
    out: Out = None,
    overwrite: Overwrite = False,
    position: SensorPositions = False,
    biases: Biases = None,
    window: Window = None,
    prior_scale: PriorScale = 1.0,
    speed: Speed = 10.0,
    bad_rows: BadRows = "refuse",
    trust: Trust = False,
) -> None:
    """Estimate sensor biases, noise, detection, clutter, and modes of motion.

    From recorded scans alone, by maximum likelihood, with 95 % intervals. Values that are implausible, or fit held-back
    scans no better, stay as in the file.
    """
    from vedette.scenarios.calibration import calibrated_text

    _check_output(out, overwrite)
    recorded, warnings = read_recording(sensors, scans, None, speed=speed, bad_rows=bad_rows, trust=trust)
    with interruptible("nothing was written"):
        windows = _calibrate(recorded, window or math.inf, position, biases, prior_scale)
        if out is not None:
            last = windows[-1].calibration._replace(converged=all(part.calibration.converged for part in windows))
            write_text(out, calibrated_text(recorded.scenario, sensors, last, out.parent))
    names = _owners(recorded)
    print_windows(windows, names, position=position)
    if out is None:
        echo("Nothing was written. Add --out calibrated.yaml to save the estimates for `vedette track`.")
    else:
        kept = "" if last.converged else " The search did not converge: its values are those of the old file."
        echo(f"Wrote {out}.{kept} Use it with: vedette track {scans} --sensors {out}")
    document = (
        calibration_document(windows[0].calibration, names) if window is None else windows_document(windows, names)
    )
    origin = {"assumptions": recorded.assumed, "skipped": recorded.recording.skipped, "warnings": warnings}
    emit_json({**document, **origin, "written": [] if out is None else [out]})
    if not all(part.calibration.converged for part in windows):
        raise typer.Exit(NOT_CONVERGED)


def _check_output(out: Path | None, overwrite: bool) -> None:
    from vedette.internal.files import unwritable

    check_ending(out, "--out", "yaml", "yml")
    if out is not None and out.exists() and not overwrite:
        raise InputError(f"{out}: already there; --overwrite replaces it")
    if out is not None and (reason := unwritable(out)):
        raise InputError(f"{out}: expected a file that can be written; {reason}")


def _calibrate(
    recorded: RecordingScenario, window: float, position: bool, biases: bool | None, prior_scale: float
) -> list[CalibrationWindow]:
    """Return the calibrations of the parts of a recording. biases: None for those of two sensors or more that scan."""
    from vedette.calibration.bias_drift import calibrate_windows
    from vedette.scenarios.calibration import build_problem

    if biases is None:
        biases = _has_several_sensors(recorded)
        if not biases:
            why = "as manoeuvres look like them"
            note(f"Biases of a single sensor are not estimated, {why}: --biases estimates them.")
    problem = build_problem(recorded.scenario, position=position, biases=biases, prior_scale=prior_scale)
    with compiling(), _pass_counter() as progress:
        return list(calibrate_windows(problem, window, progress))


def _owners(recorded: RecordingScenario) -> tuple[str, ...]:
    """Return the names of the sensors, and last the word for parameters of the motion, whose sensor is `TARGETS`."""
    return *recorded.scenario.model.sensor_names, "targets"


def _has_several_sensors(recorded: RecordingScenario) -> bool:
    """Return True if two sensors or more scan."""
    instants = recorded.recording.scans
    return len({s for instant in instants for s, scan in enumerate(instant) if scan is not None}) > 1


def calibrate_doubtful(recorded: RecordingScenario, fit: Fit, sensors: Path) -> tuple[str, dict[str, Any]] | None:
    """Estimate and print parameters that the sensors file does not give, or that the fit finds wrong.

    Returns the sensors file with better values, and the calibration as data, or None if there is nothing to estimate.
    """
    from vedette.calibration import CalibrationWindow, calibrate
    from vedette.scenarios.calibration import build_problem, calibrated_text

    problem = build_problem(recorded.scenario, biases=_has_several_sensors(recorded))
    doubtful = _doubtful_parameters(problem, recorded, fit)
    if not doubtful:
        note("--calibrate: the sensors file gives all values, and the fit names none of them")
        return None
    with compiling(), _pass_counter() as progress:
        found = calibrate(problem, progress, doubtful)
    names = _owners(recorded)
    print_windows([CalibrationWindow(0.0, math.inf, found)], names, position=False)
    text = calibrated_text(recorded.scenario, sensors, found, None)
    return text, calibration_document(found, names)


def _doubtful_parameters(problem: Problem, recorded: RecordingScenario, fit: Fit) -> list[Parameter]:
    """Return the parameters that are assumed, and those that findings of fit name. Biases of 0 count as not given."""
    tests, names = {(each.sensor, each.test) for each in fit.findings}, recorded.scenario.model.sensor_names

    def is_doubtful(each: Parameter) -> bool:
        if each.kind == "motion":  # no finding names modes
            return True
        if each.kind == "bias" and (each.start == 0.0 or ("", "agreement") in tests):
            return True
        is_assumed = each.kind == "clutter" and "clutter" in recorded.assumed
        return is_assumed or (names[each.sensor], each.kind) in tests

    return [each for each in problem.parameters if is_doubtful(each)]


@contextmanager
def _pass_counter() -> Iterator[Callable[[], None]]:
    """Show how many times the filter has processed the recording: on a terminal always, in pipes as a line a while."""
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    screen = console(stderr=True)
    if not screen.is_terminal:
        yield _line_printer()
        return
    columns = (TimeElapsedColumn(), TextColumn("{task.description} {task.completed:.0f}"))
    with Progress(*columns, console=screen, transient=True) as bar:
        task = bar.add_task("passes of the filter:", total=None)
        yield lambda: bar.advance(task)


def _line_printer() -> Callable[[], None]:
    """Return a counter of passes that prints a line after each `_SECONDS_A_LINE`."""
    passes, due = 0, time.monotonic() + _SECONDS_A_LINE

    def count() -> None:
        nonlocal passes, due
        passes += 1
        if time.monotonic() >= due:
            note(f"calibrate: {passes} passes of the filter over the recording so far")
            due = time.monotonic() + _SECONDS_A_LINE

    return count
