"""Edits of a results folder: its manifest, its database and the runs in it."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.edits import edit_arrow, edit_json, edit_npz
from fuzz.mutations import JUNK, pick, spoil_bytes
from vedette.campaigns.manifest import contents_checksum
from vedette.campaigns.rows import pack, unpack

Generator = np.random.Generator
Statement = tuple[str, tuple[Any, ...]]

_STATEMENTS = [
    "DROP TABLE runs",
    "DROP TABLE campaign",
    "DROP TABLE failures",
    "DELETE FROM campaign",
    "INSERT INTO campaign SELECT * FROM campaign",
    "ALTER TABLE runs DROP COLUMN session",
    "ALTER TABLE runs RENAME COLUMN payload TO load",
    "ALTER TABLE runs RENAME TO old",
    "ALTER TABLE runs ADD COLUMN more",
    "UPDATE runs SET cell = 'nobody' WHERE run = 0",
    "UPDATE runs SET cell = x'00ff' WHERE run = 0",
    "UPDATE runs SET run = run + 1000000000000 WHERE run = 1",
    "UPDATE runs SET run = -1 WHERE run = 1",
    "UPDATE runs SET payload = (SELECT payload FROM runs WHERE run = 1 LIMIT 1) WHERE run = 0",
    "UPDATE runs SET timings = payload",
    "UPDATE runs SET payload = zeroblob(1000000)",
    "UPDATE runs SET payload = 'text', payload_sha256 = x'00'",
    "UPDATE runs SET session = 99",
    "UPDATE runs SET session = 'x'",
    "UPDATE campaign SET contents = x'ff'",
    "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM runs; END",
    "PRAGMA user_version = 77",
    "PRAGMA application_id = 77",
]
_VIEW = (
    "ALTER TABLE runs RENAME TO old",
    "CREATE VIEW runs AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) "
    "SELECT 'jdm' AS cell, n AS run, 1 AS session, x'' AS payload, '' AS payload_sha256, x'' AS metrics, "
    "'' AS metrics_sha256, x'' AS timings, "
    "'' AS timings_sha256 FROM r",
)
_UNTYPED = (
    "ALTER TABLE runs RENAME TO old",
    "CREATE TABLE runs (cell, run, session, payload, payload_sha256, metrics, metrics_sha256, timings, timings_sha256)",
    "INSERT INTO runs SELECT * FROM old",
    "DROP TABLE old",
)


def edit_manifest(folder: Path, rng: Generator, *, sign: bool) -> None:
    """Another manifest; with `sign` the database agrees with it, as far as one can be made to."""
    path = folder / "manifest.json"
    path.write_bytes(edit_json(path.read_bytes(), rng))
    if sign:
        sign_manifest(folder)


def sign_manifest(folder: Path) -> None:
    """Let the database hold the checksum of the manifest that is there now."""
    with suppress(Exception):
        checksum = contents_checksum(json.loads((folder / "manifest.json").read_bytes()))
        ask(folder, ("UPDATE campaign SET contents = ?", (checksum,)))


def edit_database(folder: Path, rng: Generator) -> None:
    """Other tables, rows or bytes."""
    path, what = folder / "campaign.sqlite", rng.integers(12)
    if what == 0:
        path.unlink()
    elif what == 1:
        path.write_bytes(b"")
    elif what == 2:
        path.unlink()
        ask(folder, ("CREATE TABLE songs (title TEXT)", ()))
    elif what == 3:
        path.write_bytes(spoil_bytes(rng, path.read_bytes()))
    elif what == 4:
        ask(folder, *((statement, ()) for statement in _VIEW))
    elif what == 5:
        column = ["cell", "run", "session", "payload", "payload_sha256", "metrics", "timings", "timings_sha256"][
            rng.integers(8)
        ]
        value = _storable(pick(rng, JUNK))
        change = (f"UPDATE runs SET {column} = ? WHERE run = 0", (value,))
        ask(folder, *((statement, ()) for statement in _UNTYPED), change)
    else:
        ask(folder, (_STATEMENTS[rng.integers(len(_STATEMENTS))], ()))


def _storable(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode(errors="surrogatepass") if "\ud800" in value else value
    if isinstance(value, bool | None) or (isinstance(value, int) and abs(value) < 2**63) or isinstance(value, float):
        return value
    return json.dumps(value).encode()


def edit_run(folder: Path, rng: Generator, *, sign: bool) -> None:
    """Other bytes of one run; with `sign` their checksum fits."""
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database:
        rows = database.execute("SELECT cell, run, payload, metrics, timings FROM runs ORDER BY cell, run").fetchall()
    cell, run, *blobs = rows[rng.integers(len(rows))]
    column, old = list(zip(("payload", "metrics", "timings"), blobs, strict=True))[max(0, int(rng.integers(6)) - 3)]
    content = (edit_npz if column == "payload" else edit_arrow)(unpack(old), rng)
    if not rng.integers(20):
        content = bytes(200_000_000)  # a fifth of a megabyte on the disk
    packed = pack(cell, run, content).content
    ask(folder, (f"UPDATE runs SET {column} = ? WHERE cell = ? AND run = ?", (packed, cell, run)))
    if sign:
        checksum = hashlib.sha256(f"{cell}\n{run}\n".encode() + content).hexdigest()
        set_checksum = f"UPDATE runs SET {column}_sha256 = ? WHERE cell = ? AND run = ?"
        ask(folder, (set_checksum, (checksum, cell, run)))


def ask(folder: Path, *statements: Statement) -> None:
    """Have the database do this, as far as it can."""
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database, database, suppress(sqlite3.Error):
        for statement, values in statements:
            database.execute(statement, values)
