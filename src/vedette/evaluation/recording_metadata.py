"""Clock of a run and names of its targets, from the recordings of its scenario."""

from typing import NamedTuple

import numpy as np

from vedette.scenarios import Scenario
from vedette.scenarios.recorded_data import recorded_scans, recorded_targets
from vedette.simulation.records import RunRecord


class RecordingMetadata(NamedTuple):
    """Clock and names."""

    start: float  # s, to be added to times of the run
    is_utc: bool  # True if the sums are seconds since 1970 UTC
    names: tuple[str, ...]  # of the targets, by id, empty if they were not recorded


def recording_metadata(record: RunRecord, scenario: Scenario) -> RecordingMetadata:
    """Return clock and names from the recordings of a run's scenario, or no clock if its scans are not from them.

    Raises `InputError` if they cannot be read.
    """
    model = scenario.model
    start, is_utc, names = 0.0, False, tuple[str, ...]()
    if model.recording is not None:
        recording = recorded_scans(model, scenario.folder)
        if np.array_equal(recording.times[: record.num_scans], record.times):
            start, is_utc = recording.start, recording.is_utc
    if model.targets.kind == "recorded":
        names = tuple(str(track.name) for track in recorded_targets(model, scenario.folder).tracks)
    return RecordingMetadata(start, is_utc, names)
