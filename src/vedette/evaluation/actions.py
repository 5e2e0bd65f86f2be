"""Actions and the certainty of decisions in words, and actions as an axis of a figure."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from vedette.control.plan import Plan
from vedette.internal.text import with_minus
from vedette.kernels.base.types import Floats
from vedette.platforms import Actions
from vedette.platforms.base import switch_words

# The action of one sensor, rounded for counting: name and number of each column.
Row: TypeAlias = tuple[tuple[str, float], ...]

_UNITS = {"_deg": ("deg", "°"), "_rad": ("rad", " rad"), "_m": ("m", " m"), "_mps": ("m/s", " m/s")}
# Directions in whole turns from 0 to 360 degrees.
_AZIMUTHS = ("course_deg", "azimuth_deg")


class ActionAxis(NamedTuple):
    """The actions of a sensor along an axis."""

    name: str  # of the axis: `heading`, or the names of all columns
    unit: str  # `deg`, or empty
    places: Floats  # (num_actions,) position of each action
    ticks: tuple[str, ...]  # the numbers alone
    labels: tuple[str, ...]  # in words
    is_numeric: bool  # True if places are the numbers of a column. Otherwise they count actions from 1

    def title(self, sensor: str = "") -> str:
        """Return the title `Heading (deg)`, or for a named sensor `Heading of sensor 1 (deg)`."""
        suffix = f" of {sensor}" if sensor else ""
        return self.name[:1].upper() + self.name[1:] + suffix + (f" ({self.unit})" if self.unit else "")

    def counted(self) -> "ActionAxis":
        """Return the axis with the actions side by side, regardless of their numbers."""
        return self._replace(places=np.arange(1.0, len(self.places) + 1), is_numeric=False)


def action_axis(actions: Actions) -> ActionAxis:
    """Return the axis of actions: the numbers of a single column, or for several columns the actions side by side.

    A speed that all courses share does not count as a column.
    """
    actions = _without_speed(actions)
    rows = [rounded(actions.columns, row) for row in actions.values]
    ticks = tuple(with_minus(", ".join([f"{value:g}" for _, value in row])) for row in rows)
    labels = tuple(map(describe_action, rows))
    names, units = [[_split_column(column)[i] for column in actions.columns] for i in (0, 1)]
    if len(names) == 1:
        return ActionAxis(names[0], units[0], actions.values[:, 0], ticks, labels, True)
    one_unit = len(set(units)) == 1
    titles = (
        names if one_unit else [f"{name} ({unit})" if unit else name for name, unit in zip(names, units, strict=True)]
    )
    places = np.arange(1.0, len(actions) + 1)
    return ActionAxis(", ".join(titles) or "action", units[0] if one_unit else "", places, ticks, labels, False)


def _without_speed(actions: Actions) -> Actions:
    if "course_deg" not in actions.columns or "speed_mps" not in actions.columns:
        return actions
    place = actions.columns.index("speed_mps")
    if np.ptp(actions.values[:, place]) > 0.0:
        return actions
    columns = [i for i in range(len(actions.columns)) if i != place]
    return Actions(tuple(actions.columns[i] for i in columns), actions.values[:, columns])


def rounded(columns: Sequence[str], row: Floats) -> Row:
    """Return a row with angles rounded to whole degrees and all else to four digits."""
    cells = []
    for name, number in zip(columns, row.tolist(), strict=True):
        if not name.endswith("_deg"):
            number = float(f"{number:.4g}")
        else:
            number = round(number) % 360 if name in _AZIMUTHS else round(number)
        cells.append((name, number + 0.0))
    return tuple(cells)


def drawn_angle(row: Mapping[str, float], heading: str = "heading_deg", azimuth: str = "course_deg") -> float | None:
    """Return the direction of an action for a drawing, deg counter-clockwise from east, or None if it has none.

    True north is drawn upwards, wherever the sensor is.
    """
    if azimuth in row:
        return 90.0 - row[azimuth]
    return row.get(heading)


def describe_action(row: Row) -> str:
    """Return a row in words: `-30°` if only a heading or course, else `heading -30°, speed 5, off`, or `stationary`."""
    if len(row) == 1 and row[0][0] in ("heading_deg", "course_deg"):
        return f"{row[0][1]:g}°"
    return ", ".join([switch_words(column, x) or _describe_number(column, x) for column, x in row]) or "stationary"


def _describe_number(column: str, number: float) -> str:
    name, _, sign = _split_column(column)
    return f"{name} {number:g}{sign}"


def describe_choice(rows: Sequence[Row]) -> str:
    """Return the actions of all sensors in words: `-30°, 60°`."""
    return ("; " if any(len(row) > 1 for row in rows) else ", ").join(map(describe_action, rows))


def _split_column(column: str) -> tuple[str, str, str]:
    """Return name in words, unit, and sign after a number: `heading_deg` gives `heading`, `deg`, `°`."""
    end = next(filter(column.endswith, _UNITS), "")
    name = column.removesuffix(end).replace("_", " ")
    return (name, *_UNITS[end]) if end else (name, "", "")


def lead_words(plan: Plan) -> str:
    """Return the lead in mean reward over the runner-up, `0.071 (3.3 std. errors)`, empty if it is not recorded."""
    runner_up = None if plan.explanation is None else plan.explanation.runner_up
    if runner_up is None:
        return ""
    ratio = runner_up.in_standard_errors
    if ratio is None or not math.isfinite(ratio):
        return f"{runner_up.margin:.3g}"
    return f"{runner_up.margin:.3g} ({ratio:.2g} std. errors)"


def optimality_words(plan: Plan) -> str:
    """Return `yes` for a proven optimum, `within 6.1 %` of it, or `not known`, empty for decisions without a bound."""
    bound = None if plan.explanation is None else plan.explanation.bound
    if bound is None:
        return ""
    if bound.gap <= 0.0:
        return "yes"
    return f"within {100.0 * bound.relative:.2g} %" if bound.is_close else "not known"
