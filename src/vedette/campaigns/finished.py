"""A finished run of a campaign, as it is read back."""

from __future__ import annotations

from dataclasses import dataclass

from vedette.evaluation.metrics import RunMetrics
from vedette.simulation.records import RunRecord


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """One run of a campaign.

    Attributes:
        cell: name of its cell.
        record: with the seconds that it took.
        metrics: measures of its estimates.
        session: number of the session, from 1, in the manifest's list, that kept it.
        checksum: SHA-256 of all but its timings; equal for equal results.
    """

    cell: str
    record: RunRecord
    metrics: RunMetrics
    session: int
    checksum: str
