"""After whatever end the loop goes on as if nothing had been."""

from __future__ import annotations

import asyncio
import itertools
import os
from pathlib import Path
from typing import Any

import pytest

from live.examples import answered, line, small, walk
from vedette.errors import InputError
from vedette.live import MAX_LINE_BYTES, LineSplitter, LiveLoop, PersistentLoop, encode_line
from vedette.live.lines import iter_lines

LINES = [*walk(7), b"{", line("nobody"), *walk(9)[14:]]


def sent(persistent: PersistentLoop, lines: list[bytes]) -> list[bytes]:
    return [encode_line(answer) for one in lines for answer in persistent.process(one)]


def resumed(persistent: PersistentLoop) -> list[bytes]:
    return [encode_line(answer) for answers in persistent.resume() for answer in answers]


@pytest.fixture
def live(tmp_path: Path) -> LiveLoop:
    return small(tmp_path, decide_every=3.0)


@pytest.mark.parametrize("end", [0, 1, 9, 15, len(LINES)])
@pytest.mark.parametrize("kept", [("snapshot",), ("record",), ("snapshot", "record")], ids="-".join)
def test_a_loop_resumes_from_its_files(tmp_path: Path, live: LiveLoop, end: int, kept: tuple[str, ...]) -> None:
    whole = answered(live, LINES)
    files: dict[str, Any] = {name: tmp_path / name for name in kept}
    ticks = itertools.count()
    # With a record a snapshot is now and then, without at every line.
    every = 4.0 if "record" in kept else 0.0
    before = PersistentLoop(live, **files, snapshot_interval=every, clock=lambda: float(next(ticks)))
    first = sent(before, LINES[:end])
    before._locks.close()  # the system closes the files of whom it ends
    if "record" in kept:
        before._record.close()  # type: ignore[union-attr]
        with (tmp_path / "record").open("ab") as file:
            file.write(b'{"sensor": 1, "ti')
    after = PersistentLoop(live, **files)
    again = resumed(after)
    assert first[len(first) - len(again) :] == again
    assert first + sent(after, LINES[end:]) == whole
    after.close()
    if "record" in kept:
        assert (tmp_path / "record").read_bytes() == b"".join(one + b"\n" for one in LINES)
    if "snapshot" in kept:
        assert PersistentLoop(live, snapshot=tmp_path / "snapshot").state.num_lines == len(LINES)


@pytest.mark.parametrize(
    "content", [b"time,x,y\n1,2,3\n", b"sensors:\n- name: A\n", b'{"type": "Feature"}\n', b"notes"]
)
def test_a_file_that_is_no_record_is_refused(tmp_path: Path, live: LiveLoop, content: bytes) -> None:
    path = tmp_path / "scans.csv"
    path.write_bytes(content)
    with pytest.raises(
        InputError, match=r"scans\.csv: expected a new file, or a record of live scans; got a file without"
    ):
        PersistentLoop(live, record=path)
    assert path.read_bytes() == content


def test_a_record_replays_to_the_same_bytes(tmp_path: Path, live: LiveLoop) -> None:
    persistent = PersistentLoop(live, record=tmp_path / "record")
    splitter = LineSplitter(MAX_LINE_BYTES)
    came = b"\r\n".join([*LINES[:5], b"", b"x" * (2 * MAX_LINE_BYTES), b"\xff\x00", *LINES[5:]])
    first = sent(persistent, [*splitter.feed(came), *splitter.rest()])
    persistent.close()
    again = LineSplitter(MAX_LINE_BYTES)
    assert answered(live, again.feed((tmp_path / "record").read_bytes())) == first
    assert (tmp_path / "record").stat().st_size < 1.1 * MAX_LINE_BYTES


def test_files_of_others_are_refused(tmp_path: Path, live: LiveLoop) -> None:
    persistent = PersistentLoop(live, identity="this", snapshot=tmp_path / "a", record=tmp_path / "r")
    sent(persistent, LINES[:4])
    persistent.close()
    with pytest.raises(InputError, match="expected a snapshot of the same sensors and options; got one of others"):
        PersistentLoop(live, identity="that", snapshot=tmp_path / "a")
    (tmp_path / "r").write_bytes(LINES[0] + b"\n")
    with pytest.raises(InputError, match="expected at least the 4 lines that the snapshot has taken; got 1"):
        resumed(short := PersistentLoop(live, identity="this", snapshot=tmp_path / "a", record=tmp_path / "r"))
    short.close()
    (tmp_path / "a").write_bytes(b"PK")
    with pytest.raises(InputError, match="expected a snapshot; it is damaged"):
        PersistentLoop(live, snapshot=tmp_path / "a")
    with pytest.raises(InputError, match="expected a file that can be written"):
        PersistentLoop(live, record=tmp_path / "no" / "r")


def test_a_snapshot_that_cannot_be_written_is_reported_and_the_loop_continues(tmp_path: Path, live: LiveLoop) -> None:
    told = list[str]()
    persistent = PersistentLoop(live, snapshot=tmp_path / "no" / "a", snapshot_interval=0.0, report=told.append)
    assert sent(persistent, LINES[:3]) == answered(live, LINES[:3])
    assert len(told) == 3
    assert "expected a file that can be written" in told[0]


@pytest.mark.parametrize("name", ["record", "snapshot"])
def test_two_loops_do_not_write_one_file(name: str, tmp_path: Path, live: LiveLoop) -> None:
    files: dict[str, Any] = {name: tmp_path / "kept"}
    first = PersistentLoop(live, **files)
    with pytest.raises(InputError, match="kept: expected to write alone; another process is writing it"):
        PersistentLoop(live, **files)
    first.close()
    PersistentLoop(live, **files).close()


def test_a_full_disk_is_reported_and_a_device_is_no_record(tmp_path: Path, live: LiveLoop) -> None:
    if Path("/dev/full").exists():
        with pytest.raises(InputError, match="/dev/full: expected a file for the record; got something else"):
            PersistentLoop(live, record=Path("/dev/full"))
    persistent = PersistentLoop(live, record=tmp_path / "record")

    class Full:
        def write(self, _: bytes) -> None:
            raise OSError(28, "No space left on device")

        def close(self) -> None:
            self.write(b"what is left")

    persistent.close()
    persistent._record = Full()  # type: ignore[assignment]
    with pytest.raises(InputError, match="record: expected room for the record; No space left on device"):
        persistent.process(LINES[0])
    persistent.close()


def test_the_reader_of_a_pipe_outlives_an_interrupted_loop_in_silence() -> None:
    """What it raised in its thread would be an error of this test. The end that it reads stays open."""
    reading, writing = os.pipe()

    class Source:
        def fileno(self) -> int:
            return reading

    async def interrupted() -> None:
        lines = iter_lines(Source())
        os.write(writing, b"first\n")
        assert await anext(lines) == b"first"
        os.write(writing, b"second\n")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        asyncio.run(interrupted())
    os.write(writing, b"third\n")
    os.close(writing)
