"""What the examples share: each prints what it finds, and `--picture FILE` draws it, as PNG, SVG or PDF."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def show(main: Callable[[], Any], draw: Callable[[Any], Any]) -> None:
    """Run an example; with a picture wanted, draw what it returned."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw it, by the name's ending as png, svg or pdf")
    wanted = parser.parse_args().picture
    found = main()
    if wanted is not None:
        draw(found).savefig(wanted, dpi=130)


def panels(number: int, *, width: float = 7.2, height: float = 3.4) -> tuple[Any, Any]:
    """A figure and its axes, side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, number)


def draw_paths(axes: Any, paths: Any) -> None:
    """Paths of targets, each (num_scans, 2), in grey, on equal axes in metres."""
    for number, path in enumerate(paths):
        axes.plot(*np.asarray(path).T, color="0.6", linewidth=3, label=None if number else "targets")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


def draw_errors(axes: Any, times: Any, errors: dict[str, Any], ylabel: str = "position error (m)") -> None:
    """Errors (num_scans,) against time, one line each, by name."""
    for name, values in errors.items():
        axes.plot(times, values, label=name)
    axes.set(xlabel="time (s)", ylabel=ylabel, ylim=(0, None))
    legend_above(axes)


def legend_above(axes: Any) -> None:
    """A legend that hides no line."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
