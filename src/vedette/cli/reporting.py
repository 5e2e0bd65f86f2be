"""The commands that draw saved results: report (a page of a campaign or a run) and video (of a run)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.errors import check_ending, option_errors, usage_error
from vedette.cli.options import ResultsFolder
from vedette.cli.output import bar, echo, emit_json, note
from vedette.cli.running import interruptible
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.scenarios import Scenario
    from vedette.simulation.records import RunRecord


def report(
    folder: ResultsFolder,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Where the page goes; else report.html in the folder.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Write the figures too, as PDF, SVG and PNG.")
    ] = None,
    runs: Annotated[
        str | None,
        typer.Option(
            "--runs",
            metavar="CELL:RUN,...",
            help="Runs of a campaign to replay. Default: a typical run under every strategy.",
        ),
    ] = None,
    trust: Annotated[
        bool,
        typer.Option("--allow-code", help="Run code that the scenarios of the results name, to draw measurements."),
    ] = False,
) -> None:
    """Report on a campaign or a run: one page that opens anywhere, with tables, figures and a replay of runs."""
    check_ending(out, "--out", "html")
    require_packages("vedette report", "jinja2", "matplotlib", "pyarrow")
    from vedette.simulation.storage import holds_run

    replays = None if runs is None else [_parse_cell_and_run(text) for text in runs.split(",")]
    is_run = holds_run(folder)
    if is_run and runs is not None:
        raise usage_error(f"expected of a campaign; {folder} holds a single run", "--runs")
    page = out or folder / "report.html"
    with interruptible("what is not yet written is missing; the same command writes it all anew"):
        written, untrusted_code = (
            _report_run(folder, page, figures, trust)
            if is_run
            else _report_campaign(folder, page, figures, replays, trust)
        )
    emit_json({"page": page, "figures": written, "replays_without_measurements": untrusted_code})


WrittenReport = tuple[Sequence[Path], Sequence[str]]


def _report_campaign(
    folder: Path, page: Path, figures: Path | None, replays: list[tuple[str, int]] | None, trust: bool
) -> WrittenReport:
    """Write the report and figures, and return the figures that were written, and the code that was not run."""
    from vedette.campaigns.results import open_results
    from vedette.reports import replay_code, write_figures, write_report

    results = open_results(folder, num_workers=0)
    with option_errors({"path": "--out", "replays": "--runs", "cell": "--runs"}):
        write_report(results, page, replays=replays, trust=trust)
    untrusted_code = () if trust else replay_code(results)
    _print_page(page, untrusted_code)
    return _figures(figures, lambda path: write_figures(results, path)), untrusted_code


def _report_run(folder: Path, page: Path, figures: Path | None, trust: bool) -> WrittenReport:
    from vedette.evaluation.scans import measurement_code
    from vedette.reports import write_run_figures, write_run_report
    from vedette.simulation.storage import read_manifest

    record, scenario = saved_run(folder)
    with option_errors({"path": "--out"}):
        write_run_report(record, scenario, page, manifest=read_manifest(folder), trust=trust)
    untrusted_code = () if trust else measurement_code(scenario)
    _print_page(page, untrusted_code)
    return _figures(figures, lambda path: write_run_figures(record, scenario, path)), untrusted_code


def _print_page(page: Path, untrusted_code: Sequence[str]) -> None:
    echo(f"wrote {page}")
    note_untrusted(untrusted_code)


def note_untrusted(code: Sequence[str]) -> None:
    """Print a remark if measurements are not drawn because of code that is not trusted."""
    if code:
        note(f"without measurements, as drawing them runs {', '.join(code)}: --allow-code allows it")


def _figures(folder: Path | None, write: Callable[[Path], Sequence[Path]]) -> Sequence[Path]:
    if folder is None:
        return ()
    with option_errors({"path": "--figures"}):
        written = write(folder)
    echo(f"wrote {len(written)} files to {folder}")
    return written


def saved_run(folder: Path) -> tuple[RunRecord, Scenario]:
    """Return a saved run and its scenario. Raise `VedetteError` for a folder without both."""
    from vedette.scenarios import load_scenario
    from vedette.simulation.storage import SCENARIO, load_run

    return load_run(folder), load_scenario(folder / SCENARIO)


def _parse_cell_and_run(text: str) -> tuple[str, int]:
    cell, colon, run = text.strip().rpartition(":")
    if not colon or not cell or not (run.isascii() and run.isdigit()):
        raise usage_error(f"expected CELL:RUN, such as jdm:0; got {text.strip()!r}", "--runs")
    return cell, int(run)


TimeScale = Annotated[
    float | None,
    typer.Option("--time-scale", metavar="FACTOR", min=1e-3, help="Seconds of the run per second of video."),
]
Duration = Annotated[
    float | None,
    typer.Option(
        "--duration", metavar="SECONDS", min=0.1, help="Length of the video; default: 0.2 s per scan, but 2 to 60 s."
    ),
]


def video(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results folder of a single run.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="A .mp4 file (needs ffmpeg) or a .gif file.")],
    fps: Annotated[float, typer.Option("--fps", metavar="N", min=0.1, max=120.0, help="Frames per second.")] = 10.0,
    speed: TimeScale = None,
    seconds: Duration = None,
    size: Annotated[int, typer.Option("--size", metavar="PIXELS", min=200, max=4000, help="Width of the video.")] = 800,
    trust: Annotated[
        bool, typer.Option("--allow-code", help="Run Python code named in the scenario, to draw measurements.")
    ] = False,
) -> None:
    """Show a run as a video: targets, estimates, sensors and measurements, scan by scan."""
    if speed is not None and seconds is not None:
        raise usage_error("expected one of --time-scale and --duration; got both", "--time-scale")
    require_packages("vedette video", "matplotlib", "pyarrow")
    from vedette.evaluation.figures import write_video
    from vedette.evaluation.scans import measurement_code

    with interruptible("nothing was written"):
        record, scenario = saved_run(folder)
        if speed is not None:
            seconds = float(record.times[-1] - record.times[0]) / speed
        with bar("frames") as progress, option_errors({"path": "--out", "seconds": "--duration"}):
            number = write_video(
                record, scenario, out, fps=fps, seconds=seconds, size=size, trust=trust, progress=progress
            )
    untrusted_code = () if trust else measurement_code(scenario)
    note_untrusted(untrusted_code)
    echo(f"wrote {out}: {pluralise(number, 'frame')}, {number / fps:.1f} s")
    emit_json({"video": out, "frames": number, "seconds": number / fps, "replays_without_measurements": untrusted_code})
