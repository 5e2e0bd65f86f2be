"""Processes killed and disks filled in earnest, while runs are added."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from campaigns.adding import CELL, CONTENTS, entry_of, put, started
from vedette.campaigns.database import DATABASE, Reader
from vedette.campaigns.journal import Writer
from vedette.errors import InputError

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")


@pytest.fixture
def folder(tmp_path):
    writer = Writer(tmp_path)
    writer.open_runs(CONTENTS)
    writer.close()
    return tmp_path


def check_whole(folder: Path, at_least: set[int]) -> set[int]:
    """Every run there is whole and its own; returns their numbers."""
    reader = Reader(folder)
    reader.check(CONTENTS)
    runs = {run for _, run in reader.finished()}
    assert at_least <= runs
    for run in runs:
        assert reader.entry(CELL, run) == entry_of(run)
    with closing(sqlite3.connect(folder / DATABASE)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    return runs


def kill_while_adding(process: subprocess.Popen[str], seconds: float) -> set[int]:
    """Have a child add runs for so long after its first, kill it; returns the runs that it told of."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("again\n")
    process.stdin.flush()
    lines: list[str] = []
    child = 0
    while child == 0 or len(lines) < 2:
        lines.append(process.stdout.readline())
        if lines[-1].startswith("child"):
            child = int(lines[-1].split()[1])
    time.sleep(seconds)
    with contextlib.suppress(ProcessLookupError):  # on a busy machine it may be done with all that it adds
        os.kill(child, signal.SIGKILL)
    while not lines[-1].endswith("gone\n"):  # the child may have been killed within a line
        lines.append(process.stdout.readline())
        assert lines[-1], process.communicate()
    return {int(line) for line in lines if line.strip().isdigit()}


def test_whatever_was_added_survives_a_kill_at_any_moment(folder):
    dice = random.Random(1)
    added: set[int] = set()
    with started("add_in_children", str(folder)) as process:
        for _ in range(25):
            told = added | kill_while_adding(process, dice.uniform(0.0, 0.03))
            added = check_whole(folder, told)
            assert len(added) <= len(told) + 1  # the one that was on the disk before it could be told of
        process.kill()
    assert added == set(range(len(added)))


def test_a_transaction_killed_half_way_is_taken_back_by_the_first_reader(folder):
    writer = Writer(folder)
    writer.open_runs(CONTENTS)
    put(writer, 0)
    writer.close()
    before = (folder / DATABASE).stat().st_size
    with started("add_half", str(folder)) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        process.kill()
    assert (folder / DATABASE).stat().st_size > before + 1_000_000
    assert check_whole(folder, {0}) == {0}
    assert (folder / DATABASE).stat().st_size == before


def test_a_folder_is_read_while_it_is_written(folder):
    with started("add_for_ever", str(folder), "0.02") as process:
        assert process.stdout is not None
        told = set()
        for _ in range(20):
            told.add(int(process.stdout.readline()))
            assert told <= {run for _, run in Reader(folder).finished()}
            assert Reader(folder).entry(CELL, max(told)) == entry_of(max(told))
        with pytest.raises(InputError, match="another process is writing this campaign"):
            Writer(folder)
        process.kill()
    Writer(folder).close()


LIMIT = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, -1))"


def check_went_on(output: str, folder: Path) -> None:
    error, went_on = output.splitlines()[:2]
    run = int(error.split()[1].rstrip(":"))
    assert run > 2
    assert f"cell jdm, run {run}: expected room on the disk" in error
    assert DATABASE in error
    assert went_on == f"went on with run {run}"
    assert check_whole(folder, set(range(run + 1))) == set(range(run + 1))


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of resources")
def test_a_file_that_may_not_grow_is_told_and_gone_on_with(folder):
    with started("add_until_full", str(folder), LIMIT.format(-1), before=LIMIT.format(300_000)) as process:
        output, errors = process.communicate()
    assert not errors
    check_went_on(output, folder)


@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="needs to mount")
def test_a_full_disk_is_told_and_gone_on_with(tmp_path):
    # A disk of its own, in a name space of its own: nothing of it is left when the process ends.
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    call = "import subprocess; subprocess.run(['mount', *{0!r}, {1!r}], check=True)\n"
    mount = call.format(["-t", "tmpfs", "-o", "size=400k", "x"], str(disk))
    copy = f"import atexit, shutil; atexit.register(shutil.copytree, {str(disk)!r}, {str(kept)!r})"
    grow = call.format(["-o", "remount,size=9m"], str(disk)) + copy
    unshare = shutil.which("unshare")
    if unshare is None:
        pytest.skip("needs unshare")
    with started("add_until_full", str(disk), grow, before=mount, prefix=(unshare, "-m")) as process:
        output, errors = process.communicate()
    if "unshare failed" in errors or "permission denied" in errors:
        pytest.skip(errors)
    assert not errors
    check_went_on(output, kept)
