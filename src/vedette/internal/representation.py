"""Text and notebook representations of containers: one or two lines, and in a notebook the first rows of the table."""

from abc import abstractmethod
from html import escape
from typing import Any

import numpy as np

from vedette.internal.text import ELLIPSIS, elided, plain

_MOST_FIELDS, _MOST_NUMBERS, _MOST_ROWS = 8, 4, 20
_WIDEST = 160


class SummaryRepr:
    """Frozen dataclass (with `repr=False`) with a one-line summary as its repr, as its arrays would fill pages."""

    __slots__ = ()

    def _summary(self) -> str:
        """Return content and size, to follow the class name, by default the fields, arrays by their shapes."""
        names = [name for name in self.__match_args__ if not name.startswith("_")]  # type: ignore[attr-defined]
        told = [f"{name} {_brief(getattr(self, name))}" for name in names[:_MOST_FIELDS]]
        return "of " + ", ".join(told + [ELLIPSIS] * (len(names) > _MOST_FIELDS))

    def _detail(self) -> str:
        """Return the most important facts about the content, empty if there are none."""
        return ""

    def in_short(self) -> str:
        """Return class name and summary on one line."""
        return elided(f"{type(self).__name__} {self._summary()}", _WIDEST)

    def __repr__(self) -> str:
        detail = elided(self._detail(), _WIDEST)
        return f"{self.in_short()}\n  {detail}" if detail else self.in_short()

    def _repr_html_(self) -> str:
        lines = repr(self).split("\n  ")
        return "<p>" + "<br>".join([f"<b>{escape(lines[0])}</b>", *map(escape, lines[1:])]) + "</p>"


class TabularRepr(SummaryRepr):
    """Container that also has a table."""

    __slots__ = ()

    @abstractmethod
    def to_table(self) -> dict[str, list[Any]]:
        """Return columns of equal length by name, as `pandas.DataFrame` and `polars.DataFrame` take them."""

    def _repr_html_(self) -> str:
        table = self.to_table()
        rows = list(zip(*(column[:_MOST_ROWS] for column in table.values()), strict=True))
        more = max(map(len, table.values()), default=0) - len(rows)
        lines = [_html_row("th", table), *(_html_row("td", map(_cell, row)) for row in rows)]
        below = f"<p>and {more} more</p>" if more else ""
        return f"<p><b>{escape(self.in_short())}</b></p><table>{''.join(lines)}</table>{below}"


def in_short(value: Any) -> str:
    """Return a container on one line, or of other objects only the type name."""
    return value.in_short() if isinstance(value, SummaryRepr) else type(value).__name__


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return plain(value) if value.size <= _MOST_NUMBERS else str(value.shape)
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, str):
        return elided(value)
    if value is None or isinstance(value, bool | int):
        return str(value)
    if isinstance(value, tuple | list | dict):
        if len(value) <= _MOST_NUMBERS and all(isinstance(entry, int | float | str) for entry in value):
            return elided(plain(value))
        return "(1 entry)" if len(value) == 1 else f"({len(value)} entries)"
    return type(value).__name__


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def _html_row(tag: str, cells: Any) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(elided(cell))}</{tag}>" for cell in cells) + "</tr>"
