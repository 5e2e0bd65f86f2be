"""Scripts that other processes run: they add runs to a results folder until something stops them."""

from __future__ import annotations

import hashlib
import os
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

from vedette.campaigns.database import DATABASE
from vedette.campaigns.journal import Writer
from vedette.campaigns.rows import Entry, row_of
from vedette.errors import InputError

CELL, CONTENTS = "jdm", "checksum of a manifest"
SIZE = 40_000


def entry_of(run: int) -> Entry:
    """A run of bytes that do not compress, others for every number."""
    seed = hashlib.sha256(str(run).encode()).digest()
    payload = hashlib.shake_256(seed).digest(SIZE)
    return Entry(CELL, run, 1, payload, b"", payload[:1000])


def put(writer: Writer, run: int) -> None:
    """Add it."""
    entry = entry_of(run)
    writer.put([row_of(entry.cell, entry.run, entry.payload, entry.timings, entry.metrics)], entry.session)


def add_for_ever(folder: Path, pause: str = "0.0") -> None:
    """Print the number of every run once it is added; rest for so many seconds after each."""
    writer = Writer(folder)
    writer.open_runs(CONTENTS)
    done = writer.finished()
    run = 0
    while True:
        if (CELL, run) not in done:
            put(writer, run)
            print(f"{run}\n", end="", flush=True)
            time.sleep(float(pause))
        run += 1


def add_in_children(folder: Path) -> None:
    """For every line read, one more process that adds for ever (without the seconds that a new interpreter takes)."""
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            add_for_ever(folder)
        print(f"child {child}", flush=True)
        os.waitpid(child, 0)
        print("gone", flush=True)


def add_half(folder: Path) -> None:
    """Begin to add runs, let them reach the file, and never finish."""
    database = sqlite3.connect(folder / DATABASE, isolation_level=None)
    database.execute("PRAGMA journal_mode = PERSIST")
    database.execute("PRAGMA cache_size = 1")
    database.execute("BEGIN IMMEDIATE")
    for run in range(1000, 1100):
        row = (CELL, run, 1, entry_of(run).payload, "", b"", "", b"", "")
        database.execute("INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
    print("half", flush=True)
    sys.stdin.read()


def add_until_full(folder: Path, make_room: str) -> None:
    """Add until the disk is full, say what that raised, make room, add once more."""
    writer = Writer(folder)
    writer.open_runs(CONTENTS)
    run = 0
    try:
        while run < 1000:
            put(writer, run)
            run += 1
    except InputError as error:
        print(f"run {run}: {error}")
    exec(make_room)
    put(writer, run)
    writer.close()
    print(f"went on with run {run}", flush=True)


def started(
    function: str, *arguments: str, before: str = "", prefix: tuple[str, ...] = (), module: str = "adding"
) -> subprocess.Popen[str]:
    """One of these functions, or those of another module here, in a process of its own."""
    tests = str(Path(__file__).parents[1])
    call = f"import sys; sys.path.insert(0, {tests!r}); {before}\nfrom campaigns.{module} import *\n"
    call += f"{function}(Path(sys.argv[1]), *sys.argv[2:])"
    return subprocess.Popen(
        [*prefix, sys.executable, "-c", call, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
