"""Estimates of `calibrate`, as a table on the terminal and as rows for `--json`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from vedette.cli.output import console, echo, note

if TYPE_CHECKING:
    from vedette.calibration import Calibration, CalibrationWindow, ParameterEstimate

_NOT_CONVERGED = (
    "the optimiser stopped before it converged. The estimates may be inaccurate and have no intervals. "
    "Check units, north and --max-target-speed, or use a longer recording."
)


def calibration_document(calibration: Calibration, names: tuple[str, ...]) -> dict[str, Any]:
    """Return a calibration as data. names: names of the sensors."""
    return {
        "parameters": [
            {
                "sensor": names[each.parameter.sensor],
                "parameter": each.parameter.name,
                "unit": each.parameter.unit,
                "assumed": each.parameter.start,
                "estimate": each.value if not each.reason else None,
                "ci_low": each.ci_low,
                "ci_high": each.ci_high,
                "reason": each.reason or None,
                "kept": each.kept or None,
            }
            for each in calibration.estimates
        ],
        "log_likelihood": calibration.log_likelihood,
        "log_likelihood_assumed": calibration.initial_log_likelihood,
        "converged": calibration.converged,
        "rank": calibration.rank,
    }


def windows_document(windows: list[CalibrationWindow], names: tuple[str, ...]) -> dict[str, Any]:
    """Return the calibrations of several windows as data. names: names of the sensors."""
    return {
        "windows": [
            {"begin_s": window.begin, "end_s": window.end, **calibration_document(window.calibration, names)}
            for window in windows
        ]
    }


def print_windows(windows: list[CalibrationWindow], names: tuple[str, ...], *, position: bool) -> None:
    """Print the estimates of each window, their reference sensor, warnings and likelihoods."""
    _print_table(windows, names)
    if any(_is_outside(each) for window in windows for each in window.calibration.estimates):
        echo("* the assumed value lies outside the interval")
    _print_reasons([each for window in windows for each in window.calibration.estimates], names)
    _print_references(windows[0].calibration.estimates, names, position)
    for window in windows:
        calibration = window.calibration
        part = f"From {window.begin:.0f} s on: " if len(windows) > 1 else ""
        if not calibration.converged:
            note(f"Warning: {part[:1].lower()}{part[1:]}{_NOT_CONVERGED}")
        if any(each.reason for each in calibration.estimates):
            echo(
                f"{part}The recording determines {calibration.rank} of "
                f"{len(calibration.estimates)} parameter directions."
            )
        values = (
            f"{calibration.initial_log_likelihood:.1f} with the assumed values, "
            f"{calibration.log_likelihood:.1f} with the estimates"
        )
        echo(f"{part}Log-likelihood: {values}.")


def _print_reasons(estimates: Sequence[ParameterEstimate], names: tuple[str, ...]) -> None:
    """Print why values stay as they were, once for the parameters of a sensor that share a reason."""
    labels: dict[tuple[int, str], dict[str, None]] = {}
    for each in estimates:
        why = each.reason or (each.kept and f"the assumed value is kept, as {each.kept}")
        if why:
            labels.setdefault((each.parameter.sensor, why), {})[each.parameter.label] = None
    for (sensor, why), own in labels.items():
        echo(f"{', '.join(own)} of {names[sensor]}: {why}")
    if any(each.reason.startswith("implausible") for each in estimates):
        echo("Implausible estimates are more than 5 prior standard deviations away; --prior-scale widens the prior.")


def _print_table(windows: list[CalibrationWindow], names: tuple[str, ...]) -> None:
    """Print the table of estimates, with one row for each parameter and window."""
    from rich.table import Table

    several = ["from (s)"] if len(windows) > 1 else []
    table = Table("sensor", "parameter", "unit", *several, "assumed", "estimate", "95 % interval", "", box=None)
    interval_texts = [
        _interval_ends(estimate)
        for window in windows
        for estimate in window.calibration.estimates
        if not math.isnan(estimate.ci_low)
    ]
    low_width, high_width = (
        (max(map(len, side)) for side in zip(*interval_texts, strict=True)) if interval_texts else (0, 0)
    )
    for estimates_of_parameter in zip(*(window.calibration.estimates for window in windows), strict=True):
        for window, estimate in zip(windows, estimates_of_parameter, strict=True):
            parameter, since = estimate.parameter, [f"{window.begin:.0f}"] if several else []
            head = (names[parameter.sensor], parameter.label, parameter.unit, *since, f"{parameter.start:.4g}")
            if estimate.reason:
                table.add_row(*head, estimate.reason.split(":")[0], "", "")
                continue
            interval = ""
            if not math.isnan(estimate.ci_low):
                low, high = _interval_ends(estimate)
                interval = f"{low:>{low_width}} to {high:>{high_width}}"
            table.add_row(*head, _number(estimate.value, estimate), interval, _mark(estimate))
    table.pad_edge = False
    console().print(table)


def _print_references(estimates: tuple[ParameterEstimate, ...], names: tuple[str, ...], position: bool) -> None:
    """Print the estimates that are relative to those of the first sensor."""
    first = {each.parameter.component for each in estimates if each.parameter.sensor == estimates[0].parameter.sensor}
    others = {each.parameter.component for each in estimates if each.parameter.sensor != estimates[0].parameter.sensor}
    name = names[estimates[0].parameter.sensor]
    if "clock" in others:
        echo(f"Clock offsets are relative to {name}, the first sensor.")
    if position or "x" in others - first:
        subject = "Positions and bearings" if position else "Positions"
        echo(f"{subject} are relative to {name}, the first sensor{'' if others else ', and there is no other'}.")


def _mark(each: ParameterEstimate) -> str:
    return " ".join(["*"] * _is_outside(each) + ["kept"] * bool(each.kept))


def _is_outside(each: ParameterEstimate) -> bool:
    """Return True if the interval excludes the assumed value, False without an interval."""
    return each.parameter.start < each.ci_low or each.parameter.start > each.ci_high


def _interval_ends(each: ParameterEstimate) -> tuple[str, str]:
    """Return both ends of the interval as text."""
    return _number(each.ci_low, each), _number(each.ci_high, each)


def _number(value: float, each: ParameterEstimate) -> str:
    """Return a value rounded to two digits of half the interval's width, or to four digits without an interval."""
    half = 0.5 * (each.ci_high - each.ci_low)
    return f"{value:.{max(0, 1 - math.floor(math.log10(half)))}f}" if half > 0.0 else f"{value:.4g}"
