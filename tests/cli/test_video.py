"""`vedette video`: whole or not at all, with the frames that were asked for, and clear words where it cannot be."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL.GifImagePlugin import GifImageFile
from typer.testing import CliRunner, Result

from recordings import write_recording
from vedette.cli import app
from vedette.cli.reporting import saved_run
from vedette.evaluation.figures import write_video
from vedette.evaluation.figures.video import _Drawing


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("video")
    write_recording(folder, seconds=40.0)
    words = [str(folder / "scans.csv"), "--sensors", str(folder / "radars.yaml"), "--truth", str(folder / "truth.csv")]
    for command in (["track", *words], ["run", "paper-a", "--planner", "stationary"]):
        made = CliRunner().invoke(app, [*command, "--out", str(folder / command[0])])
        assert made.exit_code == 0, made.output
    return folder


def call(*words: object) -> Result:
    return CliRunner().invoke(app, ["video", *map(str, words)])


@pytest.mark.parametrize("name", ["track", "run"])
def test_a_gif_has_the_size_and_the_length_that_were_asked_for(runs: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "new" / "run.gif"
    result = call(runs / name, "--out", out, "--duration", 2, "--fps", 5, "--size", 300)
    assert result.exit_code == 0, result.output
    assert result.stdout.strip() == f"wrote {out}: 10 frames, 2.0 s"
    assert [path.name for path in out.parent.iterdir()] == ["run.gif"]
    with GifImageFile(out) as image:
        lasts = []
        for frame in range(image.n_frames):
            image.seek(frame)
            lasts.append(image.info["duration"])
        assert image.width == 300
        assert sum(lasts) == 2000  # ms
        assert image.n_frames > 5  # equal ones in a row are one


def test_speed_is_the_run_over_the_video(runs: Path, tmp_path: Path) -> None:
    result = call(runs / "run", "--out", tmp_path / "run.gif", "--time-scale", 13, "--fps", 2, "--size", 200)
    assert result.stdout.strip().endswith(": 6 frames, 3.0 s")  # 39 s of the run


def test_a_frame_shows_its_scan(runs: Path) -> None:
    record, scenario = saved_run(runs / "run")
    drawing: Any = _Drawing(record, scenario, False)
    for step in (0, 20, 7):
        drawing.show(step)
        (axes,) = drawing.figure.axes
        assert axes.get_title().endswith(f"t = {record.times[step]:.1f} s")
        drawn = {tuple(point) for line in axes.lines for point in np.column_stack(line.get_data()).tolist()}
        _, states = record.truth.at(step)
        shown = [*states[:, :2], *record.estimates[step].means[:, :2], *record.poses[step, :, :2]]
        assert {tuple(point.tolist()) for point in shown} <= drawn
        measured = sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == "x")
        assert measured == sum(len(scan.measurements) for scan in drawing._scans[step])


def test_an_interrupted_one_leaves_nothing(runs: Path, tmp_path: Path) -> None:
    def interrupt(frame: int, number: int) -> None:
        if frame == 3:
            raise KeyboardInterrupt

    record, scenario = saved_run(runs / "run")
    with pytest.raises(KeyboardInterrupt):
        write_video(record, scenario, tmp_path / "run.gif", size=200, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_prints_one_line(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("vedette.evaluation.figures.write_video", interrupted)
    result = call(runs / "run", "--out", tmp_path / "run.gif")
    assert (result.exit_code, result.output.strip()) == (130, "interrupted: nothing was written")


@pytest.mark.skipif(os.name == "nt", reason="programs are scripts of a shell")
@pytest.mark.parametrize("is_there", [False, True])
def test_a_missing_or_failing_ffmpeg_is_reported(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_there: bool
) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    if is_there:
        (programs / "ffmpeg").write_text("#!/bin/sh\ncat > /dev/null\necho 'Unknown encoder h264' >&2\nexit 1\n")
        (programs / "ffmpeg").chmod(0o755)
        monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    else:
        monkeypatch.setenv("PATH", str(programs))
    result = call(runs / "run", "--out", tmp_path / "run.mp4", "--duration", 1, "--fps", 3, "--size", 200)
    assert result.exit_code == 1
    (line,) = result.output.splitlines()
    if is_there:
        assert "expected ffmpeg to write it; it failed: Unknown encoder h264" in line
    else:
        assert line.startswith("--out: expected ffmpeg, which writes ")
        assert "a .gif needs none" in line
    assert list(tmp_path.iterdir()) == [programs]


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg on PATH to write MP4 with")
def test_an_mp4_is_one(runs: Path, tmp_path: Path) -> None:
    result = call(runs / "run", "--out", tmp_path / "run.mp4", "--duration", 1, "--fps", 3, "--size", 201)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("run.avi",), 1, "--out: expected a file that ends with .mp4 or .gif; got run.avi"),
        (("a.gif", "--duration", 500), 1, "--duration: expected at most 1000 frames of a .gif file; got 5000"),
        (("a.gif", "--duration", 5, "--time-scale", 2), 2, "expected one of --time-scale and --duration; got both"),
        (("a.gif", "--size", 20), 2, "for '--size': expected greater than or equal to 200; got '20'"),
    ],
)
def test_invalid_options_are_reported(runs: Path, words: tuple[object, ...], status: int, message: str) -> None:
    result = call(runs / "run", "--out", *words)
    assert result.exit_code == status
    assert message in " ".join(result.output.replace("\u2502", " ").split())


def test_a_folder_without_a_run_is_reported(tmp_path: Path) -> None:
    result = call(tmp_path, "--out", tmp_path / "run.gif")
    assert result.exit_code == 1
    assert "no such file" in result.output
