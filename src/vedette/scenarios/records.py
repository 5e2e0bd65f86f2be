"""The recorded targets of a scenario: their file read once for check and runs."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import numpy as np

from vedette.errors import InputError
from vedette.models import Region
from vedette.recorded import Cleaning
from vedette.recorded import RecordedTargets as RecordedSource
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.sections.world import RegionSection, Time


def recorded_source(section: RecordedTargets, region: RegionSection, folder: Path) -> RecordedSource:
    """The recorded targets; a file that stays as it was is read once.

    Raises:
        InputError: the file cannot be read, or nothing is left of it.
    """
    file = folder / section.path
    try:
        state = os.stat(file)
    except (OSError, ValueError):
        raise InputError(f"{section.path}: expected a readable file of recorded targets; got none") from None
    return _read(str(file.resolve()), state.st_mtime_ns, state.st_size, section, region)


@lru_cache(maxsize=16)
def _read(
    file: str, changed_ns: int, num_bytes: int, section: RecordedTargets, region: RegionSection
) -> RecordedSource:
    edges = Region(region.x_min, region.x_max, region.y_min, region.y_max)
    return RecordedSource.from_file(
        file,
        columns=section.columns.given(),
        origin_deg=section.origin_deg,
        time_origin=section.time_origin,
        cleaning=Cleaning(section.max_gap, section.min_speed, section.max_speed, edges if section.crop else None),
    )


def record_fault(section: RecordedTargets, region: RegionSection, time: Time, folder: Path) -> str | None:
    """Why a run could not use the file, with the row where that is, or None."""
    try:
        source = recorded_source(section, region, folder)
        times = time.start + time.step_period * np.arange(time.num_steps, dtype=np.float64)
        source.truth(times, rng=np.random.default_rng(0))
    except InputError as error:
        return str(error)
    return None
