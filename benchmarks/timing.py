"""What the benchmarks time with: one figure at a time, its least and median, and two checkouts turn about.

A benchmark module says what it can time by a function `measures()`; `benchmarks/all.py` makes one table of them.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

Once = Callable[[], float]


@dataclass(frozen=True)
class Measure:
    """Something that can be timed again and again.

    Attributes:
        group, name: where it stands in a table, and what it is called there.
        prepare: makes what is not timed, warms up, and returns what gives one figure a call.
        unit: of the figure.
        rounds: how often it is asked for, where nobody says otherwise.
        long: takes more than a few seconds a round.
    """

    group: str
    name: str
    prepare: Callable[[], Once]
    unit: str = "ms"
    rounds: int = 7
    long: bool = False

    @property
    def key(self) -> str:
        """By which it is asked for."""
        return f"{self.group}: {self.name}"


class Figures(NamedTuple):
    """Of one measure, over its rounds."""

    least: float
    median: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Figures:
        """Of the figures of all rounds."""
        return cls(min(values), statistics.median(values))


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU time of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start


def wall_seconds(work: Callable[[], object]) -> float:
    """Wall time."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def repeated(work: Callable[[], object], repeats: int) -> Figures:
    """CPU seconds of some work, after once that does not count."""
    work()
    return Figures.of([cpu_seconds(work) for _ in range(repeats)])


def milliseconds_of(work: Callable[[], object], calls: int = 1) -> Once:
    """CPU milliseconds of one of so many calls, after one that does not count."""
    work()
    return lambda: 1e3 * cpu_seconds(lambda: [work() for _ in range(calls)]) / calls
