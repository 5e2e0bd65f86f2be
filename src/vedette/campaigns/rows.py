"""Finished run as a row of the store: packed where it was computed, verified whenever it is read.

Every row carries checksums of its unpacked parts, which also cover its cell and run number.
"""

import hashlib
from dataclasses import dataclass
from typing import Any, NamedTuple

import pyarrow as pa

from vedette.internal.reading import MOST_BYTES, error_summary, inflate

_ZSTD = pa.Codec("zstd", compression_level=-1)  # a third of the size; 4 % less would take a third longer
# Rows are packed to a third of their size; a row cannot unpack to more than this.
_MOST_TIMES, _SMALL = 1000, 2**20
_MAGIC = b"\x28\xb5\x2f\xfd"  # first bytes of a zstd frame


class Packed(NamedTuple):
    """Part of a run as stored: compressed bytes, and the checksum of the uncompressed content."""

    content: bytes
    checksum: str


def pack(cell: str, run: int, content: bytes) -> Packed:
    """Return the packed form of a part of a run."""
    return Packed(_ZSTD.compress(content, asbytes=True), _checksum(cell, run, content))


def unpack(packed: bytes, max_bytes: int = MOST_BYTES) -> bytes:
    """Return the content of bytes packed by zstd or, in older files, by zlib. Raises `ValueError` for others.

    A zstd frame states its unpacked size (RFC 8878, 3.1.1.1). Larger ones are refused before memory is allocated.
    """
    max_bytes = min(max_bytes, _SMALL + _MOST_TIMES * len(packed))
    if packed[: len(_MAGIC)] != _MAGIC:
        return inflate(packed, max_bytes)
    descriptor = int.from_bytes(packed[4:5], "little")
    flag, single = descriptor >> 6, descriptor >> 5 & 1
    field = packed[6 - single :][: (single, 2, 4, 8)[flag]]
    size = int.from_bytes(field, "little") + 256 * (flag == 1)
    if size > max_bytes:
        raise ValueError(f"it unpacks to more than {max_bytes} bytes")
    try:
        content: bytes = _ZSTD.decompress(packed, decompressed_size=size, asbytes=True)
    except OSError as error:
        raise ValueError(error_summary(error)) from None
    return content


@dataclass(frozen=True, slots=True)
class Row:
    """A finished run to store."""

    cell: str  # identify the run
    run: int  # identify the run
    payload: Packed  # the run, and its timings
    metrics: Packed  # metrics of the run, empty before packing if there are none, as they can be computed later
    timings: Packed  # the run, and its timings

    def values(self, session: int) -> tuple[Any, ...]:
        """Return the values for the columns of the store."""
        return (self.cell, self.run, session, *self.payload, *self.metrics, *self.timings)


def row_of(cell: str, run: int, payload: bytes, timings: bytes, metrics: bytes = b"") -> Row:
    """Return a finished run as a row, packed."""
    return Row(cell, run, *(pack(cell, run, part) for part in (payload, metrics, timings)))


@dataclass(frozen=True, slots=True)
class Entry:
    """A finished run read from the store."""

    cell: str  # identify the run
    run: int  # identify the run
    session: int  # number, from 1, of the session that stored it
    payload: bytes  # as in `Row`, unpacked
    metrics: bytes  # as in `Row`, unpacked
    timings: bytes  # as in `Row`, unpacked

    @property
    def checksum(self) -> str:
        """SHA-256 of the run's cell, number and payload: equal for equal results, whenever they were computed."""
        return _checksum(self.cell, self.run, self.payload)


def verified(values: tuple[Any, ...]) -> Entry | None:
    """Return the run from the columns of the store, or None if it is damaged."""
    cell, run, session, *packed = values
    if not isinstance(cell, str) or not isinstance(run, int) or not isinstance(session, int):
        return None
    try:
        parts = [unpack(part) for part in packed[::2]]
    except (ValueError, TypeError):
        return None
    intact = [_checksum(cell, run, part) for part in parts] == packed[1::2]
    return Entry(cell, run, session, *parts) if intact else None


def _checksum(cell: str, run: int, content: bytes) -> str:
    digest = hashlib.sha256(f"{cell}\n{run}\n".encode())
    digest.update(content)
    return digest.hexdigest()
