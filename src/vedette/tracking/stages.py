"""What the time of a step is spent on, and which part of it an exception came from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

_NOTE = "stage: "


class Stages:
    """A stopwatch for the parts of a step, which also notes on an exception in which part it was raised.

    Attributes:
        seconds: wall time by the name of the part, in order of their first start.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def timing(self, name: str, sensor: int | None = None) -> Iterator[None]:
        """Take the time of what runs inside. sensor: counted from 0, where the part is of one sensor alone."""
        start = perf_counter()
        try:
            yield
        except BaseException as error:
            if stage_of(error) is None:  # the innermost part says it best
                error.add_note(f"{_NOTE}the {name}" + ("" if sensor is None else f" of sensor {sensor + 1}"))
            raise
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


def stage_of(error: BaseException) -> str | None:
    """Where an exception was raised, as a stopwatch noted it: "the filter of sensor 2"; None where none did."""
    notes = [note for note in getattr(error, "__notes__", ()) if note.startswith(_NOTE)]
    return notes[0].removeprefix(_NOTE) if notes else None
