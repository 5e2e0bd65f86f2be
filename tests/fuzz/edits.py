"""Edits that a careless or a hostile hand makes to JSON, bytes and arrays."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np
import pyarrow as pa

from fuzz.mutations import JUNK, pick, spoil_bytes, spoil_data

Generator = np.random.Generator

DEEP = 100_000  # levels; more than any reader's stack


def edit_json(text: bytes, rng: Generator) -> bytes:
    """JSON text edited as data or as text."""
    if rng.integers(3):
        data = pick(rng, JUNK) if rng.random() < 0.03 else spoil_data(rng, json.loads(text))
        return json.dumps(data).encode()
    what = rng.integers(6)
    if what == 0:  # a key twice
        data = json.loads(text)
        if isinstance(data, dict) and data:
            key = list(data)[rng.integers(len(data))]
            twice = f"{{{json.dumps(key)}: {json.dumps(pick(rng, JUNK))}, "
            return (json.dumps(data)[:-1] + f', {twice[1:]}"z": 0}}').encode()
    if what == 1:
        return b"[" * DEEP + (b"]" * DEEP if rng.integers(2) else b"")
    if what == 2:
        return b'{"a":' * DEEP + b"1" + b"}" * DEEP
    return spoil_bytes(rng, text)


def edit_array(array: np.ndarray[Any, Any], rng: Generator) -> np.ndarray[Any, Any]:
    """The array with other numbers, of another type or of another shape."""
    what = rng.integers(7)
    if what == 0 and array.dtype.kind in "fiu":
        return array.astype(rng.choice(["<f4", "<i8", "<f8", "<U3", "<c16", "?"]))
    if what == 1:
        return array.reshape(-1)
    if what == 2:
        return array[:-1] if array.ndim and len(array) else np.zeros((2, 3))
    if what == 3:
        return array[None]
    edited = array.copy()
    if edited.size and edited.dtype.kind in "fiu":
        edited.reshape(-1)[rng.integers(edited.size)] = _number(edited.dtype, rng)
    return edited


def _number(dtype: np.dtype[Any], rng: Generator) -> Any:
    if dtype.kind == "f":
        return rng.choice([np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, 1e-300, -1e300, 7.5])
    if dtype.kind in "iu":
        return rng.choice([0, 1, -1, 2, 2**31, 2**62, -(2**62)])
    return np.zeros((), dtype)[()]


def npy(array: np.ndarray[Any, Any]) -> bytes:
    """The bytes of an `.npy` file."""
    out = io.BytesIO()
    np.lib.format.write_array(out, array, allow_pickle=False)
    return out.getvalue()


def huge_npy(rng: Generator) -> bytes:
    """The header of an array far larger than what follows it."""
    shape = [(10**13,), (2**62, 2**62), (-1,), (10**6, 10**6), (0, 10**18)][rng.integers(5)]
    header = str(
        {"descr": str(rng.choice(["<f8", "|V0", "<U0", "|O", "<M8[s]"])), "fortran_order": False, "shape": shape}
    )
    return b"\x93NUMPY\x01\x00" + (len(header) + 1).to_bytes(2, "little") + header.encode() + b"\n" + b"\0" * 64


def edit_arrow(content: bytes, rng: Generator) -> bytes:
    """An Arrow file with other bytes, columns, types, rows or nulls; in several batches, or packed."""
    what = rng.integers(8)
    if what < 3:
        return spoil_bytes(rng, content)
    table = pa.ipc.open_file(content).read_all()
    if what == 3:
        table = pa.table({name: np.zeros(2_000_000) for name in table.schema.names[:1]})
    elif what > 4 and table.num_columns:
        table = _edit_column(table, int(rng.integers(table.num_columns)), rng)
    packing = [None, "zstd", "lz4"][rng.integers(3)] if what in (3, 4) else None
    out = pa.BufferOutputStream()
    with pa.ipc.new_file(out, table.schema, options=pa.ipc.IpcWriteOptions(compression=packing)) as writer:
        writer.write_table(table, None if rng.integers(4) else 1)
    return bytes(out.getvalue().to_pybytes())


def _edit_column(table: pa.Table, place: int, rng: Generator) -> pa.Table:
    """With one column gone, renamed, of another type, with nulls or other values; or with rows in another order."""
    name, column, what = table.schema.names[place], table.column(place), rng.integers(6)
    if what == 0:
        return table.drop_columns([name])
    if what == 1:
        names = list(table.schema.names)
        names[place] = str(rng.choice(["", "extra", "action_99", "state_7", *names]))
        return table.rename_columns(names)
    if what == 2:
        types = (pa.string(), pa.float32(), pa.int32(), pa.binary(), pa.bool_(), pa.null(), pa.list_(pa.int64()))
        kind = types[rng.integers(len(types))]
        return table.set_column(place, name, pa.nulls(table.num_rows, kind))
    if what == 3:
        return table.take(
            rng.integers(0, max(table.num_rows, 1), int(rng.integers(0, table.num_rows + 3)) * bool(table))
        )
    values = column.to_pylist()
    for index in rng.integers(0, max(len(values), 1), min(len(values), int(rng.integers(1, 4)))):
        if what == 4:
            values[index] = None
        elif pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
            values[index] = _number(np.dtype(column.type.to_pandas_dtype()), rng).item()
        else:
            values[index] = ["", "x" * 1000][rng.integers(2)] if pa.types.is_string(column.type) else not values[index]
    return table.set_column(place, name, pa.array(values, column.type))


def edit_npz(content: bytes, rng: Generator) -> bytes:
    """An archive of arrays and JSON with a member edited, replaced, gone, doubled or inflated."""
    if not rng.integers(5):
        return spoil_bytes(rng, content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    place = int(rng.integers(len(members)))
    name, old = members[place]
    what, packing = rng.integers(12), zipfile.ZIP_STORED
    if what == 0:
        del members[place]
    elif what == 1:
        members[place] = (name, spoil_bytes(rng, old))
    elif what == 2:
        members[place] = (name, huge_npy(rng))
    elif what == 3:
        members[place] = (name, npy(np.zeros(2_000_000)))
        packing = zipfile.ZIP_DEFLATED
    elif what == 4:
        members.append((["extra.npy", "../x.npy", "tracks", ""][rng.integers(4)], old))
    elif what == 5:
        members[place] = (f"{name}x", old)
    elif name.endswith(".json"):
        members[place] = (name, edit_json(old, rng))
    elif name.endswith(".arrow"):
        members[place] = (name, edit_arrow(old, rng))
    else:
        array = np.lib.format.read_array(io.BytesIO(old), allow_pickle=False)
        members[place] = (name, npy(edit_array(array, rng)))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", packing) as archive:
        for each, data in members:
            archive.writestr(zipfile.ZipInfo(each), data, packing)
    return out.getvalue()
