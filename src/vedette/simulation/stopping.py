"""How a run that ends before its last scan says where it stopped, and hands over what it had."""

from __future__ import annotations

import sysconfig
import traceback
from pathlib import Path
from typing import Any

from vedette.errors import VedetteError
from vedette.simulation.records import RunRecord

_LIBRARIES = (str(Path(__file__).parents[1]), *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")))


def cause_of(error: Exception) -> str:
    """What was raised, in words; where it is not this library's word, with the place in the user's own code."""
    if isinstance(error, VedetteError):
        return str(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith(_LIBRARIES)]
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno}, {frames[-1].name})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


class RunStopped(VedetteError):
    """A filter, a fusion, an estimate or a planner raised in the middle of a run; chained from that error.

    Attributes:
        step: the scan at which it happened, counted from 1.
        time: of that scan, s.
        stage: what was under way, in words: "the filter of sensor 2".
        record: of the scans that were finished, its field `stopped` the message; None where not one was.
    """

    def __init__(self, message: str, step: int, time: float, stage: str, record: RunRecord | None) -> None:
        super().__init__(message)
        self.step = step
        self.time = time
        self.stage = stage
        self.record = record

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.step, self.time, self.stage, self.record)


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of a run.

    Attributes:
        record: of the scans that were finished, its field `stopped` the message; None where not one was.
    """

    def __init__(self, message: str, record: RunRecord | None) -> None:
        super().__init__(message)
        self.record = record
