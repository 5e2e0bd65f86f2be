"""Where commands write and read: nothing else is replaced, and what is in the way is one line."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import write_recording
from vedette.campaigns.database import LOCK, lock_of
from vedette.cli import app
from vedette.cli.output import system_error_message
from vedette.errors import InputError
from vedette.internal.files import unwritable, write_file, write_whole
from vedette.simulation.storage import check_target

posix = pytest.mark.skipif(os.name == "nt", reason="of POSIX systems")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a recording, and a file of the user's own."""
    write_recording(tmp_path, seconds=20.0)
    (tmp_path / "mine.yaml").write_text("mine")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(text: str) -> Result:
    return CliRunner().invoke(app, text.split(), env={"COLUMNS": "300"})


@pytest.mark.parametrize(
    ("words", "endings"),
    [
        ("schema --out mine.yaml", "json"),
        ("report run --out mine.yaml", "html"),
        ("results run --tex mine.yaml", "tex"),
        ("show paper-a --out mine.yaml", "png, pdf, svg"),
        ("calibrate scans.csv --sensors radars.yaml --out scans.csv --overwrite", "yaml, yml"),
    ],
)
def test_output_does_not_replace_a_file_of_another_kind(place: Path, words: str, endings: str) -> None:
    before = {path: path.read_bytes() for path in place.iterdir()}
    result = call(words)
    assert result.exit_code == 2
    assert f"expected a file ending in {endings}; got" in result.stderr
    assert {path: path.read_bytes() for path in place.iterdir()} == before


def test_a_run_does_not_replace_a_campaign(tmp_path: Path) -> None:
    campaign = tmp_path / "results"
    campaign.mkdir()
    (campaign / "manifest.json").write_text('{"format": "vedette-campaign", "format_version": 7}')
    with pytest.raises(InputError, match=r"expected a folder that holds a run; .*results holds something else"):
        check_target(campaign, overwrite=True)


def test_a_lock_that_is_a_folder_is_a_line(tmp_path: Path) -> None:
    (tmp_path / LOCK).mkdir()
    with pytest.raises(InputError, match=rf"expected a folder that can be written; {LOCK}: unable to open"):
        lock_of(tmp_path)


@posix
def test_a_pipe_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="it is no regular file"):
        write_whole(pipe, lambda file: file.write(b"text"))
    with pytest.raises(InputError, match="pipe: expected a file that can be written; it is no regular file"):
        write_file(pipe, lambda file: file.write(b"text"))
    assert pipe.is_fifo()
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


@posix
def test_a_pipe_is_no_missing_scenario(place: Path) -> None:
    os.mkfifo(place / "pipe")
    assert "it is no regular file" in call("check pipe").stdout


def test_a_folder_that_cannot_be_written_is_reported_before_the_work(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = call("calibrate scans.csv --sensors radars.yaml --out mine.yaml/found.yaml")
    expected = f"expected a file that can be written; {place / 'mine.yaml'} is no folder"
    assert (result.exit_code, result.stderr) == (1, f"mine.yaml/found.yaml: {expected}\n")
    (place / "shut").mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "shut")
    assert unwritable(place / "shut" / "new" / "run") == f"{place / 'shut'} may not be written to"
    assert unwritable(place / "run") == ""
    with pytest.raises(InputError, match=r"got .*run: .*shut may not be written to"):
        check_target(place / "shut" / "run", overwrite=False)


def test_a_folder_is_no_recording(place: Path) -> None:
    assert call("track . --sensors radars.yaml").stderr == ".: a folder; expected a file of scans\n"
    told = call("track scans.csv --sensors .").stderr
    assert told == ".: expected a sensors file; got a folder\n"


def test_another_yaml_file_as_sensors_file_is_reported(place: Path) -> None:
    (place / "empty.yaml").write_text("")
    told = call("track scans.csv --sensors empty.yaml").stderr
    assert told == "empty.yaml: expected a mapping with `sensors`; got nothing\n"
    assert 'got "mine"' in call("track scans.csv --sensors mine.yaml").stderr


def test_a_file_that_the_system_refuses_is_a_line() -> None:
    text = system_error_message(PermissionError(errno.EACCES, "Permission denied", "private/x"))
    assert text == "private/x: expected a file or folder that can be used; Permission denied"
    result = call(f"run {'x' * 300}.yaml --out {'y' * 300}")
    assert (result.exit_code, isinstance(result.exception, SystemExit)) == (1, True)
    result = call(f"track {'x' * 300}.csv --sensors radars.yaml")
    assert (result.exit_code, isinstance(result.exception, SystemExit)) == (1, True)
    with pytest.raises(OSError, match="odd"):
        system_error_message(OSError(errno.EINVAL, "odd"))
