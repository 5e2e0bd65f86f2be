"""Tables of named columns as Arrow, and as bytes of an Arrow file (Feather), both lossless.

The bytes depend only on the numbers: uncompressed, one batch, no metadata except what is given. When read, they are
untrusted: nothing is decompressed, only types of `Kind` are created, and every offset is checked before use.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.reading import error_summary
from vedette.internal.text import shown
from vedette.kernels.base.types import Bools, Floats, Ints

if TYPE_CHECKING:
    import pyarrow as pa

# Columns of equal length by name: arrays (num_rows,), or lists of texts.
Columns: TypeAlias = dict[str, "Ints | Floats | Bools | list[str]"]
# Columns that identify the run of a row, in tables of many runs.
RUN_COLUMNS = frozenset({"cell", "run", "scenario", "planner", "variant", "filter", "fusion"})

_MAGIC, _ALIGNMENT = b"ARROW1", 8
_MOST_TEXT = 2**31 - 1  # bytes per column, as offsets have 32 bits


class Kind(Enum):
    """Type of a column."""

    INTEGER = "whole numbers"  # (num_rows,) int64
    NUMBER = "numbers"  # (num_rows,) float64, NaN if missing
    COUNT = "whole numbers or nothing"  # (num_rows,) int64 from 0, null in the file for -1
    VALUE = "numbers or nothing"  # (num_rows,) float64, null in the file for NaN
    TRUTH = "truths"  # (num_rows,) bool
    TEXT = "texts"  # num_rows texts


_DTYPES: dict[Kind, type] = {
    Kind.INTEGER: np.int64,
    Kind.NUMBER: np.float64,
    Kind.COUNT: np.int64,
    Kind.VALUE: np.float64,
    Kind.TRUTH: np.bool_,
}


_NAMES = {np.int64: "int64", np.float64: "double", np.bool_: "bool"}
_ARROW_TYPES = {**{kind: _NAMES[dtype] for kind, dtype in _DTYPES.items()}, Kind.TEXT: "string"}


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Columns of a table."""

    fixed: Mapping[str, Kind]  # required columns
    # prefixes of optional columns, of which there may be any number. The empty text: any name
    more: Mapping[str, Kind] = field(default_factory=dict)

    def kind(self, name: str) -> Kind | None:
        """Return the type of the column of that name, or None if the table has no such column."""
        if name in self.fixed:
            return self.fixed[name]
        return next((kind for start, kind in self.more.items() if name.startswith(start)), None)

    def others(self, names: Mapping[str, Any]) -> list[str]:
        """Return the names that are not fixed columns, in order."""
        return [name for name in names if name not in self.fixed]


def stacked(
    parts: Sequence[Mapping[str, Any]], layout: Layout, names: Sequence[str] = (), num_rows: Sequence[int] = ()
) -> Columns:
    """Concatenate tables.

    Args:
        parts: columns of each table. A single value is repeated in every row of its part.
        layout: layout of the result. Columns that a part lacks are filled with NaN, or -1 for a count.
        names: names of all columns, in order. none: the fixed ones and then the other columns of the parts.
        num_rows: rows of each part. none: the length of its columns, one if all are single values.

    Raises `InputError` for a column that is not among the names.
    """
    names = names or list(dict.fromkeys([*layout.fixed, *(name for part in parts for name in part)]))
    if others := {name for part in parts for name in part} - set(names):
        raise InputError(f"column {shown(min(others))}: expected one of {', '.join(names)}")
    lengths = num_rows or [next((len(data) for data in part.values() if not np.isscalar(data)), 1) for part in parts]
    joined: Columns = {}
    for name in names:
        kind = layout.kind(name)
        assert kind is not None  # every stored column has a layout
        missing = -1 if kind is Kind.COUNT else np.nan
        joined[name] = _joined([part.get(name, missing) for part in parts], lengths, kind)
    return joined


def _joined(column: list[Any], lengths: Sequence[int], kind: Kind) -> Any:
    if kind is Kind.TEXT:
        parts = zip(column, lengths, strict=True)
        return [text for values, num in parts for text in ([values] * num if isinstance(values, str) else values)]
    if not column:
        return np.empty(0, _DTYPES[kind])
    joined = np.concatenate(
        [np.full(num, values) if np.isscalar(values) else values for values, num in zip(column, lengths, strict=True)]
    )
    return joined if kind is Kind.NUMBER else joined.astype(_DTYPES[kind], copy=False)


def to_arrow(columns: Columns, layout: Layout, *, nan_is_null: bool = False) -> pa.RecordBatch:
    """Return the table in Arrow, with `nan_is_null` for tools that would treat NaN as a number.

    Raises `InputError` for a column that the layout does not have, and for columns of unequal lengths.
    """
    require_packages("a run on disk", "pyarrow")
    import pyarrow as pa

    arrays = []
    for name, column in columns.items():
        kind = layout.kind(name)
        if kind is None:
            raise InputError(f"column {shown(name)}: expected one of {', '.join(layout.fixed)}")
        arrays.append(_texts(list(column)) if kind is Kind.TEXT else _numbers(column, kind, nan_is_null))
    lengths = [len(array) for array in arrays]
    if len(set(lengths)) > 1:
        raise InputError(f"columns: expected equal lengths; got {', '.join(map(str, lengths))}")
    return pa.RecordBatch.from_arrays(arrays, list(columns))


# Conversion by buffers: pa.array and to_numpy would import pandas if installed, which takes longer than a run.


def _texts(texts: list[Any]) -> pa.Array:
    import pyarrow as pa

    encoded_text = {text: text.encode() for text in set(texts)}
    encoded = [encoded_text[text] for text in texts]
    offsets = np.cumsum([0, *map(len, encoded)])
    if offsets[-1] > _MOST_TEXT:
        raise InputError(f"column of texts: expected at most {_MOST_TEXT} bytes; got {offsets[-1]}")
    buffers = [None, pa.py_buffer(offsets.astype(np.int32)), pa.py_buffer(b"".join(encoded))]
    return pa.Array.from_buffers(pa.string(), len(encoded), buffers)


def _numbers(column: Any, kind: Kind, nan_is_null: bool) -> pa.Array:
    import pyarrow as pa

    values: NDArray[Any] = np.ascontiguousarray(column)
    missing = np.zeros(len(values), bool)
    if kind is Kind.COUNT:
        missing = values < 0
        values = np.where(missing, 0, values)
    elif kind is Kind.VALUE or (nan_is_null and kind is Kind.NUMBER):
        missing = np.isnan(values)
    validity = pa.py_buffer(_bits(~missing)) if missing.any() else None
    is_truth = values.dtype == bool
    content, values_type = (_bits(values), pa.bool_()) if is_truth else (values, pa.from_numpy_dtype(values.dtype))
    return pa.Array.from_buffers(values_type, len(values), [validity, pa.py_buffer(content)])


def _bits(truths: Bools) -> NDArray[np.uint8]:
    return np.packbits(truths, bitorder="little")


def _values(column: pa.Array, kind: Kind) -> NDArray[Any]:
    """Return the numbers of a column as a copy, with -1 or NaN for null."""
    validity, content = column.buffers()
    bits = slice(column.offset, column.offset + len(column))
    if kind is Kind.TRUTH:
        return _truths(content)[bits]
    values: NDArray[Any] = np.frombuffer(content or b"", _DTYPES[kind])[bits].copy()
    if column.null_count:
        values[~_truths(validity)[bits]] = -1 if kind is Kind.COUNT else np.nan
    return values


def _truths(bits: Any) -> Bools:
    return np.unpackbits(np.frombuffer(bits or b"", np.uint8), bitorder="little").astype(bool)


def write_table(columns: Columns, layout: Layout, metadata: Mapping[str, str] | None = None) -> bytes:
    """Return the bytes of an Arrow file, which `pandas.read_feather` and others read.

    Raises `InputError` as `to_arrow`.
    """
    require_packages("a run on disk", "pyarrow")
    import pyarrow as pa

    batch, out = to_arrow(columns, layout).replace_schema_metadata(metadata), pa.BufferOutputStream()
    with pa.ipc.new_file(out, batch.schema) as writer:
        writer.write_batch(batch)
    content: bytes = out.getvalue().to_pybytes()
    return content


def read_table(content: bytes, layout: Layout, place: str) -> Columns:
    """Return the columns from their bytes.

    Raises `InputError`, naming the place, for bytes that are not such a file, and for a column that is missing, unknown
    or of another type.
    """
    try:
        described, batch = _messages(content)
        return _read_columns(*_described(described.serialize().to_pybytes(), layout), batch)
    except InputError as error:
        raise InputError(f"{place}{error}") from error
    except Exception as error:  # damaged files can raise nearly any error
        raise InputError(
            f"{place}: expected a table as an Arrow file; it is damaged: {error_summary(error)}"
        ) from error


def read_metadata(content: bytes) -> dict[str, str]:
    """Return the metadata given to `write_table`. Raises nearly any error for bytes that are not an Arrow file."""
    require_packages("a run on disk", "pyarrow")
    import pyarrow as pa

    metadata = pa.ipc.read_schema(_messages(content)[0]).metadata or {}
    return {key.decode(): value.decode() for key, value in metadata.items()}


def _messages(content: bytes) -> tuple[pa.Message, pa.Message]:
    """Return the schema and the single batch of a file.

    The footer, which indexes files of many batches, is not read.
    """
    require_packages("a run on disk", "pyarrow")
    import pyarrow as pa

    if content[: len(_MAGIC)] != _MAGIC:
        raise ValueError("it does not begin as one")
    if content[-len(_MAGIC) :] != _MAGIC:
        raise ValueError("it is cut short")
    messages = list(pa.ipc.MessageReader.open_stream(pa.py_buffer(content).slice(_ALIGNMENT)))
    if [message.type for message in messages] != ["schema", "record batch"]:
        raise ValueError("expected a schema and one batch of rows")
    if _is_compressed(messages[1].metadata.to_pybytes()):
        raise ValueError("expected rows that are not compressed")
    return messages[0], messages[1]


def _is_compressed(metadata: bytes) -> bool:
    """Return True if a batch message has the field `compression` (format/Message.fbs of Arrow).

    Compressed batches could expand to any size, and pyarrow reports compression only after decompressing.
    """

    def entry(table: int, index: int) -> int:
        (back,) = struct.unpack_from("<i", metadata, table)
        (size,) = struct.unpack_from("<H", metadata, table - back)
        if 4 + 2 * index >= size:
            return 0
        (offset,) = struct.unpack_from("<H", metadata, table - back + 4 + 2 * index)
        return table + offset if offset else 0

    header = entry(struct.unpack_from("<I", metadata)[0], 2)
    return bool(entry(header + struct.unpack_from("<I", metadata, header)[0], 3))


@lru_cache(maxsize=256)
def _described(message: bytes, layout: Layout) -> tuple[pa.Schema, dict[str, Kind]]:
    """Return the schema of a message, and the type of each column. Raises `InputError` for columns not in the layout.

    Cached, as tables of a thousand runs have only a few schemas.
    """
    import pyarrow as pa

    schema = pa.ipc.read_schema(pa.py_buffer(message))
    missing = [name for name in layout.fixed if name not in schema.names]
    if missing:
        raise InputError(f": expected a column {missing[0]}; got {shown(', '.join(schema.names))}")
    kinds: dict[str, Kind] = {}
    for name, arrow_type in zip(schema.names, map(str, schema.types), strict=True):
        kind = layout.kind(name)
        if kind is None:
            raise InputError(f": expected no other column than {', '.join(layout.fixed)}; got {shown(name)}")
        if name in kinds:
            raise InputError(f": expected each column once; got {shown(name)} twice")
        if arrow_type != _ARROW_TYPES[kind]:
            raise InputError(f", column {shown(name)}: expected {kind.value}; got the type {shown(arrow_type)}")
        kinds[name] = kind
    return schema, kinds


def _read_columns(schema: pa.Schema, kinds: Mapping[str, Kind], message: pa.Message) -> Columns:
    import pyarrow as pa

    batch = pa.ipc.read_record_batch(message, schema)
    batch.validate(full=True)
    columns: Columns = {}
    for (name, kind), column in zip(kinds.items(), batch.columns, strict=True):
        if column.null_count and kind not in (Kind.COUNT, Kind.VALUE):
            raise InputError(f", column {shown(name)}: expected {kind.value}; got nothing")
        columns[name] = column.to_pylist() if kind is Kind.TEXT else _values(column, kind)
    return columns
