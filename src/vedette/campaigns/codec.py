"""Encoding of a run as bytes, lossless.

The bytes are an uncompressed zip archive of the Arrow files of a saved run (`vedette.simulation.serialization`) and of
`run.json`, which identifies the run. They depend only on the numbers in the run.
"""

import io
import json
import zipfile
from collections.abc import Container
from typing import Any

from vedette.errors import InputError
from vedette.internal.reading import error_summary, parse_json, read_members
from vedette.simulation import serialization
from vedette.simulation.records import RunRecord, RunSummary
from vedette.simulation.tables import run_facts

_RUN = "run.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time in a zip archive
_UNIX = 3


def encode(record: RunRecord) -> bytes:
    """Return a run as bytes, without its timings. Equal runs give equal bytes.

    Raises `InputError` for a record that contradicts itself or holds an invalid plan.
    """
    files = {_RUN: json.dumps(run_facts(record)).encode() + b"\n", **serialization.encode_run(record)}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name, _EPOCH)
            info.create_system = _UNIX
            archive.writestr(info, content)
    return out.getvalue()


def decode(payload: bytes, timings: bytes | None = None) -> RunRecord:
    """Return the run from its bytes and, if given, those of its timings.

    Raises `InputError` for bytes that are not those of a run.
    """
    facts, members = _members(payload)
    return serialization.decode_run(facts, members, "run", timings)


def decode_summary(payload: bytes, timings: bytes | None = None) -> RunSummary:
    """Return the summary of a run, in a third of the time of `decode`. Raises as `decode`."""
    facts, members = _members(payload, {_RUN, *serialization.SUMMARY_FILES})
    return serialization.decode_summary(facts, members, "run", timings)


def _members(payload: bytes, names: Container[str] | None = None) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return the facts that identify a run, and its files."""
    try:
        members = read_members(payload, names)
        facts = parse_json(members[_RUN])
        if not isinstance(facts, dict):
            raise TypeError(f"{_RUN} does not name one")
    except Exception as error:  # other bytes can raise nearly any error
        raise InputError(
            f"run: expected the bytes of a run; got others: {type(error).__name__}: {error_summary(error)}"
        ) from error
    return facts, members
