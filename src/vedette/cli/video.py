"""The command that shows a run as a video."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.errors import option_errors, usage_error
from vedette.cli.output import echo, emit_json, note
from vedette.cli.progress import bar
from vedette.cli.results import saved_run
from vedette.cli.running import interruptible
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise


def video(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results folder of a single run.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="A .mp4 file (needs ffmpeg) or a .gif file.")],
    fps: Annotated[float, typer.Option("--fps", metavar="N", min=0.1, max=120.0, help="Frames per second.")] = 10.0,
    speed: Annotated[
        float | None,
        typer.Option("--time-scale", metavar="FACTOR", min=1e-3, help="Seconds of the run per second of video."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--duration",
            metavar="SECONDS",
            min=0.1,
            help="Length of the video; default: 0.2 s per scan, but 2 to 60 s.",
        ),
    ] = None,
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
    if untrusted_code:
        note(f"without measurements, as drawing them runs {', '.join(untrusted_code)}: --allow-code allows it")
    echo(f"wrote {out}: {pluralise(number, 'frame')}, {number / fps:.1f} s")
    emit_json({"video": out, "frames": number, "seconds": number / fps, "replays_without_measurements": untrusted_code})
