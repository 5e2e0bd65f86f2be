"""The command that tracks recorded scans: track."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.compiling import compiling
from vedette.cli.documents import run_document
from vedette.cli.errors import usage_error
from vedette.cli.options import BadRows, Overwrite, ScansFile, SensorsFile, Speed, Trust
from vedette.cli.output import bar, echo, emit_json, note
from vedette.cli.recordings import read_recording
from vedette.cli.run_summary import print_run
from vedette.cli.running import (
    check_out,
    end_stopped,
    finishing,
    interruptible,
    save_unfinished,
    unchanged_out,
)
from vedette.cli.scenario_files import write_text
from vedette.cli.smoothing import check_labels, check_smoothing, print_trajectories, smoothed_record
from vedette.internal.extras import without
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.evaluation.fit import Fit
    from vedette.evaluation.joining import Join
    from vedette.recorded import RecordedScans
    from vedette.scenarios import Scenario
    from vedette.scenarios.from_recording import RecordingScenario
    from vedette.simulation.records import RunRecord
    from vedette.tracking import TraceEntry

Format = StrEnum("Format", ["csv", "geojson", "parquet", "czml", "mcap"])
ON_EARTH = ("geojson", "czml", "mcap")
_MIN_ESTIMATES = 10  # smallest number of estimates of a lasting track

TruthFile = Annotated[
    Path | None,
    typer.Option("--truth", metavar="FILE", help="Reports of the targets themselves, to compute errors."),
]
PartialTruth = Annotated[
    bool,
    typer.Option(
        "--partial-truth",
        help="The reports cover only some targets: estimates near none of them are no error.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for results, tracks and figures; default: print only."),
]
Formats = Annotated[
    list[Format] | None,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Of the tracks: csv and geojson (default), parquet, czml, mcap. May be repeated.",
    ),
]
JoinTracks = Annotated[
    bool, typer.Option("--join/--no-join", help="Join tracks across gaps, where they are probably of one target.")
]
Smooth = Annotated[
    bool, typer.Option("--smooth", help="Also write tracks in which each estimate uses the scans after it, too.")
]
Lag = Annotated[
    float | None,
    typer.Option("--lag", metavar="SECONDS", help="With --smooth: use later scans of this time only; default: all."),
]
Calibrate = Annotated[
    bool,
    typer.Option(
        "--calibrate",
        help="First estimate what the sensors file does not give or the fit finds wrong; see `vedette calibrate`.",
    ),
]


def track(
    scans: ScansFile,
    sensors: SensorsFile,
    truth: TruthFile = None,
    partial_truth: PartialTruth = False,
    out: Out = None,
    overwrite: Overwrite = False,
    formats: Formats = None,
    join: JoinTracks = True,
    smooth: Smooth = False,
    lag: Lag = None,
    calibrate: Calibrate = False,
    speed: Speed = 10.0,
    bad_rows: BadRows = "refuse",
    trust: Trust = False,
) -> None:
    """Track recorded scans.

    Prints tracks and diagnostics, and errors if the targets' own reports are given. --out writes tracks, tables and
    figures.
    """
    from vedette.cli.calibrating import calibrate_doubtful
    from vedette.evaluation.runs import named_target_scores
    from vedette.scenarios.from_recording import scenario_from_recording

    check_smoothing(smooth, lag)
    identity = _check_output(formats or (), out, overwrite)
    if partial_truth and truth is None:
        raise usage_error("expected with --truth, which names the reports", "--partial-truth")
    settings: dict[str, Any] = {"speed": speed, "bad_rows": bad_rows, "partial_truth": partial_truth}
    recorded, warnings = read_recording(sensors, scans, truth, trust=trust, **settings)
    if smooth:
        check_labels(recorded)
    if "clutter" in recorded.assumed and not calibrate:
        note("`--calibrate` estimates clutter, noise and detection from the same scans.")
    on_earth = [name for name in formats or () if name in ON_EARTH]
    if on_earth and recorded.scenario.model.origin is None:  # before a folder with only a part of the output exists
        raise usage_error(f"expected an origin in {sensors}, as {on_earth[0]} has degrees; got none", "--format")
    text, calibration = None, None
    with interruptible("nothing was written"):
        trace: list[TraceEntry] | None = [] if smooth else None
        record, fit = _tracked(recorded, trace)
        if calibrate and (found := calibrate_doubtful(recorded, fit, sensors)):
            text, calibration = found
            recorded = scenario_from_recording(sensors, scans, truth, text=text, **settings)
            trace = None if trace is None else []
            record, fit = _tracked(recorded, trace)
        scenario = recorded.scenario
        print_run(record, scenario, fit, len(warnings))
        folder = unchanged_out(out, overwrite, identity)
        written = [] if folder is None else _save(record, scenario, fit, folder, text, overwrite=overwrite)
    with interruptible("nothing was written") if folder is None else finishing(folder, "tracks and figures"):
        joins = _print_tracks(record, recorded, scans, join)
        records, trajectories = {"tracks": record}, {}
        if trace is not None:
            records["smoothed"] = smoothed_record(record, recorded, trace, lag)
            trajectories = print_trajectories(records, joins, scenario)
        if folder is not None:
            for name, each in records.items():
                written += _write_tracks(each, scenario, folder, formats, joins, name)
                _draw(each, scenario, folder, name)
    if folder is not None:
        echo(f"Wrote {folder}: {', '.join(_contents(folder, written))}")
    origin = {"assumptions": recorded.assumed, "skipped": recorded.recording.skipped, "warnings": warnings}
    targets = [{"name": name, **own._asdict()} for name, own in named_target_scores(record, scenario)]
    more: dict[str, Any] = {"targets": targets, "joins": [join._asdict() for join in joins], **trajectories}
    more["calibration"] = calibration
    emit_json({**run_document(record, scenario, fit), **origin, **more, "folder": folder, "written": written})


def _tracked(recorded: RecordingScenario, trace: list[TraceEntry] | None) -> tuple[RunRecord, Fit]:
    """Return the run of the tracker over all scans, and the fit of its model. trace: see `track_recording`."""
    from vedette.evaluation.fit import fit_of_run

    record = _run_tracker(recorded.scenario, recorded.recording, trace)
    with compiling():
        return record, fit_of_run(record, recorded.scenario)


def _save(
    record: RunRecord, scenario: Scenario, fit: Fit, folder: Path, text: str | None, *, overwrite: bool
) -> list[Path]:
    """Write the tables of a run, still without tracks and figures, and its sensors file of this text if calibrated.

    Returns the sensors file, if any.
    """
    if missing_package := without("vedette track --out: a folder of results", "pyarrow"):
        note(f"{missing_package}; the tracks are written without it")
    else:
        save_unfinished(record, scenario, fit, folder, overwrite)
    if text is None:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "sensors.yaml", text)
    return [folder / "sensors.yaml"]


def _check_output(formats: Sequence[str], out: Path | None, overwrite: bool) -> tuple[int, ...]:
    from vedette.evaluation.track_table import check_format

    for name in formats:
        check_format(Path(f"tracks.{name}"))
    if formats and out is None:
        raise usage_error("expected with --out, which names the folder", "--format")
    return check_out(out, overwrite)


def _run_tracker(scenario: Scenario, recording: RecordedScans, trace: list[TraceEntry] | None) -> RunRecord:
    """Run the tracker over all scans. Exit if the run stops early."""
    from vedette.evaluation.runs import track_recording
    from vedette.simulation.journal import RunInterrupted, RunStopped

    try:
        with compiling(), bar("scans", len(recording.times)) as progress:
            return track_recording(scenario, recording, progress=progress, trace=trace)
    except (RunStopped, RunInterrupted) as error:
        end_stopped(error, "nothing was written")


def _write_tracks(
    record: RunRecord, scenario: Scenario, folder: Path, formats: Sequence[str] | None, joins: Sequence[Join], name: str
) -> list[Path]:
    """Write the tracks in each format, in files of this name, and return the files."""
    from vedette.evaluation.track_table import table_of_run, write_tracks

    default_formats = ("csv", "geojson") if scenario.model.origin is not None else ("csv",)
    written = [folder / "tracks" / f"{name}.{ending}" for ending in dict.fromkeys(formats or default_formats)]
    table = table_of_run(record, scenario, joins)
    for path in written:
        write_tracks(path, table)
    return written


def _contents(out: Path, written: list[Path]) -> list[str]:
    """Return the contents of the folder: the files of tracks, figures, and the number of tables."""
    names = [file.relative_to(out).as_posix() for file in written]
    figures = ["figures/"] if (out / "figures").is_dir() else []
    tables = len(list(out.glob("*.arrow")))
    return [*names, *figures, *([pluralise(tables, "table")] if tables else [])]


def _print_tracks(record: RunRecord, recorded: RecordingScenario, scans: Path, join: bool) -> tuple[Join, ...]:
    """Print the size of the recording and the number of tracks, and return the joins of tracks, none without `join`."""
    from vedette.evaluation.joining import joins_of_run, with_joined_tracks

    scenario, recording, _ = recorded
    sizes = pluralise(record.num_scans, "scan"), pluralise(recording.num_measurements, "measurement")
    echo(f"{scans}: {', '.join(sizes)}, {pluralise(len(scenario.model.sensors), 'sensor')}")
    joins: tuple[Join, ...] = ()
    if join:
        with compiling(), bar("joins of tracks, scans", record.num_scans) as progress:
            joins = joins_of_run(record, scenario, progress=progress)
    echo(f"  tracks      {_describe_tracks(with_joined_tracks(record, joins))}")
    if joins:
        echo(f"  joined      {pluralise(len(joins), 'gap')} between labels of one track (--no-join: none)")
    return joins


def _describe_tracks(record: RunRecord) -> str:
    """Return the number of tracks and of lasting tracks, in words."""
    num_estimates: dict[tuple[int, ...], int] = {}
    for estimate in record.estimates:
        for label in map(tuple, estimate.labels.tolist()):
            num_estimates[label] = num_estimates.get(label, 0) + 1
    num_lasting = sum(number >= _MIN_ESTIMATES for number in num_estimates.values())
    mean = sum(num_estimates.values()) / max(record.num_scans, 1)
    return (
        f"{len(num_estimates)} ({num_lasting} with at least {_MIN_ESTIMATES} estimates), {mean:.1f} present on average"
    )


def _draw(record: RunRecord, scenario: Scenario, out: Path, name: str) -> None:
    if missing_package := without("vedette track --out: figures", "matplotlib"):
        note(missing_package)
        return
    from vedette.evaluation.figures import build_scene, save_figure, tracks_figure

    save_figure(tracks_figure(record, scene=build_scene(scenario, record.planner)), out / "figures" / name)
