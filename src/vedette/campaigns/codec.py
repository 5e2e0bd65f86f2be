"""A run as bytes, and back, bit for bit.

The bytes are those of a NumPy `.npz` archive: a structured array for each table of `vedette.simulation.tabulation` and
one for the metrics, and two members of JSON. They depend on nothing but the numbers in them: no times of writing, no
compression, little-endian on every machine. `np.load(io.BytesIO(payload))` reads them without this library.
"""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.evaluation.metrics import RunMetrics
from vedette.kernels.base.types import Floats
from vedette.reading import parse_json, read_array, read_members, said
from vedette.simulation.columns import check_columns, pack, unpack
from vedette.simulation.decisions import read_decisions, write_decisions
from vedette.simulation.encoding import timing_columns, timings_of
from vedette.simulation.records import RunRecord
from vedette.simulation.tabulation import TABLES, check_record, record_of, run_facts, tables_of
from vedette.text import shown

PAYLOAD_VERSION = 2  # of the layout: another wherever a table or the metrics gain, lose or rename a column
_METRICS, _RUN, _DECISIONS = "metrics", "run.json", "decisions.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip archive can say
_UNIX = 3


def encode(record: RunRecord, metrics: RunMetrics) -> bytes:
    """Everything of a run but its timings; equal runs give equal bytes.

    Raises `InputError` for a record that contradicts itself or holds an invalid plan, or metrics of another length.
    """
    check_record(record)
    if metrics.num_scans != record.num_scans:
        raise InputError(f"metrics: expected one entry for each of {record.num_scans} scans; got {metrics.num_scans}")
    facts = json.dumps({"payload_version": PAYLOAD_VERSION, **run_facts(record)}) + "\n"
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        _add(archive, _RUN, facts.encode())
        for name, columns in tables_of(record).items():
            _add(archive, f"{name}.npy", _array_bytes(pack(columns)))
        _add(archive, f"{_METRICS}.npy", _array_bytes(pack(metrics.columns())))
        _add(archive, _DECISIONS, write_decisions(record.decisions).encode())
    return out.getvalue()


def decode(payload: bytes) -> tuple[RunRecord, RunMetrics]:
    """The run back from its bytes, without timings.

    Raises `InputError` for bytes that are not those of a run.
    """
    try:
        record, metrics = _decoded(payload)
    except InputError:
        raise
    except Exception as error:  # bytes of no run can raise nearly anything on the way to one
        raise InputError(
            f"run: expected the bytes of a run; got others: {type(error).__name__}: {said(error)}"
        ) from error
    check_record(record)
    if metrics.num_scans != record.num_scans:
        raise InputError(f"metrics: expected one entry for each of {record.num_scans} scans; got {metrics.num_scans}")
    return record, metrics


def _decoded(payload: bytes) -> tuple[RunRecord, RunMetrics]:
    members = read_members(payload)
    facts = parse_json(members[_RUN])
    if facts["payload_version"] != PAYLOAD_VERSION:
        raise InputError(f"run: expected payload version {PAYLOAD_VERSION}; got {shown(facts['payload_version'])}")
    tables = {name: unpack(read_array(members[f"{name}.npy"])) for name in TABLES}
    for name, kinds in TABLES.items():
        check_columns(tables[name], kinds, f"run, table {name}")
    metrics = RunMetrics.from_columns(unpack(read_array(members[f"{_METRICS}.npy"])))
    return record_of(facts, tables, read_decisions(members[_DECISIONS].decode()), {}), metrics


def encode_timings(record: RunRecord) -> bytes:
    """The seconds of every stage and scan as the bytes of one `.npy` array."""
    return _array_bytes(pack(timing_columns(record)))


def decode_timings(content: bytes) -> dict[str, Floats]:
    """The timings back from their bytes. Raises `InputError` for other bytes."""
    try:
        return timings_of(unpack(read_array(content)))
    except ValueError as error:
        raise InputError(f"timings: expected the bytes of an array; got others: {error}") from error


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.create_system = _UNIX
    archive.writestr(info, content)


def _array_bytes(array: np.ndarray[Any, Any]) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array(out, array, version=(1, 0), allow_pickle=False)
    return out.getvalue()
