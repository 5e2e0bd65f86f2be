"""Reading of recorded scans for commands, with what is printed of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vedette.cli.output import note
from vedette.cli.running import CodeTrust
from vedette.cli.scenario_files import note_assumptions, print_warnings

if TYPE_CHECKING:
    from vedette.scenarios.from_recording import RecordingScenario

_SHOWN_ROWS = 5


def read_recording(
    sensors: Path,
    scans: Path,
    truth: Path | None,
    *,
    speed: float,
    bad_rows: str,
    trust: bool,
    partial_truth: bool = False,
) -> tuple[RecordingScenario, list[str]]:
    """Return the scenario of recorded scans and its warnings. Print skipped rows, assumptions and code that runs."""
    from vedette.scenarios.from_recording import scenario_from_recording

    recorded = scenario_from_recording(
        sensors, scans, truth, speed=speed, bad_rows=bad_rows, partial_truth=partial_truth
    )
    CodeTrust(trust)(recorded.scenario)
    warnings = print_warnings(recorded.scenario)
    for text in recorded.recording.skipped[:_SHOWN_ROWS]:
        note(f"skipped: {text}")
    if len(recorded.recording.skipped) > _SHOWN_ROWS:
        note(f"skipped: {len(recorded.recording.skipped) - _SHOWN_ROWS} more rows")
    note_assumptions(recorded.assumed, sensors)
    return recorded, warnings
