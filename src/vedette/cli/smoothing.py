"""Smoothed tracks of recorded scans: the options of `vedette track`, and the errors of both kinds of tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from vedette.cli.compiling import compiling
from vedette.cli.errors import usage_error
from vedette.cli.output import echo

if TYPE_CHECKING:
    from vedette.evaluation.joining import Join
    from vedette.scenarios import Scenario
    from vedette.scenarios.from_recording import RecordingScenario
    from vedette.simulation.records import RunRecord
    from vedette.tracking import TraceEntry


def check_smoothing(smooth: bool, lag: float | None) -> None:
    """Raise a usage error for a lag without smoothing, or one that is not above 0."""
    if lag is not None and not smooth:
        raise usage_error("expected with --smooth, as no other tracks have a lag", "--lag")
    if lag is not None and not 0.0 < lag < float("inf"):
        raise usage_error(f"expected a time above 0 s; got {lag:g}", "--lag")


def check_labels(recorded: RecordingScenario) -> None:
    """Raise a usage error if the targets of the tracker have no labels."""
    from vedette.densities import LabelledDensity
    from vedette.scenarios.build import build_tracking

    if not isinstance(build_tracking(recorded.scenario, recorded.recording).tracker.initial().fused, LabelledDensity):
        kind = recorded.scenario.model.filter.kind
        raise usage_error(f"expected a filter whose targets have labels, such as delta_glmb; got {kind}", "--smooth")


def smoothed_record(
    record: RunRecord, recorded: RecordingScenario, trace: Sequence[TraceEntry], lag: float | None
) -> RunRecord:
    """Return the record with smoothed estimates. lag: see `vedette.tracking.smooth`."""
    from vedette.scenarios.build import build_tracking
    from vedette.tracking import smooth

    targets = build_tracking(recorded.scenario, recorded.recording).tracker.targets
    with compiling():
        return replace(record, estimates=smooth(trace, targets, lag))


def print_trajectories(records: Mapping[str, RunRecord], joins: Sequence[Join], scenario: Scenario) -> dict[str, Any]:
    """Print the errors of filtered and smoothed tracks if the targets are known, and return the entry of `--json`."""
    from vedette.evaluation.joining import with_joined_tracks
    from vedette.evaluation.runs import trajectory_errors

    if scenario.model.targets.kind == "unknown":
        return {"trajectories": None}
    filtered, smoothed = (trajectory_errors(with_joined_tracks(each, joins), scenario) for each in records.values())
    for head, name, unit in (("position RMSE", "rmse_m", "m"), ("OSPA(2)", "ospa2_m", "m")):
        echo(f"  smoothed    {head} {smoothed[name]:.2f} {unit}, filtered {filtered[name]:.2f} {unit}")
    return {"trajectories": {"filtered": filtered, "smoothed": smoothed}}
