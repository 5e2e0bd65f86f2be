"""Which way the sensors were sent, and how often: one rose a strategy and a decision."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vedette.errors import InputError
from vedette.evaluation.actions import row_words, with_minus
from vedette.evaluation.comparison import Choice, Comparison
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.style import (
    GREY,
    TEXT_WIDTH,
    colour,
    new_figure,
    shown_decisions,
    styled,
)
from vedette.kernels.base.types import Floats, Ints

_SIZE = 1.5  # inches of a rose
_MOST_BARS = 4  # of a sensor
_SECTORS = 24  # that headings which are no fixed set are counted in


@styled
def roses_figure(comparison: Comparison) -> Figure:
    """Shares of the runs in which each action was chosen: a row a strategy that decides, a column a decision.

    A rose where every sensor was sent on a heading, and bars of the actions in words elsewhere. Headings are
    counter-clockwise from east (0). Sensors stand side by side within the sector of a heading. The area of a bar of a
    rose is in proportion to the share: the radius goes with its square root. Of many decisions at most six are shown,
    evenly spread, the first and the last among them.

    Raises `InputError` where no strategy made a decision.
    """
    rows = [index for index, runs in enumerate(comparison.choices) if any(runs)]
    if not rows:
        raise InputError("comparison: expected decisions; got none")
    columns = shown_decisions(len(comparison.decision_times))
    num_sensors, names = _num_sensors(comparison), short_labels(comparison.strategies, 20)
    size = min(TEXT_WIDTH / (len(columns) + 0.35), _SIZE)
    figure = new_figure(size * len(rows) + 0.5, width=size * (len(columns) + 0.35))
    are_headings = all("heading_deg" in dict(row) for choice in _all_choices(comparison) for row in choice)
    polar = {"projection": "polar"} if are_headings else {}
    panels = figure.subplots(len(rows), len(columns), subplot_kw=polar, squeeze=False)
    for row, index in enumerate(rows):
        for column, decision in enumerate(columns):
            panel = panels[row, column]
            chosen = [run[decision] for run in comparison.choices[index] if decision < len(run)]
            if are_headings and chosen:
                _draw_rose(panel, _headings(chosen), num_sensors)
            else:
                _draw_bars(panel, chosen)
            if row == 0:
                panel.set_title(f"{comparison.decision_times[decision]:g} s", pad=9)
        panels[row, 0].set_ylabel(names[index], labelpad=22, fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(num_sensors, 6))
    return figure


def _num_sensors(comparison: Comparison) -> int:
    return max(map(len, _all_choices(comparison)))


def _all_choices(comparison: Comparison) -> list[Choice]:
    return [choice for runs in comparison.choices for run in runs for choice in run]


def _headings(chosen: list[Choice]) -> Ints:
    """(num_runs, num_sensors) headings in whole degrees."""
    degrees = [[dict(row)["heading_deg"] for row in choice] for choice in chosen]
    return np.array(degrees, np.int64).reshape(len(chosen), -1) % 360


def _draw_bars(axes: Any, chosen: list[Choice]) -> None:
    """One bar a sensor and action that was chosen, the most frequent of each sensor on top."""
    place, ticks = 0, []
    for sensor, rows in enumerate(zip(*chosen, strict=True)):
        for number, (row, count) in enumerate(Counter(rows).most_common(_MOST_BARS)):
            label = {"label": f"sensor {sensor + 1}"} if number == 0 else {}
            axes.barh(place, count / len(chosen), color=colour(sensor), height=0.8, **label)
            ticks.append(with_minus(row_words(row)))
            place += 1
    axes.set_yticks(range(place), ticks, fontsize=4)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "", "100 %"], fontsize=6)


def _draw_rose(axes: Any, chosen: Ints, num_sensors: int) -> None:
    centres, width = _sectors(chosen)
    share = width / max(num_sensors, 1) * 0.9
    for sensor in range(chosen.shape[1]):
        counts = _shares(chosen[:, sensor], centres, width)
        # The first sensor lies first counter-clockwise, so that overlapping choices of all sensors stay visible.
        places = centres + (sensor - (num_sensors - 1) / 2.0) * share
        shown = counts > 0.0
        axes.bar(places[shown], np.sqrt(counts[shown]), width=share, color=colour(sensor), label=f"sensor {sensor + 1}")
    axes.set_thetagrids(range(0, 360, 90), ["0°", "90°", "180°", "270°"])
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks(np.sqrt([0.1, 0.5]), ["10 %", "50 %"])
    axes.set_rlabel_position(112.0)
    axes.tick_params(axis="x", labelsize=6, pad=-2)
    axes.tick_params(axis="y", labelsize=5, labelcolor=GREY)
    axes.spines["polar"].set_visible(True)
    axes.spines["polar"].set_linewidth(0.5)


def _sectors(chosen: Ints) -> tuple[Floats, float]:
    """Centres (rad) and the width of the sectors: of the grid that the headings lie on, or else of equal ones."""
    step = int(np.gcd.reduce(np.append(chosen.ravel(), 360)))
    if 360 // step > 2 * _SECTORS:
        step = 360 // _SECTORS
    step = min(step, 30)
    degrees = np.arange(0, 360, step)
    return np.deg2rad(degrees.astype(np.float64)), float(np.deg2rad(step))


def _shares(headings: Ints, centres: Floats, width: float) -> Floats:
    if len(headings) == 0:
        return np.zeros(len(centres))
    sector = np.floor(np.deg2rad(headings) / width + 0.5).astype(np.int64) % len(centres)
    return np.bincount(sector, minlength=len(centres)) / len(headings)
