"""Tables of state vectors of the OpenSky Network: ADS-B reports of aircraft."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from vedette.internal.text import pluralise
from vedette.recorded.tables import FARTHEST, Table, is_empty

_POSITION = ("icao24", "lat", "lon")
_VELOCITY = ("velocity", "heading")
_NOTHING = ("null", "none", "nan", r"\n")


def is_opensky(columns: Iterable[str]) -> bool:
    """Return True if these are the columns of state vectors."""
    return {"time", *_POSITION} <= set(columns)


def of_opensky(table: Table) -> tuple[Table, dict[str, str]]:
    """Return state vectors as reports of aircraft, and the names of their columns for `parse_reports`.

    State vectors repeat the last report every second: rows without a position, and repeated ones, are left out (the
    former are counted in `notes`), and the time is that of the position (`lastposupdate`) if every row has one.
    Velocities are `velocity` (m/s over ground) along `heading` (degrees clockwise from the north) if every row has
    both.

    Raises:
        InputError: names the file, row, column, and the expected and given values.
    """
    rows = [i for i in range(len(table.rows)) if all(_is_there(table, name, i) for name in _POSITION)]
    num_without = len(table.rows) - len(rows)
    notes = (f"left out: {pluralise(num_without, 'row')} without a position",) if num_without else ()
    time = "lastposupdate" if _are_there(table, ("lastposupdate",), rows) else "time"
    first: dict[tuple[str, str], int] = {}
    for i in rows:
        first.setdefault((str(table.columns["icao24"][i]), str(table.columns[time][i])), i)
    rows = list(first.values())
    columns = {name: [cells[i] for i in rows] for name, cells in table.columns.items()}
    reports = replace(table, columns=columns, rows=[table.rows[i] for i in rows], notes=notes)
    names = {"time": time, "id": "icao24", "longitude": "lon", "latitude": "lat"}
    if not _are_there(table, _VELOCITY, rows):
        return reports, names
    speed, heading = reports.numbers("velocity", FARTHEST), np.radians(reports.numbers("heading", 360.0))
    columns |= {"vx": (speed * np.sin(heading)).tolist(), "vy": (speed * np.cos(heading)).tolist()}
    return reports, {**names, "vx": "vx", "vy": "vy"}


def _are_there(table: Table, names: Iterable[str], rows: list[int]) -> bool:
    return all(name in table.columns and all(_is_there(table, name, i) for i in rows) for name in names)


def _is_there(table: Table, name: str, row: int) -> bool:
    cell: Any = table.columns[name][row]
    return not is_empty(cell) and str(cell).strip().lower() not in _NOTHING
